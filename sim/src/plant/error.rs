//! What a simulated actuator refuses, and what to do about it.

use miette::Diagnostic;
use thiserror::Error;

use super::ModelError;
use crate::files::Fault;

/// Why no actuator can be simulated from a model or its settings.
#[derive(Clone, Debug, PartialEq, Error, Diagnostic)]
pub enum PlantError {
    /// A value of the model breaks a rule.
    #[error("the model: {0}")]
    #[diagnostic(help("{}", .0.help))]
    Model(Fault),
    /// The model says nothing about the nominal command that was asked for.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Range(#[from] ModelError),
    /// The model names an effect that cannot be simulated.
    #[error("the model has an effect of kind \"{kind}\", which this version does not simulate")]
    #[diagnostic(help("remove the [[effect]] from the model file to simulate the lag without it"))]
    UnknownEffect {
        /// The kind that the model names.
        kind: String,
    },
    /// A setting of a stage or of the noise is outside what it can be.
    #[error("{parameter} = {value} must be {limit}")]
    #[diagnostic(help("change {parameter}"))]
    Setting {
        /// The setting's name.
        parameter: &'static str,
        /// What it was given.
        value: f64,
        /// What it may be.
        limit: &'static str,
    },
    /// A setting is missing that another one makes necessary.
    #[error("{parameter} is missing: {reason}")]
    #[diagnostic(help("add {parameter}"))]
    MissingSetting {
        /// The setting's name.
        parameter: &'static str,
        /// What makes it necessary.
        reason: &'static str,
    },
}

/// `value`, unless `holds` is false for it.
pub(super) fn checked(
    parameter: &'static str,
    value: f64,
    limit: &'static str,
    holds: bool,
) -> Result<f64, PlantError> {
    if holds { Ok(value) } else { Err(PlantError::Setting { parameter, value, limit }) }
}
