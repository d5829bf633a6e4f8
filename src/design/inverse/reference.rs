//! Second-order reference model of the inverse, and its discretization.

use libm::{exp, expm1, sin, sinh, sqrt};

use super::super::error::within;
use super::super::{DAMPING_RANGE, DesignError, FASTEST_POLE_RAD, FREQUENCY_RANGE_RAD_S};

/// The response that the rotor is to have at every operating point:
/// `omega_f^2 / (s^2 + 2 damping omega_f s + omega_f^2)`, that of the compensated fastest rotor of the paper.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReferenceModel {
    /// Natural frequency, rad/s; at most 0.4 per tick. With a damping of 1/sqrt(2) also the bandwidth.
    pub omega_f_rad_s: f64,
    /// Damping ratio, 0.3 to 2.
    pub damping: f64,
}

/// The reference model at a loop rate: `A` and `B` of [`crate::inverse`].
pub(super) struct Discrete {
    pub a: f64,
    pub b: f64,
}

impl ReferenceModel {
    /// The recurrence `x' = x + A (r - v) - B x`, `v' = v + A x'`, which has the poles of the continuous model,
    /// `exp(s T)`.
    ///
    /// Its characteristic polynomial is `z^2 - (2 - B - A^2) z + 1 - B`, so `1 - B` is the product of the poles and `A^2`
    /// that of their distances from 1: `A^2 = (1 - E)^2 + 4 E sin^2(omega_d T / 2)`, a form without cancellation.
    pub(super) fn discrete(&self, loop_rate_hz: f64) -> Result<Discrete, DesignError> {
        let omega_f_rad_s = within("omega_f_rad_s", self.omega_f_rad_s, FREQUENCY_RANGE_RAD_S)?;
        let damping = within("damping", self.damping, DAMPING_RANGE)?;
        let max_rad_s = FASTEST_POLE_RAD * loop_rate_hz;
        if omega_f_rad_s > max_rad_s {
            return Err(DesignError::TooCloseToNyquist {
                parameter: "omega_f_rad_s",
                value_rad_s: omega_f_rad_s,
                max_rad_s,
            });
        }
        let angle = omega_f_rad_s / loop_rate_hz;
        let decay = damping * angle;
        let distance = -expm1(-decay);
        // For real poles omega_d is imaginary, and the sine a hyperbolic one.
        let squared_sine = if damping <= 1.0 {
            let sine = sin(angle * sqrt(1.0 - damping * damping) / 2.0);
            sine * sine
        } else {
            let sine = sinh(angle * sqrt(damping * damping - 1.0) / 2.0);
            -sine * sine
        };
        let a = sqrt(distance * distance + 4.0 * exp(-decay) * squared_sine);
        Ok(Discrete { a, b: -expm1(-2.0 * decay) })
    }
}
