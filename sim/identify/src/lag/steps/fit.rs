//! The output-error fit of the lag to the steps of a record.
//!
//! Each step is simulated over a window from a few rows before it to a few time constants after it, and up to [`BATCH`]
//! steps are fitted at once. Their parameters:
//!
//! - one delay and one curvature `k` ([`super::response`]) for all of them;
//! - per step the time constant, as its logarithm;
//! - per step the levels before and after it, as slow drift would otherwise bend the time constants;
//! - per step an *onset*, how much earlier or later than the common delay it began. The log says in
//!   which row the command had changed, not when, and an ESC or a stand takes a command over once per
//!   frame of its own. With one delay for all steps this leaks into the time constants: in a stand's log of
//!   7 ms rows and 20 ms frames it makes neighbors differ by a factor of two. Onsets have mean zero and a standard deviation that is
//!   estimated from the record, and enter the sum of squares as such (random effects; the sum is then
//!   minus twice the logarithm of the joint density).
//!
//! The curvature has a Gaussian prior about the middle of what drag can make of it, so that a
//! record of small steps only, which say nothing of it, still has a solution; where it comes out beyond that range, the end
//! of the range is taken. Left free, it bends to whatever starts a response gently, a second lag or a filter of the speed,
//! and takes that from the time constants.
//!
//! # Stamps of the command
//! A log that repeats a command every `T` seconds stamps its change late by 0 to `T`, on average by `T / 2`, with a variance of `T^2 / 12`.
//! What of that the onsets do not show as scatter between steps, as where both clocks keep their phase, is common to all steps: it stands
//! in the delay's interval and does not shrink with their number.

use rayon::iter::{IntoParallelIterator as _, ParallelIterator as _};
use rotorlead_numerics::least_squares::{Damping, Decrease, NormalEquations as _, SearchEnd, Strategy, search};
use rotorlead_numerics::normal_equations::scaled_inverse;
use rotorlead_numerics::sample::{mean, median, variance};

use nalgebra::{DMatrix, DVector};
use rotorlead_plant::Lagged;

use super::problem::{CURVATURE, DELAY, Evaluation, Linearization, StepLaw, StepProblem, Window};
use super::step::{Step, StepFault, StepLag};
use super::uncertainty::{correlated, correlation};
use super::weights::{weigh, window};
use super::{Run, StepsError};
use crate::estimate::Estimate;
use crate::goodness_of_fit::{percent_with_residual, spread};
use crate::rows::gaps::rows_after_gaps;
use crate::rows::resolution::resolution;

/// Most steps that are fitted at once. Chosen: the solve takes time with the cube of the steps, and 24 know their common delay five times,
/// `sqrt(24)`, as well as one; half or double changes little.
const BATCH: usize = 24;
/// Most steps that are fitted: four batches. Chosen: a delay is then known ten times as well as by one step; time goes with the steps.
const MOST_STEPS: usize = 96;
/// Length of a window in units of the median time to 63 % of a step, which includes the delay. Chosen: 0.03 %, `e^-8`, of a step is then
/// still to come; shorter ones confuse level and time constant, longer ones bring drift.
const WINDOW: f64 = 8.0;
/// Onsets in the first pass, in which they are nearly free, seconds. Chosen: a whole frame of a 50 Hz ESC, `sqrt(12)` times the standard
/// deviation of an onset within it.
pub(super) const FREE_ONSET_STD_S: f64 = 0.02;
/// The least by which a command's own stamps are off, seconds. Chosen: few loggers stamp to better than a tenth of a millisecond, and none
/// at all makes an infinite weight.
const LEAST_CHANGE_STD_S: f64 = 1e-4;
/// The least and the most that drag makes of the curvature. Derived: none, and `0.5 * 1.4`, as `c R` is at most half the rate at the
/// highest level, which is seldom more than 1.4 times the usual one.
const CURVATURES: (f64, f64) = (0.0, 0.7);
/// Its Gaussian prior, mean and standard deviation. Derived: the mean is the middle of a motor's 0 to 0.5. Chosen: twice that, which hardly
/// holds it; a narrower one decides where the steps do not.
pub(super) const CURVATURE_KNOWN: (f64, f64) = (0.25, 0.5);
/// From here on it is one. Chosen: it changes the middle of the largest step by 2 %, `0.5 / (1 + 0.5 k)` in place of 0.5.
const LEAST_CURVATURE: f64 = 0.1;
/// Standard deviation by which it is held to an end of its range. Chosen: far below [`LEAST_CURVATURE`], and far above what would
/// cost the normal equations digits.
const CURVATURE_HELD_STD: f64 = 1e-4;
/// The curvature of a first-order lag, held so.
pub(super) const FIRST_ORDER: (f64, f64) = (0.0, CURVATURE_HELD_STD);

