//! Confirm: how far simulation and measurement are apart on what was held out, before and after, and how far noise alone
//! would keep them apart.

use rotorlead_identify::simulation::align;
use serde::Serialize;

use crate::DiagnoseError;
use crate::data::dataset::PreparedRecord;
use crate::data::split::Split;
use crate::estimate::fit::Fit;
use crate::likelihood::{Likelihood, Power, RecordLikelihood as _};
use crate::model::hypothesis::{Coordinate, Hypothesis};

/// Gap on held-out segments, `RMS(y - yhat) / RMS(y - mean y)`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Gap {
    /// Of the model as it was.
    pub before: f64,
    /// Of the improved one.
    pub after: f64,
    /// What the noise of the records leaves to a perfect one.
    pub noise_floor: f64,
}

/// A gap above this is no disagreement of a model with its records: both are not of the same thing. Chosen: thrust in place of a speed is
/// off by a thousand, a model of another motor by a few.
const MOST_GAP: f64 = 100.0;

/// What is left beyond noise has to shrink to this part of its power before one explanation takes the place of another. Chosen: it then
/// explains more than all that the other leaves; less would take the place by chance, as both have about as many numbers.
const SHRINKS_TO: f64 = 0.5;

impl Gap {
    /// Whether its improved model leaves less than half of the power beyond noise that the `other` one leaves.
    pub(crate) fn explains_more_than(self, other: Self) -> bool {
        let beyond_noise = |gap: Self| (gap.after * gap.after - gap.noise_floor * gap.noise_floor).max(0.0);
        beyond_noise(self) < SHRINKS_TO * beyond_noise(other)
    }

    /// # Errors
    /// [`DiagnoseError::NoComparison`] for a gap that no model of the records has.
    pub(crate) fn check(self) -> Result<(), DiagnoseError> {
        let largest = [self.before, self.after]
            .into_iter()
            .fold(0.0, |most: f64, gap| if gap > most || gap.is_nan() { gap } else { most });
        if largest < MOST_GAP { Ok(()) } else { Err(DiagnoseError::NoComparison { percent: 100.0 * largest }) }
    }
}

/// The gap of one record.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RecordGap {
    /// The record.
    pub file: String,
    /// Its nominal command.
    pub nominal: f64,
    /// The gap.
    #[serde(flatten)]
    pub gap: Gap,
}

/// What is left of the record that the first model explains worst, over one period, in means of so many rows.
#[derive(Clone, Debug, PartialEq)]
pub struct Residual {
    /// The record.
    pub file: String,
    /// Rows of a mean.
    pub rows: usize,
    /// Middle of each, seconds.
    pub time_s: Vec<f64>,
    /// Measured less simulated by the first model, response units.
    pub before: Vec<f64>,
    /// The same by the improved one.
    pub after: Vec<f64>,
    /// Standard deviation of such a mean if the noise were white.
    pub noise_std: f64,
}

/// How far a logarithm is moved at most for a standard error: a number that is not known at all is no excuse. Chosen: 20 %, where a
/// prediction is no longer linear in it. Higher excuses any gap of a lag that is not known.
const FARTHEST_OFF: f64 = 0.2;
/// Most means of a [`Residual`]. Chosen: about as many as a figure has dots across.
const MOST_MEANS: usize = 500;

/// [`Residual`] of the first compared period; `None` where nothing can be simulated.
pub(crate) fn residual(
    likelihood: &Likelihood,
    records: &[RecordGap],
    before: &Hypothesis,
    after: &Hypothesis,
    held_out: bool,
) -> Option<Residual> {
    // Without noise any gap is over it.
    let over = |record: &&RecordGap| record.gap.before / record.gap.noise_floor.max(1e-12);
    let worst = records.iter().max_by(|a, b| over(a).total_cmp(&over(b)))?;
    let record = likelihood.data.records.iter().find(|record| record.file == worst.file)?;
    let split = if held_out { Split::Holdout } else { Split::Train };
    let (segment, whitening) = likelihood.periodic(record)?.segments(split).next()?;
    let rows = segment.rows.clone();
    let (time_s, measured) = (&record.time_s[rows.clone()], &record.measured[rows.clone()]);
    let period = record.period_rows.min(rows.len());
    let width = period.div_ceil(MOST_MEANS);
    let means = |values: &[f64]| -> Vec<f64> {
        values[..period].chunks_exact(width).map(|chunk| chunk.iter().sum::<f64>() / width as f64).collect()
    };
    let residual = |hypothesis: &Hypothesis| -> Option<Vec<f64>> {
        let simulated = hypothesis.simulate(&likelihood.data, record, rows.end).ok()?;
        let tau_s = before.base[record.point].time_constant_s;
        let aligned = align(time_s, measured, &simulated[rows.clone()], tau_s);
        Some(means(&measured.iter().zip(aligned).map(|(y, model)| y - model).collect::<Vec<_>>()))
    };
    Some(Residual {
        file: record.file.clone(),
        rows: width,
        time_s: means(time_s),
        before: residual(before)?,
        after: residual(after)?,
        noise_std: (whitening.row_variance() / width as f64).sqrt(),
    })
}

