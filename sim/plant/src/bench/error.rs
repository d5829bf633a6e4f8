//! Why an experiment cannot be run.

use miette::Diagnostic;
use rotorlead_records::files::Fault;
use thiserror::Error;

use crate::error::PlantError;

/// Why an experiment cannot be run.
#[derive(Clone, Debug, PartialEq, Error, Diagnostic)]
pub enum BenchError {
    /// A value of the plan breaks a rule.
    #[error("the plan: {0}")]
    #[diagnostic(help("{}", .0.help))]
    Plan(Fault),
    /// The model cannot be simulated as the plan asks.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Plant(#[from] PlantError),
    /// The plan names a compensator, and none was given.
    #[error("the plan names the compensator `{file}`, but none was given")]
    #[diagnostic(help("read that file and give its design, or remove `compensator` from the plan"))]
    CompensatorMissing {
        /// The file that the plan names.
        file: String,
    },
    /// A compensator was given that the plan does not name.
    #[error("a compensator was given, but the plan names none")]
    #[diagnostic(help("add `compensator = \"compensator.toml\"` to the plan, so that its records say what they are"))]
    CompensatorNotNamed,
    /// The compensator runs at another rate than the loop.
    #[error("the compensator was designed for {designed_hz} Hz, and the plan's loop_rate_hz is {loop_rate_hz}")]
    #[diagnostic(help("design the compensator for the plan's loop rate, or change the plan's"))]
    LoopRate {
        /// Rate of the design, hertz.
        designed_hz: f64,
        /// Rate of the plan, hertz.
        loop_rate_hz: u32,
    },
    /// Sensor noise is in newtons, the response is not.
    #[error("the plan's noise is in newtons, but the model's response is in revolutions per minute")]
    #[diagnostic(help("set sigma_n and hum_n of [noise] to 0, or use a model of thrust"))]
    NoiseUnit,
}

impl From<Fault> for BenchError {
    fn from(fault: Fault) -> Self {
        Self::Plan(fault)
    }
}
