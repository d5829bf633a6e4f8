//! The output-error fit of the lag to the steps of a record.
//!
//! Each step is simulated over a window from a few rows before it to a few time constants after it, and all
//! steps are fitted at once. Their parameters:
//!
//! - one delay and one `kappa` ([`super::response`]) for the record;
//! - one time constant per level and direction, as its logarithm;
//! - per step the levels before and after it, as slow drift would otherwise bend the time constants;
//! - per step an *onset*, how much earlier or later than the record's delay it began. The log says in
//!   which row the command had changed, not when, and an ESC or a stand takes a command over once per
//!   frame of its own. With one delay for all steps this leaks into the time constants: in a stand's log of
//!   7 ms rows and 20 ms frames it makes neighbors differ by a factor of two. Onsets have mean zero and a standard deviation that is
//!   estimated from the record, and enter the sum of squares as such (random effects; the sum is then
//!   minus twice the logarithm of the joint density).
//!
//! `kappa` is tied to zero with a standard deviation of 1/2, the most that drag can make of it, so that a
//! record of small steps only, which say nothing of it, still has a solution.

use std::ops::Range;

use nalgebra::DMatrix;

use super::plateaus::{Direction, Plateau, SAME_LEVEL, mean_and_std};
use super::response::{Stretch, value};
use super::uncertainty::{correlated, correlation};
use super::{Estimate, StepsError};
use crate::identify::least_squares::{Limits, Residuals, Solution, minimize};

/// What is fitted: the record, free of spikes.
pub(super) struct Data<'a> {
    pub(super) name: &'a str,
    pub(super) time_s: &'a [f64],
    pub(super) y: &'a [f64],
    /// Rows that say nothing.
    pub(super) spike: &'a [bool],
}

/// Steps that share a time constant: all that go to one command in one direction.
#[derive(Clone, Debug)]
pub(super) struct Group {
    pub(super) command: f64,
    pub(super) direction: Direction,
    pub(super) time_constant_s: Estimate,
    /// % fit over the windows of its steps.
    pub(super) fit_percent: f64,
}

/// What came out.
pub(super) struct LagFit {
    pub(super) groups: Vec<Group>,
    pub(super) delay_s: Estimate,
    pub(super) curvature: Estimate,
    /// Standard deviation of the onsets, seconds.
    pub(super) onset_std_s: f64,
    pub(super) steps: Vec<FittedStep>,
}

/// One step as fitted.
#[derive(Clone, Copy, Debug)]
pub(super) struct FittedStep {
    /// Index of the plateau it leads to.
    pub(super) plateau: usize,
    /// Index of its group.
    pub(super) group: usize,
    /// Its final level.
    pub(super) level: f64,
    /// The record's delay and its own onset together, seconds.
    pub(super) delay_s: f64,
}

/// A step smaller than this many times the noise around it tells nothing of the lag.
const MIN_STEP_STD: f64 = 3.0;
/// Length of a window in units of the median time to 63 % of a step, which includes the delay.
const WINDOW: f64 = 8.0;
/// Rows of a window that are before its step.
const ROWS_BEFORE: usize = 30;
/// What drag can make of `kappa`.
const CURVATURE_STD: f64 = 0.5;
/// Onsets in the first pass, in which they are nearly free, seconds.
const FREE_ONSET_STD_S: f64 = 0.02;
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

#[derive(Clone, Debug)]
struct Step {
    plateau: usize,
    /// Its window.
    rows: Range<usize>,
    /// The first row with the new command.
    change: usize,
    before: f64,
    after: f64,
    /// Standard deviation of a residual of this step.
    noise: f64,
    group: usize,
    /// Time from the command to 63 % of the step, seconds.
    rise_s: f64,
}

/// Indices of the parameters: delay, kappa, then the levels after and before each step and its onset, then
/// logarithms of the time constants. Levels are in units of their rough values.
const DELAY: usize = 0;
const CURVATURE: usize = 1;
const SHARED: usize = 2;
const PER_STEP: usize = 3;

struct Problem<'a> {
    data: &'a Data<'a>,
    steps: &'a [Step],
    onset_std_s: f64,
}

