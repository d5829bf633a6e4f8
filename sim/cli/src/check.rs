//! `rotorlead check`

use std::io::{Write as _, stderr};
use std::path::PathBuf;

use clap::Args;
use miette::Diagnostic;
use rotorlead_answer::words::{counted, remark};
use rotorlead_records::files::printable;
use rotorlead_records::{Experiment, Finding, Severity};
use rotorlead_results::check_answer;
use thiserror::Error;

use super::outcome::{JsonOption, Outcome, Verbosity};
use super::progress;

/// Says what is wrong with an experiment's folder, before anything is made of it
///
/// Looks at every record for rows that are missing, uneven or too slow, a sensor that is slower than its rows, columns
/// that are swapped or in another unit than their name says, a response of the wrong sign, limits that a column ran
/// into, periods that are too few or none, and all else that `rotorlead identify` would refuse or warn of; and says all
/// of it at once, each with what to do. Nothing is written. An error is what an identification refuses; after a warning
/// it goes on, with numbers that may be worth less.
///
/// What a motor could have done is not seen: a thrust in pounds-force (4.4 times too small) is distinguished from newtons only
/// for a small motor, or by voltage and current; a calibration that is off by less than that is not detected.
#[derive(Args, Debug)]
pub struct Check {
    /// The experiment's folder
    #[arg(value_name = "DIR")]
    experiment: PathBuf,
    #[command(flatten)]
    pub(super) json: JsonOption,
}

/// What fails the command although its findings are said.
#[derive(Debug, Error, Diagnostic)]
#[error("`{}` has {}: it cannot be identified as it is", folder.display(), counted(*errors, "error"))]
#[diagnostic(help("correct what is listed as an error, and check again"))]
struct Faulty {
    folder: PathBuf,
    errors: usize,
}

impl Check {
    /// Runs the command and says what was found; fails where there is an error among it.
    pub fn say(&self, verbosity: Verbosity) -> miette::Result<()> {
        self.json.check(None)?;
        let answer = progress::over_files("checking", &[&self.experiment], || {
            check_answer(&self.experiment.display().to_string(), &Experiment::inspect(&self.experiment))
        });
        self.json.say(|| Ok(Outcome::from_answer(&answer, "")), verbosity)?;
        let errors: Vec<&Finding> =
            answer.findings.iter().filter(|finding| finding.severity == Severity::Error).collect();
        let count = errors.len();
        if count == 0 {
            return Ok(());
        }
        // Errors are said even to those who want nothing else.
        if verbosity == Verbosity::Quiet {
            let list: String = errors.into_iter().map(remark).collect();
            // Where nobody is left to read them, the status says it.
            let _ = stderr().write_all(printable(&list).as_bytes());
        }
        Err(Faulty { folder: self.experiment.clone(), errors: count }.into())
    }
}
