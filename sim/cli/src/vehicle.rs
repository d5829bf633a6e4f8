//! `rotorlead vehicle`

use std::fmt::Write as _;
use std::path::PathBuf;

use clap::Args;
use miette::{IntoDiagnostic as _, WrapErr as _};
use rotorlead_answer::{Fact, Report, Tone, Verdict};
use rotorlead_plant::Model;
use rotorlead_results::paper::table_1;
use rotorlead_results::{
    judged, vehicle_force_table, vehicle_gains_table, vehicle_other_table, vehicle_section, vehicle_table,
};
use rotorlead_vehicle::{Airframe, Ratios, Row, Study, Worth, findings, headline, steps, study};
use serde::Serialize;

use super::outcome::{JsonOption, Outcome};
use super::report_option::ReportOption;
use super::{progress, report_pages};
use rotorlead_answer::words::paragraph;

/// Says what a compensator is worth in a vehicle, by simulation
///
/// The roll axis of a multirotor, its motors bare, with the paper's compensator, with the conditioned inverse, and with a loop of the
/// rotors' measured speed. For each of them the controller is tuned by one rule to the same margins: at one hover command, and with
/// one gain set for a range of them. In simulation the compensators are the code that runs on the controller. Prints the bandwidth of
/// the rate loop, how far a torque turns the vehicle and how soon a step settles, for each latency; and how a lateral force rises on a
/// hexarotor with tilted rotors. Says where a compensator makes the vehicle worse. `docs/vehicle.md` has the equations and a file for
/// --airframe.
#[derive(Args, Debug)]
pub struct Vehicle {
    /// The vehicle's parameters; a quadrotor of 450 mm unless given
    #[arg(long, value_name = "FILE")]
    airframe: Option<PathBuf>,
    /// The model of a motor with its propeller, as `rotorlead identify` writes it; the paper's Table 1 unless given
    #[arg(long, value_name = "FILE")]
    model: Option<PathBuf>,
    #[command(flatten)]
    report: ReportOption,
    #[command(flatten)]
    pub(super) json: JsonOption,
}

/// What came out, for programs.
#[derive(Serialize)]
struct Values<'a> {
    airframe: &'a Airframe,
    #[serde(flatten)]
    study: &'a Study,
    over_none: Vec<OverNone>,
    findings: &'a [String],
}

/// The results at one latency over those of the bare actuator, in the order of the rows.
#[derive(Serialize)]
struct OverNone {
    latency_s: f64,
    hover: Vec<Beside>,
    range: Vec<Beside>,
}

/// One actuator beside the bare one.
#[derive(Serialize)]
struct Beside {
    ratios: Option<Ratios>,
    worth: Option<Worth>,
}

impl Vehicle {
    /// Runs the command.
    pub fn run(&self) -> miette::Result<Outcome> {
        self.report.check()?;
        let airframe = self.airframe.as_deref().map_or_else(|| Ok(Airframe::default()), Airframe::read)?;
        let model = self.model.as_deref().map_or_else(|| Ok(table_1()), Model::read)?;
        let bar = progress::bar("tuning and simulating", steps(&airframe));
        let compared = study(&airframe, &model, &|| bar.inc(1));
        bar.finish_and_clear();
        let compared = compared.map_err(miette::Report::from);
        // The default model and the default airframe go together: it is a file that does not.
        let compared = match self.model.as_ref().or(self.airframe.as_ref()) {
            Some(file) => compared.wrap_err_with(|| format!("`{}`", file.display()))?,
            None => compared?,
        };

        let found = findings(&compared, airframe.hover.command, airframe.hover.range);
        let mut text = self.text(&compared, &airframe, &model, &found).into_diagnostic()?;
        text.push_str(&self.report.write(|| self.page(&compared, &airframe))?);
        let detail: Vec<String> =
            (0..compared.latencies.len()).map(|index| vehicle_gains_table(&compared, index).text()).collect();
        let over_none = compared.latencies.iter().map(|at| OverNone {
            latency_s: at.latency_s,
            hover: beside(&at.hover),
            range: beside(&at.range),
        });
        let values = Values { airframe: &airframe, study: &compared, over_none: over_none.collect(), findings: &found };
        Ok(Outcome::new(text, &values).with_detail(detail.join("\n")))
    }

    /// For people: the verdict, and the tables that it rests on.
    fn text(
        &self,
        compared: &Study,
        airframe: &Airframe,
        model: &Model,
        found: &[String],
    ) -> Result<String, std::fmt::Error> {
        let mut out = paragraph(&headline(compared), "");
        out.extend(judged(model).map(|warning| paragraph(&warning, "  ")));
        out.push('\n');
        for sentence in found {
            out.push_str(&paragraph(&format!("- {sentence}"), "  "));
        }
        out.push('\n');
        for index in 0..compared.latencies.len() {
            for is_range in [false, true] {
                writeln!(out, "{}", vehicle_table(compared, airframe, index, is_range).text())?;
            }
            writeln!(out, "{}", vehicle_other_table(compared, airframe, index).text())?;
        }
        if let Some(table) = vehicle_force_table(compared, airframe) {
            writeln!(out, "{}", table.text())?;
        }
        for refused in &compared.refused {
            let name = refused.actuator.name();
            out.push_str(&paragraph(&format!("There is no {name}: {}.", refused.reason), "  "));
        }
        if !model.effects.is_empty() {
            let kinds: Vec<&str> = model.effects.iter().map(|effect| effect.kind.as_str()).collect();
            out.push_str(&paragraph(&format!("Left out of the model: {}.", kinds.join(", ")), "  "));
        }
        out.push_str(&paragraph(
            "Simulated: a rigid axis, rotors with one lag, no airflow, no vibration but the gyro's noise. It shows which \
             actuator is worth a flight, and does not replace one.",
            "  ",
        ));
        Ok(out)
    }

    fn page(&self, compared: &Study, airframe: &Airframe) -> Report {
        let is_worse = compared
            .latencies
            .iter()
            .flat_map(|at| [&at.hover, &at.range])
            .any(|rows| rows.iter().any(|row| rows.first().and_then(|bare| row.worth(bare)) == Some(Worth::Worse)));
        let tone = if is_worse { Tone::Attention } else { Tone::Good };
        let named = |name: &str, path: Option<&PathBuf>, default: &str| {
            path.map_or_else(|| Fact::new(name, default), |path| report_pages::file(name, path))
        };
        Report {
            facts: vec![
                named("Airframe", self.airframe.as_ref(), "a quadrotor of 450 mm"),
                named("Model", self.model.as_ref(), "the paper's Table 1"),
                report_pages::version(),
            ],
            sections: vec![vehicle_section(compared, airframe)],
            ..report_pages::report(
                "Vehicle",
                "What a compensator is worth in a vehicle",
                Verdict::new(tone, headline(compared)),
            )
        }
    }
}

fn beside(rows: &[Row]) -> Vec<Beside> {
    let Some(bare) = rows.first() else { return Vec::new() };
    rows.iter().map(|row| Beside { ratios: row.ratios(bare), worth: row.worth(bare) }).collect()
}
