//! From settings to what the motors' compensators run.

use core::fmt;

use crate::compensator::{CommandRange, Filter};
use crate::design::{DesignError, InverseDesign, InverseError, LeadDesign};
use crate::settings::{CompensatorKind, MOTORS, MotorSettings, Settings, Validated};
use crate::throttle::Command;

/// Why there is no filter for these settings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FilterError {
    /// The lead is refused.
    Lead(DesignError),
    /// A motor's inverse is refused.
    Inverse {
        /// The motor, from 0.
        motor: usize,
        /// Why.
        error: InverseError,
    },
}

impl fmt::Display for FilterError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Lead(error) => error.fmt(f),
            Self::Inverse { motor, error } => {
                write!(f, "no inverse can be made of inverse.* and motor.{motor}.time_constant_s: {error}")
            }
        }
    }
}

impl core::error::Error for FilterError {}

/// The filter of each motor, in their order: the lead of [`Settings::lead`] for all, or the inverse of [`Settings::inverse`] along
/// each motor's own [`MotorSettings::curve`]; both with the slew limit of [`Settings::slew_per_s`]. Some hundred milliseconds of double precision in software on the controller, and
/// the same bits as on a host.
///
/// # Errors
/// [`FilterError`]: when the design of one is refused.
pub fn filters(settings: &Validated) -> Result<[Filter; MOTORS], FilterError> {
    match settings.compensator {
        CompensatorKind::Lead => {
            let design = LeadDesign::new(settings.lead.into(), f64::from(settings.loop_rate_hz), None)
                .and_then(|design| design.with_slew(settings.slew_per_s))
                .map_err(FilterError::Lead)?;
            Ok([design.filter().into(); MOTORS])
        }
        CompensatorKind::Inverse | CompensatorKind::Rpm => {
            let [a, b, c, d] = &settings.motors;
            Ok([inverse(settings, 0, a)?, inverse(settings, 1, b)?, inverse(settings, 2, c)?, inverse(settings, 3, d)?])
        }
    }
}

// Four times in line it would take four times the flash.
#[inline(never)]
fn inverse(settings: &Settings, motor: usize, of_motor: &MotorSettings) -> Result<Filter, FilterError> {
    let parameters = &settings.inverse;
    let range = CommandRange {
        lowest: Command::saturating_from_bits(parameters.compensate_from),
        highest: Command::saturating_from_bits(parameters.compensate_to),
    };
    let curve = of_motor.curve.as_ref().ok_or(InverseError::NoPoints);
    curve
        .and_then(|curve| InverseDesign::from_curve(parameters.reference(), f64::from(settings.loop_rate_hz), curve))
        .and_then(|design| design.filter(settings.slew_per_s, range))
        .map(Filter::Inverse)
        .map_err(|error| FilterError::Inverse { motor, error })
}
