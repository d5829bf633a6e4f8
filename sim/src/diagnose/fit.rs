//! Least squares of white residuals over all records at once.
//!
//! Each record's residual depends on its own lag and on the effects, so derivatives are taken record by record and summed
//! up into the normal equations: memory does not grow with the number of records. The step is Levenberg's and Marquardt's.

use nalgebra::{Cholesky, DMatrix, DVector, Matrix2, Vector2};
use num_complex::Complex64;
use rayon::prelude::*;

use super::hypothesis::{Candidate, Coordinate, Hypothesis, slope};
use super::trial::{Purpose, Trial, Trials};
use crate::plant::effect::{Site, Use};

/// Most steps of a search.
pub(super) const MOST_STEPS: usize = 25;
/// A search ends where a step gains less than this in the sum of squares: a twentieth of what one parameter gains by chance.
const ENOUGH: f64 = 0.05;
/// Standard deviations of an interval of 95 %.
const TWO_SIDED: f64 = 1.96;
/// Steps for derivatives, in coordinates.
const SMOOTH_STEP: f64 = 1e-4;
const EFFECT_STEP: f64 = 2e-3;
/// That of effects in the end: where many commands come to a limit or leave it, a derivative over a longer way is another one.
const FINE_STEP: f64 = 1e-4;
/// How far it is looked around for a better place where the misfit has kinks, in coordinates, and how often.
const LOOKS: [f64; 5] = [0.03, 0.01, 3e-3, 1e-3, 3e-4];
const MOST_LOOKS: usize = 8;

/// A hypothesis fitted to the records.
#[derive(Clone, Debug)]
pub(super) struct Fit {
    /// With the values that fit best.
    pub hypothesis: Hypothesis,
    /// Sum of squares of the white residual over what is fitted.
    pub misfit: f64,
    /// What was searched.
    pub coordinates: Vec<Coordinate>,
    /// Covariance of the coordinates.
    pub covariance: Option<DMatrix<f64>>,
}

/// Derivatives at a hypothesis, for judging others next to it without a search.
pub(super) struct Tangent {
    coordinates: Vec<Coordinate>,
    records: Vec<RecordTangent>,
    matrix: DMatrix<f64>,
}

/// White columns of one record with the places of their coordinates.
struct RecordTangent {
    columns: Vec<(usize, Vec<Complex64>)>,
}

fn dot(a: &[Complex64], b: &[Complex64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.re * b.re + a.im * b.im).sum()
}

/// The white residual of one record over its stretches of a purpose. The state from which the record starts is not
/// compared: its decay is projected out.
pub(super) fn residual(
    trials: &Trials,
    trial: &Trial,
    hypothesis: &Hypothesis,
    purpose: Purpose,
) -> Option<Vec<Complex64>> {
    if let Some(log) = &trial.log {
        let tau_s = hypothesis.base[trial.point].time_constant_s;
        let (difference, trace) = hypothesis.seen(trials, trial)?;
        let white = log.white(purpose, &difference, &trial.time_s, tau_s);
        let beside = trial.channels.iter().flat_map(|channel| channel.white(trial, purpose, &trace));
        return Some(white.into_iter().chain(beside).map(Complex64::from).collect());
    }
    let rows = trial.end_of(Some(purpose));
    let simulated = hypothesis.simulate(trials, trial, rows).ok()?;
    let difference: Vec<f64> = trial.measured.iter().zip(&simulated).map(|(y, model)| y - model).collect();
    Some(whiten(trial, hypothesis, purpose, &difference))
}

fn whiten(trial: &Trial, hypothesis: &Hypothesis, purpose: Purpose, difference: &[f64]) -> Vec<Complex64> {
    let mut all = Vec::new();
    for stretch in trial.stretches.iter().filter(|stretch| stretch.purpose == purpose) {
        let mut white = stretch.whitening.apply(&difference[stretch.rows.clone()]);
        if stretch.rows.start == 0 {
            let tau_s = hypothesis.base[trial.point].time_constant_s;
            let decay = stretch.whitening.apply_to_decay((-1.0 / (trial.rate_hz * tau_s)).exp());
            let share = dot(&decay, &white) / dot(&decay, &decay);
            if share.is_finite() {
                white.iter_mut().zip(&decay).for_each(|(white, decay)| *white -= decay * share);
            }
        }
        all.append(&mut white);
    }
    all
}

