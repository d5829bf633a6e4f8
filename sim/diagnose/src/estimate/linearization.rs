//! Derivatives of the white residuals, taken record by record.

use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;
use rayon::prelude::*;
use rotorlead_numerics::normal_equations::{damped_step, floored_diagonal};

use crate::data::dataset::PreparedRecord;
use crate::data::split::Split;
use crate::likelihood::Likelihood;
use crate::model::hypothesis::{Coordinate, Hypothesis};
use crate::noise::whitening::dot;

/// Steps for derivatives, in coordinates: of lags and alignment, and in the end of values of effects too, since over a longer way many
/// commands come to a limit or leave it. Derived: a difference is off by half of it, 5e-5, of the second
/// derivative and by 1e-12 of rounding.
pub(crate) const SMOOTH_STEP: f64 = 1e-4;
/// The same of values of effects. Chosen: 0.2 % of a value or range, so that many commands cross a limit over it. Smaller sees single
/// commands; larger is off by the bend of the response.
pub(crate) const EFFECT_STEP: f64 = 2e-3;

/// Derivatives at a hypothesis, for judging others next to it without a search.
pub(crate) struct Linearization {
    /// What is moved.
    pub coordinates: Vec<Coordinate>,
    records: Vec<RecordJacobian>,
    /// Products of the derivatives, summed over records: the normal equations.
    pub matrix: DMatrix<f64>,
}

/// White columns of one record with the places of their coordinates.
struct RecordJacobian {
    columns: Vec<(usize, Vec<Complex64>)>,
    /// The white residual where they were taken.
    residual: Vec<Complex64>,
}

/// What a search pays for values away from where the effects are not: weight and distance of each coordinate that is tied.
/// Only on a part of the records, which may not determine all of them.
fn priors(likelihood: &Likelihood, hypothesis: &Hypothesis, coordinates: &[Coordinate]) -> Vec<(usize, f64, f64)> {
    if !likelihood.is_part {
        return Vec::new();
    }
    let prior = |(place, coordinate): (usize, &Coordinate)| {
        let (null, std) = hypothesis.prior(*coordinate)?;
        Some((place, std.powi(-2), hypothesis.get(*coordinate) - null))
    };
    coordinates.iter().enumerate().filter_map(prior).collect()
}

