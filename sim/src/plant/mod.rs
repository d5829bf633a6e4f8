//! Simulated actuators, and the files that describe one and its compensator.
//!
//! A simulated actuator is a chain in physical order. What acts on the command is a [`CommandStage`]; then comes
//! the rotor, [`FirstOrder`]; what the sensor adds is [`SensorNoise`]. [`Actuator`] runs the chain.

mod actuator;
mod compensator_file;
mod delay;
mod error;
mod esc_frame;
mod first_order;
mod hold;
mod model;
mod model_check;
mod model_file;
mod noise;
mod operating;
mod stage;

#[cfg(test)]
pub(crate) mod testing;

pub use actuator::{Actuator, EscTiming, Law};
pub use compensator_file::{CoefficientFormat, CompensatorFile, SignalFormat, StoredCoefficients};
pub use delay::TransportDelay;
pub use error::PlantError;
pub use esc_frame::EscFrame;
pub(crate) use esc_frame::SAME_MOMENT_FRAMES;
pub use first_order::FirstOrder;
pub(crate) use hold::frames_per_pattern;
pub use hold::{hold_response, hold_response_at_phase};
pub use model::{Effect, Lag, MapPolynomial, Model, ModelError, Point, Provenance, StaticMap};
pub use noise::{Color, Noise, SensorNoise};
pub use operating::{OperatingCurve, OperatingPoint};
pub use stage::{CommandStage, Segment};