/// Sums of squares, to be divided at the end.
#[derive(Clone, Copy, Default)]
pub(crate) struct SquaredResiduals {
    pub before: f64,
    pub after: f64,
    pub noise: f64,
    pub response: f64,
}

impl SquaredResiduals {
    pub fn add(&mut self, other: Self) {
        self.before += other.before;
        self.after += other.after;
        self.noise += other.noise;
        self.response += other.response;
    }

    pub fn is_any(&self) -> bool {
        self.response > 0.0
    }

    pub fn gap(self) -> Gap {
        let part = |sum: f64| (sum / self.response).sqrt();
        // Noise is a part of what is left: an estimate beyond it has taken what drifts for noise.
        let noise = self.noise.min(self.before).min(self.after);
        Gap { before: part(self.before), after: part(self.after), noise_floor: part(noise) }
    }
}

/// Gap in total and record by record on what is there in a split.
pub(crate) fn compute_gap(
    likelihood: &Likelihood,
    before: &Hypothesis,
    after: &Hypothesis,
    split: Split,
) -> (Gap, Vec<RecordGap>) {
    let mut total = SquaredResiduals::default();
    let mut records = Vec::new();
    for record in likelihood.data.records.iter().filter(|record| likelihood.has(record, split)) {
        let Some(squares) = squares(likelihood, record, before, after, split) else { continue };
        total.add(squares);
        records.push(RecordGap { file: record.file.clone(), nominal: record.nominal, gap: squares.gap() });
    }
    (total.gap(), records)
}

/// Square of the part of the gap on what is in `split` that the standard errors of the lags account for: a nominal command that
/// was fitted to one quiet record is known badly, and shows it on a loud one. 0 for records that do not repeat.
///
/// A prediction that is linear in the numbers has the variance `J C J'`, with `C` their covariance: along each of its axes the
/// record is simulated once more, one standard error away.
pub(crate) fn unsure(likelihood: &Likelihood, fit: &Fit, split: Split) -> f64 {
    let of_record = |record: &PreparedRecord| {
        let rows = likelihood.periodic(record)?.end(split);
        let here = fit.hypothesis.simulate(&likelihood.data, record, rows).ok()?;
        let coordinates = [Coordinate::Gain(record.point), Coordinate::TimeConstant(record.point)];
        let axes = fit.pair_covariance(coordinates)?.symmetric_eigen();
        let mut sum = 0.0;
        for (variance, axis) in axes.eigenvalues.iter().zip(axes.eigenvectors.column_iter()) {
            let mut moved = fit.hypothesis.clone();
            for (coordinate, part) in coordinates.into_iter().zip(axis.iter()) {
                let off = (variance.max(0.0).sqrt() * part).clamp(-FARTHEST_OFF, FARTHEST_OFF);
                moved.set(coordinate, moved.get(coordinate) + off);
            }
            let there = moved.simulate(&likelihood.data, record, rows).ok()?;
            for segment in record.segments.iter().filter(|segment| segment.split == split) {
                sum += scatter(segment.rows.clone().map(|row| there[row] - here[row]));
            }
        }
        let segments = record.segments.iter().filter(|segment| segment.split == split);
        let response: f64 =
            segments.map(|segment| scatter(record.measured[segment.rows.clone()].iter().copied())).sum();
        Some((sum, response))
    };
    let compared = likelihood.data.records.iter().filter(|record| likelihood.has(record, split));
    let (sum, response) =
        compared.filter_map(of_record).fold((0.0, 0.0), |(sum, all), (off, response)| (sum + off, all + response));
    if response > 0.0 { sum / response } else { 0.0 }
}

/// Sum of squares around the mean.
fn scatter(values: impl Iterator<Item = f64> + Clone) -> f64 {
    let (sum, count) = values.clone().fold((0.0, 0.0), |(sum, count), value| (sum + value, count + 1.0));
    let mean = if count > 0.0 { sum / count } else { 0.0 };
    values.map(|value| (value - mean).powi(2)).sum()
}

/// Sums of squares of one record in a split, by both models.
pub(crate) fn squares(
    likelihood: &Likelihood,
    record: &PreparedRecord,
    before: &Hypothesis,
    after: &Hypothesis,
    split: Split,
) -> Option<SquaredResiduals> {
    let of = likelihood.for_record(record);
    let tau_s = before.base[record.point].time_constant_s;
    let Power { response, noise } = of.power(split);
    let residual = |hypothesis| of.squares(hypothesis, tau_s, split);
    Some(SquaredResiduals { before: residual(before)?, after: residual(after)?, noise, response })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_more_is_noise_than_is_left() {
        let floor = |noise: f64| SquaredResiduals { before: 4.0, after: 1.0, noise, response: 1.0 }.gap().noise_floor;
        assert_eq!((floor(0.25), floor(9.0)), (0.5, 1.0));
    }
}
