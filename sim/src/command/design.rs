//! `rotorlead design`

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::Args;
use miette::WrapErr as _;
use rotorlead::design::LeadDesign;
use serde_json::json;

use super::bandwidth::{self, positive, rad_s};
use super::outcome::{JsonOption, Outcome};
use crate::design::{Chain, DesignOptions, bandwidths, compensator_file, design};
use crate::files::check_writable;
use crate::plant::Model;

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

/// The parameters of a design.
#[derive(Args, Clone, Debug)]
pub struct DesignArguments {
    /// Highest frequency that is to be amplified; 2 pi 100 rad/s, the paper's, unless given
    #[arg(long, value_name = "RAD_S", value_parser = positive, allow_negative_numbers = true)]
    omega_g: Option<f64>,
    /// Damping ratio of the compensator's poles; 1/sqrt(2) unless given
    #[arg(long, value_name = "RATIO", value_parser = positive, allow_negative_numbers = true)]
    damping: Option<f64>,
    /// Rate at which the filter runs; 5000 Hz unless given
    #[arg(long, value_name = "HZ", value_parser = positive, allow_negative_numbers = true)]
    loop_rate: Option<f64>,
    /// Frequency at which the sampled filter is to match the continuous one exactly
    #[arg(long, value_name = "RAD_S", value_parser = positive, allow_negative_numbers = true)]
    prewarp: Option<f64>,
}

impl DesignArguments {
    /// Designs for `model`, which was read from `file`.
    pub fn design(&self, model: &Model, file: &Path) -> miette::Result<LeadDesign> {
        design(model, &self.options())
            .map_err(miette::Report::from)
            .wrap_err_with(|| format!("`{}` gives no compensator", file.display()))
    }

    /// What was given, and the paper's values for the rest.
    fn options(&self) -> DesignOptions {
        let default = DesignOptions::default();
        DesignOptions {
            omega_g_rad_s: self.omega_g.unwrap_or(default.omega_g_rad_s),
            damping: self.damping.unwrap_or(default.damping),
            loop_rate_hz: self.loop_rate.unwrap_or(default.loop_rate_hz),
            prewarp_rad_s: self.prewarp,
        }
    }
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
        writeln!(text, "\nPredicted bandwidth\n\n{}", bandwidth::table(&points)).expect("a string takes all");
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
            "points": points.iter().map(|point| json!({
                "nominal": point.nominal,
                "uncompensated_rad_s": rad_s(point.uncompensated),
                "compensated_rad_s": rad_s(point.compensated),
            })).collect::<Vec<_>>(),
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
