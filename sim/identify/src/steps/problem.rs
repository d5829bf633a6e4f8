//! The steps of a record as a least-squares problem: which there are, and how a set of parameters misses them.

use std::ops::Range;

use nalgebra::DMatrix;
use rotorlead_numerics::least_squares::Residuals;
use rotorlead_numerics::sample::mean;

use super::plateaus::{Direction, Plateau, SAME_LEVEL};
use super::response::{Segment, value};
use super::run::shows;

/// What is fitted: the record, free of spikes.
pub(super) struct Data<'a> {
    pub(super) name: &'a str,
    pub(super) time_s: &'a [f64],
    pub(super) y: &'a [f64],
    /// Rows that say nothing.
    pub(super) spike: &'a [bool],
}

/// A step smaller than this many times the noise around it tells nothing of the lag.
const MIN_STEP_STD: f64 = 3.0;
/// Rows of a window that are before its step.
const ROWS_BEFORE: usize = 30;
/// What drag can make of the curvature.
const CURVATURE_STD: f64 = 0.5;
/// Delays beyond this are not searched, seconds.
const MAX_DELAY_S: f64 = 0.3;

/// Whether a step shows the lag: in the direction of the command and out of the noise.
pub(super) fn usable(before: &Plateau, to: &Plateau) -> bool {
    let rise = to.mean - before.mean;
    let forward = match to.direction {
        Some(Direction::Up) => rise > 0.0,
        Some(Direction::Down) => rise < 0.0,
        None => false,
    };
    forward && rise.abs() > MIN_STEP_STD * before.std.max(to.std)
}

/// An interval between rows longer than this many usual ones is a gap.
const GAP_INTERVALS: f64 = 2.5;

/// Rows that come after a gap of the log, and the longest such interval in seconds.
pub fn rows_after_gaps(time_s: &[f64]) -> (Vec<usize>, f64) {
    let intervals: Vec<f64> = time_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let mut sorted = intervals.clone();
    if sorted.is_empty() {
        return (Vec::new(), 0.0);
    }
    let middle = sorted.len() / 2;
    let usual_s = *sorted.select_nth_unstable_by(middle, f64::total_cmp).1;
    let rows: Vec<usize> = (1..time_s.len()).filter(|&row| intervals[row - 1] > GAP_INTERVALS * usual_s).collect();
    let longest_s = rows.iter().map(|&row| intervals[row - 1]).fold(0.0, f64::max);
    (rows, longest_s)
}

/// One usable step.
#[derive(Clone, Debug)]
pub(super) struct Step {
    pub(super) plateau: usize,
    /// Its window.
    pub(super) rows: Range<usize>,
    /// The first row with the new command.
    pub(super) change: usize,
    pub(super) before: f64,
    pub(super) after: f64,
    /// Standard deviation of a residual of this step.
    pub(super) noise: f64,
    pub(super) group: usize,
    /// Time from the command to 63 % of the step, seconds.
    pub(super) rise_s: f64,
}

/// Indices of the parameters: delay, curvature, then the levels after and before each step and its onset, then
/// logarithms of the time constants. Levels are in units of their rough values.
pub(super) const DELAY: usize = 0;
pub(super) const CURVATURE: usize = 1;
const SHARED: usize = 2;
pub(super) const PER_STEP: usize = 3;

/// The residuals of `steps` as a function of the parameters.
pub(super) struct Problem<'a> {
    pub(super) data: &'a Data<'a>,
    pub(super) steps: &'a [Step],
    /// Standard deviation by which onsets are tied to zero, seconds.
    pub(super) onset_std_s: f64,
}

impl Problem<'_> {
    fn rows(&self) -> usize {
        self.steps.iter().map(|s| s.rows.len()).sum()
    }

    pub(super) fn level(&self, step: usize) -> usize {
        SHARED + PER_STEP * step
    }

    fn level_before(&self, step: usize) -> usize {
        self.level(step) + 1
    }

    pub(super) fn onset(&self, step: usize) -> usize {
        self.level(step) + 2
    }

    pub(super) fn time_constant(&self, group: usize) -> usize {
        SHARED + PER_STEP * self.steps.len() + group
    }

    /// Residual of one step in units of its noise.
    fn step(&self, k: usize, p: &[f64], out: &mut [f64]) -> bool {
        let step = &self.steps[k];
        let segment = Segment {
            from_s: self.data.time_s[step.change],
            level: step.after * p[self.level(k)],
            time_constant_s: p[self.time_constant(step.group)].exp(),
            delay_s: p[DELAY] + p[self.onset(k)],
        };
        let excess = step.before * p[self.level_before(k)] - segment.level;
        let mut ok = segment.delay_s.abs() < MAX_DELAY_S;
        for (row, r) in step.rows.clone().zip(out) {
            let w = value(&segment, p[CURVATURE], excess, self.data.time_s[row], &mut ok);
            *r = if self.data.spike[row] { 0.0 } else { (w - self.data.y[row]) / step.noise };
        }
        ok
    }

    /// Whether parameter `index` has to do with `step`.
    fn concerns(&self, index: usize, step: usize) -> bool {
        index < SHARED
            || index == self.level(step)
            || index == self.level_before(step)
            || index == self.onset(step)
            || index == self.time_constant(self.steps[step].group)
    }
}

