//! What a simulated actuator refuses, and what to do about it.

use miette::Diagnostic;
use rotorlead_records::files::Fault;
use thiserror::Error;

use super::ModelError;

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
    /// What was asked for is computed of the lag alone, and the model has an effect beside it.
    #[error("the model has the effect `{kind}`, and this is computed of its lag alone")]
    #[diagnostic(help("simulate the model, or remove its [[effect]]"))]
    EffectLeftOut {
        /// The kind that the model names.
        kind: String,
    },
    /// An effect has another number of values than its kind has parameters.
    #[error("`{kind}` has {needed} parameters, and {given} values are given")]
    #[diagnostic(help("give one value per parameter, optional ones too"))]
    EffectValues {
        /// The kind.
        kind: &'static str,
        /// How many values there are.
        given: usize,
        /// How many there have to be.
        needed: usize,
    },
    /// More effects act on the rotor than can be integrated together.
    #[error("{count} effects act on the rotor; {most} can be simulated together")]
    #[diagnostic(help("remove effects of the same kind from the model"))]
    RotorEffects {
        /// How many there are.
        count: usize,
        /// How many there may be.
        most: usize,
    },
    /// A value of the noise breaks a rule.
    #[error("the noise: {0}")]
    #[diagnostic(help("{}", .0.help))]
    Noise(Fault),
    /// A setting of a stage is outside what it can be.
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
    /// More work than a simulation is meant for.
    #[error("{work} takes {ticks:.0} ticks of the loop, and {most:.0} are simulated at most")]
    #[diagnostic(help("lower the loop's rate, or correct a time constant that is too long for a motor's"))]
    Work {
        /// What would be simulated.
        work: &'static str,
        /// Ticks that it takes.
        ticks: f64,
        /// Ticks that are simulated at most.
        most: f64,
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