/// What is common to all steps.
pub(super) struct LagFit {
    pub(super) delay_s: Estimate,
    pub(super) curvature: Estimate,
    pub(super) lagged: Lagged,
    /// [`StepLaw::bend_per_s`] of it.
    pub(super) bend_per_s: f64,
    /// Standard deviation of the onsets, seconds.
    pub(super) onset_std_s: f64,
    /// How much before its command a response may seem to move, seconds: the command's stamp is late by so much at most.
    pub(super) most_lead_s: f64,
    /// Standard deviation of time stamps, seconds.
    pub(super) stamp_std_s: f64,
    /// What the first pass leaves, and what the fit does.
    pub(super) first_chi_square: ChiSquare,
    pub(super) chi_square: ChiSquare,
    /// Covariance of the logarithms of the time constants of the steps that have a lag, in their order.
    pub(super) covariance: DMatrix<f64>,
    /// What the same logarithms are off by where all levels are off by a standard deviation of their resolution.
    pub(super) resolution_shift: DVector<f64>,
}

impl LagFit {
    /// Whether large steps are known not to be those of a first-order lag, with this probability. At an end of its range a curvature is held
    /// there.
    pub(super) fn is_curved(&self, probability: f64) -> bool {
        self.curvature.value > LEAST_CURVATURE && self.curvature.interval(probability).0 > 0.0
    }
}

/// A sum of squares in units of the noise of settled rows.
#[derive(Clone, Copy, Debug)]
pub(super) struct ChiSquare {
    sum: f64,
    rows: usize,
}

impl ChiSquare {
    /// Twice the logarithm of the likelihood ratio of another fit of the same rows to this one, in units of what the better of the two
    /// leaves, where that is more than the noise.
    pub(super) fn gain_of(self, other: Self) -> f64 {
        (self.sum - other.sum) / (self.sum.min(other.sum) / self.rows.max(1) as f64).max(1.0)
    }
}

/// The rows of a record.
pub(super) struct StepRows<'a> {
    pub(super) name: &'a str,
    pub(super) time_s: &'a [f64],
    /// The response, free of spikes.
    pub(super) y: &'a [f64],
    /// Rows that say nothing: spikes, and repeats of the reading before.
    pub(super) without_reading: &'a [bool],
    /// Over how long each reading is the mean, seconds; 0 for a momentary value.
    pub(super) mean_s: f64,
    /// What is taken to lag, and what is known of its curvature beforehand: mean and standard deviation.
    pub(super) lagged: Lagged,
    pub(super) curvature: (f64, f64),
    /// How late the command's own stamps may be, seconds, where it has them.
    pub(super) late_s: Option<f64>,
}

