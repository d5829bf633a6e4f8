//! `rotorlead validate`

use std::fmt::Write as _;
use std::path::PathBuf;

use clap::Args;
use miette::{IntoDiagnostic as _, WrapErr as _};
use serde_json::json;

use super::outcome::{JsonOption, Outcome};
use super::progress;
use crate::identify::{Domain, RecordValidation, validate};
use crate::plant::Model;
use crate::record::{Excitation, Experiment, Role};

/// Says how well a model explains each record of an experiment
///
/// Multisine records are compared in the frequency domain, all others in time, by
/// % fit = 100 (1 - |y - yhat| / |y - mean y|). The ceiling is what a perfect model would score, given the noise.
#[derive(Args, Debug)]
pub struct Validate {
    /// The experiment's folder
    #[arg(value_name = "DIR")]
    experiment: PathBuf,
    /// The model, as `rotorlead identify` writes it
    #[arg(long, value_name = "FILE")]
    model: PathBuf,
    #[command(flatten)]
    pub(super) json: JsonOption,
}

impl Validate {
    /// Runs the command.
    pub fn run(&self) -> miette::Result<Outcome> {
        let model = Model::read(&self.model)?;
        let experiment = Experiment::read(&self.experiment)?;
        let bar = progress::bar("validating", experiment.records.len() as u64);
        let records = validate(&experiment, &model).map_err(miette::Report::from).wrap_err_with(|| {
            format!("`{}` was not compared with `{}`", self.experiment.display(), self.model.display())
        })?;
        bar.finish_and_clear();

        let mut text = String::from("  u_nom   excitation   role       compared in    % fit   ceiling   record\n");
        for record in &records {
            writeln!(
                text,
                "  {:<5.3}   {:<10}   {:<8}   {:<11} {:>8.2}   {:>7}   {}{}",
                record.nominal,
                excitation(record.excitation),
                role(record.role),
                domain(record.domain),
                record.fit_percent,
                record.ceiling_percent.map_or_else(|| String::from("-"), |ceiling| format!("{ceiling:.2}")),
                record.file,
                if record.compensated { " (compensated)" } else { "" },
            )
            .into_diagnostic()?;
        }
        let json = json!({ "records": records.iter().map(|record: &RecordValidation| json!({
            "file": record.file,
            "nominal": record.nominal,
            "excitation": record.excitation,
            "compensated": record.compensated,
            "role": record.role,
            "domain": domain(record.domain),
            "fit_percent": record.fit_percent,
            "ceiling_percent": record.ceiling_percent,
        })).collect::<Vec<_>>() });
        Ok(Outcome { text, json })
    }
}

fn excitation(excitation: Excitation) -> &'static str {
    match excitation {
        Excitation::Multisine => "multisine",
        Excitation::Square => "square",
        Excitation::Step => "step",
        Excitation::Staircase => "staircase",
        Excitation::Chirp => "chirp",
        Excitation::Free => "free",
    }
}

fn role(role: Option<Role>) -> &'static str {
    match role {
        Some(Role::Fit) => "fit",
        Some(Role::Validate) => "validate",
        None => "-",
    }
}

fn domain(domain: Domain) -> &'static str {
    match domain {
        Domain::Frequency => "frequency",
        Domain::Time => "time",
    }
}
