//! What a command says: text for people, JSON for programs.

use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use anstream::AutoStream;
use anstyle::{AnsiColor, Style};
use clap::Args;
use miette::Diagnostic;
use rotorlead_answer::{Answer, Text};
use rotorlead_records::files::{
    AcceptedRange, FileError, OutputFolder, all_or_nothing, check_writable, is_order, printable, write_file,
};
use serde::Serialize;
use serde_json::Value;
use thiserror::Error;

use super::replacement::generator;
use super::report_option::{arguments, this_command};

/// A result with a number that is none, or impossible in its unit.
#[derive(Debug, Error, Diagnostic)]
#[error("`{}` leads to a number that cannot be: {place}", this_command())]
#[diagnostic(help(
    "look for values in the records or the model that are far from all others; `rotorlead check` says what is odd"
))]
struct Impossible {
    /// Where it stands, with what it is.
    place: String,
}

/// Standard output takes no more.
#[derive(Debug, Error, Diagnostic)]
#[error("cannot write to standard output")]
#[diagnostic(help("make room where it goes"))]
struct Unprinted(#[source] io::Error);

/// What came out of a command.
#[derive(Debug)]
pub struct Outcome {
    /// For people, what matters first; ends with a line break.
    pub text: String,
    /// What `--verbose` adds below the text: tables that few readers need; may be empty.
    pub detail: String,
    /// What came out, which is printed last; may be empty.
    pub verdict: String,
    /// The same for programs.
    pub json: Value,
}

/// How much of an outcome is printed for people.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verbosity {
    /// Nothing.
    Quiet,
    /// The text.
    Normal,
    /// The text, and the detail below.
    Verbose,
}

impl Outcome {
    /// Text, and the values behind it, of which those that are not finite become null.
    pub fn new(text: String, values: &impl Serialize) -> Self {
        let json = serde_json::to_value(values).expect("keys are text, and no value fails to be written");
        Self { text, detail: String::new(), verdict: String::new(), json }
    }

    /// An answer, with what it was written to at its end.
    pub fn from_answer(answer: &Answer, written: &str) -> Self {
        let Text { shown, detail, verdict } = answer.text();
        let verdict = if written.is_empty() { verdict } else { format!("{verdict}{written}") };
        Self { text: shown, detail, verdict, json: answer.json() }
    }

    /// The same behind what was done before.
    pub fn after(self, text: &str, detail: &str) -> Self {
        let behind = |before: &str, part: &str| {
            let parts = [before.trim_end(), part].into_iter().filter(|part| !part.is_empty());
            parts.collect::<Vec<_>>().join("\n\n")
        };
        Self { text: behind(text, &self.text), detail: behind(detail, &self.detail), ..self }
    }

    /// Refuses a result that holds a number that cannot be: whatever the reason, the rest is not to be trusted either.
    fn check(&self) -> Result<(), Impossible> {
        let typed: Vec<String> = arguments().collect();
        // What was typed is a name, also where it is called as no number is.
        let is_typed =
            |none: &str| typed.iter().any(|word| word.split(|c: char| !c.is_alphanumeric()).any(|part| part == none));
        let is_none = |word: &str| {
            let word = word.trim_matches(|c: char| !c.is_alphanumeric());
            matches!(word, "NaN" | "inf") && !is_typed(word)
        };
        let mut lines = [&self.text, &self.detail, &self.verdict].into_iter().flat_map(|text| text.lines());
        let line = lines.find(|line| line.split_whitespace().any(is_none)).map(|line| line.trim().to_owned());
        line.or_else(|| impossible("", &self.json)).map_or(Ok(()), |place| Err(Impossible { place }))
    }

    /// The same in a file, by which it is known as this program's own.
    fn json_file(&self) -> String {
        let mut json = self.json.clone();
        if let Value::Object(keys) = &mut json {
            keys.insert("generator".to_owned(), generator().into());
        }
        json_text(&json)
    }
}

fn json_text(json: &Value) -> String {
    // JSON itself asks for that of the first 32 controls alone.
    let text = format!("{json:#}\n");
    if !text.contains(is_order) {
        return text;
    }
    let escaped = |character: char| match character {
        order if is_order(order) => format!("\\u{:04x}", u32::from(order)),
        sign => sign.to_string(),
    };
    text.chars().map(escaped).collect()
}

/// The first number that is out of the range of its key, with that.
fn impossible(key: &str, value: &Value) -> Option<String> {
    match value {
        Value::Number(number) => {
            let refused = AcceptedRange::accept_result(key, number.as_f64()?).err();
            refused.map(|message| format!("`{key}`, {message}"))
        }
        Value::Array(items) => items.iter().find_map(|item| impossible(key, item)),
        Value::Object(keys) => keys.iter().find_map(|(key, item)| impossible(key, item)),
        Value::Null | Value::Bool(_) | Value::String(_) => None,
    }
}

/// Where the JSON goes.
#[derive(Args, Debug)]
pub struct JsonOption {
    /// Also write what is printed as JSON; with `-`, to standard output and instead of the text
    #[arg(long = "json", value_name = "FILE")]
    json: Option<PathBuf>,
}

impl JsonOption {
    /// Refuses a file that cannot be written, before any work is done. `out` is where the command's own output goes.
    pub fn check(&self, out: Option<&Path>) -> Result<(), FileError> {
        match (self.file(), out) {
            // In a folder that the command is yet to make.
            (Some(file), Some(out)) if file.starts_with(out) => Ok(()),
            (Some(file), _) => check_writable(file),
            (None, _) => Ok(()),
        }
    }