/// Fits the steps that have no fault. `frame_s` is the ESC's frame, where known.
///
/// Two passes: the first with nearly free onsets and the noise of the settled response; from its
/// residuals come the noise of the stamps and of each step, model error included, and the spread of the onsets for the second.
pub(super) fn fit(data: &StepRows<'_>, runs: &[Run], steps: &mut [Step], frame_s: f64) -> Result<LagFit, StepsError> {
    leave_out_the_many(steps);
    let used: Vec<usize> = (0..steps.len()).filter(|&k| steps[k].fault.is_none()).collect();
    let Some(rise_s) = median(used.iter().map(|&k| rise_s(data, &steps[k]))) else {
        return Err(StepsError::NoUsableStep { record: data.name.into(), reasons: reasons(steps) });
    };
    for &k in &used {
        let step = &mut steps[k];
        let end = step.at_s + WINDOW * rise_s;
        step.window.end = step.window.start + data.time_s[step.window.clone()].partition_point(|&t| t < end);
    }
    let row_s = (data.time_s[data.time_s.len() - 1] - data.time_s[0]) / (data.time_s.len() - 1) as f64;
    // Uniform within a row, unless the command has stamps of its own, and within a frame.
    let change_std_s = uniform_std(data.late_s.unwrap_or(row_s)).max(LEAST_CHANGE_STD_S);
    let least_onset_std_s = change_std_s.hypot(uniform_std(frame_s));
    let plateaus = || runs.iter().flat_map(|run| &run.plateaus);
    let highest = plateaus().map(|plateau| plateau.mean).fold(f64::MIN_POSITIVE, f64::max);
    let law = StepLaw { lagged: data.lagged, reference: data.lagged.at_response(highest), usual_s: rise_s };
    let resolution = resolution(data.y);
    let after_gaps = rows_after_gaps(data.time_s);
    let pairs = || runs.iter().flat_map(|run| run.plateaus.windows(2));
    let mut windows: Vec<Window> =
        used.iter().map(|&k| window(data, pairs(), &steps[k], &after_gaps, resolution)).collect();

    let batches = windows.len().div_ceil(windows.len().div_ceil(BATCH));
    let first_onset_std_s = FREE_ONSET_STD_S.max(least_onset_std_s);
    let rough: Vec<Fitted> = windows
        .chunks(batches)
        .collect::<Vec<_>>()
        .into_par_iter()
        .map(|steps| {
            first_pass(
                &StepProblem { steps, onset_std_s: first_onset_std_s, curvature: data.curvature, law },
                rise_s,
                data.half_late_s(),
            )
        })
        .collect::<Option<_>>()
        .ok_or_else(|| StepsError::NotConverged { record: data.name.into(), iterations: 0 })?;
    let of_onsets = windows.chunks(batches).zip(&rough).map(|(steps, rough)| {
        let problem = StepProblem { steps, onset_std_s: first_onset_std_s, curvature: data.curvature, law };
        (onset_variance(&problem, rough), steps.len() as f64)
    });
    let (sum, count) =
        of_onsets.fold((0.0, 0.0), |(sum, count), (variance, steps)| (sum + variance * steps, count + steps));
    let onset_variance = sum / count;
    let onset_std_s = onset_variance.sqrt().max(least_onset_std_s);
    let shown_variance = (onset_variance - uniform_std(frame_s).powi(2)).max(0.0);
    let common_std_s = data.late_s.map_or(0.0, |late_s| (uniform_std(late_s).powi(2) - shown_variance).max(0.0).sqrt());
    let left: f64 = rough.iter().flat_map(|fitted| fitted.at.residuals.iter().flatten()).map(|r| r * r).sum();
    let rows = windows.iter().flat_map(|window| &window.weight).filter(|weight| **weight > 0.0).count();
    let first_chi_square = ChiSquare { sum: left, rows };
    let stamp_std_s = weigh(&mut windows, batches, &rough, law, row_s);

    let curvature = {
        let of_batches: Vec<f64> = rough.iter().map(|fitted| fitted.at.parameters[CURVATURE]).collect();
        let (least, most) = CURVATURES;
        match median(of_batches) {
            Some(beyond) if beyond < least => (least, CURVATURE_HELD_STD),
            Some(beyond) if beyond > most => (most, CURVATURE_HELD_STD),
            _ => data.curvature,
        }
    };
    let fits: Vec<Fitted> = windows
        .chunks(batches)
        .zip(rough)
        .collect::<Vec<_>>()
        .into_par_iter()
        .map(|(steps, rough)| {
            Fitted::from(&StepProblem { steps, onset_std_s, curvature, law }, rough.at.parameters, LIMITS)
        })
        .map(|fitted| fitted.filter(|fitted| fitted.converged))
        .collect::<Option<_>>()
        .ok_or_else(|| StepsError::NotConverged { record: data.name.into(), iterations: LIMITS.iterations })?;
    let correlation = correlation(data.y, plateaus());
    let residuals = fits.iter().flat_map(|fitted| &fitted.at.residuals);
    let left = windows.iter().zip(residuals).map(|(window, r)| window.excess * r.iter().map(|r| r * r).sum::<f64>());
    let chi_square = ChiSquare { sum: left.sum(), rows };
    let mut result = LagFit {
        delay_s: Estimate::normal(0.0, 0.0),
        curvature: Estimate::normal(0.0, 0.0),
        lagged: law.lagged,
        bend_per_s: 0.0,
        onset_std_s,
        most_lead_s: data.late_s.map_or(row_s, |_| data.half_late_s()),
        stamp_std_s,
        first_chi_square,
        chi_square,
        covariance: DMatrix::zeros(windows.len(), windows.len()),
        resolution_shift: DVector::zeros(windows.len()),
    };
    let (mut delays, mut curvatures) = (Vec::new(), Vec::new());
    let (mut delay_shifts, mut curvature_shifts) = (Vec::new(), Vec::new());
    for (batch, (problem, fitted)) in
        windows.chunks(batches).map(|steps| StepProblem { steps, onset_std_s, curvature, law }).zip(&fits).enumerate()
    {
        let covariance = fitted.covariance(&problem, &correlation);
        let shift = fitted.shift_by_resolution(&problem).unwrap_or_else(|| DVector::zeros(fitted.at.parameters.len()));
        delay_shifts.push(shift[DELAY]);
        curvature_shifts.push(shift[CURVATURE]);
        let own: Vec<usize> = (batch * batches..windows.len()).take(batches).collect();
        let p = &fitted.at.parameters;
        let std = |at: usize| covariance.as_ref().map_or(f64::INFINITY, |c| c[(at, at)].max(0.0).sqrt());
        delays.push(Estimate::normal(p[DELAY], std(DELAY)));
        curvatures.push(Estimate::normal(p[CURVATURE], std(CURVATURE)));
        for (i, &step) in own.iter().enumerate() {
            result.resolution_shift[step] = shift[StepProblem::time_constant_index(i)];
            for (j, &other) in own.iter().enumerate() {
                let (a, b) = (StepProblem::time_constant_index(i), StepProblem::time_constant_index(j));
                let unknown = if i == j { f64::INFINITY } else { 0.0 };
                result.covariance[(step, other)] = covariance.as_ref().map_or(unknown, |c| c[(a, b)]);
            }
            let tau_s = p[StepProblem::time_constant_index(i)].exp();
            let window = &problem.steps[i];
            steps[used[step]].lag = Some(StepLag {
                time_constant_s: Estimate::normal(tau_s, tau_s * std(StepProblem::time_constant_index(i))),
                delay_s: p[DELAY] + p[StepProblem::onset_index(i)],
                after: window.after * p[StepProblem::level_index(i)],
                before: window.before * p[StepProblem::level_before_index(i)],
                fit_percent: percent(window, &problem, i, p),
                bend: law.bend_per_s(p[CURVATURE]) * tau_s,
                lagged: law.lagged,
                mean_s: data.mean_s,
            });
        }
    }
    let with = |estimate: Estimate, common: f64| Estimate { std: estimate.std.hypot(common), ..estimate };
    result.delay_s = with(pooled(&delays), common_std_s.hypot(mean(&delay_shifts)));
    let curvature = with(pooled(&curvatures), mean(&curvature_shifts));
    result.bend_per_s = law.bend_per_s(curvature.value);
    let taus = steps.iter().filter_map(|step| Some(step.lag?.time_constant_s.value));
    let scale = median(taus).unwrap_or(law.usual_s) / law.usual_s;
    result.curvature = Estimate::normal(scale * curvature.value, scale * curvature.std);
    Ok(result)
}