/// What a search pays for values away from where the effects are not: weight and distance of each coordinate that is tied.
/// Only on a part of the records, which may not determine all of them.
fn ties(trials: &Trials, hypothesis: &Hypothesis, coordinates: &[Coordinate]) -> Vec<(usize, f64, f64)> {
    if !trials.is_part {
        return Vec::new();
    }
    let tie = |(place, coordinate): (usize, &Coordinate)| {
        let (null, std) = hypothesis.tie(*coordinate)?;
        Some((place, std.powi(-2), hypothesis.get(*coordinate) - null))
    };
    coordinates.iter().enumerate().filter_map(tie).collect()
}

/// Part of a row by which the stamps of a record may be off in the mean.
const STAMPS_OFF: f64 = 0.005;

/// How far the rows of the records leave the alignment open. A command takes effect at its row and the response is that of
/// its row's moment, so what is left is a logger's own jitter, whose mean over a record is small. Of a log nobody knows where
/// in its interval a row was taken: a uniform error of one row has this standard deviation.
fn late_std(trials: &Trials) -> f64 {
    let longest = |part: f64, are_logs: bool| {
        let there = trials.trials.iter().filter(|trial| trial.log.is_some() == are_logs);
        there.map(|trial| part / trial.rate_hz).reduce(f64::max)
    };
    longest(STAMPS_OFF, false).or_else(|| longest(12_f64.sqrt().recip(), true)).unwrap_or(f64::INFINITY)
}

/// Sum of squares over what is for `purpose`. `None` where the hypothesis is impossible.
pub(super) fn misfit(trials: &Trials, hypothesis: &Hypothesis, purpose: Purpose) -> Option<f64> {
    let parts: Option<Vec<f64>> = trials
        .trials
        .par_iter()
        .filter(|trial| trial.end_of(Some(purpose)) > 0)
        .map(|trial| residual(trials, trial, hypothesis, purpose).map(|white| dot(&white, &white)))
        .collect();
    let sum = parts?.iter().sum::<f64>() + (hypothesis.late_s / late_std(trials)).powi(2);
    sum.is_finite().then_some(sum)
}

/// Minus twice the log likelihood of what is for `purpose`, but for a constant: [`misfit`], and of records that do not repeat that
/// with the errors that they are left with.
pub(super) fn surprise(trials: &Trials, hypothesis: &Hypothesis, purpose: Purpose) -> Option<f64> {
    let of_trial = |trial: &Trial| {
        let Some(log) = &trial.log else {
            return residual(trials, trial, hypothesis, purpose).map(|white| dot(&white, &white));
        };
        let (difference, trace) = hypothesis.seen(trials, trial)?;
        let tau_s = hypothesis.base[trial.point].time_constant_s;
        let channels: f64 = trial.channels.iter().map(|channel| channel.surprise(trial, purpose, &trace)).sum();
        Some(log.surprise(purpose, &difference, &trial.time_s, tau_s) + channels)
    };
    let compared = trials.trials.par_iter().filter(|trial| trial.end_of(Some(purpose)) > 0);
    let parts: Option<Vec<f64>> = compared.map(of_trial).collect();
    let sum = parts?.iter().sum::<f64>() + (hypothesis.late_s / late_std(trials)).powi(2);
    sum.is_finite().then_some(sum)
}

