//! What can be wrong with a log, and what to do about it.

use std::fmt;
use std::path::{Path, PathBuf};

use miette::Diagnostic;
use thiserror::Error;

use super::format::LogFormat;
use super::missing::{EXCITATIONS, MissingOption};
use crate::files::shown;

/// Where a row of a log is, from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// Line of a text.
    Line(u64),
    /// Sample of a binary log.
    Sample(u64),
}

impl fmt::Display for Place {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Line(number) => write!(formatter, "line {number}"),
            Self::Sample(number) => write!(formatter, "sample {number}"),
        }
    }
}

/// Why a log was not taken: a variant for each thing that may be done about it. Every message names the file and, where there is one,
/// the line or sample and the column.
#[derive(Debug, Error, Diagnostic)]
pub enum ImportError {
    /// The file could not be read.
    #[error("{}: cannot be read", file.display())]
    #[diagnostic(help("check the path and the permissions"))]
    Read {
        /// The log.
        file: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// No log, or none that is known: another file has to be given.
    #[error("{}{problem}", file.display())]
    #[diagnostic(help("{remedy}"))]
    NotALog {
        /// The file.
        file: PathBuf,
        /// What it is, behind the file's name.
        problem: String,
        /// How a log comes of it.
        remedy: String,
    },
    /// A binary log that is cut short or damaged.
    #[error("{}, byte {offset}: {problem}", file.display())]
    #[diagnostic(help("copy or save the file again: it is cut short or damaged"))]
    Damaged {
        /// The log.
        file: PathBuf,
        /// Where the part begins that cannot be read.
        offset: usize,
        /// What is wrong with it.
        problem: &'static str,
    },
    /// Nothing but a header, or less.
    #[error("{}: {rows} usable row(s); at least {needed} are needed", file.display())]
    #[diagnostic(help(
        "check that the recording ran while the command was on; where each row is a steady point, say so with \
         `--excitation steady`: four are enough"
    ))]
    TooFewRows {
        /// The log.
        file: PathBuf,
        /// Rows that could be used.
        rows: usize,
        /// Rows that are needed.
        needed: usize,
    },
    /// The command never changes.
    #[error("{}: the command is {command} in all of the {rows} rows taken, so nothing can be identified from it", file.display())]
    #[diagnostic(help(
        "record again with levels or an excitation, which `rotorlead excite --out excitation.csv` designs; where the log does have them, it may be cut short or hold another run"
    ))]
    ConstantCommand {
        /// The log.
        file: PathBuf,
        /// The command, 0..1.
        command: f64,
        /// Rows taken.
        rows: usize,
    },
    /// A flight, whose commands are those of a controller.
    #[error(
        "{}: a flight, and no bench run: while the command of motor {motor} moves, so does that of {others}, each in its own way",
        file.display()
    )]
    #[diagnostic(help(
        "a controller answers what the motors do, so that a lag of a bench is not to be fitted: `--excitation flight` takes all motors as they \
         flew, whose lag is estimated in closed loop; --seconds takes a part of the log that is a run of one motor on a bench, and \
         `--excitation free` one motor as a record that no lag is fitted to"
    ))]
    Flight {
        /// The log.
        file: PathBuf,
        /// The motor that was asked for, from 1.
        motor: usize,
        /// The others that move: what they are, and their numbers from 1.
        others: String,
    },
    /// What the log does not say of itself, and options would.
    #[error("{}{problem}", file.display())]
    #[diagnostic(help("{remedy}"))]
    Unstated {
        /// The log.
        file: PathBuf,
        /// What it does not say, behind the line of the names where there is one.
        problem: String,
        /// What it has, and the options that would say it.
        remedy: String,
        /// Those options.
        missing: Vec<MissingOption>,
    },
    /// What is asked for or needed, and the log does not have.
    #[error("{}{problem}", file.display())]
    #[diagnostic(help("{remedy}"))]
    Missing {
        /// The log.
        file: PathBuf,
        /// What it does not have, behind the place where it should be.
        problem: String,
        /// What it has, and how the rest comes about.
        remedy: String,
    },
    /// A value that cannot be used.
    #[error("{}, {place}: {problem}", file.display())]
    #[diagnostic(help("{remedy}"))]
    Value {
        /// The log.
        file: PathBuf,
        /// Where it is: a line or a sample, and a column; or a header, a vector or a variable.
        place: String,
        /// What is wrong with it.
        problem: String,
        /// What to do about it.
        remedy: String,
    },
    /// The stated range of the ESC signal is no range.
    #[error("the ESC signal's range {low_us}..{high_us} µs is empty or not finite")]
    #[diagnostic(help("give zero command and full command in microseconds, such as 1000 and 2000"))]
    SignalRange {
        /// What should become 0.
        low_us: f64,
        /// What should become 1.
        high_us: f64,
    },
    /// A log of which no copy without names and places can be made.
    #[error("{}{problem}", file.display())]
    #[diagnostic(help("{remedy}"))]
    NotRedacted {
        /// The log.
        file: PathBuf,
        /// Why not.
        problem: String,
        /// What to hand over in its place.
        remedy: String,
    },
}

