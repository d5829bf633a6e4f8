//! The rotor's time constant over the command.

use super::super::FREQUENCY_RANGE_RAD_S;
use super::super::error::within;
use super::{InverseError, table_command};
use crate::inverse::TABLE_POINTS;

/// Range of time constants in seconds: that of the poles, `1 / tau`.
pub const TIME_CONSTANT_RANGE_S: (f64, f64) = (1.0 / FREQUENCY_RANGE_RAD_S.1, 1.0 / FREQUENCY_RANGE_RAD_S.0);

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

/// A rotor's time constants at the commands of the table, `i / 32`, in seconds: what a controller stores of it.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "settings", derive(serde::Serialize, serde::Deserialize, postcard_schema::Schema))]
pub struct RotorCurve {
    /// Below the highest command.
    lower: [f32; TABLE_POINTS - 1],
    /// At the highest command.
    last: f32,
}

impl RotorCurve {
    /// Through 1 to 33 points in increasing order of the command. Between them `1 / tau` is interpolated linearly, and before
    /// the first and after the last it is constant.
    ///
    /// The pole of a rotor is nearly linear in its speed, and so in the command. `tau` is not, and between points far apart its
    /// chord lies above the curve: a time constant that is too long makes the rotor overshoot.
    ///
    /// # Errors
    /// When a point is out of range, or not above the one before; where there is none, or there are too many.
    pub fn through(points: &[CurvePoint]) -> Result<Self, InverseError> {
        check(points)?;
        let mut tau_s = [0.0; TABLE_POINTS];
        for (index, tau_s) in tau_s.iter_mut().enumerate() {
            // Seven digits, of a number of which two or three are known.
            *tau_s = (1.0 / pole_at(points, table_command(index)).ok_or(InverseError::NoPoints)?) as f32;
        }
        Ok(Self::from_time_constants_s(tau_s))
    }

    /// From the time constants at `i / 32`.
    #[must_use]
    pub fn from_time_constants_s(tau_s: [f32; TABLE_POINTS]) -> Self {
        let [lower @ .., last] = tau_s;
        Self { lower, last }
    }

    /// The time constants at `i / 32`.
    #[must_use]
    pub fn time_constants_s(&self) -> [f32; TABLE_POINTS] {
        core::array::from_fn(|index| self.lower.get(index).copied().unwrap_or(self.last))
    }

    /// `1 / tau` at the commands of the table, rad/s.
    pub(super) fn poles_rad_s(&self) -> Result<[f64; TABLE_POINTS], InverseError> {
        let poles_rad_s = self.time_constants_s().map(|tau_s| 1.0 / f64::from(tau_s));
        for (index, pole) in poles_rad_s.iter().enumerate() {
            within("tau_s", 1.0 / pole, TIME_CONSTANT_RANGE_S).map_err(|error| InverseError::Point { index, error })?;
        }
        Ok(poles_rad_s)
    }
}

/// That points make a curve.
fn check(curve: &[CurvePoint]) -> Result<(), InverseError> {
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
    Ok(())
}

/// `1 / tau` at `command`; `None` for a curve without points.
fn pole_at(curve: &[CurvePoint], command: f64) -> Option<f64> {
    let above = curve.iter().find(|point| point.command >= command);
    let below = curve.iter().rev().find(|point| point.command < command);
    match (below, above) {
        // To the last bit: through its own table a curve is itself again.
        (_, Some(point)) if point.command == command => Some(point.pole_rad_s()),
        (Some(low), Some(high)) => {
            let part = (command - low.command) / (high.command - low.command);
            Some(low.pole_rad_s() + part * (high.pole_rad_s() - low.pole_rad_s()))
        }
        (end, None) | (None, end) => end.map(CurvePoint::pole_rad_s),
    }
}