/// Columns of the derivatives of one record's residual, with the places of their coordinates.
fn columns(
    trials: &Trials,
    trial: &Trial,
    hypothesis: &Hypothesis,
    (coordinates, effect_step): (&[Coordinate], f64),
    at: &[Complex64],
) -> Option<Vec<(usize, Vec<Complex64>)>> {
    let concerns = |coordinate: &Coordinate| match coordinate {
        Coordinate::Gain(point) | Coordinate::TimeConstant(point) => *point == trial.point,
        Coordinate::Late | Coordinate::Effect { .. } => true,
    };
    let mut all = Vec::new();
    for (place, &coordinate) in coordinates.iter().enumerate().filter(|(_, coordinate)| concerns(coordinate)) {
        let step = match coordinate {
            Coordinate::Effect { .. } => effect_step,
            Coordinate::Late => SMOOTH_STEP * hypothesis.base[trial.point].time_constant_s,
            _ => SMOOTH_STEP,
        };
        let mut moved = hypothesis.clone();
        moved.set(coordinate, hypothesis.get(coordinate) + step);
        if moved.get(coordinate) == hypothesis.get(coordinate) {
            moved.set(coordinate, hypothesis.get(coordinate) - step);
        }
        let width = moved.get(coordinate) - hypothesis.get(coordinate);
        if width == 0.0 {
            continue;
        }
        let mut column = residual(trials, trial, &moved, Purpose::Fit)?;
        column.iter_mut().zip(at).for_each(|(moved, at)| *moved = (*moved - at) / width);
        all.push((place, column));
    }
    Some(all)
}

/// Searches the values of `start` that fit best; the lags only where `lags` says so. `None` where `start` is impossible.
pub(super) fn fit(trials: &Trials, start: &Hypothesis, lags: bool) -> Option<Fit> {
    fit_in(trials, start, lags, MOST_STEPS)
}

/// The same in so many steps at most.
///
/// Derivatives cost several simulations, a step along them one: they serve for more steps as long as these gain at least half
/// of what they promise.
pub(super) fn fit_in(trials: &Trials, start: &Hypothesis, lags: bool, most_steps: usize) -> Option<Fit> {
    fit_of(trials, start, start.coordinates(lags), most_steps)
}

/// The same of these coordinates alone.
pub(super) fn fit_of(
    trials: &Trials,
    start: &Hypothesis,
    coordinates: Vec<Coordinate>,
    most_steps: usize,
) -> Option<Fit> {
    let has_effects = coordinates.iter().any(|coordinate| matches!(coordinate, Coordinate::Effect { .. }));
    let mut found = descend(trials, start, coordinates, EFFECT_STEP, most_steps)?;
    if has_effects && most_steps >= MOST_STEPS {
        found = descend(trials, &found.at, found.tangent.coordinates, FINE_STEP, most_steps)?;
        for _ in 0..MOST_LOOKS {
            let Some(at) = look_around(trials, &found) else { break };
            let other = descend(trials, &at, found.tangent.coordinates.clone(), FINE_STEP, most_steps)?;
            // It was judged to first order only.
            if other.sum >= found.sum {
                break;
            }
            found = other;
        }
    }
    let Descent { at, sum, tangent } = found;
    Some(Fit { hypothesis: at, misfit: sum, covariance: inverse(&tangent.matrix), coordinates: tangent.coordinates })
}

/// A better place beside a search's end along a value that acts on the command: where levels of the command come to a limit
/// or leave it the misfit has kinks, at which a search by derivatives ends. All else follows to first order. `None` where
/// there is none.
fn look_around(trials: &Trials, found: &Descent) -> Option<Hypothesis> {
    let acts_on_command = |coordinate: &&Coordinate| match coordinate {
        Coordinate::Effect { effect, .. } => found.at.effects[*effect].kind.site <= Site::Command,
        _ => false,
    };
    let mut best: Option<(f64, Hypothesis)> = None;
    for &coordinate in found.tangent.coordinates.iter().filter(acts_on_command) {
        let others = found.tangent.coordinates.iter().copied().filter(|other| *other != coordinate).collect();
        let tangent = Tangent::at(trials, &found.at, others)?;
        let here = found.at.get(coordinate);
        for distance in LOOKS.into_iter().flat_map(|distance| [-distance, distance]) {
            let mut moved = found.at.clone();
            moved.set(coordinate, here + distance);
            let Some((left, there)) = tangent.judge(trials, &moved) else { continue };
            if left < best.as_ref().map_or(found.sum - ENOUGH, |best| best.0) {
                best = Some((left, there));
            }
        }
    }
    best.map(|(_, there)| there)
}