impl Residuals for Problem<'_> {
    fn count(&self) -> usize {
        self.rows() + self.steps.len() + 1
    }

    fn evaluate(&self, p: &[f64], out: &mut [f64]) -> bool {
        let (rows, ties) = out.split_at_mut(self.rows());
        let mut at = 0;
        let mut ok = true;
        for (k, step) in self.steps.iter().enumerate() {
            ok &= self.step(k, p, &mut rows[at..at + step.rows.len()]);
            at += step.rows.len();
            ties[k] = p[self.onset(k)] / self.onset_std_s;
        }
        ties[self.steps.len()] = p[CURVATURE] / CURVATURE_STD;
        ok
    }

    /// Central differences, each over the steps that the parameter has to do with.
    fn jacobian(&self, p: &[f64], out: &mut DMatrix<f64>) -> bool {
        out.fill(0.0);
        let longest = self.steps.iter().map(|s| s.rows.len()).max().unwrap_or(0);
        let mut ahead = vec![0.0; longest];
        let mut behind = vec![0.0; longest];
        let mut at = p.to_vec();
        for j in 0..p.len() {
            let h = f64::EPSILON.cbrt() * p[j].abs().max(self.typical(j));
            let mut row = 0;
            for (k, step) in self.steps.iter().enumerate() {
                let n = step.rows.len();
                if self.concerns(j, k) {
                    at[j] = p[j] + h;
                    let ok = self.step(k, &at, &mut ahead[..n]);
                    at[j] = p[j] - h;
                    if !(ok && self.step(k, &at, &mut behind[..n])) {
                        return false;
                    }
                    at[j] = p[j];
                    for i in 0..n {
                        out[(row + i, j)] = (ahead[i] - behind[i]) / (2.0 * h);
                    }
                }
                row += n;
            }
        }
        let rows = self.rows();
        for k in 0..self.steps.len() {
            out[(rows + k, self.onset(k))] = 1.0 / self.onset_std_s;
        }
        out[(rows + self.steps.len(), CURVATURE)] = 1.0 / CURVATURE_STD;
        true
    }

    fn typical(&self, index: usize) -> f64 {
        let seconds = index == DELAY || (0..self.steps.len()).any(|k| index == self.onset(k));
        if seconds { 0.01 } else { 1.0 }
    }
}

/// The usable steps with windows as long as their plateaus, and the groups they form.
pub(super) fn steps_of(data: &Data<'_>, plateaus: &[Plateau]) -> (Vec<Step>, Vec<(f64, Direction)>) {
    let mut groups: Vec<(f64, Direction)> = Vec::new();
    let mut steps = Vec::new();
    let (after_gaps, _) = rows_after_gaps(data.time_s);
    for (k, pair) in plateaus.windows(2).enumerate() {
        let [before, to] = pair else { continue };
        let (true, Some(direction)) = (usable(before, to) && shows(plateaus, k + 1), to.direction) else {
            continue;
        };
        // Nobody knows when in the gap the command changed.
        if after_gaps.binary_search(&to.rows.start).is_ok() {
            continue;
        }
        let same = |g: &(f64, Direction)| g.1 == direction && (g.0 - to.command).abs() <= SAME_LEVEL;
        let group = groups.iter().position(same).unwrap_or_else(|| {
            groups.push((to.command, direction));
            groups.len() - 1
        });
        let change = to.rows.start;
        let ahead = change.saturating_sub(ROWS_BEFORE).max(before.rows.start);
        let level = mean(&data.y[ahead..change]);
        let target = level + (1.0 - (-1.0f64).exp()) * (to.mean - level);
        let rising = to.mean > level;
        let risen = to.rows.clone().find(|&i| (data.y[i] > target) == rising).unwrap_or(change);
        let interval = data.time_s[change] - data.time_s[change - 1];
        steps.push(Step {
            plateau: k + 1,
            rows: ahead..to.rows.end,
            change,
            before: level,
            after: to.mean,
            // A sensor that reads the same value all the time has still its own resolution.
            noise: to.std.max(1e-3 * (to.mean - level).abs()),
            group,
            rise_s: (data.time_s[risen] - data.time_s[change]).max(interval),
        });
    }
    (steps, groups)
}
