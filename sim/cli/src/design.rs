//! `rotorlead design`

use std::path::PathBuf;

use clap::Args;
use miette::WrapErr as _;
use rotorlead_answer::Report;
use rotorlead_plant::Model;
use rotorlead_records::files::check_writable;

use super::latency::LatencyArguments;
use super::model_argument::ModelArgument;
use super::outcome::{JsonOption, Outcome};
use super::parameters::{DesignArguments, PurposeOption};
use super::replacement::written_to;
use super::report_option::ReportOption;
use super::report_pages;

/// Designs one compensator for all points of a model
///
/// Without --kind it designs what is recommended for the purpose: what is better than none in the default vehicle, simulated with
/// this motor (docs/judgement.md). Where nothing is, it says why and writes nothing. The zero of a lead is put on the fastest pole of
/// the model, and the two poles where the filter amplifies up to omega_g, or as far as a slow motor allows where --omega-g is not given.
/// An inverse (--kind inverse) makes the rotor equally fast at every point, with the limits of its command in its state; it is refused
/// where a time constant is known too badly. Writes the parameters and the integers that a controller makes of them; refuses what its
/// format cannot hold. Predicts the bandwidths and the phase of the whole chain as `rotorlead bandwidth` does, and warns where dead time
/// makes the gained bandwidth worthless.
#[derive(Args, Debug)]
pub struct Design {
    #[command(flatten)]
    model: ModelArgument,
    /// Where the compensator goes
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    #[command(flatten)]
    parameters: DesignArguments,
    #[command(flatten)]
    purpose: PurposeOption,
    #[command(flatten)]
    latency: LatencyArguments,
    #[command(flatten)]
    pub(super) report: ReportOption,
    #[command(flatten)]
    pub(super) json: JsonOption,
}

impl Design {
    /// Runs the command.
    pub fn run(&self) -> miette::Result<Outcome> {
        // Before anything is read or written: it may be wrong use.
        let request = self.parameters.request()?;
        let latency = self.latency.latency(request.loop_rate_hz())?;
        let model = Model::read(self.model.path())?;
        check_writable(&self.out)?;
        self.report.check()?;
        let found = request
            .design(&model, self.purpose.purpose(), latency)
            .map_err(miette::Report::from)
            .wrap_err_with(|| format!("`{}` gives no compensator", self.model.path().display()))?;
        found.compensator.write(&self.out)?;
        let answer = found.answer(&model);
        let report = self.report.write(|| {
            let facts = vec![
                report_pages::file("Model", self.model.path()),
                report_pages::file("Compensator", &self.out),
                report_pages::version(),
            ];
            let title = format!("Compensator for {}", self.model.path().display());
            Report { facts, ..report_pages::answer_page("Design", title, &answer) }
        })?;
        Ok(Outcome::from_answer(&answer, &format!("{}\n{report}", written_to(&self.out))))
    }
}