/// Where a search ended.
struct Descent {
    at: Hypothesis,
    sum: f64,
    tangent: Tangent,
}

fn descend(
    trials: &Trials,
    start: &Hypothesis,
    coordinates: Vec<Coordinate>,
    effect_step: f64,
    most_steps: usize,
) -> Option<Descent> {
    let mut at = start.clone();
    let mut tangent = Tangent::with_step(trials, &at, coordinates, effect_step)?;
    let (mut sum, mut gradient) = tangent.slope(trials, &at)?;
    let (mut damping, mut is_fresh) = (1e-3, true);
    for _ in 0..most_steps {
        let Some(step) = damped_step(&tangent.matrix, &gradient, damping) else { break };
        let moved = tangent.moved(&at, &step);
        let there = tangent.slope(trials, &moved);
        let gain = there.as_ref().map_or(f64::NEG_INFINITY, |there| sum - there.0);
        let promised = -(2.0 * gradient.dot(&step) + step.dot(&(&tangent.matrix * &step)));
        if gain > 0.0
            && let Some(there) = there
        {
            at = moved;
            (sum, gradient) = there;
            damping = (damping * 0.2_f64).max(1e-9);
            if gain < ENOUGH && is_fresh {
                break;
            }
            is_fresh = false;
            if gain >= 0.5 * promised && gain >= ENOUGH {
                continue;
            }
        } else if is_fresh {
            damping *= 10.0;
            if damping > 1e3 || promised < ENOUGH {
                break;
            }
            continue;
        }
        tangent = Tangent::with_step(trials, &at, tangent.coordinates, effect_step)?;
        (sum, gradient) = tangent.slope(trials, &at)?;
        is_fresh = true;
    }
    Some(Descent { at, sum, tangent })
}

fn damped_step(matrix: &DMatrix<f64>, gradient: &DVector<f64>, damping: f64) -> Option<DVector<f64>> {
    let mut damped = matrix.clone();
    let largest = damped.diagonal().max();
    for i in 0..damped.nrows() {
        // A value without any effect stays where it is.
        damped[(i, i)] += damping * matrix[(i, i)].max(1e-12 * largest);
    }
    Some(-Cholesky::new(damped)?.solve(gradient))
}

/// Inverse with rows and columns scaled to a unit diagonal; what has no effect at all keeps a large variance.
fn inverse(matrix: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let scale = matrix.diagonal().map(|d| if d > 0.0 { d.sqrt().recip() } else { 1.0 });
    let n = matrix.nrows();
    let scaled = DMatrix::from_fn(n, n, |i, j| {
        let value = matrix[(i, j)] * scale[i] * scale[j];
        if i == j { value.max(1e-12) * (1.0 + 1e-10) } else { value }
    });
    let inverse = Cholesky::new(scaled)?.inverse();
    Some(DMatrix::from_fn(n, n, |i, j| inverse[(i, j)] * scale[i] * scale[j]))
}

impl Fit {
    /// Squared length of a change of two coordinates in their standard errors and correlation. `None` where they were not
    /// searched.
    pub fn distance(&self, coordinates: [Coordinate; 2], off: [f64; 2]) -> Option<f64> {
        let covariance = self.covariance.as_ref()?;
        let [i, j] = coordinates.map(|one| self.coordinates.iter().position(|other| *other == one));
        let (i, j) = (i?, j?);
        let block = Matrix2::new(covariance[(i, i)], covariance[(i, j)], covariance[(j, i)], covariance[(j, j)]);
        let off = Vector2::from(off);
        Some(off.dot(&(block.try_inverse()? * off)))
    }

    /// Whether the interval of 95 % of each value of an effect excludes the value at which the effect vanishes.
    pub fn excludes_absence(&self, effect: usize) -> bool {
        let candidate = &self.hypothesis.effects[effect];
        Candidate::searched(candidate.kind)
            .filter(|(_, parameter)| parameter.null.is_finite() && parameter.usage == Use::Fitted)
            .all(|(value, parameter)| {
                let std = self.std(Coordinate::Effect { effect, value }).unwrap_or(f64::INFINITY);
                let std = std * slope(parameter, candidate.values[value]).abs();
                (candidate.values[value] - parameter.null).abs() > TWO_SIDED * std
            })
    }

