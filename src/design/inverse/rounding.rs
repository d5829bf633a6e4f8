//! What rounding in the recurrence does to the steady output.

use libm::fabs;

use super::{FORMAT_A, FORMAT_G, InverseError, table_command};
use crate::inverse::{Coefficients, OUTPUT_BITS};
use crate::throttle::FRACTION_BITS;

/// Largest bound on the error of `u*` at rest, in steps of 2^-29: half a step of the output, less one for the rounding of
/// `u*` itself.
pub const LARGEST_ROUNDING_ERROR: f64 = (1_u32 << (FRACTION_BITS - OUTPUT_BITS - 1)) as f64 - 1.0;

/// The impulse responses are summed until the state is this small, relative to the impulse.
const RESPONSE_END: f64 = 1e-9;

/// The bound over the whole table; the error when it is too large.
///
/// It is half the L1 gain from both rounding errors to `u*`. For a gain `g` that is `sum |d[n] + g x[n]|`, a convex
/// function of `g`, so over the table it is largest at the lowest or highest `g`.
pub(super) fn checked_error(coefficients: &Coefficients) -> Result<f64, InverseError> {
    let gains = coefficients.gains();
    let mut worst = 0.0;
    let ends = [gains.iter().enumerate().min_by_key(|(_, g)| **g), gains.iter().enumerate().max_by_key(|(_, g)| **g)];
    for (index, &gain) in ends.into_iter().flatten() {
        let error = rounding_error(coefficients, f64::from(gain) / FORMAT_G);
        if error > LARGEST_ROUNDING_ERROR {
            return Err(InverseError::RoundingTooLarge { command: table_command(index), max: LARGEST_ROUNDING_ERROR });
        }
        if error > worst {
            worst = error;
        }
    }
    Ok(worst)
}

/// Half the sum of the L1 gains from an error in step 1 and from one in step 5 to `u*`, at the gain `g`. Cut short when it
/// exceeds [`LARGEST_ROUNDING_ERROR`].
fn rounding_error(coefficients: &Coefficients, g: f64) -> f64 {
    let (a, b) = (f64::from(coefficients.a()) / FORMAT_A, f64::from(coefficients.b()) / FORMAT_A);
    let mut error = 0.0;
    // `d = v - r` and `x` after step 1: of the tick of an error in step 1, and of the tick after one in step 5.
    for (mut d, mut x) in [(0.0, 1.0), (1.0, -a)] {
        while d * d + x * x > RESPONSE_END * RESPONSE_END && error <= LARGEST_ROUNDING_ERROR {
            error += 0.5 * fabs(d + g * x);
            d += a * x;
            x -= a * d + b * x;
        }
    }
    error
}
