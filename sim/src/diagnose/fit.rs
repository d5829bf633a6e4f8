//! Least squares of white residuals over all records at once.
//!
//! Each record's residual depends on its own lag and on the effects, so derivatives are taken record by record and summed
//! up into the normal equations: memory does not grow with the number of records. The step is Levenberg's and Marquardt's.

use nalgebra::{Cholesky, DMatrix, DVector};
use num_complex::Complex64;
use rayon::prelude::*;

use super::hypothesis::{Coordinate, Hypothesis};
use super::trial::{Purpose, Trial, Trials};

/// Most steps of a search.
pub(super) const MOST_STEPS: usize = 25;
/// A search ends where a step gains less than this in the sum of squares: a twentieth of what one parameter gains by chance.
const ENOUGH: f64 = 0.05;
/// Steps for derivatives, in coordinates.
const SMOOTH_STEP: f64 = 1e-4;
const EFFECT_STEP: f64 = 2e-3;

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
    inverse: DMatrix<f64>,
}

/// White columns of one record with the places of their coordinates.
struct RecordTangent {
    columns: Vec<(usize, Vec<Complex64>)>,
}

/// Sum of squares with the normal equations.
struct Normal {
    sum: f64,
    matrix: DMatrix<f64>,
    gradient: DVector<f64>,
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
            let decay: Vec<f64> = trial.time_s[stretch.rows.clone()]
                .iter()
                .map(|time_s| (-(time_s - trial.time_s[0]) / tau_s).exp())
                .collect();
            let decay = stretch.whitening.apply(&decay);
            let share = dot(&decay, &white) / dot(&decay, &decay);
            if share.is_finite() {
                white.iter_mut().zip(&decay).for_each(|(white, decay)| *white -= decay * share);
            }
        }
        all.append(&mut white);
    }
    all
}

