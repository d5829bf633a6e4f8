//! What is known of each level: the static map up and down, its slope, the time constants.

use serde::ser::SerializeStruct as _;
use serde::{Serialize, Serializer};

use super::TimeConstantCurve;
use super::plateaus::{Direction, Plateau, PlateauState, SAME_LEVEL};
use super::step::Step;
use crate::estimate::Estimate;
use rotorlead_numerics::sample;

/// One level of the staircase.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Level {
    /// The command, 0..1.
    pub command: f64,
    /// What was seen when it was reached from below.
    pub up: Option<Branch>,
    /// What was seen when it was reached from above.
    pub down: Option<Branch>,
    /// Slope of the static map in response units per unit of command; `None` where the map does not rise, or no other level was reached
    /// in the same direction, so that none is known.
    #[serde(serialize_with = "value")]
    pub gain: Option<Estimate>,
    /// Whether its response is not above that of a level below, reached in the same direction.
    #[serde(skip)]
    pub falls: bool,
    /// Time constant of small motions about the level by the curve, seconds; `None` beyond the steps that it rests on.
    #[serde(serialize_with = "value")]
    pub time_constant_s: Option<Estimate>,
}

/// A level as seen in one direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Branch {
    /// Mean of the settled response and its standard error, slow drift included.
    pub mean: Estimate,
    /// Standard deviation of the settled response: noise and ripple.
    pub std: f64,
    /// Time constant of the steps to here, seconds; `None` where none was usable. Its interval is
    /// [`Estimate::interval_of_logarithm`].
    pub time_constant_s: Option<Estimate>,
    /// % fit over the windows of those steps, each with its own final level and onset.
    pub fit_percent: Option<f64>,
}

/// An estimate without its error.
fn value<S: Serializer>(estimate: &Option<Estimate>, serializer: S) -> Result<S::Ok, S::Error> {
    estimate.map(|estimate| estimate.value).serialize(serializer)
}

impl Serialize for Branch {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut values = serializer.serialize_struct("Branch", 5)?;
        values.serialize_field("response", &self.mean.value)?;
        values.serialize_field("response_std", &self.mean.std)?;
        values.serialize_field("time_constant_s", &self.time_constant_s.map(|tau| tau.value))?;
        values.serialize_field("time_constant_s_std", &self.time_constant_s.map(|tau| tau.std))?;
        values.serialize_field("fit_percent", &self.fit_percent)?;
        values.end()
    }
}

impl Level {
    /// The branch of that direction.
    #[must_use]
    pub fn branch(&self, direction: Direction) -> Option<&Branch> {
        match direction {
            Direction::Up => self.up.as_ref(),
            Direction::Down => self.down.as_ref(),
        }
    }
}

/// The levels by increasing command, and the direction in which more of them were seen: the *main*
/// branch, on which slopes are taken. Up and down differ by a few percent (temperature, voltage), as much
/// as a tenth of the difference between neighbors, so a slope across branches would be wrong by that.
///
/// A level on which the response stands on a limit is none, nor is one that is too short to settle.
pub(super) fn levels(
    plateaus: &[Plateau],
    steps: &[Step],
    curve: Option<&TimeConstantCurve>,
) -> (Vec<Level>, Direction) {
    let is_level = |plateau: &&Plateau| !plateau.limited && plateau.state == PlateauState::Running;
    let free: Vec<Plateau> = plateaus.iter().filter(is_level).cloned().collect();
    // The plateau that begins a record is a level like those reached from below, by which a motor starts; where there is none, like the
    // others.
    let from_below = free.iter().any(|p| p.direction == Some(Direction::Up));
    let usual = if from_below { Direction::Up } else { Direction::Down };
    let plateaus = &free;
    let mut levels: Vec<Level> = Vec::new();
    for plateau in plateaus {
        if !levels.iter().any(|l| (l.command - plateau.command).abs() <= SAME_LEVEL) {
            let curve = curve.filter(|curve| curve.holds(plateau.command));
            let time_constant_s = curve.map(|curve| curve.at(plateau.command));
            levels.push(Level {
                command: plateau.command,
                up: None,
                down: None,
                gain: None,
                falls: false,
                time_constant_s,
            });
        }
    }
    levels.sort_by(|a, b| a.command.total_cmp(&b.command));
    for level in &mut levels {
        level.up = branch(level.command, Direction::Up, usual, plateaus, steps);
        level.down = branch(level.command, Direction::Down, usual, plateaus, steps);
    }
    let seen = |d| levels.iter().filter(|l| l.branch(d).is_some()).count();
    let (main, other) = if seen(Direction::Up) >= seen(Direction::Down) {
        (Direction::Up, Direction::Down)
    } else {
        (Direction::Down, Direction::Up)
    };
    // The main branch last: where both have a slope, its own stands.
    set_gains(&mut levels, other);
    set_gains(&mut levels, main);
    (levels, main)
}

