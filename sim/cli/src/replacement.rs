//! What an output may take the place of: a file of its own kind, which this program can write again. A log is none.

use std::fs::File;
use std::io::{self, BufReader, Read as _};
use std::path::{Path, PathBuf};

use miette::Diagnostic;
use rotorlead_export::is_exported;
use rotorlead_records::files::TomlFile;
use rotorlead_report::is_drawn;
use serde::Deserialize;
use thiserror::Error;

use super::sample::SampleLog;

const COMMANDS: &str = "a table of commands";
const COMPENSATOR: &str = "a compensator";
const EXPORT: &str = "exported numbers";
const FIGURE: &str = "a figure";
const LOG: &str = "a redacted log";
const JSON: &str = "JSON of this program";
const MODEL: &str = "a model";
const PLAN: &str = "a plan";
const REPORT: &str = "a report";
const SAMPLE: &str = "a sample";
const STAND: &str = "a stand";
const TABLE: &str = "a table";
const UNKNOWN: &str = "of an unknown kind";

/// What a page and JSON say wrote them, before its version.
const GENERATOR: &str = "rotorlead ";

/// Bytes at the beginning of a file that tell a report and a table: what wrote a page stands in its head.
const BEGINNING: u64 = 1000;

/// A file that would be lost.
#[derive(Debug, Error, Diagnostic)]
#[error("`{}` {origin}exists and is {found}; {written} would replace it", path.display())]
#[diagnostic(help("name another {place}, or give --force to replace it"))]
pub(super) struct ReplacementRefused {
    path: PathBuf,
    /// Which option the path was typed at, where it was.
    origin: String,
    found: &'static str,
    written: &'static str,
    /// What is to be named instead.
    place: String,
}

/// JSON with what wrote it.
#[derive(Deserialize)]
struct Generated {
    generator: String,
}

/// What wrote JSON, for [`kind`].
pub(super) fn generator() -> String {
    format!("{GENERATOR}{}", env!("CARGO_PKG_VERSION"))
}

/// Whether a path was typed at its option, or is what the option stands for where none is.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Typed {
    Path,
    Nothing,
}

/// Refuses to replace a file that no output of this option of the command can be. A folder is filled by rules of its own.
pub(super) fn check(
    path: &Path,
    option: &str,
    typed: Typed,
    (command, id): (&str, &str),
) -> Result<(), ReplacementRefused> {
    let kinds: &[&'static str] = match (command, id) {
        (_, "json") => &[JSON],
        (_, "report") | ("report", "out") => &[REPORT],
        (_, "out_model") => &[MODEL],
        (_, "out_plan") => &[PLAN],
        (_, "out_compensator") | ("design", "out") => &[COMPENSATOR],
        ("identify", "out") => &[MODEL, STAND],
        ("excite", "out") => &[COMMANDS],
        ("export", "out") => &[EXPORT],
        ("sample", "out") => &[SAMPLE],
        // A copy is a log like any other: none is lost.
        ("redact", "out") => &[LOG],
        _ => return Ok(()),
    };
    if !loses(path) {
        return Ok(());
    }
    let found = kind(path);
    if found.is_some_and(|found| kinds.contains(&found)) {
        return Ok(());
    }
    let (origin, place) = match typed {
        Typed::Path => (format!("of {option} "), "file".to_owned()),
        Typed::Nothing => (String::new(), format!("file with {option}")),
    };
    let found = found.unwrap_or(UNKNOWN);
    Err(ReplacementRefused { path: path.to_owned(), origin, found, written: kinds[0], place })
}

/// Whether something is lost where this is replaced. What cannot be read is refused as what cannot be written.
fn loses(path: &Path) -> bool {
    path.is_file() && path.metadata().is_ok_and(|file| file.len() > 0)
}

/// Refuses to replace a file of the figures' folder: a picture that was not drawn here, or a table of other columns.
pub(super) fn check_figure(path: &Path, content: &[u8]) -> Result<(), ReplacementRefused> {
    let is_table = path.extension().is_some_and(|end| end == "csv");
    let is_own = |beginning: String| match is_table {
        true => beginning.lines().next() == String::from_utf8_lossy(content).lines().next(),
        false => is_drawn(&beginning),
    };
    if !loses(path) || beginning(path).is_ok_and(is_own) {
        return Ok(());
    }
    let (path, origin, found) = (path.to_owned(), "of --figures ".to_owned(), kind(path).unwrap_or(UNKNOWN));
    Err(ReplacementRefused {
        path,
        origin,
        found,
        written: if is_table { TABLE } else { FIGURE },
        place: "folder".into(),
    })
}

/// What a file is, where this program writes such files.
fn kind(path: &Path) -> Option<&'static str> {
    let beginning = beginning(path).ok()?;
    let mark = format!("<meta name=\"generator\" content=\"{GENERATOR}");
    if beginning.starts_with("<!doctype html>") && beginning.contains(&mark) {
        return Some(REPORT);
    }
    if beginning.lines().next() == Some("time_s,command") {
        return Some(COMMANDS);
    }
    if SampleLog::is_one(path) {
        return Some(SAMPLE);
    }
    if is_exported(&beginning) {
        return Some(EXPORT);
    }
    let is_own = |json: Generated| json.generator.starts_with(GENERATOR);
    let is_json = |file: File| serde_json::from_reader(BufReader::new(file)).is_ok_and(is_own);
    if beginning.trim_start().starts_with('{') && File::open(path).is_ok_and(is_json) {
        return Some(JSON);
    }
    TomlFile::kind(path)
}

fn beginning(path: &Path) -> io::Result<String> {
    let mut bytes = Vec::new();
    File::open(path)?.take(BEGINNING).read_to_end(&mut bytes)?;
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}

/// Where a file is written, and whether it takes the place of another: until the command is done, that one is still there.
pub(super) fn written_to(path: &Path) -> String {
    format!("{} {}", if path.is_file() { "Replaced" } else { "Written to" }, path.display())
}

/// The same of a report.
pub(super) fn report_at(path: &Path) -> String {
    format!("\nReport{}: {}\n", if path.is_file() { ", replaced" } else { "" }, path.display())
}
