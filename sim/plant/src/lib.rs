//! Simulated actuators, and the files that describe one and its compensator.
//!
//! A simulated actuator is a chain in physical order. What acts on the command is a [`CommandStage`]; then comes
//! the rotor, [`FirstOrder`] or, with effects on it ([`RotorEffect`]), one that is integrated; then what lies between rotor and
//! logger ([`ResponseStage`]); what the sensor adds is [`SensorNoise`]. [`Actuator`] runs the chain, tick by tick;
//! [`simulate`] runs it over a record. The kinds of effects are in [`effect`], one file each.

mod actuator;
pub mod bench;
mod command_signal;
mod compensator;
mod delay;
pub mod effect;
mod error;
mod esc_frame;
mod filter;
mod first_order;
mod hold;
mod integrated;
mod judgement;
mod model;
mod model_check;
mod model_file;
mod noise;
mod operating;
mod passage;
mod pieces;
mod rotor;
mod simulate;
mod stage;

#[cfg(any(test, feature = "testing"))]
#[doc(hidden)]
pub mod testing;

pub use actuator::{Actuator, EscTiming, Law};
pub use command_signal::{CommandSignal, Interpolation};
pub use compensator::{
    CoefficientFormat, CommandNoiseGain, CompensatorDesign, CompensatorProvenance, FilterDesign, GainFormat,
    InverseCompensator, InverseFile, InverseKind, InverseRange, LeadFile, LeadKind, ReferenceFormat, SignalFormat,
    StoredCoefficients, StoredCompensator, StoredInverse,
};
pub use delay::TransportDelay;
pub use effect::{ActiveEffect, Catalog, LinearChain};
pub use error::PlantError;
pub use esc_frame::EscFrame;
pub use esc_frame::SAME_MOMENT_FRAMES;
pub use filter::{Interval, ResponseStage};
pub use first_order::FirstOrder;
pub use hold::frames_per_pattern;
pub use hold::{hold_delay_s, hold_response, hold_response_at_phase};
pub use judgement::{Judgement, Readiness};
pub use model::{
    Effect, Lag, Lagged, MapPolynomial, Model, ModelError, Point, Provenance, StaticMap, TimeConstantBand,
};
pub use noise::{Color, Noise, SensorNoise};
pub use operating::{OperatingCurve, OperatingPoint};
pub use rotor::{Motion, RotorBase, RotorEffect, Supply};
pub use simulate::{Start, Trace, simulate, simulate_periodic_response, simulate_response};
pub use simulate::{simulate_interpolated, simulate_periodic_interpolated};
pub use stage::{CommandStage, Memory, Segment};
