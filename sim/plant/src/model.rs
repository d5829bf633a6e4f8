//! `model.toml`: what is known of one actuator.

use std::collections::BTreeMap;

use miette::Diagnostic;
use rotorlead_records::files::{checksum, to_toml};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::judgement::Judgement;

/// One actuator: a first-order lag at each nominal command, and what else is known of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Model {
    /// Version of the file's layout; 1.
    pub format: u32,
    /// The linear models, by increasing nominal command.
    #[serde(rename = "point", default)]
    pub points: Vec<Point>,
    /// Steady response against command.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub static_map: Option<StaticMap>,
    /// The time constant over operating points with its band, where it comes from steps.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time_constant_curve: Option<TimeConstantBand>,
    /// What the actuator does beyond a first-order lag.
    #[serde(rename = "effect", default, skip_serializing_if = "Vec::is_empty")]
    pub effects: Vec<Effect>,
    /// Where the numbers come from.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub provenance: Option<Provenance>,
}

/// The linear model `gain e^(-s delay) / (time_constant s + 1)` around one nominal command (1).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Point {
    /// Command around which it holds, 0..1.
    pub nominal: f64,
    /// Static gain in response units (newtons or revolutions per minute) per unit of command.
    pub gain: f64,
    /// Standard error of `gain`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gain_std: Option<f64>,
    /// Time constant in seconds, rising and falling alike.
    pub time_constant_s: f64,
    /// Standard error of `time_constant_s`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time_constant_s_std: Option<f64>,
    /// Dead time in seconds, beyond the holds of command and ESC frame.
    #[serde(default)]
    pub delay_s: f64,
    /// Standard error of `delay_s`; absent when the delay was not estimated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub delay_s_std: Option<f64>,
    /// Time constant of steps up to this level, seconds (step and staircase records).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time_constant_up_s: Option<f64>,
    /// Time constant of steps down to this level, seconds (step and staircase records).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time_constant_down_s: Option<f64>,
    /// % fit of the frequency response, where one was measured.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fit_frequency_percent: Option<f64>,
    /// % fit on the square wave, where one was measured.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fit_square_percent: Option<f64>,
    /// % fit on the steps of this level, where there are any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fit_step_percent: Option<f64>,
}

/// Time constants of small motions at a set of operating points, each with its 95 % interval.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TimeConstantBand {
    /// Commands, increasing, 0..1.
    pub nominal: Vec<f64>,
    /// Time constants, seconds.
    pub time_constant_s: Vec<f64>,
    /// Lower ends of their intervals, seconds.
    pub low_s: Vec<f64>,
    /// Upper ends of their intervals, seconds.
    pub high_s: Vec<f64>,
    /// The time constant of steps down over that of steps up, where they are known to differ. The time constants are then those of
    /// the mean of the two rates.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub down_over_up: Option<f64>,
}

/// Steady response at a set of commands, linear between them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StaticMap {
    /// Commands, increasing, 0..1.
    pub command: Vec<f64>,
    /// Steady responses, newtons or revolutions per minute.
    pub response: Vec<f64>,
    /// What goes from level to level as a first-order lag.
    #[serde(default, skip_serializing_if = "Lagged::is_response")]
    pub lagged: Lagged,
    /// The polynomial through them with what goes with it, where it was fitted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub polynomial: Option<MapPolynomial>,
}

/// What a first-order lag acts on between levels. Small motions have the same time constant either way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Lagged {
    /// The response itself.
    #[default]
    Response,
    /// Its square root: the response is a thrust, the square of the speed that lags (Leishman, Principles of Helicopter Aerodynamics,
    /// ch. 2). Below zero it is minus the root of the size, so that an offset has a level too.
    SquareRoot,
}

impl Lagged {
    /// The quantity at a response, which has the response's units or their square root.
    #[inline]
    #[must_use]
    pub fn at_response(self, response: f64) -> f64 {
        match self {
            Self::Response => response,
            Self::SquareRoot => response.abs().sqrt().copysign(response),
        }
    }

    /// The response at such a quantity.
    #[inline]
    #[must_use]
    pub fn response(self, quantity: f64) -> f64 {
        match self {
            Self::Response => quantity,
            Self::SquareRoot => quantity * quantity.abs(),
        }
    }