/// The response has a kink where a step begins, and moving it across a row leaves the search zigzagging by
/// ever less. A sum of squares in units of the noise has about one per row, so a decrease by this share, a
/// few thousandths, moves no parameter by a tenth of its standard error. The iterations are chosen: they bound that zigzag, and a search
/// that needs more is refused.
const LIMITS: StoppingCriteria = StoppingCriteria { iterations: 200, decrease: 1e-6 };

/// Enough to tell which start is in the right basin. Chosen: only the best start is searched on to [`LIMITS`]; more
/// iterations cost time, fewer may take a wrong basin.
const FIRST_LOOK: StoppingCriteria = StoppingCriteria { iterations: 10, decrease: 1e-3 };

/// When a search stops.
#[derive(Clone, Copy)]
struct StoppingCriteria {
    iterations: usize,
    decrease: f64,
}

/// A batch of steps as fitted.
pub(super) struct Fitted {
    pub(super) at: Evaluation,
    pub(super) linearization: Linearization,
    converged: bool,
}

impl Fitted {
    fn from(problem: &StepProblem<'_>, start: Vec<f64>, limits: StoppingCriteria) -> Option<Self> {
        let strategy = Strategy {
            iterations: limits.iterations,
            decrease: Decrease::Relative(limits.decrease),
            damping: Damping::GainRatio,
            reuses_jacobian: false,
        };
        let SearchEnd { at, linearization, converged, .. } = search(problem, problem.at(start)?, &strategy)?;
        Some(Self { at, linearization, converged })
    }