    /// Checks its file, and runs and says as [`Self::say`] does. `out` is as in [`Self::check`].
    pub fn answer(
        &self,
        out: Option<&Path>,
        run: impl FnOnce() -> miette::Result<Outcome>,
        verbosity: Verbosity,
    ) -> miette::Result<()> {
        self.check(out)?;
        self.say(run, verbosity)
    }

    /// Runs what has an outcome and prints it, or writes it, or both. Files that it writes are all replaced, or none is.
    pub fn say(&self, run: impl FnOnce() -> miette::Result<Outcome>, verbosity: Verbosity) -> miette::Result<()> {
        all_or_nothing(|| {
            let outcome = run()?;
            outcome.check()?;
            self.write(&outcome)?;
            // What cannot be printed has failed, and leaves the files as they were.
            self.print(&outcome, verbosity)
        })
    }

    /// As [`Self::say`], of a folder that lacks but its name: where the JSON cannot be written, no folder is made.
    pub fn say_with_folder(&self, folder: OutputFolder, outcome: Outcome, verbosity: Verbosity) -> miette::Result<()> {
        outcome.check()?;
        let is_inside = self.file().is_some_and(|file| file.starts_with(folder.destination()));
        all_or_nothing(|| {
            if is_inside {
                folder.commit()?;
                self.write(&outcome)
            } else {
                self.write(&outcome)?;
                Ok(folder.commit()?)
            }
        })?;
        self.print(&outcome, verbosity)
    }

    fn write(&self, outcome: &Outcome) -> miette::Result<()> {
        self.file().map_or(Ok(()), |file| Ok(write_file(file, outcome.json_file().as_bytes())?))
    }

    fn print(&self, outcome: &Outcome, verbosity: Verbosity) -> miette::Result<()> {
        if self.json.is_some() && self.file().is_none() {
            return print_bytes(json_text(&outcome.json).as_bytes());
        }
        let Outcome { text, detail, verdict, .. } = outcome;
        let parts = match verbosity {
            Verbosity::Quiet => return Ok(()),
            Verbosity::Normal => vec![text, verdict],
            Verbosity::Verbose => vec![text, detail, verdict],
        };
        let parts: Vec<&str> = parts.into_iter().filter(|part| !part.is_empty()).map(String::as_str).collect();
        print(&parts.join("\n"))
    }

    /// The file, where it is not standard output.
    pub(super) fn file(&self) -> Option<&Path> {
        self.json.as_deref().filter(|file| *file != Path::new("-"))
    }
}

/// What a remark begins with, and its color on a terminal.
const REMARKS: [(&str, AnsiColor); 4] = [
    ("error:", AnsiColor::Red),
    ("warning:", AnsiColor::Yellow),
    ("note:", AnsiColor::Cyan),
    ("help:", AnsiColor::Cyan),
];

/// Prints `text`, where there are colors with them. A reader that has seen enough, such as `head`, is no failure.
fn print(text: &str) -> miette::Result<()> {
    let mut stdout = AutoStream::auto(io::stdout().lock());
    printed(stdout.write_all(painted(&printable(text)).as_bytes()).and_then(|()| stdout.flush()))
}

/// The text with the words in color that remarks begin with.
fn painted(text: &str) -> String {
    let line = |line: &str| {
        let inner = line.trim_start_matches(' ');
        let indent = &line[..line.len() - inner.len()];
        let remark = REMARKS.iter().find_map(|(mark, color)| Some((mark, color, inner.strip_prefix(mark)?)));
        remark.map_or_else(
            || line.to_owned(),
            |(mark, color, rest)| {
                let style = Style::new().fg_color(Some((*color).into())).bold();
                format!("{indent}{style}{mark}{style:#}{rest}")
            },
        )
    };
    text.split_inclusive('\n').map(line).collect()
}

/// Prints bytes as they are.
pub(super) fn print_bytes(bytes: &[u8]) -> miette::Result<()> {
    let mut stdout = io::stdout().lock();
    printed(stdout.write_all(bytes).and_then(|()| stdout.flush()))
}

/// What came of printing: a reader that has seen enough is no failure.
pub(super) fn printed(result: io::Result<()>) -> miette::Result<()> {
    match result {
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        printed => Ok(printed.map_err(Unprinted)?),
    }
}

#[cfg(test)]
mod tests {
    use serde_json::Value;

    use super::{Outcome, painted};

    #[test]
    fn a_number_that_is_none_is_refused_wherever_it_stands_in_the_text() {
        for (text, is_refused) in [("gain inf N\n", true), ("(NaN, 1)\n", true), ("info in inf.csv\n", false)] {
            assert_eq!(Outcome::new(text.into(), &Value::Null).check().is_err(), is_refused, "{text}");
        }
    }

    #[test]
    fn a_remark_is_told_by_its_color_and_nothing_else_is_changed() {
        let text = "warning: low\n  help: raise it\nsome note: here\n";
        let found = painted(text);
        assert!(found.starts_with("\u{1b}[1m\u{1b}[33mwarning:\u{1b}[0m low\n  \u{1b}"), "{found:?}");
        assert!(found.ends_with("\nsome note: here\n"), "{found:?}");
        assert_eq!(anstream::adapter::strip_str(&found).to_string(), text);
    }
}