    /// By how much the response changes with the quantity.
    #[inline]
    #[must_use]
    pub fn slope(self, quantity: f64) -> f64 {
        match self {
            Self::Response => 1.0,
            Self::SquareRoot => 2.0 * quantity.abs(),
        }
    }

    fn is_response(&self) -> bool {
        *self == Self::Response
    }
}

/// A static map as a polynomial in the command, with dead zone, hysteresis and limit. For people and for linearizing a
/// throttle; simulations use the commands and responses of [`StaticMap`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MapPolynomial {
    /// Commands from and to which it holds.
    pub range: [f64; 2],
    /// Coefficients in powers of the command, from the constant on, response units.
    pub coefficients: Vec<f64>,
    /// Their standard errors.
    pub coefficients_std: Vec<f64>,
    /// Command at which the motor begins to turn.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dead_zone: Option<f64>,
    /// Standard error of `dead_zone`; absent where it is only the lowest command seen to turn the motor.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dead_zone_std: Option<f64>,
    /// Width in command between levels reached from below and from above.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hysteresis: Option<f64>,
    /// Standard error of `hysteresis`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hysteresis_std: Option<f64>,
    /// Command beyond which the response rises no more.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub limit: Option<f64>,
    /// Standard error of `limit`; absent where the response falls beyond it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub limit_std: Option<f64>,
}

/// One effect of the catalog, by its kind and parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Effect {
    /// Its identifier in the catalog.
    pub kind: String,
    /// Parameters by name, in the units that the name carries.
    #[serde(default)]
    pub parameters: BTreeMap<String, f64>,
    /// Standard errors by name.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub std: BTreeMap<String, f64>,
}

/// Where a model's numbers come from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Provenance {
    /// The name of the experiment that they are of.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub experiment: Option<String>,
    /// The records used.
    pub records: Vec<String>,
    /// [`Experiment::checksum`](rotorlead_records::Experiment::checksum) of what they were read from; `None` for records in memory.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub records_crc32: Option<String>,
    /// The version of this tool.
    pub version: String,
    /// `thrust_n` or `rpm`.
    pub output: rotorlead_records::Output,
    /// `flight` for motors that were identified in the air, by the command of their vehicle's controller; `None` for a stand.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub excitation: Option<rotorlead_records::Excitation>,
    /// Rate at which the command was updated, hertz.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub command_rate_hz: Option<f64>,
    /// Rate at which the ESC takes over a command, hertz.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub esc_frame_hz: Option<f64>,
    /// Whether a compensator may be built on it, by the records that it was identified with.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub judgement: Option<Judgement>,
}

impl Model {
    /// Whether a compensator may be built on it, where its file says so.
    #[must_use]
    pub fn judgement(&self) -> Option<&Judgement> {
        self.provenance.as_ref()?.judgement.as_ref()
    }

    /// Whether its motors were identified in flight.
    #[must_use]
    pub fn is_from_flight(&self) -> bool {
        self.provenance.as_ref().is_some_and(|from| from.excitation == Some(rotorlead_records::Excitation::Flight))
    }

    /// By which a compensator names the model that it was designed for: [`checksum`] of all that the file says of the actuator, as
    /// this program writes it. Comments, the order of the keys and `[provenance]` make no other actuator of it, and a model that was
    /// never written has one too.
    #[must_use]
    pub fn checksum(&self) -> String {
        checksum(to_toml(&Self { provenance: None, ..self.clone() }).as_bytes())
    }
}

/// The three numbers of `gain e^(-s delay) / (time_constant s + 1)` (1).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lag {
    /// Static gain in response units per unit of command.
    pub gain: f64,
    /// Time constant in seconds, above zero.
    pub time_constant_s: f64,
    /// Dead time in seconds, zero or more.
    pub delay_s: f64,
}

/// What can be asked of a model that it does not answer.
#[derive(Clone, Debug, PartialEq, Error, Diagnostic)]
pub enum ModelError {
    /// A nominal command between none of the model's points.
    #[error("the model says nothing of a nominal command of {nominal}: it holds from {from} to {to}")]
    #[diagnostic(help("choose a nominal command in that range, or identify the motor at this one too"))]
    OutsideRange {
        /// The nominal command asked for.
        nominal: f64,
        /// That of the first point.
        from: f64,
        /// That of the last point.
        to: f64,
    },
    /// A model without points (only possible for one made in memory).
    #[error("the model has no point")]
    #[diagnostic(help("run `rotorlead identify` on an experiment: it finds the points"))]
    NoPoints,
}

