//! What rounding the coefficients does to a design, and whether the section's headroom holds it.

use core::f64::consts::PI;

use libm::{fabs, log10, pow, sqrt};

use super::recurrence::Recurrence;
use super::{DesignError, LARGEST_DEVIATION_DB, LARGEST_L1_GAIN, LeadParameters};
use crate::biquad::Coefficients;

/// Ticks after which the impulse response of a design must have died out; every accepted pole is faster.
const LONGEST_RESPONSE_TICKS: u32 = 1 << 18;
/// The impulse response is summed until it is this small, relative to the pole's distance from 1: about the sum of what
/// remains.
const RESPONSE_END: f64 = 1e-9;
/// Frequencies at which the response is checked after rounding, evenly spaced in the logarithm.
const CHECKED_FREQUENCIES: u32 = 128;

/// What is found when the response is computed again from the rounded coefficients.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DesignCheck {
    /// Largest `20 log10(1 + |H_rounded / H - 1|)` in decibels, at 128 frequencies from a thousandth of the zero up to
    /// about nine tenths of Nyquist (at Nyquist `H` is 0).
    pub worst_deviation_db: f64,
    /// Where it is, rad/s.
    pub worst_deviation_rad_s: f64,
    /// Distances of the two poles of the rounded section from the origin; under 1.
    pub pole_radii: [f64; 2],
    /// Sum of the magnitudes of the impulse response, to 1e-9: for inputs in [0, 1] the output stays within
    /// (1 +- l1_gain) / 2.
    pub l1_gain: f64,
    /// Largest output for a step from 0 to 1.
    pub step_peak: f64,
}

/// Computes the response again from the rounded coefficients, and refuses what does not hold.
pub(super) fn check(
    ideal: &Recurrence,
    coefficients: &Coefficients,
    lead: &LeadParameters,
    loop_rate_hz: f64,
) -> Result<DesignCheck, DesignError> {
    let actual = Recurrence::from(coefficients);
    let pole_radii = pole_radii(&actual);
    let (l1_gain, step_peak) = gains(&actual, pole_radii);
    if l1_gain.is_nan() || l1_gain > LARGEST_L1_GAIN {
        return Err(DesignError::L1GainTooHigh { l1_gain, max: LARGEST_L1_GAIN });
    }

    let (mut worst, mut worst_rad_s) = (0.0, 0.0);
    let lowest = lead.omega_z_rad_s / 1000.0;
    let ratio = PI * loop_rate_hz / lowest;
    for i in 0..CHECKED_FREQUENCIES {
        // The last frequency is a step of the grid below Nyquist, where the response is 0.
        let omega_rad_s = lowest * pow(ratio, f64::from(i) / f64::from(CHECKED_FREQUENCIES));
        let theta = omega_rad_s / loop_rate_hz;
        let deviation = (actual.response(theta) / ideal.response(theta) - 1.0).norm_sqr();
        if deviation > worst {
            (worst, worst_rad_s) = (deviation, omega_rad_s);
        }
    }
    let deviation_db = 20.0 * log10(1.0 + sqrt(worst));
    if deviation_db > LARGEST_DEVIATION_DB {
        return Err(DesignError::DeviationTooLarge { deviation_db, max_db: LARGEST_DEVIATION_DB });
    }
    Ok(DesignCheck {
        worst_deviation_db: deviation_db,
        worst_deviation_rad_s: worst_rad_s,
        pole_radii,
        l1_gain,
        step_peak,
    })
}

/// Magnitudes of the roots of `z^2 - (2 + k - c) z + 1 + k`, larger first. The discriminant is formed from the small
/// numbers themselves: `(1 + (k - c)/2)^2 - (1 + k) = (k - c)^2 / 4 - c`.
fn pole_radii(section: &Recurrence) -> [f64; 2] {
    let half_shift = (section.k - section.c) / 2.0;
    let discriminant = half_shift * half_shift - section.c;
    if discriminant < 0.0 {
        [sqrt(1.0 + section.k); 2]
    } else {
        let root = sqrt(discriminant);
        [fabs(1.0 + half_shift + root), fabs(1.0 + half_shift - root)]
    }
}

/// L1 gain and largest value of the step response, by summing the impulse response until it has died out. Infinite
/// when it has not after [`LONGEST_RESPONSE_TICKS`].
fn gains(section: &Recurrence, pole_radii: [f64; 2]) -> (f64, f64) {
    let end = RESPONSE_END * (1.0 - pole_radii[0]);
    // A step of the output of size sqrt(c) weighs as much as a deviation of 1 (see the energy in `docs/fixed-point.md`).
    let weight = 1.0 / sqrt(section.c);
    let (mut y, mut u) = (0.0, 0.0);
    let (mut l1_gain, mut step, mut step_peak) = (0.0, 0.0, 0.0);
    for tick in 0..LONGEST_RESPONSE_TICKS {
        // The impulse is at tick 0: its step in at that tick and out at the next, each met by g0 and a tick later by g1.
        let input = match tick {
            0 => section.c + section.g0,
            1 => section.g1 - section.g0,
            2 => -section.g1,
            _ => 0.0,
        };
        u += section.k * u - section.c * y + input;
        y += u;
        l1_gain += fabs(y);
        step += y;
        if step > step_peak {
            step_peak = step;
        }
        if tick > 2 && fabs(y) + weight * fabs(u) < end {
            return (l1_gain, step_peak);
        }
    }
    (f64::INFINITY, f64::INFINITY)
}
