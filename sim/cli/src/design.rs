//! `rotorlead design`

use std::fmt::Write as _;
use std::path::PathBuf;

use clap::Args;
use rotorlead::design::{DEFAULT_LOOP_RATE_HZ, LeadDesign};
use rotorlead_identify::design::{
    Chain, DesignedInverse, MOST_OVER_REFERENCE, REACH, Setting, bandwidths_with, chain_phases,
};
use rotorlead_plant::{ActiveEffect, CompensatorDesign, LeadFile, Model, StoredCoefficients, StoredCompensator};
use rotorlead_records::files::check_writable;
use rotorlead_report::{
    PointValues, Report, bandwidth_section, bandwidth_values, curve_table, design_section, design_table,
    discrete_table, fastest_point, inverse_equation, inverse_table, transfer_function,
};
use serde::Serialize;
use serde_json::Value;

use super::bandwidth::{counted_effects, predicted};
use super::latency::{LatencyArguments, counted_delays, latency_json};
use super::lost_gain::lost_gain;
use super::outcome::{JsonOption, Outcome, paragraph, without_mark};
use super::parameters::{DesignArguments, Designed};
use super::report_option::ReportOption;
use super::report_pages;

/// Designs one compensator for all points of a model
///
/// The zero of a lead is put on the fastest pole of the model, and the two poles where the filter amplifies up to omega_g. An
/// inverse (--kind inverse) makes the rotor equally fast at every point, with the limits of its command in its state; it is
/// refused where a time constant is known too badly. Writes the parameters and the integers that a controller makes of them; refuses what its format cannot hold.
/// Predicts the bandwidths and the phase of the whole chain as `rotorlead bandwidth` does, and warns where dead time makes
/// the gained bandwidth worthless.
#[derive(Args, Debug)]
pub struct Design {
    /// The model, as `rotorlead identify` writes it
    #[arg(long, value_name = "FILE")]
    model: PathBuf,
    /// Where the compensator goes
    #[arg(long, value_name = "FILE")]
    pub(super) out: PathBuf,
    #[command(flatten)]
    parameters: DesignArguments,
    #[command(flatten)]
    latency: LatencyArguments,
    #[command(flatten)]
    pub(super) report: ReportOption,
    #[command(flatten)]
    pub(super) json: JsonOption,
}

/// What came out, for programs.
#[derive(Serialize)]
#[serde(untagged)]
enum Values {
    Lead(LeadValues),
    Inverse(InverseValues),
}

/// Of a lead.
#[derive(Serialize)]
struct LeadValues {
    zero_rad_s: f64,
    pole_rad_s: f64,
    damping: f64,
    loop_rate_hz: f64,
    coefficients: StoredCoefficients,
    warnings: Vec<String>,
    worst_deviation_db: f64,
    pole_radii: [f64; 2],
    l1_gain: f64,
    step_peak: f64,
    points: Vec<PointValues>,
    latency: Value,
}

/// Of an inverse.
#[derive(Serialize)]
struct InverseValues {
    #[serde(flatten)]
    stored: StoredCompensator,
    setting: &'static str,
    /// The lowest and the highest command at which the time constant was measured.
    measured: [f64; 2],
    /// Where the response may exceed the reference model most, and by which factor.
    worst: Worst,
    rounding_error: f64,
    step_peak: f64,
    warnings: Vec<String>,
    points: Vec<PointValues>,
    latency: Value,
}

#[derive(Serialize)]
struct Worst {
    nominal: f64,
    over_reference: f64,
}