impl Point {
    /// A point of which nothing is known beyond its linear model.
    #[must_use]
    pub fn new(nominal: f64, lag: Lag) -> Self {
        Self {
            nominal,
            gain: lag.gain,
            gain_std: None,
            time_constant_s: lag.time_constant_s,
            time_constant_s_std: None,
            delay_s: lag.delay_s,
            delay_s_std: None,
            time_constant_up_s: None,
            time_constant_down_s: None,
            fit_frequency_percent: None,
            fit_square_percent: None,
            fit_step_percent: None,
        }
    }

    /// Its linear model.
    #[must_use]
    pub fn lag(&self) -> Lag {
        Lag { gain: self.gain, time_constant_s: self.time_constant_s, delay_s: self.delay_s }
    }
}

impl Model {
    /// The linear model at `nominal`: gain, time constant and delay of the points on either side,
    /// interpolated linearly. At a point it is that point's.
    ///
    /// # Errors
    /// When `nominal` is outside the points' range (a NaN is), or there are none. Points are
    /// increasing, as [`Model::check`] demands.
    pub fn at(&self, nominal: f64) -> Result<Lag, ModelError> {
        let (Some(first), Some(last)) = (self.points.first(), self.points.last()) else {
            return Err(ModelError::NoPoints);
        };
        if !(first.nominal..=last.nominal).contains(&nominal) {
            return Err(ModelError::OutsideRange { nominal, from: first.nominal, to: last.nominal });
        }
        let above = self.points.partition_point(|point| point.nominal < nominal);
        let high = &self.points[above];
        if high.nominal == nominal {
            return Ok(high.lag());
        }
        // The first point is not above `nominal`, so there is one before `high`.
        let low = &self.points[above - 1];
        let part = (nominal - low.nominal) / (high.nominal - low.nominal);
        let between = |low: f64, high: f64| low + part * (high - low);
        Ok(Lag {
            gain: between(low.gain, high.gain),
            time_constant_s: between(low.time_constant_s, high.time_constant_s),
            delay_s: between(low.delay_s, high.delay_s),
        })
    }
}

#[cfg(test)]
mod tests {
    use rotorlead_records::files::testing::assert_report;

    use super::*;
    use crate::testing::model;

    fn lag(gain: f64, time_constant_s: f64, delay_s: f64) -> Lag {
        Lag { gain, time_constant_s, delay_s }
    }

    #[test]
    fn between_points_each_number_is_interpolated() {
        let model = model(&[(0.25, 8.0, 0.5, 0.0), (0.50, 16.0, 0.25, 0.5), (1.0, 0.0, 0.125, 0.5)]);
        assert_eq!(model.at(0.25), Ok(lag(8.0, 0.5, 0.0)));
        assert_eq!(model.at(0.375), Ok(lag(12.0, 0.375, 0.25)));
        assert_eq!(model.at(0.5), Ok(lag(16.0, 0.25, 0.5)));
        assert_eq!(model.at(0.625), Ok(lag(12.0, 0.21875, 0.5)));
        assert_eq!(model.at(1.0), Ok(lag(0.0, 0.125, 0.5)));
    }

    #[test]
    fn outside_the_points_the_range_is_named() {
        let model = model(&[(0.4, 1.0, 0.1, 0.0), (0.65, 1.0, 0.1, 0.0)]);
        for nominal in [0.39, 0.66, -1.0, f64::INFINITY, f64::NAN] {
            let error = model.at(nominal).unwrap_err();
            let parts = [&*nominal.to_string(), "from 0.4 to 0.65", "in that range"];
            assert_report(error, &parts);
        }
    }

    #[test]
    fn one_point_answers_for_itself_and_none_for_nothing() {
        let one = model(&[(0.5, 1.0, 0.1, 0.0)]);
        assert_eq!(one.at(0.5), Ok(lag(1.0, 0.1, 0.0)));
        assert!(one.at(0.50001).is_err());
        assert_report(model(&[]).at(0.5).unwrap_err(), &["no point", "rotorlead identify"]);
    }
}