    /// Standard deviation of a coordinate, by the noise.
    pub fn std(&self, coordinate: Coordinate) -> Option<f64> {
        let place = self.coordinates.iter().position(|other| *other == coordinate)?;
        let variance = self.covariance.as_ref()?[(place, place)];
        (variance >= 0.0).then(|| variance.sqrt())
    }

    /// Whether its alignment is off by more than the rows leave open.
    pub fn is_late(&self, trials: &Trials) -> bool {
        self.hypothesis.late_s.abs() > 2.0 * late_std(trials)
    }

    /// Derivatives around it. `None` where they are not defined.
    pub fn tangent(&self, trials: &Trials) -> Option<Tangent> {
        Tangent::at(trials, &self.hypothesis, self.coordinates.clone())
    }
}

impl Tangent {
    /// By these coordinates. `None` where they are not defined.
    pub fn at(trials: &Trials, hypothesis: &Hypothesis, coordinates: Vec<Coordinate>) -> Option<Self> {
        Self::with_step(trials, hypothesis, coordinates, EFFECT_STEP)
    }

    fn with_step(
        trials: &Trials,
        hypothesis: &Hypothesis,
        coordinates: Vec<Coordinate>,
        effect_step: f64,
    ) -> Option<Self> {
        let records: Option<Vec<RecordTangent>> = trials
            .trials
            .par_iter()
            .map(|trial| {
                if trial.end_of(Some(Purpose::Fit)) == 0 {
                    return Some(RecordTangent { columns: Vec::new() });
                }
                let at = residual(trials, trial, hypothesis, Purpose::Fit)?;
                let columns = columns(trials, trial, hypothesis, (&coordinates, effect_step), &at)?;
                Some(RecordTangent { columns })
            })
            .collect();
        let records = records?;
        let mut matrix = DMatrix::zeros(coordinates.len(), coordinates.len());
        for record in &records {
            for (i, a) in &record.columns {
                for (j, b) in &record.columns {
                    matrix[(*i, *j)] += dot(a, b);
                }
            }
        }
        if let Some(late) = coordinates.iter().position(|coordinate| *coordinate == Coordinate::Late) {
            matrix[(late, late)] += late_std(trials).powi(-2);
        }
        for (place, weight, _) in ties(trials, hypothesis, &coordinates) {
            matrix[(place, place)] += weight;
        }
        Some(Self { coordinates, records, matrix })
    }

    /// Sum of squares at `hypothesis`, and half its derivatives by the columns of the tangent.
    fn slope(&self, trials: &Trials, hypothesis: &Hypothesis) -> Option<(f64, DVector<f64>)> {
        self.slope_of(trials, hypothesis, |_, trial| residual(trials, trial, hypothesis, Purpose::Fit))
    }

    /// The same of white residuals by the place of their record.
    fn slope_of(
        &self,
        trials: &Trials,
        hypothesis: &Hypothesis,
        white: impl Fn(usize, &Trial) -> Option<Vec<Complex64>> + Sync,
    ) -> Option<(f64, DVector<f64>)> {
        let parts: Option<Vec<_>> = trials
            .trials
            .par_iter()
            .zip(&self.records)
            .enumerate()
            .filter(|(_, (trial, _))| trial.end_of(Some(Purpose::Fit)) > 0)
            .map(|(place, (trial, record))| {
                let at = white(place, trial)?;
                let slopes: Vec<(usize, f64)> = record.columns.iter().map(|(i, a)| (*i, dot(a, &at))).collect();
                Some((dot(&at, &at), slopes))
            })
            .collect();
        let mut gradient = DVector::zeros(self.coordinates.len());
        let mut sum = (hypothesis.late_s / late_std(trials)).powi(2);
        if let Some(late) = self.coordinates.iter().position(|coordinate| *coordinate == Coordinate::Late) {
            gradient[late] = hypothesis.late_s * late_std(trials).powi(-2);
        }
        for (place, weight, away) in ties(trials, hypothesis, &self.coordinates) {
            sum += weight * away * away;
            gradient[place] += weight * away;
        }
        for (part, slopes) in parts? {
            sum += part;
            slopes.into_iter().for_each(|(i, slope)| gradient[i] += slope);
        }
        sum.is_finite().then_some((sum, gradient))
    }

