//! `rotorlead redact`

use std::fmt::Write as _;
use std::path::PathBuf;

use clap::Args;
use rotorlead_answer::words::{counted, width, wrapped};
use rotorlead_records::files::{check_writable, write_file};
use rotorlead_records::import::{Dropped, Redacted, redact};
use serde_json::json;

use super::log_arguments::{LogArguments, check};
use super::outcome::{JsonOption, Outcome};
use super::replacement::written_to;

/// Copies a log without names, places and dates, to hand it to others
///
/// What is read of a log is kept, and all else is dropped. Of a table these are the columns whose names say that they are a time, a command,
/// a thrust, a speed, a voltage or a current, and those that --column names; lines above, remarks and text in cells are dropped, and
/// times are counted from the first row. Of a ULog and a DataFlash log these are the messages of motors and ESCs, and the few
/// parameters that say how to read them. A Betaflight blackbox keeps its main frames with all that they hold, which is no position.
///
/// The copy is imported beside the log, with the same options: where the two do not give the same numbers, nothing is written. A log that
/// the program refuses is copied too, if it refuses the copy for the same kind of reason.
///
/// What is dropped is listed. Look through the copy before you hand it on: a name in a place where only a number belongs is not known
/// for one. The copy is called as --out says.
#[derive(Args, Debug)]
pub struct Redact {
    /// The log
    #[arg(id = "files", value_name = "LOG")]
    file: PathBuf,
    /// The copy
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    #[command(flatten)]
    logs: LogArguments,
    #[command(flatten)]
    pub(super) json: JsonOption,
}

impl Redact {
    /// Runs the command.
    pub fn run(&self) -> miette::Result<Outcome> {
        check_writable(&self.out)?;
        let options = self.logs.options();
        check(&options)?;
        let copy = redact(&self.file, &options)?;
        let written = written_to(&self.out);
        write_file(&self.out, &copy.bytes)?;
        let Redacted { kept, dropped, changes, rows, refused, .. } = &copy;
        let json = json!({
            "out": self.out, "kept": kept, "dropped": dropped, "changes": changes, "rows": rows, "refused": refused,
        });
        Ok(Outcome::new(format!("{}\n{written}\n", described(&copy)), &json))
    }
}

/// What the copy has and has not, and how it is read.
fn described(copy: &Redacted) -> String {
    let mut text = String::new();
    let mut say = |line: String| {
        let _ = writeln!(text, "{}", wrapped(&line, width(), "  "));
    };
    say(format!("Kept: {}", copy.kept.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ")));
    if copy.dropped.is_empty() {
        say(String::from("Dropped: nothing"));
    } else {
        say(String::from("Dropped:"));
    }
    for Dropped { kind, name, count } in &copy.dropped {
        say(match name.as_str() {
            "" => format!("  {kind}: {count}"),
            name => format!("  {kind} `{name}`: {count}"),
        });
    }
    for change in &copy.changes {
        say(format!("Changed: {change}"));
    }
    say(match (&copy.refused, copy.rows) {
        (Some(error), _) => format!("The importer refuses the copy as it does the log: {error}"),
        (None, rows) => format!("The copy is read as the log is: {}", counted(rows.unwrap_or(0), "row")),
    });
    text
}
