//! What the program promises of any input, and runs of it that are held to that.
//!
//! It ends soon, in little memory, with 0, 1 or 2. At 0 no number that it prints or writes is none, or impossible in its unit. At 1
//! and 2 it names what is wrong and the remedy, and every file is as it was. Nothing but what it was asked to write is ever touched.

use std::fmt;
use std::fs::File;
use std::io::{Read as _, Seek as _};
use std::os::unix::process::ExitStatusExt as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus};
use std::thread::sleep;
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::stand::{everything, program};

/// How long a run with less than ten thousand rows may take.
const MOST_SECONDS: u64 = 20;
/// Processor time for that: two cores work, and a program that is built for tests takes thrice as long.
const MOST_CPU_SECONDS: u64 = 2 * MOST_SECONDS * if cfg!(debug_assertions) { 3 } else { 1 };
/// What the clock on the wall may show meanwhile, beside all other tests.
const MOST_WALL: Duration = Duration::from_secs(10 * MOST_SECONDS);
/// Address space of a run: a gigabyte.
const MOST_KILOBYTES: u64 = 1_000_000;
/// Longest report of what is wrong.
const MOST_BYTES: usize = 4000;
/// Digits before the point that no number needs: a time of an epoch in microseconds has sixteen.
const MOST_DIGITS: usize = 16;
/// Digits behind it that nobody reads; a table for programs may have them.
const MOST_DECIMALS: usize = 20;
/// The slowest motor.
const MOST_TIME_CONSTANT_S: f64 = 100.0;
/// The largest number of a result, a time of an epoch in microseconds.
const MOST_SIZE: f64 = 1e16;
/// Options with the path of what a command is to write. Every other path is read.
const WRITTEN: [&str; 7] =
    ["--out", "--json", "--report", "--figures", "--out-model", "--out-plan", "--out-compensator"];

/// How a promise is broken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    Panic,
    NoEnd,
    Memory,
    /// A result with a number that is none or impossible.
    Number,
    /// A report without place or remedy, or one that nobody reads.
    Report,
    /// A file of the user's is changed, or an output where the command has failed.
    Lost,
    /// Something is left that nobody asked for.
    LeftOver,
}

#[derive(Debug)]
pub struct Broken {
    pub kind: Kind,
    pub found: String,
}

impl fmt::Display for Broken {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:?}: {}", self.kind, self.found)
    }
}

fn broken<T>(kind: Kind, found: impl Into<String>) -> Result<T, Broken> {
    Err(Broken { kind, found: found.into() })
}

/// What happens to a run besides its input.
#[derive(Clone, Copy, Debug)]
pub enum Trouble {
    None,
    /// No file may be longer than so many blocks of 512 bytes: a full disk.
    LittleRoom(u32),
    /// A signal comes after so long.
    Signal(&'static str, Duration),
    /// The same command runs beside it, with the same outputs.
    Twice,
}

/// A run and where its words go.
struct Run {
    child: Child,
    said: File,
    complaint: File,
}

impl Run {
    fn start(folder: &Path, arguments: &[String], trouble: Trouble) -> Self {
        let room = match trouble {
            Trouble::LittleRoom(blocks) => format!("ulimit -f {blocks}; "),
            _ => String::new(),
        };
        let limited = format!("{room}ulimit -v {MOST_KILOBYTES}; ulimit -t {MOST_CPU_SECONDS}; exec \"$@\"");
        let [said, complaint] = [(); 2].map(|()| tempfile::tempfile().unwrap());
        let mut command = Command::new("sh");
        command.current_dir(folder).env_remove("RUST_BACKTRACE").args(["-c", &limited, "sh"]);
        // Each of the allocator's arenas takes 64 MB of addresses, used or not.
        command.env("MALLOC_ARENA_MAX", "1").arg(program().get_program()).args(arguments);
        command.stdout(said.try_clone().unwrap()).stderr(complaint.try_clone().unwrap());
        Self { child: command.spawn().unwrap(), said, complaint }
    }

    fn signal(&self, signal: &str) {
        // One that has ended takes none.
        let _ = Command::new("kill")
            .args([signal, &self.child.id().to_string()])
            .stderr(File::create("/dev/null").unwrap())
            .status();
    }