    fn moved(&self, from: &Hypothesis, step: &DVector<f64>) -> Hypothesis {
        let mut moved = from.clone();
        for (&coordinate, step) in self.coordinates.iter().zip(step.iter()) {
            moved.set(coordinate, from.get(coordinate) + step);
        }
        moved
    }

    /// The sum of squares that `hypothesis` would leave after a fit of all that the tangent knows, to first order, and the
    /// hypothesis moved there.
    pub fn judge(&self, trials: &Trials, hypothesis: &Hypothesis) -> Option<(f64, Hypothesis)> {
        self.follow(hypothesis, self.slope(trials, hypothesis)?)
    }

    fn follow(&self, hypothesis: &Hypothesis, (sum, gradient): (f64, DVector<f64>)) -> Option<(f64, Hypothesis)> {
        let step = damped_step(&self.matrix, &gradient, 1e-9)?;
        let left = sum + gradient.dot(&step);
        // The tangent holds nearby only.
        Some((left, self.moved(hypothesis, &step.map(|step| step.clamp(-0.5, 0.5)))))
    }
}

/// Judges candidates beside a fit by what they would change.
///
/// Where the fit has effects that make the rotor one that is integrated, a candidate's change is taken from the chain
/// without these and added to what the fit leaves: right to first order, which is all that the tangent is, and as quick as
/// beside no effect.
pub(super) struct Screening<'a> {
    from: &'a Fit,
    tangent: Tangent,
    /// The chain that changes are taken from, and by record what the fit leaves less what that chain leaves; empty where it
    /// is the fit's own.
    quick: Hypothesis,
    offsets: Vec<Vec<Complex64>>,
}

impl<'a> Screening<'a> {
    /// Beside `from`. `None` where its derivatives are not defined.
    pub fn new(trials: &Trials, from: &'a Fit) -> Option<Self> {
        let tangent = from.tangent(trials)?;
        let mut quick = from.hypothesis.clone();
        quick.effects.retain(|candidate| !matches!(candidate.kind.site, Site::Supply | Site::Map | Site::Rotor));
        let mut offsets = Vec::new();
        if quick.effects.len() < from.hypothesis.effects.len() {
            let offset = |trial: &Trial| {
                if trial.end_of(Some(Purpose::Fit)) == 0 {
                    return Some(Vec::new());
                }
                let mut left = residual(trials, trial, &from.hypothesis, Purpose::Fit)?;
                let without = residual(trials, trial, &quick, Purpose::Fit)?;
                left.iter_mut().zip(&without).for_each(|(left, without)| *left -= without);
                Some(left)
            };
            offsets = trials.trials.par_iter().map(offset).collect::<Option<_>>()?;
        }
        Some(Self { from, tangent, quick, offsets })
    }

    /// The sum of squares that is left with one more effect, and all of it moved there. With the misalignment of the fit, or
    /// without any.
    pub fn judge(&self, trials: &Trials, candidate: &Candidate, aligned: bool) -> Option<(f64, Hypothesis)> {
        let mut with = self.from.hypothesis.with(candidate.clone());
        let mut quick = self.quick.with(candidate.clone());
        if aligned {
            (with.late_s, quick.late_s) = (0.0, 0.0);
        }
        let slope = self.tangent.slope_of(trials, &with, |place, trial| {
            let mut left = residual(trials, trial, &quick, Purpose::Fit)?;
            if let Some(offset) = self.offsets.get(place) {
                left.iter_mut().zip(offset).for_each(|(left, offset)| *left += offset);
            }
            Some(left)
        })?;
        self.tangent.follow(&with, slope)
    }
}
