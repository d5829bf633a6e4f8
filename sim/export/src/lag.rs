//! A model's time constant at one command, with its interval.

use rotorlead_plant::{Model, Point, TimeConstantBand};

use rotorlead_identify::estimate::Estimate;

/// A number with the ends of its 95 % interval, where they are known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ConfidenceInterval {
    pub(super) value: f64,
    pub(super) low: Option<f64>,
    pub(super) high: Option<f64>,
}

impl ConfidenceInterval {
    pub(super) fn from_estimate(estimate: Estimate) -> Self {
        let (low, high) = estimate.interval(0.95);
        Self { value: estimate.value, low: Some(low), high: Some(high) }
    }

    /// All three times a factor above zero.
    pub(super) fn times(self, factor: f64) -> Self {
        let times = |value| value * factor;
        Self { value: times(self.value), low: self.low.map(times), high: self.high.map(times) }
    }

    /// The inverse of a band above zero.
    pub(super) fn inverse(self) -> Self {
        Self { value: 1.0 / self.value, low: self.high.map(f64::recip), high: self.low.map(f64::recip) }
    }
}

/// The time constant at a command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LagEstimate {
    /// Of small motions in both directions, seconds.
    pub(super) time_constant_s: ConfidenceInterval,
    /// Where.
    pub(super) at: f64,
    /// Between which commands it is known.
    pub(super) measured: (f64, f64),
    /// The model's dead time there, which a stack without one does not have, seconds.
    pub(super) delay_s: f64,
}

/// The direction of a change of the rotor speed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Direction {
    Up,
    Down,
}

impl LagEstimate {
    /// From the model's curve with its band, or from its points where it has none; in the middle unless `at` is given.
    pub(super) fn from_model(model: &Model, at: Option<f64>) -> Result<Self, String> {
        let curve = model.time_constant_curve.as_ref().filter(|curve| !curve.nominal.is_empty());
        let nominals = || match curve {
            Some(curve) => curve.nominal.clone(),
            None => model.points.iter().map(|point| point.nominal).collect(),
        };
        let nominals = nominals();
        let (Some(&first), Some(&last)) = (nominals.first(), nominals.last()) else {
            return Err(String::from(
                "the model has no time constant: record a multisine or a staircase, and run `rotorlead identify`",
            ));
        };
        let at = at.unwrap_or(0.5 * (first + last));
        if !(first..=last).contains(&at) {
            return Err(format!(
                "the time constant is known from commands of {first} to {last}, and not at {at}: choose one of these, or measure there"
            ));
        }
        let time_constant_s = curve.map_or_else(|| between_points(&model.points, at), |curve| on_curve(curve, at));
        let delay_s = model.at(at).map_or(0.0, |lag| lag.delay_s);
        Ok(Self { time_constant_s, at, measured: (first, last), delay_s })
    }

    /// The time constant of one direction. Where the model's curve knows how far they differ, its time constant is that of the
    /// mean of the two rates.
    pub(super) fn directed(self, model: &Model, direction: Direction) -> Result<ConfidenceInterval, String> {
        let ratio = model.time_constant_curve.as_ref().and_then(|curve| curve.down_over_up);
        let has_both = |point: &Point| point.time_constant_up_s.is_some() && point.time_constant_down_s.is_some();
        if ratio.is_none() && !model.points.iter().any(has_both) {
            return Err(String::from(
                "the model has one time constant for both directions: identify it on a staircase up and down, which tells them apart",
            ));
        }
        Ok(self.time_constant_s.times(match (ratio, direction) {
            (Some(ratio), Direction::Up) => 0.5 * (1.0 + 1.0 / ratio),
            (Some(ratio), Direction::Down) => 0.5 * (1.0 + ratio),
            // Where steps are not known to differ, the points have the same in both directions.
            (None, direction) => share_of_points(&model.points, self.at, direction),
        }))
    }
}

/// The time constant of one direction over that of both, by the points that know it, at the nearest command that they reach.
fn share_of_points(points: &[Point], at: f64, direction: Direction) -> f64 {
    let share = |point: &Point| {
        let of_direction = match direction {
            Direction::Up => point.time_constant_up_s,
            Direction::Down => point.time_constant_down_s,
        };
        Some((point.nominal, of_direction? / point.time_constant_s))
    };
    let (nominals, shares): (Vec<f64>, Vec<f64>) = points.iter().filter_map(share).unzip();
    let (Some(first), Some(last)) = (nominals.first(), nominals.last()) else { return 1.0 };
    interpolated(&nominals, at.clamp(*first, *last), |index| shares[index])
}

/// Linear between the values on either side of `at`, which is between the first and the last.
fn interpolated(nominals: &[f64], at: f64, value: impl Fn(usize) -> f64) -> f64 {
    let above = nominals.partition_point(|nominal| *nominal < at);
    if nominals[above] == at {
        return value(above);
    }
    let (low, high) = (nominals[above - 1], nominals[above]);
    value(above - 1) + (at - low) / (high - low) * (value(above) - value(above - 1))
}

fn on_curve(curve: &TimeConstantBand, at: f64) -> ConfidenceInterval {
    let of = |values: &[f64]| interpolated(&curve.nominal, at, |index| values[index]);
    ConfidenceInterval { value: of(&curve.time_constant_s), low: Some(of(&curve.low_s)), high: Some(of(&curve.high_s)) }
}

/// The standard error is interpolated as well: no less than that of the interpolated value, however the points' errors go together.
fn between_points(points: &[Point], at: f64) -> ConfidenceInterval {
    let nominals: Vec<f64> = points.iter().map(|point| point.nominal).collect();
    let value = interpolated(&nominals, at, |index| points[index].time_constant_s);
    // A value that is missing becomes NaN, and with it what is interpolated from it.
    let std = interpolated(&nominals, at, |index| points[index].time_constant_s_std.unwrap_or(f64::NAN));
    if std.is_nan() {
        return ConfidenceInterval { value, low: None, high: None };
    }
    let (low, high) = Estimate::normal(value, std).interval_of_logarithm(0.95);
    ConfidenceInterval { value, low: Some(low), high: Some(high) }
}