    /// Covariance of the parameters when the noise has a color (the sandwich, Ljung, section 9.4).
    fn covariance(&self, problem: &StepProblem<'_>, correlation: &[f64]) -> Option<DMatrix<f64>> {
        let unit = scaled_inverse(&self.linearization.matrix, 0.0)?;
        let blocks = self.linearization.blocks.iter().zip(problem.steps);
        let filling =
            blocks.map(|(block, window)| block.tr_mul(&correlated(block, correlation, &window.stamp_variance)));
        Some(&unit * problem.assemble_normal_matrix(filling) * &unit)
    }

    /// What the parameters are off by where all readings that stand on a level are off by a standard deviation of their common error.
    fn shift_by_resolution(&self, problem: &StepProblem<'_>) -> Option<DVector<f64>> {
        let unit = scaled_inverse(&self.linearization.matrix, 0.0)?;
        let mut right = DVector::zeros(unit.nrows());
        for (k, (block, window)) in self.linearization.blocks.iter().zip(problem.steps).enumerate() {
            let off = window.weight.iter().zip(&window.common_std).map(|(weight, std)| weight * std);
            let local = block.tr_mul(&DVector::from_iterator(block.nrows(), off));
            for (place, value) in local.iter().enumerate() {
                right[StepProblem::global_index(k, place)] += value;
            }
        }
        Some(unit * right)
    }
}

fn first_pass(problem: &StepProblem<'_>, rise_s: f64, half_late_s: f64) -> Option<Fitted> {
    let mut best: Option<Fitted> = None;
    // The delay's basin is about a time constant wide, so start within and beyond it: from no delay to 0.8 of the rise. The time constant
    // is the rest of the rise. Chosen: 0.9 of the share keeps it above zero, 0.28 of the rise at the last.
    for share in [0.0, 0.4, 0.8] {
        let mut start = vec![share * rise_s - half_late_s, problem.curvature.0];
        let log_tau = ((1.0 - 0.9 * share) * rise_s).ln();
        start.extend(problem.steps.iter().flat_map(|_| [1.0, 1.0, 0.0, log_tau]));
        if let Some(look) = Fitted::from(problem, start, FIRST_LOOK)
            && best.as_ref().is_none_or(|b| problem.sum_of_squares(&look.at) < problem.sum_of_squares(&b.at))
        {
            best = Some(look);
        }
    }
    Fitted::from(problem, best?.at.parameters, LIMITS)
}

/// Of very many steps, some are fitted that are spread evenly over operating points, directions and time.
fn leave_out_the_many(steps: &mut [Step]) {
    let mut usable: Vec<usize> = (0..steps.len()).filter(|&k| steps[k].fault.is_none()).collect();
    let count = usable.len();
    if count <= MOST_STEPS {
        return;
    }
    usable.sort_by(|&a, &b| {
        let key = |k: usize| (steps[k].to > steps[k].from, k);
        steps[a].to.total_cmp(&steps[b].to).then(key(a).cmp(&key(b)))
    });
    for (place, k) in usable.into_iter().enumerate() {
        // Whether a multiple of `count` is passed on the way to the next place.
        let is_kept = (place + 1) * MOST_STEPS / count > place * MOST_STEPS / count;
        if !is_kept {
            steps[k].fault = Some(StepFault::NotNeeded);
        }
    }
}

