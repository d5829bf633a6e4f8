//! A compensator's file as settings of a controller.

use std::path::PathBuf;

use clap::Args;
use rotorlead_device::compensator_settings;
use rotorlead_plant::{CompensatorDesign, Model};
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
        let settings = compensator_settings(&design, &path.display().to_string(), self.motor)?;
        Ok(Changes { settings, warning })
    }
}