impl ImportError {
    /// The options that would say what the log does not, each with a word in capitals where a value belongs; none where that is not
    /// what is wrong.
    #[must_use]
    pub fn missing_options(&self) -> Vec<MissingOption> {
        match self {
            Self::Unstated { missing, .. } => missing.clone(),
            _ => Vec::new(),
        }
    }

    pub(super) fn not_a_log(file: &Path, problem: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self::NotALog { file: file.into(), problem: problem.into(), remedy: remedy.into() }
    }

    /// What to hand over of a log that cannot be copied without names and places.
    pub(super) fn not_redacted(file: &Path, problem: impl Into<String>) -> Self {
        let remedy = "hand over its numbers instead: `rotorlead import` makes a folder of them, with the times, the command and the \
                      response, and nothing else of the log";
        Self::NotRedacted { file: file.into(), problem: problem.into(), remedy: remedy.into() }
    }

    /// What no log is known by; `problem` says what there is.
    pub(super) fn unknown(file: &Path, problem: String) -> Self {
        Self::not_a_log(file, problem, format!("known: {}. Export the log again as one of them", LogFormat::titles()))
    }

    pub(super) fn missing(file: &Path, problem: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self::Missing { file: file.into(), problem: problem.into(), remedy: remedy.into() }
    }

    /// Nothing for a signal of a motor; `known` is what can stand for it, `has` what the log has.
    pub(super) fn missing_signal(file: &Path, signal: &str, motor: usize, known: &str, has: &[&str]) -> Self {
        let has = if has.is_empty() { "nothing that is known" } else { &has.join(", ") };
        let remedy =
            format!("needed is {known}. The log has {has}: switch it on in the logger, or state a motor that is there");
        Self::missing(file, format!(": nothing logged for `{signal}` of motor {motor}"), remedy)
    }

    /// A log, or chirp, of a number that a file does not have.
    pub(super) fn no_such_log(file: &Path, log: usize, logs: usize) -> Self {
        let remedy = "logs, or the chirps of a DataFlash log, are numbered from 1, in the order of the file";
        Self::missing(file, format!(": there is no log {log} in it, but {logs}"), remedy)
    }

    /// A response that the log does not have, beside the columns that it has.
    pub(super) fn no_such_output(file: &Path, output: &str, columns: &str) -> Self {
        let remedy = format!(
            "name its column with --column, or choose the other response with --response. The columns are {columns}"
        );
        Self::missing(file, format!(": no column was taken as {output}, which is to be the response"), remedy)
    }

    /// Which pulse widths mean no and full command is in no parameter.
    pub(super) fn no_pulse_range(file: &Path) -> Self {
        let remedy = "state them with --pulse-us LOW..HIGH, as the ESC was calibrated; a log has them as MOT_PWM_MIN and MOT_PWM_MAX \
                      (Q_M_PWM_MIN and Q_M_PWM_MAX of a quadplane, SERVOn_MIN and SERVOn_MAX of a plane's throttle), where these are not \
                      0; PX4's are PWM_MAIN_MINn and PWM_MAIN_MAXn, and 0..1999 with DShot";
        let problem = String::from(": no parameter says which pulse widths mean no and full command");
        Self::Unstated { file: file.into(), problem, remedy: remedy.into(), missing: vec![MissingOption::pulse_us()] }
    }

    /// What drove the command is not known.
    pub(super) fn no_excitation(file: &Path) -> Self {
        let remedy = format!("say it with `{}`: {EXCITATIONS}", MissingOption::excitation());
        let problem = String::from(": the log does not say what drove the command");
        Self::Unstated { file: file.into(), problem, remedy, missing: vec![MissingOption::excitation()] }
    }

    pub(super) fn value(
        file: &Path,
        place: impl Into<String>,
        problem: impl Into<String>,
        remedy: impl Into<String>,
    ) -> Self {
        Self::Value { file: file.into(), place: place.into(), problem: problem.into(), remedy: remedy.into() }
    }

    /// A value of a column in a row.
    pub(super) fn cell(
        file: &Path,
        line: Place,
        column: &str,
        problem: impl Into<String>,
        remedy: impl Into<String>,
    ) -> Self {
        Self::value(file, format!("{line}, column `{column}`"), problem, remedy)
    }

    /// A vector, or a field of messages, that cannot be a column.
    pub(super) fn vector(file: &Path, name: &str, problem: impl Into<String>) -> Self {
        let remedy = "all columns need one number per row: save or record the log again";
        Self::value(file, format!("vector `{name}`"), problem, remedy)
    }

    /// A command outside the range that is normalized to 0..1, in a row of a table.
    pub(super) fn out_of_range(file: &Path, line: Place, column: &str, value: f64, (low, high): (f64, f64)) -> Self {
        let remedy = "where the command is a pulse width, state the ESC's range (zero and full command) with --pulse-us; else its unit \
                      is another than its column says";
        Self::cell(file, line, column, format!("{} is outside {low}..{high}", shown(value)), remedy)
    }

    /// Time that runs backwards.
    pub(super) fn time_runs_back(file: &Path, line: Place, column: &str, by_s: f64) -> Self {
        let remedy = "this looks like two logs in one file: cut it there and import the parts one by one; where each row is a steady \
                      point, say so with `--excitation steady`";
        Self::cell(file, line, column, format!("time runs backwards by {} s", shown(by_s)), remedy)
    }
}