/// A level in one direction; plateaus that came from nowhere count as reached in the `usual` one.
fn branch(
    command: f64,
    direction: Direction,
    usual: Direction,
    plateaus: &[Plateau],
    steps: &[Step],
) -> Option<Branch> {
    let here = |c: f64| (c - command).abs() <= SAME_LEVEL;
    let seen: Vec<&Plateau> =
        plateaus.iter().filter(|p| here(p.command) && p.direction.unwrap_or(usual) == direction).collect();
    if seen.is_empty() {
        return None;
    }
    let n = seen.len() as f64;
    let mean = seen.iter().map(|p| p.mean).sum::<f64>() / n;
    // What their readings have in common, the same level has at each visit.
    let common = seen.iter().map(|p| p.common_std * p.common_std).sum::<f64>();
    let error = seen.iter().map(|p| p.mean_std * p.mean_std).sum::<f64>() - common;
    let variance = seen.iter().map(|p| p.std * p.std).sum::<f64>() / n;
    let own: Vec<&Step> = steps.iter().filter(|step| step.direction() == direction && here(step.to)).collect();
    let percents: Vec<f64> =
        own.iter().filter_map(|step| Some(step.time_constant_s().and(step.lag)?.fit_percent)).collect();
    Some(Branch {
        mean: Estimate::normal(mean, (common / n).sqrt().hypot(error.max(0.0).sqrt() / n)),
        std: variance.sqrt(),
        time_constant_s: joined(own.iter().filter_map(|step| step.time_constant_s())),
        fit_percent: (!percents.is_empty()).then(|| sample::mean(&percents)),
    })
}

/// The static map at a command: the main branch where it was seen there, else the other; on the straight line between two
/// levels.
pub(super) fn map_response(levels: &[Level], main: Direction, command: f64) -> f64 {
    let response = |l: &Level| l.branch(main).or(l.up.as_ref()).or(l.down.as_ref()).map_or(0.0, |b| b.mean.value);
    if let Some(level) = levels.iter().find(|l| (l.command - command).abs() <= SAME_LEVEL) {
        return response(level);
    }
    let above = levels.partition_point(|l| l.command < command);
    match (above.checked_sub(1).and_then(|below| levels.get(below)), levels.get(above)) {
        (Some(low), Some(high)) => {
            let share = (command - low.command) / (high.command - low.command);
            response(low) + share * (response(high) - response(low))
        }
        (one, other) => one.or(other).map_or(0.0, response),
    }
}

/// The weighted mean of the logarithms of time constants.
fn joined(estimates: impl Iterator<Item = Estimate>) -> Option<Estimate> {
    let (mut sum, mut weights, mut dof) = (0.0, 0.0, f64::INFINITY);
    for estimate in estimates {
        let weight = (estimate.value / estimate.std).powi(2);
        sum += weight * estimate.value.ln();
        weights += weight;
        dof = estimate.dof;
    }
    let value = (sum / weights).exp();
    (weights > 0.0).then(|| Estimate { value, std: value / weights.sqrt(), dof })
}

/// Slopes on one branch, over the levels on which it rises. A level whose response is not above that of
/// the one before has no gain and takes no part in its neighbors' slopes.
fn set_gains(levels: &mut [Level], direction: Direction) {
    let mut rising: Vec<(usize, f64, Estimate)> = Vec::new();
    for (at, level) in levels.iter_mut().enumerate() {
        let Some(mean) = level.branch(direction).map(|b| b.mean) else {
            continue;
        };
        level.falls = rising.last().is_some_and(|last| mean.value <= last.2.value);
        if level.falls {
            level.gain = None;
        } else {
            rising.push((at, level.command, mean));
        }
    }
    for k in 0..rising.len() {
        let (at, ..) = rising[k];
        let before = k.checked_sub(1).map(|i| secant(&rising[i], &rising[k]));
        let after = rising.get(k + 1).map(|next| secant(&rising[k], next));
        levels[at].gain = match (before, after) {
            // The slope at the middle of a parabola through three points.
            (Some((b, wb)), Some((a, wa))) => {
                let value = (b * wa + a * wb) / (wa + wb);
                let (lo, mid, hi) = (rising[k - 1].2.std, rising[k].2.std, rising[k + 1].2.std);
                let std = (lo * wa / wb).hypot(mid * (wa / wb - wb / wa)).hypot(hi * wb / wa) / (wa + wb);
                Some(Estimate::normal(value, std))
            }
            (Some((value, width)), None) => {
                let std = rising[k].2.std.hypot(rising[k - 1].2.std) / width;
                Some(Estimate::normal(value, std))
            }
            (None, Some((value, width))) => {
                let std = rising[k].2.std.hypot(rising[k + 1].2.std) / width;
                Some(Estimate::normal(value, std))
            }
            (None, None) => levels[at].gain,
        };
    }
}

/// Slope and width between two levels.
fn secant(from: &(usize, f64, Estimate), to: &(usize, f64, Estimate)) -> (f64, f64) {
    let width = to.1 - from.1;
    ((to.2.value - from.2.value) / width, width)
}
