//! `rotorlead design`

use std::fmt::Write as _;
use std::path::PathBuf;

use clap::Args;
use rotorlead::design::LeadDesign;
use serde_json::json;

use super::outcome::{JsonOption, Outcome};
use super::parameters::DesignArguments;
use crate::design::{Chain, bandwidths, compensator_file};
use crate::files::check_writable;
use crate::plant::Model;
use crate::report::{bandwidth_json, bandwidth_table};

/// Designs one compensator for all points of a model
///
/// The zero is put on the fastest pole of the model, and the two poles where the filter amplifies up to omega_g.
/// Writes the parameters and the integers that a controller makes of them; refuses what its format cannot hold.
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
    pub(super) json: JsonOption,
}

impl Design {
    /// Runs the command.
    pub fn run(&self) -> miette::Result<Outcome> {
        let model = Model::read(&self.model)?;
        check_writable(&self.out)?;
        let design = self.parameters.design(&model, &self.model)?;
        compensator_file(&design).write(&self.out)?;

        let points = bandwidths(&model, Chain::Continuous(design.lead()));
        let mut text = describe(&design);
        writeln!(text, "\nPredicted bandwidth\n\n{}", bandwidth_table(&points)).expect("a string takes all");
        writeln!(text, "Written to {}", self.out.display()).expect("a string takes all");
        let check = design.check();
        let json = json!({
            "zero_rad_s": design.lead().omega_z_rad_s,
            "pole_rad_s": design.lead().omega_f_rad_s,
            "damping": design.lead().damping,
            "loop_rate_hz": design.loop_rate_hz(),
            "worst_deviation_db": check.worst_deviation_db,
            "pole_radii": check.pole_radii,
            "l1_gain": check.l1_gain,
            "step_peak": check.step_peak,
            "points": bandwidth_json(&points),
        });
        Ok(Outcome { text, json })
    }
}

/// The design in words, with what its check found.
pub fn describe(design: &LeadDesign) -> String {
    let (lead, check) = (design.lead(), design.check());
    let wf2 = lead.omega_f_rad_s.powi(2);
    let linear = wf2 / lead.omega_z_rad_s;
    let friction = 2.0 * lead.damping * lead.omega_f_rad_s;
    let rounded = design.coefficients();
    format!(
        "\
C(s) = ({linear:.2} s + {wf2:.2}) / (s^2 + {friction:.2} s + {wf2:.2})

  zero            {:>10.4} rad/s   the fastest pole (2)
  poles           {:>10.4} rad/s   damping {:.4} (4, 5)
  amplifies up to {:>10.2} rad/s   omega_g (6)
  asymptotic peak {:>10.4} dB      (5)
  gains little where the pole is slower than {:.4} rad/s

Discrete at {} Hz (Tustin{})
  coefficients, 2^-32      k {}  c {}  g0 {}  g1 {}
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