    /// How it ends, and what is on standard output and standard error.
    fn end(mut self) -> (Option<ExitStatus>, String, String) {
        let until = Instant::now() + MOST_WALL;
        let mut pause = Duration::from_millis(1);
        let status = loop {
            if let Some(status) = self.child.try_wait().unwrap() {
                break Some(status);
            }
            if Instant::now() > until {
                self.child.kill().unwrap();
                self.child.wait().unwrap();
                break None;
            }
            sleep(pause);
            pause = (2 * pause).min(Duration::from_millis(20));
        };
        let text = |mut file: File| {
            let mut bytes = Vec::new();
            file.rewind().and_then(|()| file.read_to_end(&mut bytes)).unwrap();
            String::from_utf8_lossy(&bytes).into_owned()
        };
        (status, text(self.said), text(self.complaint))
    }
}

/// Runs the program in `folder` and holds it to its promise.
pub fn hold(folder: &Path, arguments: &[String], trouble: Trouble) -> Result<(), Broken> {
    let before = everything(folder);
    let run = Run::start(folder, arguments, trouble);
    let beside = matches!(trouble, Trouble::Twice).then(|| Run::start(folder, arguments, trouble));
    if let Trouble::Signal(signal, after) = trouble {
        sleep(after);
        run.signal(signal);
    }
    let of_files = before.iter().filter_map(|(path, _)| Some(path.file_name()?.to_string_lossy().into_owned()));
    let is_path = |word: &&String| !word.starts_with('-') && word.parse::<f64>().is_err();
    let paths = arguments.iter().skip(1).filter(is_path).cloned();
    let names: Vec<String> = of_files.chain(paths).chain(["standard output".to_owned()]).collect();
    let mut failed = true;
    for run in [Some(run), beside].into_iter().flatten() {
        let (status, said, complaint) = run.end();
        failed &= hold_words(status, &said, &complaint, &names, trouble)?;
    }
    // What `check` finds is its result.
    let may_write = !failed || matches!(trouble, Trouble::Signal(..)) || arguments[0] == "check";
    hold_files(folder, &before, arguments, may_write)
}

/// Whether a run has failed, whose words keep the promise.
fn hold_words(
    status: Option<ExitStatus>,
    said: &str,
    complaint: &str,
    names: &[String],
    trouble: Trouble,
) -> Result<bool, Broken> {
    let is_signalled = matches!(trouble, Trouble::Signal(..));
    let names_place = || names.iter().any(|name| complaint.contains(name.as_str()));
    let code = status.and_then(|status| status.code());
    if complaint.contains("panicked") {
        return broken(Kind::Panic, complaint);
    }
    match code {
        Some(0) => match impossible_in_text(said) {
            Some(number) => broken(Kind::Number, format!("prints {number}:\n{said}")),
            None => Ok(false),
        },
        Some(1 | 2)
            if !complaint.contains("help: ")
                && !complaint.contains("Usage: ")
                && !complaint.contains("For more information") =>
        {
            broken(Kind::Report, format!("no remedy in:\n{complaint}"))
        }
        Some(1) if !names_place() => broken(Kind::Report, format!("no place in:\n{complaint}")),
        Some(1 | 2) if complaint.len() > MOST_BYTES => broken(Kind::Report, format!("{} bytes", complaint.len())),
        Some(1 | 2) => Ok(true),
        Some(129 | 130 | 131 | 143) if is_signalled => Ok(true),
        None if complaint.contains("memory allocation") => broken(Kind::Memory, complaint),
        // At its very start it watches over no signals yet, and has begun nothing.
        None if is_signalled && status.is_some_and(|status| status.signal() != Some(24)) => Ok(true),
        _ => broken(
            Kind::NoEnd,
            format!("ends with {status:?} or not within {MOST_CPU_SECONDS} s of work:\n{complaint}"),
        ),
    }
}

type Files = [(PathBuf, Option<Vec<u8>>)];

/// Holds the files to the promise. What has ended at a signal may have written some of its outputs, each of them whole.
fn hold_files(folder: &Path, before: &Files, arguments: &[String], may_write: bool) -> Result<(), Broken> {
    let after = everything(folder);
    let content =
        |files: &Files, path: &Path| files.iter().find(|(known, _)| known == path).map(|(_, content)| content.clone());
    let is_output = |at: &usize| at.checked_sub(1).is_some_and(|option| WRITTEN.contains(&arguments[option].as_str()));
    let (outputs, others): (Vec<usize>, Vec<usize>) = (0..arguments.len()).partition(is_output);
    let is_below = |of: &[usize], path: &Path| of.iter().any(|&at| path.starts_with(folder.join(&arguments[at])));
    for (path, old) in before {
        let is_replaced = may_write && is_below(&outputs, path) && !is_below(&others, path);
        if !is_replaced && content(&after, path).as_ref() != Some(old) {
            return broken(Kind::Lost, format!("{} is not as it was", path.display()));
        }
    }
    for (path, new) in &after {
        if content(before, path).as_ref() == Some(new) {
            continue;
        }
        let name = path.to_string_lossy();
        if !may_write || !is_below(&outputs, path) || name.ends_with(".part") || name.ends_with(".lock") {
            return broken(Kind::LeftOver, format!("{name} is left"));
        }
        let Some(text) = new.as_ref().and_then(|bytes| std::str::from_utf8(bytes).ok()) else { continue };
        if let Some(found) = impossible_in_file(path, text) {
            return broken(Kind::Number, format!("{name} has {found}"));
        }
    }
    Ok(())
}

/// A number of a file that is none, is impossible in its unit, or a file that is no such file.
fn impossible_in_file(path: &Path, text: &str) -> Option<String> {
    match path.extension().and_then(|end| end.to_str()) {
        Some("json") => match serde_json::from_str(text) {
            Ok(value) => impossible_value("", &value),
            Err(error) => Some(format!("no JSON: {error}")),
        },
        Some("html") if !text.trim_end().ends_with("</html>") => Some("no end".to_owned()),
        Some("html") => impossible_in_text(&without_code(text)),
        Some("svg") if !text.trim_end().ends_with("</svg>") => Some("no end".to_owned()),
        Some("csv" | "toml") => impossible_word(text, usize::MAX),
        _ => impossible_in_text(text),
    }
}

/// A page without scripts, styles and embedded data.
fn without_code(page: &str) -> String {
    let mut text = page.to_owned();
    for (begin, end) in [("<script", "</script>"), ("<style", "</style>"), ("data:", "\"")] {
        let mut kept = String::new();
        let mut rest = text.as_str();
        while let Some(at) = rest.find(begin) {
            kept += &rest[..at];
            rest = &rest[at..];
            rest = &rest[rest.find(end).unwrap_or(rest.len())..];
        }
        text = kept + rest;
    }
    text
}

/// A number of a JSON value that nothing has.
fn impossible_value(key: &str, value: &Value) -> Option<String> {
    match value {
        Value::Number(number) => {
            let size = number.as_f64()?.abs();
            let most = if key.starts_with("time_constant") { MOST_TIME_CONSTANT_S } else { MOST_SIZE };
            (size > most).then(|| format!("`{key}`: {number}"))
        }
        Value::String(text) => impossible_in_text(text),
        Value::Array(items) => items.iter().find_map(|item| impossible_value(key, item)),
        Value::Object(keys) => keys.iter().find_map(|(key, item)| impossible_value(key, item)),
        _ => None,
    }
}

/// A word that is no number where one is meant, or a number of digits that nothing has.
fn impossible_in_text(text: &str) -> Option<String> {
    impossible_word(text, MOST_DECIMALS)
}

fn impossible_word(text: &str, most_decimals: usize) -> Option<String> {
    let is_part = |c: char| c.is_alphanumeric() || matches!(c, '.' | '_');
    let digits = |part: &str| part.chars().all(|c| c.is_ascii_digit());
    let is_long = |whole: &str, decimals: &str| whole.len() > MOST_DIGITS || decimals.len() > most_decimals;
    let is_impossible = |word: &&str| {
        let (whole, decimals) = word.split_once('.').unwrap_or((word, ""));
        matches!(*word, "NaN" | "inf")
            || !whole.is_empty() && digits(whole) && digits(decimals) && is_long(whole, decimals)
    };
    let word = text.split(|c: char| !is_part(c)).find(is_impossible)?;
    let line = text.lines().find(|line| line.contains(word))?.trim();
    let short = |text: &str| text.chars().take(40).collect::<String>();
    let before = line.split(word).next().unwrap_or_default();
    let before: String = before.chars().rev().take(100).collect::<Vec<_>>().into_iter().rev().collect();
    Some(format!("{before}{}", short(word)))
}

#[test]
fn the_promise_knows_what_no_number_is() {
    for (name, text) in [
        ("a.csv", "time_s\n1\nNaN\n"),
        ("a.json", "{\"points\": [{\"time_constant_s\": 5626758.468}]}"),
        ("a.json", "{\"a\": 1"),
        ("a.html", "<p>from inf to -inf ms</p></html>"),
        ("a.html", "<p>"),
        ("a.svg", "<svg><path d=\"M 0 NaN\"/></svg>"),
        ("a.txt", "33827619480110402185155575808.00"),
        ("a.txt", "-0.000000009313225746154785"),
    ] {
        assert!(impossible_in_file(Path::new(name), text).is_some(), "{text}");
    }
    let page = "<script>a = NaN</script><img src=\"data:NaN/inf\"><p>information of 12.5 ms, 1e-9</p></html>";
    assert_eq!(impossible_in_file(Path::new("a.html"), page), None);
    assert_eq!(impossible_in_file(Path::new("a.json"), "{\"time_constant_s\": 0.08, \"p\": null}"), None);
}
