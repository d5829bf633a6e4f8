//! `rotorlead validate`

use std::path::PathBuf;

use clap::Args;
use miette::WrapErr as _;
use rotorlead_answer::Report;
use rotorlead_assess::{Assessment, AssessmentContext, assess};
use rotorlead_plant::Model;
use rotorlead_records::Experiment;
use rotorlead_results::validation_answer;

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
        self.report.check()?;
        let model = Model::read(&self.model)?;
        let (experiment, records, judgement, recommendation) =
            progress::over_files("validating", &[&self.experiment], || -> miette::Result<_> {
                let experiment = Experiment::read(&self.experiment)?;
                let Assessment { judgement, recommendation, records, .. } =
                    assess(&experiment, &model, AssessmentContext::default());
                let records = records.map_err(miette::Report::from).wrap_err_with(|| {
                    format!("`{}` was not compared with `{}`", self.experiment.display(), self.model.display())
                })?;
                Ok((experiment, records, judgement, recommendation))
            })?;
        let answer = validation_answer(&records, &judgement, recommendation.as_ref(), experiment.output);
        let written = self.report.write(|| Report {
            facts: [
                report_pages::records(&experiment, &self.experiment),
                vec![report_pages::file("Model", &self.model)],
            ]
            .concat(),
            ..report_pages::answer_page("Validation", format!("Validation on {}", experiment.name), &answer)
        })?;
        Ok(Outcome::from_answer(&answer, &written))
    }
}
