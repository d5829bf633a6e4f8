//! `rotorlead vehicle`

use std::path::{Path, PathBuf};

use clap::Args;
use miette::WrapErr as _;
use rotorlead_answer::{Fact, Report};
use rotorlead_plant::Model;
use rotorlead_results::paper::table_1;
use rotorlead_results::vehicle_answer;
use rotorlead_vehicle::{Airframe, steps, study};

use super::model_argument::ModelArgument;
use super::outcome::{JsonOption, Outcome};
use super::report_option::ReportOption;
use super::{progress, report_pages};

/// Says what a compensator is worth in a vehicle, by simulation
///
/// The roll axis of a multirotor, its motors bare, with the paper's compensator, with the conditioned inverse, and with a loop of the
/// rotors' measured speed. For each of them the controller is tuned by one rule to the same margins: at one hover command, and with
/// one gain set for a range of them. In simulation the compensators are the code that runs on the controller. Prints the bandwidth of
/// the rate loop, how far a torque turns the vehicle and how soon a step settles, for each latency; and how a lateral force rises on a
/// hexarotor with tilted rotors. Says where a compensator makes the vehicle worse. `docs/vehicle.md` has the equations and a file for
/// --airframe.
#[derive(Args, Debug)]
#[command(mut_arg("model", |model| {
    model.required(false).help("The model, as `rotorlead identify` writes it; the paper's Table 1 unless given")
}))]
pub struct Vehicle {
    #[command(flatten)]
    model: Option<ModelArgument>,
    /// The vehicle's parameters; a quadrotor of 450 mm unless given
    #[arg(long, value_name = "FILE")]
    airframe: Option<PathBuf>,
    #[command(flatten)]
    pub(super) report: ReportOption,
    #[command(flatten)]
    pub(super) json: JsonOption,
}

impl Vehicle {
    /// Runs the command.
    pub fn run(&self) -> miette::Result<Outcome> {
        self.report.check()?;
        let airframe = self.airframe.as_deref().map_or_else(|| Ok(Airframe::default()), Airframe::read)?;
        let file = self.model.as_ref().map(ModelArgument::path);
        let model = file.map_or_else(|| Ok(table_1()), Model::read)?;
        let bar = progress::bar("tuning and simulating", steps(&airframe));
        let compared = study(&airframe, &model, &|| bar.inc(1));
        bar.finish_and_clear();
        let compared = compared.map_err(miette::Report::from);
        // The default model and the default airframe go together: it is a file that does not.
        let compared = match file.or(self.airframe.as_deref()) {
            Some(file) => compared.wrap_err_with(|| format!("`{}`", file.display()))?,
            None => compared?,
        };

        let answer = vehicle_answer(&compared, &airframe, &model);
        let written = self.report.write(|| Report {
            facts: vec![
                fact("Airframe", self.airframe.as_deref(), "a quadrotor of 450 mm"),
                fact("Model", file, "the paper's Table 1"),
                report_pages::version(),
            ],
            ..report_pages::answer_page("Vehicle", "What a compensator is worth in a vehicle", &answer)
        })?;
        Ok(Outcome::from_answer(&answer, &written))
    }
}

/// A fact about a file, or what there is in its place.
fn fact(name: &str, path: Option<&Path>, default: &str) -> Fact {
    path.map_or_else(|| Fact::new(name, default), |path| report_pages::file(name, path))
}
