//! From identified motors to the compensator: C(s), its discrete image, and the checks that a design must pass. Also from
//! a rotor's curve of time constants to the conditioned inverse ([`InverseDesign`]).
//!
//! Equation numbers are those of the paper. Everything here is `f64` with `libm`, in a fixed order of operations, so
//! that a controller that computes its coefficients at start-up gets those of the host, bit for bit.

mod check;
mod error;
mod inverse;
mod lead;
mod recurrence;
mod slew;
mod speed;
mod tustin;

pub use check::DesignCheck;
pub use error::DesignError;
pub use inverse::{
    CurvePoint, InverseDesign, InverseError, LARGEST_ROUNDING_ERROR, ReferenceModel, RotorCurve, TIME_CONSTANT_RANGE_S,
};
pub use lead::LeadParameters;
pub use slew::{DEFAULT_SLEW_PER_S, SLEW_RANGE_PER_S, slew_limit};
pub use speed::{ERPM_RANGE, SHORTEST_SPEED_RANGE, SpeedCurve};
pub use tustin::LeadDesign;

use core::f64::consts::FRAC_1_SQRT_2;

use crate::throttle::Throttle;

/// Rate of the control loop unless something else is asked for: the paper's 5 kHz.
pub const DEFAULT_LOOP_RATE_HZ: f64 = 5000.0;
/// Damping of the compensator's poles without overshoot of the command, eq. (4).
pub const DEFAULT_DAMPING: f64 = FRAC_1_SQRT_2;
/// Range of damping ratios. Under 0.3 the compensator rings; over 2 its slower pole is below 0.27 omega_f, and most of
/// what the lead gains is lost again.
pub const DAMPING_RANGE: (f64, f64) = (0.3, 2.0);
/// Range of frequencies in rad/s: far wider than that of motors, and of what the other limits leave.
pub const FREQUENCY_RANGE_RAD_S: (f64, f64) = (1e-3, 1e6);
/// Range of loop rates in hertz: from a slow servo output to the fastest ESC protocol.
pub const LOOP_RATE_RANGE_HZ: (f64, f64) = (50.0, 100_000.0);
/// `omega_f` (or a prewarp frequency) is too close to Nyquist above this many rad/s per hertz of the loop rate, which
/// is 13 % of Nyquist. Up to it `4 c <= 3 |k|` holds at every damping, which the exactness of the steady output needs
/// (see [`crate::biquad`]).
pub const FASTEST_POLE_RAD: f64 = 0.4;
/// Smallest coefficient in steps of 2^-32: rounding one this size moves it by up to 1.2e-4 of itself, 0.001 dB.
pub const SMALLEST_COEFFICIENT: f64 = 4096.0;
/// Largest L1 gain: 2 * [`Throttle::HEADROOM`] - 1, for which commands in [0, 1] reach both ends of the headroom, less a
/// margin of 1/128 for the rounding errors of the section.
pub const LARGEST_L1_GAIN: f64 = 2.0 * Throttle::HEADROOM - 1.0 - 1.0 / 128.0;
/// Largest deviation that rounding the coefficients may cause, in decibels.
pub const LARGEST_DEVIATION_DB: f64 = 0.01;
/// Attenuation that defines a bandwidth, in decibels: exactly 3, as the paper has it, and not half the power.
pub const BANDWIDTH_DROP_DB: f64 = 3.0;