/// How many steps are left out for which reason, most first.
fn reasons(steps: &[Step]) -> String {
    let mut counts: Vec<(String, usize)> = Vec::new();
    for fault in steps.iter().filter_map(|step| step.fault) {
        let reason = fault.to_string();
        match counts.iter_mut().find(|(known, _)| *known == reason) {
            Some((_, count)) => *count += 1,
            None => counts.push((reason, 1)),
        }
    }
    counts.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
    // Chosen: more than three do not fit a message.
    let said: Vec<String> = counts.iter().take(3).map(|(reason, count)| format!("{count}: {reason}")).collect();
    said.join("; ")
}

/// Standard deviation of what is anywhere within a range.
fn uniform_std(range: f64) -> f64 {
    range / 12.0_f64.sqrt()
}

impl StepRows<'_> {
    /// How much before its moment a command may have changed, seconds.
    fn half_late_s(&self) -> f64 {
        0.5 * self.late_s.unwrap_or(0.0)
    }
}

/// Time from the earliest that the command may have changed to 63 % of the step, seconds.
fn rise_s(data: &StepRows<'_>, step: &Step) -> f64 {
    let target = step.before + (1.0 - (-1.0f64).exp()) * (step.after - step.before);
    let rising = step.after > step.before;
    let from_s = step.at_s - data.half_late_s();
    let first = data.time_s.partition_point(|time| *time < from_s).max(step.window.start + 1);
    let risen = (first..step.window.end).find(|&i| (data.y[i] > target) == rising).unwrap_or(first);
    (data.time_s[risen] - from_s).max(from_s - data.time_s[first - 1])
}

/// Variance of the onsets beyond what their own uncertainty explains (moments).
fn onset_variance(problem: &StepProblem<'_>, rough: &Fitted) -> f64 {
    let steps = problem.steps.len();
    let onsets: Vec<f64> = (0..steps).map(|k| rough.at.parameters[StepProblem::onset_index(k)]).collect();
    let unit = scaled_inverse(&rough.linearization.matrix, 0.0);
    let variance_of =
        |k: usize| unit.as_ref().map_or(0.0, |c| c[(StepProblem::onset_index(k), StepProblem::onset_index(k))]);
    // A free onset's variance is that of its step and of the delay it is counted from; the latter, common
    // to all, is what the ties leave: the spread of the ties over the number of steps.
    let common = problem.onset_std_s * problem.onset_std_s / steps as f64;
    let own = (0..steps).map(|k| (variance_of(k) - common).max(0.0)).sum::<f64>() / steps as f64;
    (variance(&onsets) - own).max(0.0)
}

/// The mean of estimates of one number, by their variances.
fn pooled(estimates: &[Estimate]) -> Estimate {
    if let [one] = estimates {
        return *one;
    }
    let (mut sum, mut weights) = (0.0, 0.0);
    for estimate in estimates.iter().filter(|estimate| estimate.std.is_finite()) {
        let weight = estimate.std.powi(-2);
        sum += weight * estimate.value;
        weights += weight;
    }
    Estimate::normal(sum / weights, weights.sqrt().recip())
}

/// % fit over a window about its own mean.
fn percent(window: &Window, problem: &StepProblem<'_>, step: usize, p: &[f64]) -> f64 {
    let mut response = vec![0.0; window.y.len()];
    let _ = problem.response(step, p, &mut response);
    let kept = |row: &usize| window.weight[*row] > 0.0;
    let y: Vec<f64> = (0..window.y.len()).filter(kept).map(|row| window.y[row]).collect();
    let left = (0..window.y.len()).filter(kept).map(|row| (window.y[row] - response[row]).powi(2)).sum();
    percent_with_residual(left, spread(&y))
}