impl Design {
    /// Runs the command.
    pub fn run(&self) -> miette::Result<Outcome> {
        // Before anything is read or written: it may be wrong use.
        self.latency.latency(DEFAULT_LOOP_RATE_HZ)?;
        self.parameters.options()?;
        let model = Model::read(&self.model)?;
        check_writable(&self.out)?;
        self.report.check(Some(&self.out))?;
        let effects = ActiveEffect::of_model(&model)?;
        let designed = self.parameters.design(&model, &self.model)?;
        let compensator = designed.compensator();
        compensator.write(&self.out)?;

        let chain = Chain::Designed(&compensator);
        let points = bandwidths_with(&model, &effects, chain);
        let latency = self.latency.latency(compensator.loop_rate_hz())?;
        let phases = chain_phases(&model, &effects, chain, &latency, &points);
        let doubts = match &designed {
            Designed::Lead(_) => uncertain_zero(&model).into_iter().collect(),
            Designed::Inverse(inverse) => doubts(&model, inverse),
        };
        let warnings: Vec<String> = doubts.into_iter().chain(lost_gain(&points, &phases)).collect();
        let (mut text, detail) = match &designed {
            Designed::Lead(design) => (describe(design, &model), discrete_table(design).text()),
            Designed::Inverse(inverse) => described_inverse(&compensator, inverse),
        };
        write!(text, "\n{}", predicted(&points, &phases).text()).expect("a string takes all");
        text.push_str(&counted_delays(&latency, &phases));
        text.push_str(&counted_effects(&effects));
        text.push('\n');
        for warning in &warnings {
            writeln!(text, "{}", paragraph(warning, "  ")).expect("a string takes all");
        }
        writeln!(text, "Written to {}", self.out.display()).expect("a string takes all");
        text.push_str(&self.report.write(|| {
            let verdict = report_pages::designed(&compensator, &points, warnings.len());
            Report {
                facts: vec![
                    report_pages::file("Model", &self.model),
                    report_pages::file("Compensator", &self.out),
                    report_pages::version(),
                ],
                warnings: without_mark(&warnings),
                sections: vec![design_section(&compensator, &model), bandwidth_section(&points, &phases, &[])],
                ..report_pages::report("Design", format!("Compensator for {}", self.model.display()), verdict)
            }
        })?);
        let (points, latency) = (bandwidth_values(&points, &phases), latency_json(&latency, chain, &phases));
        let values = match (&designed, compensator.stored()) {
            (Designed::Lead(design), StoredCompensator::Lead(LeadFile { coefficients, .. })) => {
                let (check, lead) = (design.check(), design.lead());
                Values::Lead(LeadValues {
                    zero_rad_s: lead.omega_z_rad_s,
                    pole_rad_s: lead.omega_f_rad_s,
                    damping: lead.damping,
                    loop_rate_hz: design.loop_rate_hz(),
                    coefficients,
                    warnings,
                    worst_deviation_db: check.worst_deviation_db,
                    pole_radii: check.pole_radii,
                    l1_gain: check.l1_gain,
                    step_peak: check.step_peak,
                    points,
                    latency,
                })
            }
            (Designed::Lead(_), StoredCompensator::Inverse(_)) => unreachable!("a lead is stored as one"),
            (Designed::Inverse(inverse), stored) => Values::Inverse(InverseValues {
                stored,
                setting: setting_name(inverse.setting),
                measured: inverse.measured.into(),
                worst: Worst { nominal: inverse.worst.0, over_reference: inverse.worst.1 },
                rounding_error: inverse.compensator.design().rounding_error(),
                step_peak: compensator.step_peak(),
                warnings,
                points,
                latency,
            }),
        };
        Ok(Outcome::new(text, &values).with_detail(detail))
    }
}

fn setting_name(setting: Setting) -> &'static str {
    match setting {
        Setting::Exact => "exact",
        Setting::Robust => "robust",
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

/// What is to be known of an inverse before it flies.
fn doubts(model: &Model, designed: &DesignedInverse) -> Vec<String> {
    let range = designed.compensator.range();
    let ((from, to), (low, high)) = (range.compensated, designed.measured);
    let mut doubts = Vec::new();
    // To a millionth, as the default is.
    if from < low - REACH - 1e-6 || to > high + REACH + 1e-6 {
        doubts.push(format!(
            "warning: the inverse is in the path from {from:.3} to {to:.3}, and the time constant is measured from {low:.3} to {high:.3} \
             only. A table that is longer than the truth makes the rotor overshoot: measure there, or narrow --compensate-range"
        ));
    }
    if let Some(ratio) = model.time_constant_curve.as_ref().and_then(|curve| curve.down_over_up) {
        doubts.push(format!(
            "warning: steps down take {ratio:.2} times as long as steps up. The table has the time constants of the faster direction, so \
             that neither overshoots; the other one stays slower than the bandwidth says"
        ));
    }
    if range.slew_per_s.is_none() {
        doubts.push(
            "warning: no --slew is declared. Where the ESC has a limit the motor falls behind what the inverse reckons with, and \
             too fast a voltage step can break an ESC's lock. Without its settings at hand declare 20, 2 % per millisecond"
                .to_owned(),
        );
    }
    doubts
}

/// Standard error of the fastest time constant, as a part of it, above which a zero on its pole is doubtful: a tenth
/// moves the compensated response by about 1 dB.
const DOUBTFUL_PART: f64 = 0.1;

/// Said when the fastest pole is known badly: the fastest of many uncertain poles is likely to be so by chance.
fn uncertain_zero(model: &Model) -> Option<String> {
    let point = fastest_point(model)?;
    let part = point.time_constant_s_std.map(|std| std / point.time_constant_s).filter(|part| *part > DOUBTFUL_PART)?;
    Some(format!(
        "warning: the zero stands on the pole at u_nom {:.3}, whose standard error is {:.0} %. It may be the fastest by \
         chance, and then the other levels get too little lead. Measure there again, or remove its [[point]] from the model",
        point.nominal,
        100.0 * part
    ))
}

/// The design, with what its check found.
pub fn describe(design: &LeadDesign, model: &Model) -> String {
    format!("{}\n\n{}", transfer_function(design), design_table(design, model).text())
}