/// Columns of the derivatives of what `white` makes of one record, `at` with `hypothesis`, with the places of their coordinates.
/// That by the gain without a difference, where `by_gain` knows it.
pub(crate) fn columns(
    record: &PreparedRecord,
    hypothesis: &Hypothesis,
    coordinates: &[Coordinate],
    effect_step: f64,
    (at, by_gain): (&[Complex64], impl Fn() -> Option<Vec<Complex64>>),
    white: impl Fn(&Hypothesis) -> Option<Vec<Complex64>>,
) -> Option<Vec<(usize, Vec<Complex64>)>> {
    let concerns = |coordinate: &Coordinate| match coordinate {
        Coordinate::Gain(point) | Coordinate::TimeConstant(point) => *point == record.point,
        Coordinate::TimeOffset | Coordinate::Effect { .. } => true,
    };
    // Only differences count.
    let in_rows = hypothesis.in_rows(record).and_then(|in_rows| white(&in_rows).map(|white| (in_rows, white)));
    let (hypothesis, near) = in_rows.as_ref().map_or((hypothesis, at), |(in_rows, white)| (in_rows, &white[..]));
    let mut all = Vec::new();
    for (place, &coordinate) in coordinates.iter().enumerate().filter(|(_, coordinate)| concerns(coordinate)) {
        if let Coordinate::Gain(_) = coordinate
            && let Some(column) = by_gain()
        {
            all.push((place, column));
            continue;
        }
        let step = match coordinate {
            Coordinate::Effect { .. } => effect_step,
            Coordinate::TimeOffset => SMOOTH_STEP * hypothesis.base[record.point].time_constant_s,
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
        column.iter_mut().zip(near).for_each(|(moved, near)| *moved = (*moved - near) / width);
        all.push((place, column));
    }
    Some(all)
}

impl Linearization {
    /// By these coordinates. `None` where they are not defined.
    pub fn at(likelihood: &Likelihood, hypothesis: &Hypothesis, coordinates: Vec<Coordinate>) -> Option<Self> {
        Self::with_step(likelihood, hypothesis, coordinates, EFFECT_STEP)
    }

    /// With another step for the values of effects, in coordinates.
    pub fn with_step(
        likelihood: &Likelihood,
        hypothesis: &Hypothesis,
        coordinates: Vec<Coordinate>,
        effect_step: f64,
    ) -> Option<Self> {
        let records: Option<Vec<RecordJacobian>> = likelihood
            .data
            .records
            .par_iter()
            .map(|record| {
                if !likelihood.has(record, Split::Train) {
                    return Some(RecordJacobian { columns: Vec::new(), residual: Vec::new() });
                }
                let white = |hypothesis: &Hypothesis| likelihood.residual(record, hypothesis, Split::Train);
                let residual = white(hypothesis)?;
                let by_gain = || likelihood.for_record(record).by_gain(hypothesis, Split::Train, &residual);
                let columns = columns(record, hypothesis, &coordinates, effect_step, (&residual, by_gain), white)?;
                Some(RecordJacobian { columns, residual })
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
        if let Some(late) = coordinates.iter().position(|coordinate| *coordinate == Coordinate::TimeOffset) {
            matrix[(late, late)] += likelihood.time_offset_std().powi(-2);
        }
        for (place, weight, _) in priors(likelihood, hypothesis, &coordinates) {
            matrix[(place, place)] += weight;
        }
        Some(Self { coordinates, records, matrix })
    }

    /// The white residual of each record where the linearization was taken; empty for a record that is not fitted.
    pub fn residual(&self) -> Vec<&[Complex64]> {
        self.records.iter().map(|record| &record.residual[..]).collect()
    }

    /// Sum of squares and half its derivatives at `hypothesis`, where the linearization was taken.
    pub fn slope_here(&self, likelihood: &Likelihood, hypothesis: &Hypothesis) -> Option<(f64, DVector<f64>)> {
        self.white_slope(likelihood, hypothesis, |place, _| Some(self.records[place].residual.clone()))
    }

    /// Sum of squares at `hypothesis`, and half its derivatives by the columns of the linearization.
    pub fn slope(&self, likelihood: &Likelihood, hypothesis: &Hypothesis) -> Option<(f64, DVector<f64>)> {
        self.white_slope(likelihood, hypothesis, |_, record| likelihood.residual(record, hypothesis, Split::Train))
    }

    /// The same of the white residuals that `white` returns for a record and its index.
    pub fn white_slope(
        &self,
        likelihood: &Likelihood,
        hypothesis: &Hypothesis,
        white: impl Fn(usize, &PreparedRecord) -> Option<Vec<Complex64>> + Sync,
    ) -> Option<(f64, DVector<f64>)> {
        let parts: Option<Vec<_>> = likelihood
            .data
            .records
            .par_iter()
            .zip(&self.records)
            .enumerate()
            .filter(|(_, (record, _))| likelihood.has(record, Split::Train))
            .map(|(place, (record, jacobian))| {
                let at = white(place, record)?;
                let slopes: Vec<(usize, f64)> = jacobian.columns.iter().map(|(i, a)| (*i, dot(a, &at))).collect();
                Some((dot(&at, &at), slopes))
            })
            .collect();
        let mut gradient = DVector::zeros(self.coordinates.len());
        let mut sum = (hypothesis.time_offset_s / likelihood.time_offset_std()).powi(2);
        if let Some(late) = self.coordinates.iter().position(|coordinate| *coordinate == Coordinate::TimeOffset) {
            gradient[late] = hypothesis.time_offset_s * likelihood.time_offset_std().powi(-2);
        }
        for (place, weight, away) in priors(likelihood, hypothesis, &self.coordinates) {
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

    /// The sum of squares after a fit of all coordinates of the linearization, starting at `hypothesis`, to first order, and the
    /// hypothesis moved there.
    pub fn predict(&self, likelihood: &Likelihood, hypothesis: &Hypothesis) -> Option<(f64, Hypothesis)> {
        let (sum, gradient) = self.slope(likelihood, hypothesis)?;
        self.follow(hypothesis, sum, &gradient)
    }

    /// The same from the sum of squares at `hypothesis` and half its derivatives.
    pub fn follow(&self, hypothesis: &Hypothesis, sum: f64, gradient: &DVector<f64>) -> Option<(f64, Hypothesis)> {
        let step = damped_step(&self.matrix, gradient, &floored_diagonal(&self.matrix), 1e-9)?;
        let chi_square = sum + gradient.dot(&step);
        // The linearization holds only nearby: up to half a range, or a factor of 1.6. The damping of 1e-9 only makes the matrix
        // invertible.
        Some((chi_square, self.moved(hypothesis, &step.map(|step| step.clamp(-0.5, 0.5)))))
    }
}

#[cfg(test)]
mod tests {
    use rotorlead_plant::Catalog;

    use super::*;
    use crate::estimate::settle::settle;
    use crate::model::candidate::Candidate;
    use crate::testing::{likelihood, records_with_command_rate};

    #[test]
    fn derivatives_that_are_taken_the_short_way_are_the_differences() {
        let (likelihood, base) = likelihood(&records_with_command_rate("", (0.05, 1), (2000, 400)));
        let catalog = Catalog::standard();
        let (likelihood, lags) = settle(&likelihood, &Hypothesis::from_lags(base), true).unwrap();
        let lags = lags.hypothesis;
        let likelihood = &likelihood;
        assert_eq!(likelihood.data.records[0].commands_per_row, 5);
        let kinds = catalog.kinds().filter(|kind| kind.id != "parameter_error");
        let mut in_rows = 0;
        for kind in kinds {
            let with = lags.with(Candidate::starts(kind, false)[0].clone());
            in_rows += usize::from(with.in_rows(&likelihood.data.records[0]).is_some());
            let coordinates = with.coordinates(true);
            let linearization = Linearization::at(likelihood, &with, coordinates.clone()).unwrap();
            for (record, jacobian) in likelihood.data.records.iter().zip(&linearization.records) {
                for (place, column) in &jacobian.columns {
                    let coordinate = coordinates[*place];
                    let step = match coordinate {
                        Coordinate::Effect { .. } => EFFECT_STEP,
                        _ => SMOOTH_STEP,
                    };
                    let at = |off: f64| {
                        let mut moved = with.clone();
                        moved.set(coordinate, with.get(coordinate) + off);
                        (moved.get(coordinate), likelihood.residual(record, &moved, Split::Train).unwrap())
                    };
                    let ((from, before), (to, after)) = (at(0.0), at(step));
                    if to == from {
                        continue;
                    }
                    let difference: Vec<Complex64> =
                        after.iter().zip(&before).map(|(after, before)| (after - before) / (to - from)).collect();
                    let off: Vec<Complex64> = difference.iter().zip(column).map(|(a, b)| a - b).collect();
                    let (off, whole) = (dot(&off, &off).sqrt(), dot(&difference, &difference).sqrt());
                    // A line over rows of 2.5 ms leaves out 2 % of a sinusoid of 30 Hz, and lags that switch where it turns see
                    // more of that; a gain enters exactly where nothing drifts. Where all is clipped there is but rounding.
                    let is_exact = matches!(coordinate, Coordinate::Gain(_)) && !with.drifts();
                    let limit = if is_exact { 1e-3 } else { 0.05 };
                    assert!(
                        off < limit * whole + 0.05,
                        "{} {coordinate:?} of {}: {off}, {whole}",
                        kind.id,
                        record.file
                    );
                }
            }
        }
        assert!(in_rows > 8, "{in_rows} kinds in rows");
    }
}
