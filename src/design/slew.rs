//! The slew limit of an ESC at a loop rate.

use libm::floor;

use super::DesignError;
use super::error::within;
use crate::inverse::{OUTPUT_BITS, SlewLimit};

/// Range of slew limits in units of the command per second; 0 is no limit.
pub const SLEW_RANGE_PER_S: (f64, f64) = (0.0, 1e6);
/// Slew limit of a controller unless something else is asked for, 2 % per millisecond. The slowest of the ESCs whose slew is
/// known: declared too slow, it costs speed, too fast, it may break an ESC's lock.
pub const DEFAULT_SLEW_PER_S: f64 = 20.0;

/// A slew limit in units of the command per second, 0 for none, at `loop_rate_hz` ticks per second. It is rounded down to whole steps
/// of 2^-16 per tick.
///
/// # Errors
/// When it is not finite, negative, or positive and less than a step per tick.
pub fn slew_limit(slew_per_s: f64, loop_rate_hz: f64) -> Result<SlewLimit, DesignError> {
    let slew_per_s = within("slew_per_s", slew_per_s, SLEW_RANGE_PER_S)?;
    if slew_per_s == 0.0 {
        return Ok(SlewLimit::NONE);
    }
    let steps = floor(slew_per_s / loop_rate_hz * f64::from(1_u32 << OUTPUT_BITS)) as u32;
    let min_per_s = loop_rate_hz / f64::from(1_u32 << OUTPUT_BITS);
    SlewLimit::from_steps(steps).ok_or(DesignError::SlewTooSlow { slew_per_s, min_per_s })
}
