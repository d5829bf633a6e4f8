//! A compensator's file as settings of a controller.

use std::path::{Path, PathBuf};

use clap::Args;
use rotorlead::settings::Key;
use rotorlead_device::curve_text;
use rotorlead_plant::{CompensatorDesign, FilterDesign, Model};
use rotorlead_records::Finding;
use rotorlead_results::warn_of_another_model;

/// A compensator to be set, and where.
#[derive(Args, Debug)]
pub struct CompensatorArguments {
    /// Set this compensator, as `rotorlead design` writes it; a lead is that of all motors
    #[arg(long, value_name = "FILE")]
    pub compensator: Option<PathBuf>,
    /// Of an inverse, set the time constants of this motor alone; of every motor unless given
    #[arg(long, value_name = "MOTOR", requires = "compensator")]
    motor: Option<u8>,
    /// The model of the motor that is driven: warns where the compensator was designed for another
    #[arg(long, value_name = "FILE", requires = "compensator")]
    model: Option<PathBuf>,
}

/// What a compensator's file changes.
#[derive(Default)]
pub struct Changes {
    /// Names and values of the settings; none where no file is given.
    pub settings: Vec<(String, String)>,
    /// Where the compensator is of another model than the one given.
    pub warning: Option<Finding>,
}

impl CompensatorArguments {
    /// What is to be set.
    ///
    /// # Errors
    /// When a file cannot be read, holds a prewarped lead, or a loop rate that is no whole number.
    pub fn changes(&self) -> miette::Result<Changes> {
        let Some(path) = &self.compensator else { return Ok(Changes::default()) };
        let design = CompensatorDesign::read(path)?;
        let model = self.model.as_deref().map(Model::read).transpose()?;
        let warning = model.and_then(|model| warn_of_another_model(&design, &model));
        if let FilterDesign::Lead(design) = &design.kind
            && let Some(prewarp_rad_s) = design.prewarp_rad_s()
        {
            return Err(prewarped(path, prewarp_rad_s));
        }
        Ok(Changes { settings: settings(&design, self.motor), warning })
    }
}

/// Names and values of the settings that make a controller run `design`, which is not prewarped: with the time constants of an inverse for
/// one motor, or for every one.
pub(super) fn settings(design: &CompensatorDesign, motor: Option<u8>) -> Vec<(String, String)> {
    let mut changes = vec![(Key::LoopRateHz, design.loop_rate_hz().to_string())];
    match &design.kind {
        FilterDesign::Lead(design) => {
            let lead = design.lead();
            changes.extend([
                (Key::Compensator, "lead".to_owned()),
                (Key::OmegaZRadS, lead.omega_z_rad_s.to_string()),
                (Key::OmegaFRadS, lead.omega_f_rad_s.to_string()),
                (Key::Damping, lead.damping.to_string()),
            ]);
            // A file without one, as the paper has it, leaves that of the ESCs as it is.
            changes.extend(design.slew_per_s().map(|slew_per_s| (Key::OutputSlewPerS, slew_per_s.to_string())));
        }
        FilterDesign::Inverse(inverse) => {
            let (reference, range) = (inverse.design().reference(), inverse.range());
            changes.extend([
                (Key::Compensator, "inverse".to_owned()),
                (Key::InverseNaturalRadS, reference.omega_f_rad_s.to_string()),
                (Key::InverseDamping, reference.damping.to_string()),
                (Key::OutputSlewPerS, range.slew_per_s.unwrap_or(0.0).to_string()),
                (Key::InverseCompensateFrom, range.compensated.0.to_string()),
                (Key::InverseCompensateTo, range.compensated.1.to_string()),
                (Key::TimeConstantS, curve_text(inverse.curve())),
            ]);
        }
    }
    let motor = motor.map_or_else(|| "*".to_owned(), |motor| motor.to_string());
    let name =
        |key: Key| if key.is_of_a_motor() { format!("motor.{motor}.{}", key.name()) } else { key.name().to_owned() };
    changes.into_iter().map(|(key, value)| (name(key), value)).collect()
}

fn prewarped(path: &Path, prewarp_rad_s: f64) -> miette::Report {
    miette::miette!(
        help = "design it again without --prewarp",
        "`{}` is prewarped at {prewarp_rad_s} rad/s, and a controller computes the plain transform",
        path.display()
    )
}
