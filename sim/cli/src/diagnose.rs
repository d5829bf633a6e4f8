//! `rotorlead diagnose`

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::Args;
use miette::{IntoDiagnostic as _, WrapErr as _};
use rotorlead_answer::Report;
use rotorlead_diagnose::{Diagnosis, Options, diagnose, fill_in_esc_commands};
use rotorlead_plant::{Catalog, Model};
use rotorlead_records::Experiment;
use rotorlead_records::files::{check_writable, write_file};
use rotorlead_results::{diagnosed_model, diagnosis_answer};
use serde_json::json;

use super::outcome::{JsonOption, Outcome};
use super::redesign::RedesignArguments;
use super::replacement::written_to;
use super::report_option::ReportOption;
use super::{progress, report_pages};

/// Steps of a search that finds one effect: each kind is screened and some are fitted, twice.
pub(super) const STEPS: u64 = 60;

/// Finds where simulation and measurement disagree, names the effect that is missing, and shows the gap shrink
///
/// The base is the first-order lag at each nominal command: the given model's, or the one that the records show. Effects
/// are fitted to a part of the records, or to those that are not marked `validate`; the rest, to which no number is fitted,
/// helps to choose among them and shows the gap. Staircases and other records that do not repeat are compared from where the
/// motor runs steadily; of them whole steps are held out.
#[derive(Args, Debug)]
pub struct Diagnose {
    /// The experiment's folder
    #[arg(value_name = "DIR")]
    experiment: PathBuf,
    /// The model to be judged; unless given, the lags that the records show
    #[arg(long, value_name = "FILE")]
    model: Option<PathBuf>,
    /// Where the model with the effects that were found goes
    #[arg(long, value_name = "FILE")]
    out_model: Option<PathBuf>,
    /// Where the plan of the experiment that would say more goes, for `rotorlead simulate` and for a controller
    #[arg(long, value_name = "FILE")]
    out_plan: Option<PathBuf>,
    #[command(flatten)]
    pub(super) report: ReportOption,
    #[command(flatten)]
    redesign: RedesignArguments,
    #[command(flatten)]
    pub(super) json: JsonOption,
}

impl Diagnose {
    /// Runs the command.
    pub fn run(&self) -> miette::Result<Outcome> {
        self.redesign.check()?;
        let model = self.model.as_deref().map(Model::read).transpose()?;
        let folder = &self.experiment;
        let mut experiment = Experiment::read(folder)?;
        fill_in_esc_commands(&mut experiment, folder.as_path().into())?;
        if let Some(out) = &self.out_model {
            check_writable(out)?;
        }
        if let Some(out) = &self.out_plan {
            check_writable(out)?;
        }
        self.report.check()?;
        let catalog = Catalog::standard();
        let bar = progress::estimate("diagnosing", STEPS);
        let tick = || progress::step(&bar);
        let options = Options { model: model.as_ref(), catalog: &catalog, progress: &tick };
        let mut found = diagnose(&experiment, &options)
            .map_err(miette::Report::from)
            .wrap_err_with(|| format!("nothing was diagnosed from `{}`", folder.display()))?;
        bar.finish_and_clear();
        found.model = diagnosed_model(&experiment, model.as_ref(), &found);
        let mut answer = diagnosis_answer(&found);
        let (mut written, mut sections) = (String::new(), vec![answer.section()]);
        if let Some(out) = &self.out_model {
            found.model.write(out)?;
            writeln!(written, "{}", written_to(out)).into_diagnostic()?;
        }
        if let Some(out) = &self.out_plan {
            written.push_str(&write_plan(&found, out)?);
        }
        if let Some(redesigned) = self.redesign.run(&found, experiment.esc_frame_hz)? {
            let redesign = redesigned.answer;
            answer.verdict.sentences.insert(0, redesign.verdict.headline);
            answer.text.extend(redesign.text);
            answer.findings.extend(redesign.findings);
            answer.tables.extend(redesign.tables);
            answer.values.insert("redesign".to_owned(), json!(redesign.values));
            sections.extend(redesigned.sections);
            written.push_str(&redesigned.written);
        }
        written.push_str(&self.report.write(|| {
            let given = self.model.as_deref().map(|model| report_pages::file("Model that was judged", model));
            Report {
                facts: [report_pages::records(&experiment, folder), given.into_iter().collect()].concat(),
                warnings: answer.warnings(),
                sections,
                ..report_pages::report("Diagnosis", format!("Diagnosis of {}", experiment.name), answer.verdict.clone())
            }
        })?);
        Ok(Outcome::from_answer(&answer, &written))
    }
}

/// Writes the plan of the next experiment where there is one, and says so.
fn write_plan(found: &Diagnosis, out: &Path) -> miette::Result<String> {
    let Some(next) = found.next_experiment() else {
        return Ok(format!("No further experiment needed: no plan is written to {}\n", out.display()));
    };
    write_file(out, next.file().into_diagnostic()?.as_bytes())?;
    Ok(format!("Its plan, {} records, is written to {}\n", next.plan.records.len(), out.display()))
}
