//! Simulated actuators, and the files that describe one and its compensator.

mod compensator_file;
mod model;
mod model_check;
mod model_file;

pub use compensator_file::{CoefficientFormat, CompensatorFile, SignalFormat, StoredCoefficients};
pub use model::{Effect, Lag, Model, ModelError, Point, Provenance, StaticMap};
