//! What a compensator is worth in a vehicle, simulated.
//!
//! A roll axis with a rate and an attitude loop, and a fully actuated hexarotor, each with the same motors behind different
//! actuators: bare, with the paper's compensator, with the conditioned inverse, and with a loop of the rotor's measured speed. The
//! compensators are the controller's own code, [`rotorlead::compensator::Compensator`] and
//! [`rotorlead::inverse::ConditionedInverse`], at their 5 kHz. For each actuator the controller is tuned by one rule to the same
//! margins ([`TuningRule`]), at one operating point and for a range of them.
//!
//! [`study`] does all of it. `docs/vehicle.md` has the equations, the assumptions and the results.

mod airframe;
mod benefit;
mod error;
mod filters;
mod lateral;
mod motor_control;
mod open_loop;
mod recommendation;
mod response;
mod roll;
mod rotor;
mod study;
mod tuning;
mod verdict;

pub use airframe::{Actuators, Airframe, Controller, Hover, Lateral, Roll};
pub use benefit::{Benefit, Ratios};
pub use error::VehicleError;
pub use lateral::ForcePerformance;
pub use motor_control::MotorControlKind;
pub use open_loop::{LoopCurve, LoopMargin};
pub use recommendation::{Asked, Candidate, Choice, Purpose, Recommendation, design_options, recommend};
pub use response::Margins;
pub use study::{AtLatency, ForceRow, KeptGains, Performance, Refused, Row, Study, steps, study};
pub use tuning::{Gains, TuningRule};
pub use verdict::{findings, headline};

use rotorlead::design::DEFAULT_LOOP_RATE_HZ;

/// Rate of the compensators and of the simulation, hertz.
pub(crate) const TICK_HZ: f64 = DEFAULT_LOOP_RATE_HZ;

/// A latency in ticks, to the nearest.
pub(crate) fn latency_ticks(latency_s: f64) -> usize {
    (latency_s * TICK_HZ).round() as usize
}
