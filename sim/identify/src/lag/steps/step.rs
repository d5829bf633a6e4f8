//! Steps of a staircase: which there are, and why one carries no lag.

use serde::ser::SerializeStruct as _;
use serde::{Serialize, Serializer};
use std::fmt;
use std::ops::Range;

use rotorlead_numerics::sample::{mean, median};
use rotorlead_plant::Lagged;

use super::Run;
use super::plateaus::{Direction, Plateau, PlateauState};
use super::response::{Segment, mean_value};
use super::step_gaps::mark_hidden_steps;
use crate::estimate::Estimate;

/// Rows of a window that are before its step. Chosen: their mean is known to 0.18, `1 / sqrt(30)`, of a row's noise; more reach back to
/// where the response may not have settled.
const ROWS_BEFORE: usize = 30;
/// And readings, where each stands in several rows. Chosen: the scatter of fewer is too badly known to tell a drift from it.
const READINGS_BEFORE: usize = 10;
/// A step below so many standard errors of its two levels is not there. Derived: by Student's t with the 8 degrees of freedom of both
/// levels' batches, noise alone exceeds 3 about once in 120 times.
const LEAST_STD: f64 = 3.0;
/// A response that still moves by this share of the coming step, where a step begins, has not settled. Chosen: it changes the time
/// constant by about as much, which is within the scatter between steps; a stricter limit leaves out more of a quick staircase.
const MOST_UNSETTLED: f64 = 0.1;

/// Why a step carries no lag.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StepFault {
    /// The log has a gap where the command changes, so nobody knows when it did.
    CommandInGap {
        /// Its length, seconds.
        gap_s: f64,
    },
    /// The log has a gap between the command and the response's arrival.
    ResponseInGap {
        /// When it begins, seconds after the command.
        after_s: f64,
        /// Its length, seconds.
        gap_s: f64,
        /// The share of the response's way that may be in it.
        share: f64,
    },
    /// The response had not settled when the command changed.
    Unsettled,
    /// The level before or after is too short to settle.
    Short,
    /// The response stands on a limit before or after.
    Limited,
    /// It is too small for the noise, or against the command.
    Hidden {
        /// Change of the settled response, in the direction of the command.
        rise: f64,
        /// Standard error of that change.
        std: f64,
    },
    /// So many steps lead to this level that others were enough.
    NotNeeded,
    /// Its time constant is hardly known.
    Uncertain {
        /// Relative standard error.
        relative_std: f64,
    },
    /// Its time constant is far from what the other steps say of this operating point.
    Contradicts {
        /// It, over what the others say.
        ratio: f64,
    },
}

impl fmt::Display for StepFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::CommandInGap { gap_s } => {
                write!(f, "the command changes within a gap of {:.0} ms in the log", 1e3 * gap_s)
            }
            Self::ResponseInGap { after_s, gap_s, share } => write!(
                f,
                "up to {:.0} % of the response is in a gap of {:.0} ms in the log that begins {:.0} ms after the command",
                100.0 * share,
                1e3 * gap_s,
                1e3 * after_s
            ),
            Self::Unsettled => f.write_str("the response had not settled when the command changed"),
            Self::Short => f.write_str("the level before or after is too short to settle"),
            Self::Limited => f.write_str("the response stands on a limit of its scale before or after"),
            Self::Hidden { rise, std } if *rise > 0.0 => {
                write!(f, "it is too small for the noise: {rise:.4} +- {std:.4}")
            }
            Self::Hidden { rise, std } => {
                write!(f, "the response does not move in the direction of the command: {rise:.4} +- {std:.4}")
            }
            Self::NotNeeded => f.write_str("other steps to this level are enough"),
            Self::Uncertain { relative_std } => {
                write!(f, "its time constant is known to {:.0} % only", 100.0 * relative_std)
            }
            Self::Contradicts { ratio } => {
                write!(f, "its time constant is {ratio:.2} times what the other steps say of this operating point")
            }
        }
    }
}

/// One change of the command between two plateaus, with what was found of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Step {
    /// The first row with the new command.
    pub row: usize,
    /// When the command changed, seconds: by its own stamps where it has them, half an interval before where they repeat, else at that row.
    pub at_s: f64,
    /// Rows that were fitted, or would have been.
    pub window: Range<usize>,
    /// Command before.
    pub from: f64,
    /// Command after.
    pub to: f64,
    /// Settled response before.
    pub before: f64,
    /// Settled response after.
    pub after: f64,
    /// The lag; `None` where no fit was made.
    pub lag: Option<StepLag>,
    /// Why no time constant is taken from it.
    pub fault: Option<StepFault>,
}

impl Serialize for Step {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let tau = self.time_constant_s();
        let mut values = serializer.serialize_struct("Step", 9)?;
        values.serialize_field("time_s", &self.at_s)?;
        values.serialize_field("from", &self.from)?;
        values.serialize_field("to", &self.to)?;
        values.serialize_field("before", &self.before)?;
        values.serialize_field("after", &self.after)?;
        values.serialize_field("time_constant_s", &tau.map(|tau| tau.value))?;
        values.serialize_field("time_constant_s_interval", &tau.map(|tau| tau.interval_of_logarithm(0.95)))?;
        values.serialize_field("delay_s", &self.lag.filter(|_| tau.is_some()).map(|lag| lag.delay_s))?;
        values.serialize_field("left_out", &self.fault.map(|fault| fault.to_string()))?;
        values.end()
    }
}

