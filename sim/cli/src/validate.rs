//! `rotorlead validate`

use std::path::PathBuf;

use clap::Args;
use miette::WrapErr as _;
use rotorlead_identify::{Domain, RecordValidation, validate};
use rotorlead_plant::Model;
use rotorlead_records::Experiment;
use rotorlead_report::{Report, validation_by_nominal, validation_section, validation_table, verdict};
use serde_json::{Value, json};

use super::outcome::{JsonOption, Outcome};
use super::report_option::ReportOption;
use super::{progress, report_pages};

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
    pub(super) report: ReportOption,
    #[command(flatten)]
    pub(super) json: JsonOption,
}

impl Validate {
    /// Runs the command.
    pub fn run(&self) -> miette::Result<Outcome> {
        self.report.check(None)?;
        let model = Model::read(&self.model)?;
        let (experiment, records) = progress::of_files("validating", &[&self.experiment], || -> miette::Result<_> {
            let experiment = Experiment::read(&self.experiment)?;
            let records = validate(&experiment, &model).map_err(miette::Report::from).wrap_err_with(|| {
                format!("`{}` was not compared with `{}`", self.experiment.display(), self.model.display())
            })?;
            Ok((experiment, records))
        })?;
        let written = self.report.write(|| Report {
            facts: [
                report_pages::records(&experiment, &self.experiment),
                vec![report_pages::file("Model", &self.model)],
            ]
            .concat(),
            sections: vec![validation_section(&records, experiment.output)],
            ..report_pages::report(
                "Validation",
                format!("Validation on {}", experiment.name),
                report_pages::validated(&records),
            )
        })?;
        let text = validation_table(&records) + &validation_by_nominal(&records) + "\n" + &verdict(&records) + &written;
        let json = json!({ "records": records.iter().map(record_json).collect::<Vec<_>>() });
        Ok(Outcome { text, json })
    }
}

/// One record for programs.
pub(super) fn record_json(record: &RecordValidation) -> Value {
    json!({
        "file": record.file,
        "nominal": record.nominal,
        "excitation": record.excitation,
        "compensated": record.compensated,
        "role": record.role,
        "held_out": record.fitted.map(|fitted| !fitted),
        "domain": match record.domain() {
            Domain::Frequency => "frequency",
            Domain::Time => "time",
        },
        "fit_percent": record.fit_percent,
        "ceiling_percent": record.ceiling_percent,
        // Infinity, of a record without noise, is null.
        "left_over_noise": record.left_over.map(|left| left.power_ratio),
        "left_over_p_value": record.left_over.map(|left| left.p_value),
        "model_error_percent": record.model_error_percent(),
    })
}
