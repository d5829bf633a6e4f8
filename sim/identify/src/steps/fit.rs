//! The output-error fit of the lag to the steps of a record.
//!
//! Each step is simulated over a window from a few rows before it to a few time constants after it, and all
//! steps are fitted at once. Their parameters:
//!
//! - one delay and one curvature `k` ([`super::response`]) for the record;
//! - one time constant per level and direction, as its logarithm;
//! - per step the levels before and after it, as slow drift would otherwise bend the time constants;
//! - per step an *onset*, how much earlier or later than the record's delay it began. The log says in
//!   which row the command had changed, not when, and an ESC or a stand takes a command over once per
//!   frame of its own. With one delay for all steps this leaks into the time constants: in a stand's log of
//!   7 ms rows and 20 ms frames it makes neighbors differ by a factor of two. Onsets have mean zero and a standard deviation that is
//!   estimated from the record, and enter the sum of squares as such (random effects; the sum is then
//!   minus twice the logarithm of the joint density).
//!
//! The curvature has a Gaussian prior of mean zero and standard deviation 1/2, the most that drag can make of it, so that a
//! record of small steps only, which say nothing of it, still has a solution.

use rotorlead_numerics::least_squares::{Limits, Solution, minimize};
use rotorlead_numerics::sample::{mean, median, variance};

use super::StepsError;
use super::plateaus::{Direction, Plateau};
use super::problem::{CURVATURE, DELAY, Data, PER_STEP, Problem, steps_of};
use super::uncertainty::{correlated, correlation};
use crate::Estimate;
use crate::fit_percent::{percent_when_left, spread};

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

/// Length of a window in units of the median time to 63 % of a step, which includes the delay.
const WINDOW: f64 = 8.0;
/// Onsets in the first pass, in which they are nearly free, seconds.
const FREE_ONSET_STD_S: f64 = 0.02;
/// Fits all usable steps between the plateaus of a run. `frame_s` is the ESC's frame, where known.
///
/// Two passes: the first with nearly free onsets and the noise of the settled response; from its
/// residuals come the noise of each step, model error included, and the spread of the onsets for the second.
pub(super) fn fit(data: &Data<'_>, plateaus: &[Plateau], frame_s: f64) -> Result<LagFit, StepsError> {
    let (mut steps, groups) = steps_of(data, plateaus);
    let Some(rise_s) = median(steps.iter().map(|s| s.rise_s)) else {
        return Err(StepsError::NoUsableStep { record: data.name.into() });
    };
    for step in &mut steps {
        let end = data.time_s[step.change] + WINDOW * rise_s;
        let rows = data.time_s[step.rows.clone()].partition_point(|&t| t < end);
        step.rows.end = step.rows.start + rows;
    }
    let intervals: Vec<f64> = data.time_s.windows(2).map(|w| w[1] - w[0]).collect();
    let row_s = mean(&intervals);
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
    let noise = noise_with_model_error(&first, &rough.residuals);
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

/// Standard deviation of the onsets beyond what their own uncertainty explains (moments).
fn onset_spread(problem: &Problem<'_>, rough: &Solution) -> f64 {
    let onsets: Vec<f64> = (0..problem.steps.len()).map(|k| rough.parameters[problem.onset(k)]).collect();
    let std = variance(&onsets).sqrt();
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
/// window where that is more, so that the model's error widens the intervals.
fn noise_with_model_error(problem: &Problem<'_>, residuals: &[f64]) -> Vec<f64> {
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
    let estimate = |at: usize| {
        let std = covariance.as_ref().map_or(f64::INFINITY, |c| c[(at, at)].max(0.0).sqrt());
        Estimate::normal(solution.parameters[at], std)
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
                time_constant_s: Estimate::normal(time_constant_s, time_constant_s * log.std),
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

/// % fit over the windows of a group's steps, each about its own mean.
fn percent_of_group(problem: &Problem<'_>, residuals: &[f64], group: usize) -> f64 {
    let (mut left, mut all, mut at) = (0.0, 0.0, 0);
    for step in problem.steps {
        let n = step.rows.len();
        if step.group == group {
            let kept: Vec<f64> =
                step.rows.clone().filter(|&i| !problem.data.spike[i]).map(|i| problem.data.y[i]).collect();
            all += spread(&kept);
            let own = residuals[at..at + n].iter();
            left += own.map(|r| r * r).sum::<f64>() * step.noise * step.noise;
        }
        at += n;
    }
    percent_when_left(left, all)
}