/// The lag of one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepLag {
    /// Time constant of small motions about the level after the step, seconds; use [`Estimate::interval_of_logarithm`].
    pub time_constant_s: Estimate,
    /// Delay of this step as logged, seconds.
    pub delay_s: f64,
    /// Response that it ends on.
    pub after: f64,
    /// Response that it starts from.
    pub before: f64,
    /// % fit over its window.
    pub fit_percent: f64,
    /// How much faster than an exponential it starts, per unit of what lags (`response`).
    pub(super) bend: f64,
    pub(super) lagged: Lagged,
    /// Over how long each reading is the mean, seconds; 0 for a momentary value.
    pub(super) mean_s: f64,
}

impl StepLag {
    /// The fitted response as the sensor reads it, so many seconds after the command.
    #[must_use]
    pub fn response(&self, after_s: f64) -> f64 {
        let segment = Segment {
            from_s: 0.0,
            level: self.after,
            time_constant_s: self.time_constant_s.value,
            delay_s: self.delay_s,
            bend: self.bend,
            lagged: self.lagged,
        };
        // The fit has a response; should rounding say otherwise, it is drawn as it comes out.
        mean_value(&segment, self.before - self.after, after_s, self.mean_s, &mut true)
    }
}

impl Step {
    /// Which way the command went.
    #[must_use]
    pub fn direction(&self) -> Direction {
        if self.to > self.from { Direction::Up } else { Direction::Down }
    }

    /// Whether a gap of the log hides its command or its response.
    pub(super) fn is_in_gap(&self) -> bool {
        matches!(self.fault, Some(StepFault::CommandInGap { .. } | StepFault::ResponseInGap { .. }))
    }

    /// The time constant, where it is known.
    #[must_use]
    pub fn time_constant_s(&self) -> Option<Estimate> {
        self.lag.filter(|_| self.fault.is_none()).map(|lag| lag.time_constant_s)
    }
}

/// All steps of a record's runs, in time, with a fault where one is seen without a fit.
pub(super) fn find_steps(time_s: &[f64], runs: &[Run]) -> Vec<Step> {
    let pairs = |run: &Run| {
        let pairs = run.plateaus.windows(2).enumerate();
        pairs.map(|(k, pair)| step(run, k, &pair[0], &pair[1])).collect::<Vec<Step>>()
    };
    let mut steps: Vec<Step> = runs.iter().flat_map(pairs).collect();
    mark_hidden_steps(time_s, runs, &mut steps);
    steps
}

fn step(run: &Run, k: usize, before: &Plateau, to: &Plateau) -> Step {
    let y = &run.clean;
    let row = to.rows.start;
    // The last row of the level before for certain, and one at least.
    let until = before.held_until().max(before.rows.start + 1);
    let held = run.readings.as_ref().map_or(1, |readings| (readings.rows_per_reading.round() as usize).max(1));
    let ahead = until.saturating_sub(ROWS_BEFORE.max(READINGS_BEFORE * held)).max(before.rows.start);
    let level = mean(&y[ahead..until]);
    let rise = to.mean - level;
    let sign = if to.direction == Some(Direction::Down) { -1.0 } else { 1.0 };
    let std = before.mean_std.hypot(to.mean_std);
    let fault = if before.state == PlateauState::Short || to.state == PlateauState::Short {
        Some(StepFault::Short)
    } else if !(run.is_unclipped(k) && run.is_unclipped(k + 1)) {
        Some(StepFault::Limited)
    } else if let Some(gap_s) = to.change_gap_s {
        Some(StepFault::CommandInGap { gap_s })
    } else if sign * rise <= LEAST_STD * std {
        Some(StepFault::Hidden { rise: sign * rise, std })
    } else {
        (drift(&y[ahead..until], held, before.common_std) > MOST_UNSETTLED * rise.abs()).then_some(StepFault::Unsettled)
    };
    Step {
        row,
        at_s: to.change_s,
        window: ahead..to.held_until().max(row + 1),
        from: before.command,
        to: to.command,
        before: level,
        after: to.mean,
        lag: None,
        fault,
    }
}

/// Rows of a record that say nothing of a lag: those without a reading, and what follows a step that a gap of the log hides, until
/// it has settled.
pub(super) fn rows_without_lag(without_reading: Vec<bool>, runs: &[Run], steps: &[Step]) -> Vec<bool> {
    let mut nothing = without_reading;
    for plateau in runs.iter().flat_map(|run| &run.plateaus) {
        let step = steps.binary_search_by_key(&plateau.rows.start, |step| step.row).ok().map(|k| &steps[k]);
        if step.is_some_and(Step::is_in_gap) {
            nothing[plateau.rows.start..plateau.settled().start].fill(true);
        }
    }
    nothing
}

/// By how much the second half of some rows is off the first, beyond what their scatter and their resolution explain, where each reading
/// stands in `held`.
fn drift(values: &[f64], held: usize, common_std: f64) -> f64 {
    // Counted from the step backward: how far they are apart is the same whatever the row in which a reading is new.
    let values: Vec<f64> = values.iter().rev().step_by(held).rev().copied().collect();
    let (first, second) = values.split_at(values.len() / 2);
    if first.is_empty() {
        return 0.0;
    }
    let changes = values.windows(2).map(|pair| (pair[1] - pair[0]).abs());
    // The median of the absolute difference of two normal numbers is 0.95 of the standard deviation of one.
    let noise = median(changes).unwrap_or(0.0) / 0.95;
    // The difference of the means of two halves of `n` independent rows has 4 / n times the variance of a row.
    let apart = (mean(second) - mean(first)).abs();
    // Each half may stand on another count.
    apart - LEAST_STD * (noise * (4.0 / values.len() as f64).sqrt()).hypot(2.0_f64.sqrt() * common_std)
}
