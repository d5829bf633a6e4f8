//! Derivatives of the white residuals, taken record by record.

use nalgebra::{Cholesky, DMatrix, DVector};
use num_complex::Complex64;
use rayon::prelude::*;

use super::hypothesis::{Coordinate, Hypothesis};
use super::residual::{dot, late_std, residual};
use super::trial::{Purpose, Trial, Trials};

/// Steps for derivatives, in coordinates.
const SMOOTH_STEP: f64 = 1e-4;
pub(super) const EFFECT_STEP: f64 = 2e-3;

/// Derivatives at a hypothesis, for judging others next to it without a search.
pub(super) struct Tangent {
    /// What is moved.
    pub coordinates: Vec<Coordinate>,
    records: Vec<RecordTangent>,
    /// Products of the derivatives, summed over records: the normal equations.
    pub matrix: DMatrix<f64>,
}

/// White columns of one record with the places of their coordinates.
struct RecordTangent {
    columns: Vec<(usize, Vec<Complex64>)>,
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

/// Columns of the derivatives of what `white` makes of one record, `at` with `hypothesis`, with the places of their coordinates.
pub(super) fn columns(
    trial: &Trial,
    hypothesis: &Hypothesis,
    (coordinates, effect_step): (&[Coordinate], f64),
    at: &[Complex64],
    white: impl Fn(&Hypothesis) -> Option<Vec<Complex64>>,
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
        let mut column = white(&moved)?;
        column.iter_mut().zip(at).for_each(|(moved, at)| *moved = (*moved - at) / width);
        all.push((place, column));
    }
    Some(all)
}

/// A step of Levenberg and Marquardt. `None` where the equations have no solution.
pub(super) fn damped_step(matrix: &DMatrix<f64>, gradient: &DVector<f64>, damping: f64) -> Option<DVector<f64>> {
    let mut damped = matrix.clone();
    let largest = damped.diagonal().max();
    for i in 0..damped.nrows() {
        // A value without any effect stays where it is.
        damped[(i, i)] += damping * matrix[(i, i)].max(1e-12 * largest);
    }
    Some(-Cholesky::new(damped)?.solve(gradient))
}

impl Tangent {
    /// By these coordinates. `None` where they are not defined.
    pub fn at(trials: &Trials, hypothesis: &Hypothesis, coordinates: Vec<Coordinate>) -> Option<Self> {
        Self::with_step(trials, hypothesis, coordinates, EFFECT_STEP)
    }

    /// With another step for the values of effects, in coordinates.
    pub fn with_step(
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
                let white = |hypothesis: &Hypothesis| residual(trials, trial, hypothesis, Purpose::Fit);
                let columns = columns(trial, hypothesis, (&coordinates, effect_step), &white(hypothesis)?, white)?;
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
    pub fn slope(&self, trials: &Trials, hypothesis: &Hypothesis) -> Option<(f64, DVector<f64>)> {
        self.slope_of(trials, hypothesis, |_, trial| residual(trials, trial, hypothesis, Purpose::Fit))
    }

    /// The same of white residuals by the place of their record.
    pub fn slope_of(
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

    pub fn moved(&self, from: &Hypothesis, step: &DVector<f64>) -> Hypothesis {
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

    pub fn follow(&self, hypothesis: &Hypothesis, (sum, gradient): (f64, DVector<f64>)) -> Option<(f64, Hypothesis)> {
        let step = damped_step(&self.matrix, &gradient, 1e-9)?;
        let left = sum + gradient.dot(&step);
        // The tangent holds nearby only.
        Some((left, self.moved(hypothesis, &step.map(|step| step.clamp(-0.5, 0.5)))))
    }
}
