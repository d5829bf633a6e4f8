//! What an output may take the place of: a file of its own kind, which this program can write again. A log is none.

use std::fs::File;
use std::io::{self, BufReader, Read as _};
use std::path::{Path, PathBuf};

use miette::Diagnostic;
use rotorlead_records::files::TomlFile;
use serde::de::IgnoredAny;
use thiserror::Error;

const COMMANDS: &str = "a table of commands";
const COMPENSATOR: &str = "a compensator";
const JSON: &str = "JSON";
const MODEL: &str = "a model";
const PLAN: &str = "a plan";
const REPORT: &str = "a report";
const STAND: &str = "a stand";

/// Bytes at the beginning of a file that tell a report and a table: what wrote a page stands in its head.
const BEGINNING: u64 = 1000;

/// A file that would be lost.
#[derive(Debug, Error, Diagnostic)]
#[error("`{}` of {option} exists and is {found}; {written} would replace it", path.display())]
#[diagnostic(help("name another file, or give --force to replace it"))]
pub(super) struct Replaced {
    path: PathBuf,
    option: String,
    found: &'static str,
    written: &'static str,
}

/// Refuses to replace a file that no output of this option of the command can be. A folder is filled by rules of its own.
pub(super) fn check(path: &Path, option: &str, (command, id): (&str, &str)) -> Result<(), Replaced> {
    let kinds: &[&'static str] = match (command, id) {
        (_, "json") => &[JSON],
        (_, "report") | ("report", "out") => &[REPORT],
        (_, "out_model") => &[MODEL],
        (_, "out_plan") => &[PLAN],
        (_, "out_compensator") | ("design", "out") => &[COMPENSATOR],
        ("identify", "out") => &[MODEL, STAND],
        ("excite", "out") => &[COMMANDS],
        _ => return Ok(()),
    };
    // What cannot be read is refused as what cannot be written. In an empty file nothing is lost.
    if !path.is_file() || path.metadata().is_ok_and(|file| file.len() == 0) {
        return Ok(());
    }
    let found = kind(path);
    if found.is_some_and(|found| kinds.contains(&found)) {
        return Ok(());
    }
    let found = found.unwrap_or("of an unknown kind");
    Err(Replaced { path: path.to_owned(), option: option.to_owned(), found, written: kinds[0] })
}

/// What a file is, where this program writes such files.
fn kind(path: &Path) -> Option<&'static str> {
    let beginning = beginning(path).ok()?;
    if beginning.starts_with("<!doctype html>") && beginning.contains(r#"<meta name="generator" content="rotorlead "#) {
        return Some(REPORT);
    }
    if beginning.lines().next() == Some("time_s,command") {
        return Some(COMMANDS);
    }
    let is_json = |file: File| serde_json::from_reader::<_, IgnoredAny>(BufReader::new(file)).is_ok();
    if beginning.trim_start().starts_with(['{', '[']) && File::open(path).is_ok_and(is_json) {
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
