//! The section's recurrence in numbers that are not rounded.

use libm::{cos, sin};
use num_complex::Complex64;

use super::LeadParameters;
use crate::biquad::{COEFFICIENT_BITS, Coefficients};

/// 1.0 in the coefficients' format.
pub(super) const FORMAT_ONE: f64 = (1_u64 << COEFFICIENT_BITS) as f64;
/// Unrounded coefficients of the section's recurrence; see [`crate::biquad`].
#[derive(Clone, Copy)]
pub(super) struct Recurrence {
    pub k: f64,
    pub c: f64,
    pub g0: f64,
    pub g1: f64,
}

impl Recurrence {
    /// The image of C(s) under `s -> a (1 - z^-1) / (1 + z^-1)`.
    ///
    /// With `q = omega_f / a`, `m = a / omega_z` and `D = 1 + 2 zeta q + q^2` the usual coefficients are
    /// `b0 = q^2 (1 + m) / D`, `b1 = 2 q^2 / D`, `b2 = q^2 (1 - m) / D`, `a1 = 2 (q^2 - 1) / D` and
    /// `a2 = (1 - 2 zeta q + q^2) / D`. The section's are differences of these, formed before any rounding.
    pub fn tustin(lead: &LeadParameters, a_rad_s: f64) -> Self {
        let q = lead.omega_f_rad_s / a_rad_s;
        let m = a_rad_s / lead.omega_z_rad_s;
        let d = 1.0 + 2.0 * lead.damping * q + q * q;
        Self {
            k: -4.0 * lead.damping * q / d,
            c: 4.0 * q * q / d,
            g0: q * q * (m - 3.0) / d,
            g1: q * q * (m - 1.0) / d,
        }
    }

    /// `H` at `theta` radians per tick.
    pub fn response(&self, theta: f64) -> Complex64 {
        let (difference, delay) = difference_and_delay(theta);
        self.numerator(difference, delay) / self.denominator(difference, delay)
    }

    fn numerator(&self, difference: Complex64, delay: Complex64) -> Complex64 {
        difference * (delay * self.g1 + self.g0) + self.c
    }

    fn denominator(&self, difference: Complex64, delay: Complex64) -> Complex64 {
        difference * (difference - delay * self.k) + delay * self.c
    }
}

/// `1 - z^-1` and `z^-1` at `theta` radians per tick. The first is formed as `2 sin^2(theta / 2) + j sin(theta)`, which
/// keeps its digits where `theta` is small.
fn difference_and_delay(theta: f64) -> (Complex64, Complex64) {
    let half = sin(theta / 2.0);
    (Complex64::new(2.0 * half * half, sin(theta)), Complex64::new(cos(theta), -sin(theta)))
}

impl From<&Coefficients> for Recurrence {
    fn from(coefficients: &Coefficients) -> Self {
        let value = |bits: i32| f64::from(bits) / FORMAT_ONE;
        Self {
            k: value(coefficients.k()),
            c: value(coefficients.c()),
            g0: value(coefficients.g0()),
            g1: value(coefficients.g1()),
        }
    }
}
