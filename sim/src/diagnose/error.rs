//! Why nothing can be compared.

use miette::Diagnostic;
use thiserror::Error;

use crate::identify::IdentifyError;
use crate::plant::{ModelError, PlantError};
use crate::record::RecordError;

/// Data or a model from which no diagnosis follows.
#[derive(Clone, Debug, PartialEq, Error, Diagnostic)]
pub enum DiagnoseError {
    /// No record that repeats.
    #[error("{experiment}: no record of `excitation` multisine or square")]
    #[diagnostic(help(
        "record one (`rotorlead excite` designs a multisine), or correct `excitation` in experiment.toml"
    ))]
    NothingPeriodic {
        /// The experiment's name.
        experiment: String,
    },
    /// Nothing may be fitted.
    #[error("{experiment}: every record has role = \"validate\", so nothing may be fitted")]
    #[diagnostic(help("give at least one record per nominal command role = \"fit\" in experiment.toml"))]
    NothingToFit {
        /// The experiment's name.
        experiment: String,
    },
    /// A nominal command has no record that may be fitted.
    #[error("nominal command {nominal}: every record has role = \"validate\"")]
    #[diagnostic(help("give one of its records role = \"fit\" in experiment.toml, or take them out"))]
    NominalWithoutFit {
        /// The nominal command.
        nominal: f64,
    },
    /// The record has not got the response column.
    #[error("{file}: the response column is missing")]
    #[diagnostic(help("record this column, or change `output` in experiment.toml"))]
    NoResponse {
        /// The record.
        file: String,
    },
    /// A compensated record that does not say what the ESC was told.
    #[error("{file}: a compensated record without an esc_command column")]
    #[diagnostic(help("record the command behind the compensator as esc_command: it is what the actuator follows"))]
    NoEscCommand {
        /// The record.
        file: String,
    },
    /// The command does not move.
    #[error("{file}: the command is constant")]
    #[diagnostic(help("nothing can be compared: excite the actuator, for instance with a multisine"))]
    ConstantCommand {
        /// The record.
        file: String,
    },
    /// The response does not move.
    #[error("{file}: the response is constant")]
    #[diagnostic(help("check the sensor's connection, and that the motor was running"))]
    ConstantResponse {
        /// The record.
        file: String,
    },
    /// A record is not what it says.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Record(#[from] RecordError),
    /// The first model cannot be identified.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Identify(#[from] IdentifyError),
    /// The given model says nothing of a nominal command.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Model(#[from] ModelError),
    /// The given model cannot be simulated.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Plant(#[from] PlantError),
    /// The search found no value at which the model can be simulated.
    #[error("the model of {what} cannot be compared with these records")]
    #[diagnostic(help("check the records' units and their nominal commands against the model's"))]
    NoFit {
        /// Which model.
        what: &'static str,
    },
}
