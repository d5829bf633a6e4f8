//! The rotor's time constant over the command.

use super::super::FREQUENCY_RANGE_RAD_S;
use super::super::error::within;
use super::{InverseError, table_command};
use crate::inverse::TABLE_POINTS;

/// Range of time constants: that of the poles, `1 / tau`.
const TIME_CONSTANT_RANGE_S: (f64, f64) = (1.0 / FREQUENCY_RANGE_RAD_S.1, 1.0 / FREQUENCY_RANGE_RAD_S.0);

/// A rotor's time constant at an operating point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CurvePoint {
    /// The command at which the rotor rests, 0 to 1.
    pub command: f64,
    /// Its time constant there, seconds, 1e-6 to 1000.
    pub tau_s: f64,
}

impl CurvePoint {
    fn pole_rad_s(&self) -> f64 {
        1.0 / self.tau_s
    }
}

/// `1 / tau` at the commands of the table, rad/s.
///
/// The pole of a rotor is nearly linear in its speed, and so in the command. `tau` and `g` are not, and between points far
/// apart their chord lies above the curve: a time constant that is too long makes the rotor overshoot.
pub(super) fn expanded(curve: &[CurvePoint]) -> Result<[f64; TABLE_POINTS], InverseError> {
    if curve.len() > TABLE_POINTS {
        return Err(InverseError::TooManyPoints { count: curve.len() });
    }
    for (index, point) in curve.iter().enumerate() {
        within("command", point.command, (0.0, 1.0)).map_err(|error| InverseError::Point { index, error })?;
        within("tau_s", point.tau_s, TIME_CONSTANT_RANGE_S).map_err(|error| InverseError::Point { index, error })?;
    }
    for (index, (point, next)) in curve.iter().zip(curve.iter().skip(1)).enumerate() {
        if point.command >= next.command {
            let (command, previous) = (next.command, point.command);
            return Err(InverseError::NotIncreasing { index: index + 1, command, previous });
        }
    }
    let mut poles_rad_s = [0.0; TABLE_POINTS];
    for (index, pole) in poles_rad_s.iter_mut().enumerate() {
        *pole = pole_at(curve, table_command(index)).ok_or(InverseError::NoPoints)?;
    }
    Ok(poles_rad_s)
}

/// `1 / tau` at `command`; `None` for a curve without points.
fn pole_at(curve: &[CurvePoint], command: f64) -> Option<f64> {
    let above = curve.iter().find(|point| point.command >= command);
    let below = curve.iter().rev().find(|point| point.command < command);
    match (below, above) {
        (Some(low), Some(high)) => {
            let part = (command - low.command) / (high.command - low.command);
            Some(low.pole_rad_s() + part * (high.pole_rad_s() - low.pole_rad_s()))
        }
        (end, None) | (None, end) => end.map(CurvePoint::pole_rad_s),
    }
}
