//! From a rotor's curve of time constants to the conditioned inverse.

mod curve;
mod error;
mod reference;
mod rounding;
#[cfg(test)]
mod tests;

pub use curve::{CurvePoint, RotorCurve, TIME_CONSTANT_RANGE_S};
pub use error::InverseError;
pub use reference::ReferenceModel;
pub use rounding::LARGEST_ROUNDING_ERROR;

use libm::{expm1, rint};

use super::LOOP_RATE_RANGE_HZ;
use super::error::within;
use crate::compensator::{CommandRange, InverseFilter};
use crate::inverse::{COEFFICIENT_BITS, Coefficients, GAIN_BITS, Limits, SlewLimit, TABLE_POINTS};
use crate::throttle::Command;
use reference::Discrete;

/// A checked design: the coefficients of a [`ConditionedInverse`](crate::inverse::ConditionedInverse) for a reference
/// model, a loop rate and a rotor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InverseDesign {
    reference: ReferenceModel,
    loop_rate_hz: f64,
    coefficients: Coefficients,
    rounding_error: f64,
}

impl InverseDesign {
    /// Designs the inverse of the rotor with the curve through `points` ([`RotorCurve::through`]) along `reference`, at
    /// `loop_rate_hz`, 50 to 100000.
    ///
    /// # Errors
    /// See [`InverseError`]. Nothing saturates in silence.
    pub fn new(reference: ReferenceModel, loop_rate_hz: f64, points: &[CurvePoint]) -> Result<Self, InverseError> {
        Self::from_curve(reference, loop_rate_hz, &RotorCurve::through(points)?)
    }

    /// The same for a curve as a controller stores it. The equations are those of [`crate::inverse`].
    ///
    /// # Errors
    /// See [`InverseError`].
    pub fn from_curve(reference: ReferenceModel, loop_rate_hz: f64, curve: &RotorCurve) -> Result<Self, InverseError> {
        within("loop_rate_hz", loop_rate_hz, LOOP_RATE_RANGE_HZ)?;
        let Discrete { a, b } = reference.discrete(loop_rate_hz)?;
        let poles_rad_s = curve.poles_rad_s()?;
        let gains = poles_rad_s.map(|pole| rint(a / -expm1(-pole / loop_rate_hz) * FORMAT_G) as i64);
        let coefficients = Coefficients::new(rint(a * FORMAT_A) as i32, rint(b * FORMAT_A) as i32, gains)
            .map_err(|error| InverseError::from_table_error(error, &poles_rad_s))?;
        let rounding_error = rounding::checked_error(&coefficients)?;
        Ok(Self { reference, loop_rate_hz, coefficients, rounding_error })
    }

    /// A slew limit in units of the command per second, 0 for none, as of [`slew_limit`](super::slew_limit).
    ///
    /// # Errors
    /// When it is not finite, negative, or positive and less than a step of 2^-16 per tick.
    pub fn slew_limit(&self, slew_per_s: f64) -> Result<SlewLimit, InverseError> {
        Ok(super::slew_limit(slew_per_s, self.loop_rate_hz)?)
    }

    /// What the output can do: its range [`min`, `max`] and its slew, as of [`Self::slew_limit`]. The ends are rounded inward to
    /// the output's step of 2^-16.
    ///
    /// # Errors
    /// When `min` is above `max`, or the slew is refused.
    pub fn limits(&self, min: Command, max: Command, slew_per_s: f64) -> Result<Limits, InverseError> {
        let slew = self.slew_limit(slew_per_s)?;
        if min > max {
            return Err(InverseError::LimitsCrossed { min, max });
        }
        Ok(Limits::new(min, max, slew))
    }

    /// The filter of a [`Compensator`](crate::compensator::Compensator) with a slew as of [`Self::slew_limit`], which is bypassed
    /// for commands outside `range`.
    ///
    /// # Errors
    /// When the slew is refused.
    pub fn filter(&self, slew_per_s: f64, range: CommandRange) -> Result<InverseFilter, InverseError> {
        Ok(InverseFilter { coefficients: self.coefficients, slew: self.slew_limit(slew_per_s)?, range })
    }

    /// The reference model.
    #[must_use]
    pub const fn reference(&self) -> &ReferenceModel {
        &self.reference
    }

    /// Ticks per second.
    #[must_use]
    pub const fn loop_rate_hz(&self) -> f64 {
        self.loop_rate_hz
    }

    /// The coefficients of the recurrence.
    #[must_use]
    pub const fn coefficients(&self) -> &Coefficients {
        &self.coefficients
    }

    /// Bound on the error of `v` and `u*` at rest by rounding, in steps of 2^-29; at
    /// most [`LARGEST_ROUNDING_ERROR`].
    #[must_use]
    pub const fn rounding_error(&self) -> f64 {
        self.rounding_error
    }
}

/// 1.0 in the format of `A`, `B` and `h`.
const FORMAT_A: f64 = (1_u64 << COEFFICIENT_BITS) as f64;
/// 1.0 in the format of `g`.
const FORMAT_G: f64 = (1_u64 << GAIN_BITS) as f64;

/// The command of a point of the table.
const fn table_command(index: usize) -> f64 {
    index as f64 / (TABLE_POINTS - 1) as f64
}
