//! `rotorlead design`

use std::fmt::Write as _;
use std::path::PathBuf;

use clap::Args;
use rotorlead::design::{DEFAULT_LOOP_RATE_HZ, LeadDesign};
use rotorlead_identify::design::{Chain, bandwidths_with, chain_phases, compensator_file};
use rotorlead_plant::{ActiveEffect, Model, Point};
use rotorlead_records::files::check_writable;
use rotorlead_report::{Report, bandwidth_json, bandwidth_section, bandwidth_table, design_section};
use serde_json::json;

use super::bandwidth::counted_effects;
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
        write!(text, "\nPredicted bandwidth\n\n{}", bandwidth_table(&points, &phases)).expect("a string takes all");
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
        let json = json!({
            "zero_rad_s": design.lead().omega_z_rad_s,
            "pole_rad_s": design.lead().omega_f_rad_s,
            "damping": design.lead().damping,
            "loop_rate_hz": design.loop_rate_hz(),
            "coefficients": compensator_file(&design).coefficients,
            "warnings": warnings,
            "worst_deviation_db": check.worst_deviation_db,
            "pole_radii": check.pole_radii,
            "l1_gain": check.l1_gain,
            "step_peak": check.step_peak,
            "points": bandwidth_json(&points, &phases),
            "latency": latency_json(&latency),
        });
        Ok(Outcome { text, json })
    }
}

/// Standard error of the fastest time constant, as a part of it, above which a zero on its pole is doubtful: a tenth
/// moves the compensated response by about 1 dB.
const DOUBTFUL_PART: f64 = 0.1;

/// The point with the fastest pole, on which the zero stands.
fn fastest(model: &Model) -> Option<&Point> {
    model.points.iter().min_by(|a, b| a.time_constant_s.total_cmp(&b.time_constant_s))
}

/// Standard error of a point's time constant, as a part of it.
fn relative_std(point: &Point) -> Option<f64> {
    point.time_constant_s_std.map(|std| std / point.time_constant_s)
}

/// Said when the fastest pole is known badly: the fastest of many uncertain poles is likely to be so by chance.
fn uncertain_zero(model: &Model) -> Option<String> {
    let point = fastest(model)?;
    let part = relative_std(point).filter(|part| *part > DOUBTFUL_PART)?;
    Some(format!(
        "warning: the zero stands on the pole at u_nom {:.3}, whose standard error is {:.0} %. It may be the fastest by \
         chance, and then the other levels get too little lead. Measure there again, or remove its [[point]] from the model",
        point.nominal,
        100.0 * part
    ))
}

/// The design in words, with what its check found.
pub fn describe(design: &LeadDesign, model: &Model) -> String {
    let origin = fastest(model).map_or_else(String::new, |point| {
        let std = relative_std(point).map_or_else(String::new, |part| format!(" +- {:.1} %", 100.0 * part));
        format!(", u_nom {:.3}{std}", point.nominal)
    });
    let (lead, check) = (design.lead(), design.check());
    let wf2 = lead.omega_f_rad_s.powi(2);
    let linear = wf2 / lead.omega_z_rad_s;
    let friction = 2.0 * lead.damping * lead.omega_f_rad_s;
    let rounded = design.coefficients();
    format!(
        "\
C(s) = ({linear:.2} s + {wf2:.2}) / (s^2 + {friction:.2} s + {wf2:.2})

  zero            {:>10.4} rad/s   the fastest pole (2){origin}
  poles           {:>10.4} rad/s   damping {:.4} (4, 5)
  amplifies up to {:>10.2} rad/s   omega_g (6)
  asymptotic peak {:>10.4} dB      (5)
  gains little where the pole is slower than {:.4} rad/s

Discrete at {} Hz (Tustin{})
  coefficients, 2^-32      k {}  c {}
                           g0 {}  g1 {}
  deviation by rounding    {:.1e} dB at most, at {:.0} rad/s
  pole radii               {:.8}  {:.8}
  L1 gain                  {:.3}: a command in [0, 1] stays in [{:.2}, {:.2}]
  a step of the command is answered by at most {:.2} times that step
",
        lead.omega_z_rad_s,
        lead.omega_f_rad_s,
        lead.damping,
        lead.omega_g_rad_s(),
        lead.asymptotic_peak_db(),
        lead.slowest_helped_rad_s(),
        design.loop_rate_hz(),
        design.prewarp_rad_s().map_or(String::new(), |prewarp| format!(", exact at {prewarp} rad/s")),
        rounded.k(),
        rounded.c(),
        rounded.g0(),
        rounded.g1(),
        check.worst_deviation_db,
        check.worst_deviation_rad_s,
        check.pole_radii[0],
        check.pole_radii[1],
        check.l1_gain,
        (1.0 - check.l1_gain) / 2.0,
        (1.0 + check.l1_gain) / 2.0,
        check.step_peak,
    )
}
