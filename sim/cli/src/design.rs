//! `rotorlead design`

use std::fmt::Write as _;
use std::path::PathBuf;

use clap::Args;
use miette::WrapErr as _;
use rotorlead::design::{DEFAULT_LOOP_RATE_HZ, LeadDesign};
use rotorlead_answer::Report;
use rotorlead_identify::design::{DesignedInverse, MOST_OVER_REFERENCE};
use rotorlead_plant::{ActiveEffect, CompensatorDesign, Model};
use rotorlead_records::files::check_writable;
use rotorlead_results::{
    Chosen, DesignResult, Designed, bandwidth_section, bandwidth_table, curve_table, design_section, design_table,
    discrete_table, inverse_equation, inverse_table, recommendation_table, setting_name, transfer_function,
};

use super::bandwidth::counted_effects;
use super::latency::{LatencyArguments, counted_delays};
use super::outcome::{JsonOption, Outcome, without_mark};
use super::parameters::{DesignArguments, PurposeOption};
use super::replaced::written_to;
use super::report_option::ReportOption;
use super::report_pages;
use rotorlead_answer::words::paragraph;

/// Designs one compensator for all points of a model
///
/// Without --kind it designs what is recommended for the purpose: what is better than none in the default vehicle, simulated with
/// this motor (docs/judgement.md). Where nothing is, it says why and writes nothing. The zero of a lead is put on the fastest pole of
/// the model, and the two poles where the filter amplifies up to omega_g. An inverse (--kind inverse) makes the rotor equally fast
/// at every point, with the limits of its command in its state; it is refused where a time constant is known too badly. Writes the
/// parameters and the integers that a controller makes of them; refuses what its format cannot hold. Predicts the bandwidths and the
/// phase of the whole chain as `rotorlead bandwidth` does, and warns where dead time makes the gained bandwidth worthless.
#[derive(Args, Debug)]
pub struct Design {
    /// The model, as `rotorlead identify` writes it
    #[arg(long, value_name = "FILE")]
    model: PathBuf,
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
    report: ReportOption,
    #[command(flatten)]
    pub(super) json: JsonOption,
}

impl Design {
    /// Runs the command.
    pub fn run(&self) -> miette::Result<Outcome> {
        // Before anything is read or written: it may be wrong use.
        self.latency.latency(DEFAULT_LOOP_RATE_HZ)?;
        let request = self.parameters.request()?;
        let model = Model::read(&self.model)?;
        check_writable(&self.out)?;
        self.report.check()?;
        let effects = ActiveEffect::of_model(&model)?;
        let Chosen { designed, recommendation } = request
            .design(&model, self.purpose.purpose())
            .map_err(miette::Report::from)
            .wrap_err_with(|| format!("`{}` gives no compensator", self.model.display()))?;
        let compensator = designed.compensator(&model);
        compensator.write(&self.out)?;

        let latency = self.latency.latency(compensator.loop_rate_hz())?;
        let mut found = DesignResult::of(&model, &effects, designed, latency);
        found.recommendation = recommendation;
        let DesignResult { designed, points, phases, warnings, .. } = &found;
        let (mut text, detail) = match designed {
            Designed::Lead(design) => (describe(design, &model), discrete_table(design).text()),
            Designed::Inverse(inverse) => described_inverse(&compensator, inverse),
        };
        if let Some(recommendation) = &found.recommendation {
            write!(text, "\n{}", recommendation_table(recommendation).text()).expect("a string takes all");
        }
        write!(text, "\n{}", bandwidth_table(points, phases).text()).expect("a string takes all");
        text.push_str(&counted_delays(&found.latency, phases));
        text.push_str(&counted_effects(&effects));
        text.push('\n');
        for warning in warnings {
            writeln!(text, "{}", paragraph(warning, "  ")).expect("a string takes all");
        }
        writeln!(text, "{}", written_to(&self.out)).expect("a string takes all");
        text.push_str(&self.report.write(|| {
            let verdict = report_pages::designed(&compensator, points, warnings.len());
            Report {
                facts: vec![
                    report_pages::file("Model", &self.model),
                    report_pages::file("Compensator", &self.out),
                    report_pages::version(),
                ],
                warnings: without_mark(warnings),
                sections: vec![design_section(&compensator, &model), bandwidth_section(points, phases, &[])],
                ..report_pages::report("Design", format!("Compensator for {}", self.model.display()), verdict)
            }
        })?);
        Ok(Outcome::new(text, &found.values()).with_detail(detail))
    }
}

/// The inverse with what its check found, and its curve.
fn described_inverse(compensator: &CompensatorDesign, designed: &DesignedInverse) -> (String, String) {
    let inverse = &designed.compensator;
    let mut text = format!("{}\n\n{}", inverse_equation(inverse), inverse_table(compensator, inverse).text());
    let (nominal, factor) = designed.worst;
    let said = format!(
        "Setting {}: by the intervals of the time constants the response is at most {factor:.3} times that of the reference model, at \
         command {nominal:.3}; {MOST_OVER_REFERENCE} is allowed.",
        setting_name(designed.setting)
    );
    text.push_str(&paragraph(&said, ""));
    (text, curve_table(inverse).text())
}

/// The design, with what its check found.
pub fn describe(design: &LeadDesign, model: &Model) -> String {
    format!("{}\n\n{}", transfer_function(design), design_table(design, model).text())
}