impl Problem<'_> {
    fn rows(&self) -> usize {
        self.steps.iter().map(|s| s.rows.len()).sum()
    }

    fn level(&self, step: usize) -> usize {
        SHARED + PER_STEP * step
    }

    fn level_before(&self, step: usize) -> usize {
        self.level(step) + 1
    }

    fn onset(&self, step: usize) -> usize {
        self.level(step) + 2
    }

    fn time_constant(&self, group: usize) -> usize {
        SHARED + PER_STEP * self.steps.len() + group
    }

    /// Misfit of one step in units of its noise.
    fn step(&self, k: usize, p: &[f64], out: &mut [f64]) -> bool {
        let step = &self.steps[k];
        let stretch = Stretch {
            from_s: self.data.time_s[step.change],
            level: step.after * p[self.level(k)],
            time_constant_s: p[self.time_constant(step.group)].exp(),
            delay_s: p[DELAY] + p[self.onset(k)],
        };
        let excess = step.before * p[self.level_before(k)] - stretch.level;
        let mut ok = stretch.delay_s.abs() < MAX_DELAY_S;
        for (row, r) in step.rows.clone().zip(out) {
            let w = value(&stretch, p[CURVATURE], excess, self.data.time_s[row], &mut ok);
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

/// Fits all usable steps between the plateaus of a run. `frame_s` is the ESC's frame, where known.
///
/// Two passes: the first with nearly free onsets and the noise of the settled response; from its
/// residuals come the noise of each step, misfit included, and the spread of the onsets for the second.
pub(super) fn fit(data: &Data<'_>, plateaus: &[Plateau], frame_s: f64) -> Result<LagFit, StepsError> {
    let (mut steps, groups) = steps_of(data, plateaus);
    if steps.is_empty() {
        return Err(StepsError::NoUsableStep { record: data.name.into() });
    }
    let mut rises: Vec<f64> = steps.iter().map(|s| s.rise_s).collect();
    rises.sort_by(f64::total_cmp);
    let rise_s = rises[rises.len() / 2];
    for step in &mut steps {
        let end = data.time_s[step.change] + WINDOW * rise_s;
        let rows = data.time_s[step.rows.clone()].partition_point(|&t| t < end);
        step.rows.end = step.rows.start + rows;
    }
    let intervals: Vec<f64> = data.time_s.windows(2).map(|w| w[1] - w[0]).collect();
    let row_s = mean_and_std(&intervals).0;
    // Uniform within a row and within a frame.
    let least_onset_std_s = ((row_s * row_s + frame_s * frame_s) / 12.0).sqrt();

    let first = Problem { data, steps: &steps, onset_std_s: FREE_ONSET_STD_S.max(least_onset_std_s) };
    let mut best: Option<Solution> = None;
    // The delay's basin is about a time constant wide, so start within and beyond it.
    for share in [0.0, 0.4, 0.8] {
        let mut start = vec![share * rise_s, 0.0];
        start.extend(steps.iter().flat_map(|_| [1.0, 1.0, 0.0]));
        start.extend(groups.iter().map(|_| ((1.0 - 0.9 * share) * rise_s).ln()));
        if let Some(s) = minimize(&first, &start, FIRST_LOOK)
            && best.as_ref().is_none_or(|b| s.sum_of_squares < b.sum_of_squares)
        {
            best = Some(s);
        }
    }
    let rough = best
        .and_then(|look| minimize(&first, &look.parameters, LIMITS))
        .ok_or(StepsError::NotConverged { record: data.name.into(), iterations: 0 })?;
    let onset_std_s = onset_spread(&first, &rough).max(least_onset_std_s);
    let noise = noise_with_misfit(&first, &rough.residuals);
    for (step, noise) in steps.iter_mut().zip(noise) {
        step.noise = noise;
    }
    let second = Problem { data, steps: &steps, onset_std_s };
    let solution = minimize(&second, &rough.parameters, LIMITS).filter(|s| s.converged);
    let solution =
        solution.ok_or(StepsError::NotConverged { record: data.name.into(), iterations: LIMITS.iterations })?;
    let correlation = correlation(data.y, plateaus);
    Ok(results(&second, &solution, &groups, &correlation))
}

/// The response has a kink where a step begins, and moving it across a row leaves the search zigzagging by
/// ever less. A sum of squares in units of the noise has about one per row, so a decrease by this share, a
/// few thousandths, moves no parameter by a tenth of its standard error.
const LIMITS: Limits = Limits { iterations: 200, decrease: 1e-6 };

/// Enough to tell which start is in the right basin.
const FIRST_LOOK: Limits = Limits { iterations: 10, decrease: 1e-3 };

/// The usable steps with windows as long as their plateaus, and the groups they form.
fn steps_of(data: &Data<'_>, plateaus: &[Plateau]) -> (Vec<Step>, Vec<(f64, Direction)>) {
    let mut groups: Vec<(f64, Direction)> = Vec::new();
    let mut steps = Vec::new();
    for (k, pair) in plateaus.windows(2).enumerate() {
        let [before, to] = pair else { continue };
        let (true, Some(direction)) = (usable(before, to), to.direction) else {
            continue;
        };
        let same = |g: &(f64, Direction)| g.1 == direction && (g.0 - to.command).abs() <= SAME_LEVEL;
        let group = groups.iter().position(same).unwrap_or_else(|| {
            groups.push((to.command, direction));
            groups.len() - 1
        });
        let change = to.rows.start;
        let ahead = change.saturating_sub(ROWS_BEFORE).max(before.rows.start);
        let level = mean_and_std(&data.y[ahead..change]).0;
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

/// Standard deviation of the onsets beyond what their own uncertainty explains (moments).
fn onset_spread(problem: &Problem<'_>, rough: &Solution) -> f64 {
    let onsets: Vec<f64> = (0..problem.steps.len()).map(|k| rough.parameters[problem.onset(k)]).collect();
    let std = mean_and_std(&onsets).1;
    let variance_of = |k: usize| {
        let at = problem.onset(k);
        rough.unit_covariance.as_ref().map_or(0.0, |c| c[(at, at)])
    };
    // A free onset's variance is that of its step and of the delay it is counted from; the latter, common
    // to all, is what the ties leave: the spread of the ties over the number of steps.
    let common = problem.onset_std_s * problem.onset_std_s / onsets.len() as f64;
    let own = (0..onsets.len()).map(|k| (variance_of(k) - common).max(0.0)).sum::<f64>() / onsets.len() as f64;
    (std * std - own).max(0.0).sqrt()
}

/// Noise of each step in response units: that of the settled response, or what the fit leaves in its
/// window where that is more, so that misfit widens the intervals.
fn noise_with_misfit(problem: &Problem<'_>, residuals: &[f64]) -> Vec<f64> {
    let mut at = 0;
    problem
        .steps
        .iter()
        .map(|step| {
            let n = step.rows.len();
            let own = &residuals[at..at + n];
            at += n;
            let sum = own.iter().map(|r| r * r).sum::<f64>();
            // Two levels, an onset and a time constant were fitted to them.
            let rms = (sum / n.saturating_sub(PER_STEP + 1).max(1) as f64).sqrt();
            step.noise * rms.max(1.0)
        })
        .collect()
}

fn results(problem: &Problem<'_>, solution: &Solution, groups: &[(f64, Direction)], correlation: &[f64]) -> LagFit {
    let windows: Vec<usize> = problem.steps.iter().map(|s| s.rows.len()).collect();
    let covariance = solution.covariance_of(&correlated(solution, &windows, correlation));
    let estimate = |at: usize| Estimate {
        value: solution.parameters[at],
        std: covariance.as_ref().map_or(f64::INFINITY, |c| c[(at, at)].max(0.0).sqrt()),
    };
    let groups = groups
        .iter()
        .enumerate()
        .map(|(g, &(command, direction))| {
            let log = estimate(problem.time_constant(g));
            let time_constant_s = log.value.exp();
            Group {
                command,
                direction,
                time_constant_s: Estimate { value: time_constant_s, std: time_constant_s * log.std },
                fit_percent: percent_of_group(problem, &solution.residuals, g),
            }
        })
        .collect();
    let steps = problem
        .steps
        .iter()
        .enumerate()
        .map(|(k, step)| FittedStep {
            plateau: step.plateau,
            group: step.group,
            level: step.after * solution.parameters[problem.level(k)],
            delay_s: solution.parameters[DELAY] + solution.parameters[problem.onset(k)],
        })
        .collect();
    LagFit { groups, delay_s: estimate(DELAY), curvature: estimate(CURVATURE), onset_std_s: problem.onset_std_s, steps }
}

/// `100 (1 - ||y - yhat|| / ||y - mean(y)||)` over the windows of a group's steps, each about its own
/// mean.
fn percent_of_group(problem: &Problem<'_>, residuals: &[f64], group: usize) -> f64 {
    let (mut left, mut all, mut at) = (0.0, 0.0, 0);
    for step in problem.steps {
        let n = step.rows.len();
        if step.group == group {
            let kept: Vec<f64> =
                step.rows.clone().filter(|&i| !problem.data.spike[i]).map(|i| problem.data.y[i]).collect();
            let (_, std) = mean_and_std(&kept);
            all += std * std * (kept.len().saturating_sub(1)) as f64;
            let own = residuals[at..at + n].iter();
            left += own.map(|r| r * r).sum::<f64>() * step.noise * step.noise;
        }
        at += n;
    }
    100.0 * (1.0 - (left / all).sqrt())
}
