//! `rotorlead design`

use std::fmt::Write as _;
use std::path::PathBuf;

use clap::Args;
use rotorlead::design::{DEFAULT_LOOP_RATE_HZ, LeadDesign};
use rotorlead_identify::design::{Chain, bandwidths_with, chain_phases, compensator_file};
use rotorlead_plant::{ActiveEffect, Model, StoredCoefficients};
use rotorlead_records::files::check_writable;
use rotorlead_report::{
    PointValues, Report, bandwidth_section, bandwidth_values, design_section, design_table, discrete_table,
    fastest_point, transfer_function,
};
use serde::Serialize;
use serde_json::Value;

use super::bandwidth::{counted_effects, predicted};
use super::latency::{LatencyArguments, counted_delays, latency_json};
use super::lost_gain::lost_gain;
use super::outcome::{JsonOption, Outcome, paragraph, without_mark};
use super::parameters::DesignArguments;
use super::report_option::ReportOption;
use super::report_pages;

/// Designs one compensator for all points of a model
///
/// The zero is put on the fastest pole of the model, and the two poles where the filter amplifies up to omega_g.
/// Writes the parameters and the integers that a controller makes of them; refuses what its format cannot hold.
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
struct Values {
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

impl Design {
    /// Runs the command.
    pub fn run(&self) -> miette::Result<Outcome> {
        // Before anything is read or written: it may be wrong use.
        self.latency.latency(DEFAULT_LOOP_RATE_HZ)?;
        let model = Model::read(&self.model)?;
        check_writable(&self.out)?;
        self.report.check(Some(&self.out))?;
        let effects = ActiveEffect::of_model(&model)?;
        let design = self.parameters.design(&model, &self.model)?;
        compensator_file(&design).write(&self.out)?;

        let chain = Chain::Continuous(design.lead());
        let points = bandwidths_with(&model, &effects, chain);
        let latency = self.latency.latency(design.loop_rate_hz())?;
        let phases = chain_phases(&model, &effects, chain, &latency, &points);
        let warnings: Vec<String> = uncertain_zero(&model).into_iter().chain(lost_gain(&points, &phases)).collect();
        let mut text = describe(&design, &model);
        write!(text, "\n{}", predicted(&points, &phases).text()).expect("a string takes all");
        text.push_str(&counted_delays(&latency, &phases));
        text.push_str(&counted_effects(&effects));
        text.push('\n');
        for warning in &warnings {
            writeln!(text, "{}", paragraph(warning, "  ")).expect("a string takes all");
        }
        writeln!(text, "Written to {}", self.out.display()).expect("a string takes all");
        text.push_str(&self.report.write(|| {
            let verdict = report_pages::designed(&design, &points, warnings.len());
            Report {
                facts: vec![
                    report_pages::file("Model", &self.model),
                    report_pages::file("Compensator", &self.out),
                    report_pages::version(),
                ],
                warnings: without_mark(&warnings),
                sections: vec![design_section(&design, &model), bandwidth_section(&points, &phases, &[])],
                ..report_pages::report("Design", format!("Compensator for {}", self.model.display()), verdict)
            }
        })?);
        let check = design.check();
        let lead = design.lead();
        let values = Values {
            zero_rad_s: lead.omega_z_rad_s,
            pole_rad_s: lead.omega_f_rad_s,
            damping: lead.damping,
            loop_rate_hz: design.loop_rate_hz(),
            coefficients: compensator_file(&design).coefficients,
            warnings,
            worst_deviation_db: check.worst_deviation_db,
            pole_radii: check.pole_radii,
            l1_gain: check.l1_gain,
            step_peak: check.step_peak,
            points: bandwidth_values(&points, &phases),
            latency: latency_json(&latency, chain, &phases),
        };
        Ok(Outcome::new(text, &values).with_detail(discrete_table(&design).text()))
    }
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