/// How far the rows of the records leave the alignment open: they are stamped no more finely than they are apart, and a
/// uniform error of one row has this standard deviation.
fn late_std(trials: &Trials) -> f64 {
    let rows_s = trials.trials.iter().map(|trial| trial.rate_hz.recip()).fold(0.0, f64::max);
    rows_s / 12_f64.sqrt()
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

/// Columns of the derivatives of one record's residual, with the places of their coordinates.
fn columns(
    trials: &Trials,
    trial: &Trial,
    hypothesis: &Hypothesis,
    coordinates: &[Coordinate],
    at: &[Complex64],
) -> Option<Vec<(usize, Vec<Complex64>)>> {
    let concerns = |coordinate: &Coordinate| match coordinate {
        Coordinate::Gain(point) | Coordinate::TimeConstant(point) => *point == trial.point,
        Coordinate::Late | Coordinate::Effect { .. } => true,
    };
    let mut all = Vec::new();
    for (place, &coordinate) in coordinates.iter().enumerate().filter(|(_, coordinate)| concerns(coordinate)) {
        let step = match coordinate {
            Coordinate::Effect { .. } => EFFECT_STEP,
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

fn normal(trials: &Trials, hypothesis: &Hypothesis, coordinates: &[Coordinate]) -> Option<Normal> {
    let count = coordinates.len();
    let parts: Option<Vec<_>> = trials
        .trials
        .par_iter()
        .filter(|trial| trial.end_of(Some(Purpose::Fit)) > 0)
        .map(|trial| {
            let at = residual(trials, trial, hypothesis, Purpose::Fit)?;
            let columns = columns(trials, trial, hypothesis, coordinates, &at)?;
            let products: Vec<(usize, usize, f64)> =
                columns.iter().flat_map(|(i, a)| columns.iter().map(move |(j, b)| (*i, *j, dot(a, b)))).collect();
            let slopes: Vec<(usize, f64)> = columns.iter().map(|(i, a)| (*i, dot(a, &at))).collect();
            Some((dot(&at, &at), products, slopes))
        })
        .collect();
    let mut normal = Normal { sum: 0.0, matrix: DMatrix::zeros(count, count), gradient: DVector::zeros(count) };
    for (sum, products, slopes) in parts? {
        normal.sum += sum;
        products.into_iter().for_each(|(i, j, product)| normal.matrix[(i, j)] += product);
        slopes.into_iter().for_each(|(i, slope)| normal.gradient[i] += slope);
    }
    let std = late_std(trials);
    normal.sum += (hypothesis.late_s / std).powi(2);
    if let Some(late) = coordinates.iter().position(|coordinate| *coordinate == Coordinate::Late) {
        normal.matrix[(late, late)] += std.powi(-2);
        normal.gradient[late] += hypothesis.late_s * std.powi(-2);
    }
    Some(normal)
}

/// Searches the values of `start` that fit best; the lags only where `lags` says so. `None` where `start` is impossible.
pub(super) fn fit(trials: &Trials, start: &Hypothesis, lags: bool) -> Option<Fit> {
    fit_in(trials, start, lags, MOST_STEPS)
}

/// The same in so many steps at most.
pub(super) fn fit_in(trials: &Trials, start: &Hypothesis, lags: bool, most_steps: usize) -> Option<Fit> {
    let coordinates = start.coordinates(lags);
    let mut at = start.clone();
    let mut here = normal(trials, &at, &coordinates)?;
    let mut damping = 1e-3;
    for _ in 0..most_steps {
        let Some(step) = damped_step(&here, damping) else { break };
        let mut moved = at.clone();
        for (&coordinate, step) in coordinates.iter().zip(step.iter()) {
            moved.set(coordinate, at.get(coordinate) + step);
        }
        let sum = misfit(trials, &moved, Purpose::Fit).unwrap_or(f64::INFINITY);
        let gain = here.sum - sum;
        if gain > 0.0 {
            at = moved;
            damping = (damping * 0.2_f64).max(1e-9);
            here = normal(trials, &at, &coordinates)?;
            if gain < ENOUGH {
                break;
            }
        } else {
            damping *= 10.0;
            if damping > 1e3 {
                break;
            }
        }
    }
    let covariance = inverse(&here.matrix);
    Some(Fit { hypothesis: at, misfit: here.sum, coordinates, covariance })
}

fn damped_step(normal: &Normal, damping: f64) -> Option<DVector<f64>> {
    let mut matrix = normal.matrix.clone();
    let largest = matrix.diagonal().max();
    for i in 0..matrix.nrows() {
        // A value without any effect stays where it is.
        matrix[(i, i)] += damping * matrix[(i, i)].max(1e-12 * largest);
    }
    Some(-Cholesky::new(matrix)?.solve(&normal.gradient))
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
    /// Standard deviation of a coordinate, by the noise.
    pub fn std(&self, coordinate: Coordinate) -> Option<f64> {
        let place = self.coordinates.iter().position(|other| *other == coordinate)?;
        let variance = self.covariance.as_ref()?[(place, place)];
        (variance >= 0.0).then(|| variance.sqrt())
    }

    /// Derivatives around it. `None` where they are not defined.
    pub fn tangent(&self, trials: &Trials) -> Option<Tangent> {
        let records: Option<Vec<RecordTangent>> = trials
            .trials
            .par_iter()
            .map(|trial| {
                if trial.end_of(Some(Purpose::Fit)) == 0 {
                    return Some(RecordTangent { columns: Vec::new() });
                }
                let at = residual(trials, trial, &self.hypothesis, Purpose::Fit)?;
                let columns = columns(trials, trial, &self.hypothesis, &self.coordinates, &at)?;
                Some(RecordTangent { columns })
            })
            .collect();
        let count = self.coordinates.len();
        let mut matrix = DMatrix::zeros(count, count);
        let records = records?;
        for record in &records {
            for (i, a) in &record.columns {
                for (j, b) in &record.columns {
                    matrix[(*i, *j)] += dot(a, b);
                }
            }
        }
        if let Some(late) = self.coordinates.iter().position(|coordinate| *coordinate == Coordinate::Late) {
            matrix[(late, late)] += late_std(trials).powi(-2);
        }
        Some(Tangent { coordinates: self.coordinates.clone(), records, inverse: inverse(&matrix)? })
    }
}

impl Tangent {
    /// The sum of squares that `hypothesis` would leave after a fit of all that the tangent knows, to first order, and the
    /// hypothesis moved there.
    pub fn judge(&self, trials: &Trials, hypothesis: &Hypothesis) -> Option<(f64, Hypothesis)> {
        let parts: Option<Vec<_>> = trials
            .trials
            .par_iter()
            .zip(&self.records)
            .filter(|(trial, _)| trial.end_of(Some(Purpose::Fit)) > 0)
            .map(|(trial, record)| {
                let at = residual(trials, trial, hypothesis, Purpose::Fit)?;
                let slopes: Vec<(usize, f64)> = record.columns.iter().map(|(i, a)| (*i, dot(a, &at))).collect();
                Some((dot(&at, &at), slopes))
            })
            .collect();
        let mut gradient = DVector::zeros(self.coordinates.len());
        let mut sum = 0.0;
        for (part, slopes) in parts? {
            sum += part;
            slopes.into_iter().for_each(|(i, slope)| gradient[i] += slope);
        }
        let std = late_std(trials);
        sum += (hypothesis.late_s / std).powi(2);
        if let Some(late) = self.coordinates.iter().position(|coordinate| *coordinate == Coordinate::Late) {
            gradient[late] += hypothesis.late_s * std.powi(-2);
        }
        let step = -(&self.inverse * &gradient);
        let mut moved = hypothesis.clone();
        for (&coordinate, step) in self.coordinates.iter().zip(step.iter()) {
            // The tangent holds nearby only.
            moved.set(coordinate, hypothesis.get(coordinate) + step.clamp(-0.5, 0.5));
        }
        let left = sum + gradient.dot(&step);
        left.is_finite().then_some((left, moved))
    }
}
