//! What rounding in the recurrence does to the steady output.

use libm::fabs;

use super::error::LONGEST_RESPONSE_TICKS;
use super::{FORMAT_A, FORMAT_G, InverseError, table_command};
use crate::inverse::{Coefficients, OUTPUT_BITS};
use crate::throttle::FRACTION_BITS;

/// Largest bound on the error of `u*` at rest, in steps of 2^-29: half a step of the output, less one for the rounding of
/// `u*` itself.
pub const LARGEST_ROUNDING_ERROR: f64 = (1_u32 << (FRACTION_BITS - OUTPUT_BITS - 1)) as f64 - 1.0;

/// The impulse responses are summed until the state is this small, relative to the impulse; what remains is bounded.
const RESPONSE_END: f64 = 1.0 / 4096.0;
/// Divides it.
const TICKS_PER_LOOK: u32 = 16;

/// The bound over the whole table, for `v` as for `u*`; the error when it is too large.
///
/// It is half the L1 gain from both rounding errors to `d + g x`, which is `u* - r` at the gain `g`, and `v - r` at 0. The
/// gain `sum |d[n] + g x[n]|` is a convex function of `g`, so it is largest at 0 or at the highest `g`.
pub(super) fn checked_error(coefficients: &Coefficients) -> Result<f64, InverseError> {
    let gains = coefficients.gains();
    let (mut slowest, mut highest) = (0, 0);
    for (index, &gain) in gains.iter().enumerate() {
        if gain > highest {
            (slowest, highest) = (index, gain);
        }
    }
    let error = rounding_error(coefficients, f64::from(highest) / FORMAT_G)?;
    if error > LARGEST_ROUNDING_ERROR {
        return Err(InverseError::RoundingTooLarge { command: table_command(slowest), max: LARGEST_ROUNDING_ERROR });
    }
    Ok(error)
}

/// Half the sum of the L1 gains from an error in step 1 and from one in step 5 to `d + g x`, at 0 or at this `g`, whichever is more; a
/// bound on it, 0.1 % above it at most. Infinite as soon as it exceeds [`LARGEST_ROUNDING_ERROR`].
///
/// A response that is cut off at a state `d`, `x` goes on as `d` times the second and `x + a d` times the first, so its remainder is
/// at most the larger of these, in magnitude, times the sum `S` of both. With `m` the sum of that over both responses, and `P` what
/// was summed of them, `S <= P / (1 - m)`.
///
/// A controller without an FPU spends most of the design here: both gains are summed along one response, whose end is looked for
/// once in [`TICKS_PER_LOOK`].
fn rounding_error(coefficients: &Coefficients, g: f64) -> Result<f64, InverseError> {
    let (a, b) = (f64::from(coefficients.a()) / FORMAT_A, f64::from(coefficients.b()) / FORMAT_A);
    let (mut of_v, mut of_output, mut cut_off) = (0.0, 0.0, 0.0);
    let larger = |one: f64, other: f64| if one > other { one } else { other };
    // `d = v - r` and `x` after step 1: of the tick of an error in step 1, and of the tick after one in step 5.
    for (mut d, mut x) in [(0.0, 1.0), (1.0, -a)] {
        let mut ticks = 0;
        while d * d + x * x > RESPONSE_END * RESPONSE_END {
            if 0.5 * larger(of_v, of_output) > LARGEST_ROUNDING_ERROR {
                return Ok(f64::INFINITY);
            }
            if ticks == LONGEST_RESPONSE_TICKS {
                return Err(InverseError::ResponseTooLong);
            }
            ticks += TICKS_PER_LOOK;
            for _ in 0..TICKS_PER_LOOK {
                of_v += fabs(d);
                of_output += fabs(d + g * x);
                d += a * x;
                x -= a * d + b * x;
            }
        }
        cut_off += larger(fabs(d), fabs(x + a * d));
    }
    Ok(0.5 * larger(of_v, of_output) / (1.0 - cut_off))
}
