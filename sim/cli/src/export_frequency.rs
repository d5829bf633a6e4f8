//! `rotorlead export --for matlab`, `python-control` and `csv`: frequency responses.

use std::path::PathBuf;

use clap::Args;
use miette::{IntoDiagnostic as _, WrapErr as _};
use rotorlead_export::FrequencyResponses;
use rotorlead_plant::{CompensatorDesign, Model};
use rotorlead_records::Experiment;
use rotorlead_records::files::{check_writable, write_file};

use super::UsageError;
use super::outcome::Outcome;
use super::replacement::written_to;

/// A program that takes frequency responses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrequencyFormat {
    /// A MAT-file.
    Matlab,
    /// A Python module.
    PythonControl,
    /// A table.
    Csv,
}

/// What only frequency responses take.
#[derive(Args, Debug)]
pub struct FrequencyOptions {
    /// A compensator in front of the motor: matlab, python-control and csv then also get both together
    #[arg(long, value_name = "FILE")]
    compensator: Option<PathBuf>,
    /// File for matlab, python-control or csv; standard output unless given, but for matlab
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

impl FrequencyOptions {
    /// The option that was given, where a stack's parameters are asked for.
    pub fn given(&self) -> Option<&'static str> {
        let compensator = self.compensator.as_ref().map(|_| "--compensator");
        compensator.or(self.out.as_ref().map(|_| "--out"))
    }

    /// Writes or prints the responses of `model` and of the records' multisines.
    pub fn run(
        &self,
        format: FrequencyFormat,
        model: &Model,
        experiment: &Experiment,
        at: Option<f64>,
    ) -> miette::Result<Outcome> {
        self.check(format)?;
        let compensator = self.compensator.as_deref().map(CompensatorDesign::read).transpose()?;
        let found = FrequencyResponses::new(model, experiment, compensator.as_ref(), at)
            .map_err(|why| miette::miette!(help = "docs/export.md says what frequency responses are from", "{why}"))?;
        let content = match format {
            FrequencyFormat::Matlab => found.mat(),
            FrequencyFormat::PythonControl => found.python().into_bytes(),
            FrequencyFormat::Csv => found.csv().into_bytes(),
        };
        let Some(out) = &self.out else {
            let text = String::from_utf8(content).into_diagnostic().wrap_err("a MAT-file is no text")?;
            return Ok(Outcome::new(text, &found));
        };
        let written =
            format!("{} frequencies at a command of {}. {}\n", found.lines.len(), found.nominal, written_to(out));
        write_file(out, &content)?;
        Ok(Outcome::new(written, &found))
    }

    /// Refuses a file that cannot be printed, or written.
    fn check(&self, format: FrequencyFormat) -> miette::Result<()> {
        match &self.out {
            Some(out) => Ok(check_writable(out)?),
            None if format == FrequencyFormat::Matlab => {
                Err(UsageError::new("a MAT-file is not printed", "add --out FILE").into())
            }
            None => Ok(()),
        }
    }
}
