//! The likelihood of records that do not repeat.
//!
//! What of them is compared, and by which errors, is said in [`plateau_errors`](crate::noise::plateau_errors). Columns beside the
//! response have errors of their own.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;
use rotorlead_numerics::sample;
use rotorlead_plant::Trace;

use super::excess::{Excess, Term};
use super::{AuxiliaryResidual, Power, RecordLikelihood, RecordWeights};
use crate::data::columns::Channel;
use crate::data::dataset::{Dataset, PreparedRecord};
use crate::data::plateaus::groups::{Group, LogGroups};
use crate::data::split::Split;
use crate::model::hypothesis::Hypothesis;
use crate::noise::plateau_errors::{ComparedRows, Errors, Filter, mean};

/// Parts of the time of a record. Chosen for a table that is read at a glance.
const TIMES: f64 = 10.0;
/// Levels are put together to this many ranges. Chosen for the same reason.
const LEVELS: f64 = 5.0;
/// How far off a record starts at most, in standard deviations of its response. Chosen: rows that show the start decide it, as the weight
/// of this is small beside that of rows. Lower pulls such a start; higher lets run off what no row shows.
const MOST_OFF: f64 = 10.0;

/// What a record that does not repeat is weighed by.
#[derive(Clone, Debug)]
pub(crate) struct PlateauWeights {
    /// The record's plateaus.
    log: Arc<LogGroups>,
    /// What each group is for.
    splits: Vec<Split>,
    /// What of each group is compared, with the way that the response goes there.
    parts: Vec<ComparedRows>,
    response: Filters,
    /// Of each column beside the response.
    channels: Vec<Filters>,
}

/// Errors, and what of a column is compared by them in either split.
#[derive(Clone, Debug, Default)]
struct Filters {
    errors: Errors,
    train: Filter,
    holdout: Filter,
}

impl Filters {
    fn for_split(&self, split: Split) -> &Filter {
        if split == Split::Train { &self.train } else { &self.holdout }
    }
}

impl PlateauWeights {
    /// For errors that are not known yet, all groups for what the experiment says.
    pub fn unit(log: &Arc<LogGroups>, channels: usize) -> Self {
        let weights = Self {
            log: Arc::clone(log),
            splits: log.groups.iter().map(|group| group.split).collect(),
            parts: log.parts.clone(),
            response: Filters::default(),
            channels: vec![Filters::default(); channels],
        };
        weights.with_filters()
    }

    /// The same errors with the groups for something else.
    pub fn assigned(&self, split: impl Fn(&Group) -> Split) -> Self {
        Self { splits: self.log.groups.iter().map(split).collect(), ..self.clone() }.with_filters()
    }

    fn with_filters(mut self) -> Self {
        self.response = self.filters(self.response.errors, true);
        self.channels = self.channels.iter().map(|channel| self.filters(channel.errors, false)).collect();
        self
    }

    /// What is compared of a column with these errors; `relative` where the size of the step counts.
    fn filters(&self, errors: Errors, relative: bool) -> Filters {
        let filter = |split| {
            let parts = self.groups().zip(&self.parts).enumerate().filter(|(_, ((_, own), _))| *own == split);
            let part = |(place, ((group, _), part)): (usize, ((&Group, Split), &ComparedRows))| {
                let is_kept_out = |before: usize| self.splits[before] == Split::Holdout;
                let enters = split == Split::Train && place.checked_sub(1).is_some_and(is_kept_out);
                // The noise is that of the response.
                if enters && relative { part.clone().entered(group.rows.start, group.noise) } else { part.clone() }
            };
            Filter::new(errors, parts.map(part), relative)
        };
        Filters { errors, train: filter(Split::Train), holdout: filter(Split::Holdout) }
    }

    fn groups(&self) -> impl Iterator<Item = (&Group, Split)> {
        self.log.groups.iter().zip(self.splits.iter().copied())
    }

    /// How many groups there are in a split.
    pub fn count(&self, split: Split) -> usize {
        self.splits.iter().filter(|own| **own == split).count()
    }

    /// Whether there are rows in a split.
    fn has(&self, split: Split) -> bool {
        self.groups().any(|(group, own)| own == split && !group.rows.is_empty())
    }

    /// The split whose rows say what is free: that which is fitted where there is such.
    fn known_by(&self) -> Split {
        if self.has(Split::Train) { Split::Train } else { Split::Holdout }
    }

    /// With the errors estimated from the `residual` of all rows. `simulated` is the response that it belongs to.
    fn weighed(mut self, residual: &[f64], simulated: &[f64]) -> Self {
        self.parts.iter_mut().for_each(|part| part.follow(simulated));
        let unweighed = self.filters(self.response.errors, true);
        self.response = self.filters(unweighed.for_split(self.known_by()).errors(residual), true);
        self
    }

    /// What of a difference is offset and start, at each row; what the static map is off by where that is free.
    fn free(&self, difference: &[f64], time_s: &[f64], tau_s: f64) -> Vec<f64> {
        if self.log.has_free_map {
            return self.off_the_map(difference);
        }
        let filter = self.response.for_split(self.known_by());
        let ones = vec![1.0; time_s.len()];
        let begin_s = time_s.first().copied().unwrap_or_default();
        let decay_at = |time_s: &f64| if self.log.begins_settled { 0.0 } else { (-(time_s - begin_s) / tau_s).exp() };
        let decay: Vec<f64> = time_s.iter().map(decay_at).collect();
        let (a, b, r) = (filter.apply(&ones), filter.apply(&decay), filter.apply(difference));
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        // Rows at which nothing is left of the start do not say where it was: then it is no farther off than the response ever goes.
        let prior = (MOST_OFF.powi(2) * sample::variance(&self.log.measured)).recip();
        let (aa, ab, bb, ar, br) = (dot(&a, &a), dot(&a, &b), dot(&b, &b) + prior, dot(&a, &r), dot(&b, &r));
        let determinant = aa * bb - ab * ab;
        // Columns that are alike to 1e-9 cannot be told apart but by rounding.
        let (offset, start) = if determinant > 1e-9 * aa * bb {
            ((bb * ar - ab * br) / determinant, (aa * br - ab * ar) / determinant)
        } else if aa > 0.0 {
            (ar / aa, 0.0)
        } else {
            (0.0, 0.0)
        };
        decay.iter().map(|decay| offset + start * decay).collect()
    }

    /// What of a difference the static map accounts for. A level is off by the mean over all visits to it. A step goes from one
    /// measured level to the next, by the part of the way that the simulated response has gone:
    ///
    /// ```text
    /// left = y - (1 - w) before - w level,   w = (simulated - its level before) / (its level - its level before)
    /// ```
    fn off_the_map(&self, difference: &[f64]) -> Vec<f64> {
        let levels = self.log.groups.iter().map(|group| group.rank + 1).max().unwrap_or(0);
        let mut sums = vec![(0.0, 0.0); levels];
        for (group, part) in self.log.groups.iter().zip(&self.parts).filter(|(_, part)| !part.settled.is_empty()) {
            let (sum, visits) = &mut sums[group.rank];
            *sum += mean(difference, &part.settled);
            *visits += 1.0;
        }
        let off = |group: &Group| {
            let (sum, visits) = sums[group.rank];
            if visits > 0.0 { sum / visits } else { 0.0 }
        };
        let mut free = vec![0.0; difference.len()];
        for group in &self.log.groups {
            free[group.rows.clone()].fill(off(group));
        }
        for (place, (group, part)) in self.log.groups.iter().zip(&self.parts).enumerate().skip(1) {
            let own = off(group);
            if part.settled.is_empty() || part.before.is_empty() {
                continue;
            }
            let before = off(&self.log.groups[place - 1]);
            let of_rows = |values: &dyn Fn(usize) -> f64, rows: &[usize]| {
                rows.iter().map(|&row| values(row)).sum::<f64>() / rows.len() as f64
            };
            let measured = |row: usize| self.log.measured[row];
            let simulated = |row: usize| self.log.measured[row] - difference[row];
            let [from, to] = [&part.before, &part.settled].map(|rows| of_rows(&measured, rows));
            let [start, end] = [&part.before, &part.settled].map(|rows| of_rows(&simulated, rows));
            let off_level = [mean(difference, &part.before) - before, mean(difference, &part.settled) - own];
            for (row, _) in &part.moving {
                let way = (simulated(*row) - start) / (end - start);
                // Chosen: as far beyond either level as from one to the other is more than any response overshoots.
                let way = if way.is_finite() { way.clamp(-1.0, 2.0) } else { 1.0 };
                let residual = self.log.measured[*row] - (1.0 - way) * from - way * to;
                free[*row] = difference[*row] - residual - (1.0 - way) * off_level[0] - way * off_level[1];
            }
        }
        free
    }
}

/// A record that does not repeat, with what it is weighed by.
pub(crate) struct Plateaus<'a> {
    data: &'a Dataset,
    record: &'a PreparedRecord,
    weights: &'a PlateauWeights,
}

impl<'a> Plateaus<'a> {
    pub fn new(data: &'a Dataset, record: &'a PreparedRecord, weights: &'a PlateauWeights) -> Self {
        Self { data, record, weights }
    }

    /// The plateaus.
    pub fn log(&self) -> &'a LogGroups {
        &self.weights.log
    }

    /// What a hypothesis leaves at each row, beside what is free.
    pub fn row_residual(&self, hypothesis: &Hypothesis) -> Option<Vec<f64>> {
        Some(self.beside_free(hypothesis, &hypothesis.difference(self.data, self.record)?))
    }

    fn beside_free(&self, hypothesis: &Hypothesis, difference: &[f64]) -> Vec<f64> {
        let tau_s = hypothesis.base[self.record.point].time_constant_s;
        let free = self.weights.free(difference, &self.record.time_s, tau_s);
        difference.iter().zip(free).map(|(difference, free)| difference - free).collect()
    }

    /// Rows that are compared in a split, with their groups.
    pub fn rows(&self, split: Split) -> impl Iterator<Item = (usize, &'a Group)> {
        let groups = self.weights.groups().filter(move |(_, own)| *own == split);
        groups.flat_map(|(group, _)| group.rows.clone().map(move |row| (row, group)))
    }

    /// Number and sum of squares of levels, and the mean square of each step's motion, over the rows of a split.
    pub fn levels_and_motion(&self, hypothesis: &Hypothesis, split: Split) -> Option<((f64, f64), Vec<f64>)> {
        Some(self.weights.response.for_split(split).squares(&self.row_residual(hypothesis)?))
    }

    /// Sum of squares of the rows of the record that a row stands for.
    fn square(&self, row: usize, residual: &[f64]) -> f64 {
        let (rows, scatter) = self.log().scatter[row];
        rows * residual[row].powi(2) + scatter
    }

    /// Columns beside the response, with their filters.
    fn channels(&self) -> impl Iterator<Item = (&Channel, &Filters)> {
        self.record.channels.iter().zip(&self.weights.channels)
    }

    /// What a model leaves of a column beside the sum of its predictions that comes nearest, by the rows that are fitted where there
    /// are such.
    fn residual(&self, channel: &Channel, filter: &Filter, trace: &Trace) -> Vec<f64> {
        let columns = channel.column.predicted(trace, channel.measured.len());
        let white: Vec<Vec<f64>> = columns.iter().map(|column| filter.apply(column)).collect();
        let measured = filter.apply(&channel.measured);
        // Each column over its length, since they differ by orders of magnitude; one that never moves says nothing. A singular value of
        // 1e-9 is rounding then.
        let lengths: Vec<f64> = white.iter().map(|column| dot(column, column).sqrt()).collect();
        let scale = |index: usize| if lengths[index] > 0.0 { lengths[index].recip() } else { 0.0 };
        let count = columns.len();
        let matrix = DMatrix::from_fn(count, count, |i, j| dot(&white[i], &white[j]) * scale(i) * scale(j));
        let right = DVector::from_fn(count, |i, _| dot(&white[i], &measured) * scale(i));
        let solution = rotorlead_numerics::linear::linear_least_squares(matrix, &right, 1e-9)
            .unwrap_or_else(|| DVector::zeros(count));
        let factors: Vec<f64> = solution.iter().enumerate().map(|(index, factor)| factor * scale(index)).collect();
        let nearest =
            |row: usize| columns.iter().zip(&factors).map(|(column, factor)| factor * column[row]).sum::<f64>();
        channel.measured.iter().enumerate().map(|(row, measured)| measured - nearest(row)).collect()
    }
}

impl RecordLikelihood for Plateaus<'_> {
    fn end(&self, split: Split) -> usize {
        if self.weights.has(split) { self.record.time_s.len() } else { 0 }
    }

    fn residual(&self, hypothesis: &Hypothesis, split: Split) -> Option<Vec<Complex64>> {
        let white = self.weights.response.for_split(split).apply(&self.row_residual(hypothesis)?);
        Some(white.into_iter().map(Complex64::from).collect())
    }

    fn auxiliary_residuals(&self, trace: &Trace) -> Option<Vec<AuxiliaryResidual>> {
        let known_by = self.weights.known_by();
        let of_channel = |(channel, filters): (&Channel, &Filters)| {
            let filter = filters.for_split(known_by);
            let white = filter.apply(&self.residual(channel, filter, trace));
            AuxiliaryResidual { white: white.into_iter().map(Complex64::from).collect(), numbers: filter.numbers() }
        };
        Some(self.channels().map(of_channel).collect())
    }

    fn weighed(&self, hypothesis: &Hypothesis) -> Option<RecordWeights> {
        let residual = self.row_residual(hypothesis)?;
        let simulated: Vec<f64> =
            self.record.measured.iter().zip(&residual).map(|(y, residual)| y - residual).collect();
        let mut weights = self.weights.clone().weighed(&residual, &simulated);
        if !self.record.channels.is_empty() {
            let trace = hypothesis.trace(self.data, self.record)?;
            let known_by = weights.known_by();
            let of_channel = |(channel, old): (&Channel, &Filters)| {
                let unweighed = weights.filters(old.errors, false);
                let filter = unweighed.for_split(known_by);
                weights.filters(filter.errors(&self.residual(channel, filter, &trace)), false)
            };
            weights.channels = self.channels().map(of_channel).collect();
        }
        Some(RecordWeights::Plateaus(weights))
    }

    fn terms(&self, hypothesis: &Hypothesis, split: Split) -> Vec<Term> {
        let Some(residual) = self.row_residual(hypothesis) else { return Vec::new() };
        let (log, record) = (self.log(), self.record);
        let unit = log.rows_per_sample.recip();
        let length_s = record.time_s[record.time_s.len() - 1] - record.time_s[0];
        let commands = || log.groups.iter().map(|group| group.command);
        let (low, high) = (commands().fold(f64::INFINITY, f64::min), commands().fold(f64::NEG_INFINITY, f64::max));
        let of_row = |(row, group): (usize, &Group)| {
            let (rows, _) = log.scatter[row];
            let moved = (group.step != 0.0).then_some(group.step);
            Term {
                excess: Excess {
                    sum: unit * self.square(row, &residual) / (group.noise * group.noise),
                    expected: unit * rows,
                },
                scale: group.noise * group.noise / unit,
                line: None,
                nominal: Some(bin(group.command, low, high, LEVELS)),
                // Steps of a staircase are alike or much larger: whole hundredths of the command.
                step: moved.map(|step| (100.0 * step.abs()).round() / 100.0),
                direction: moved.map(f64::signum),
                time_s: Some(bin(record.time_s[row] - record.time_s[0], 0.0, length_s, TIMES)),
            }
        };
        self.rows(split).map(of_row).collect()
    }

    /// The state at the begin and the zero are those that [`RecordLikelihood::residual`] leaves out.
    fn squares(&self, hypothesis: &Hypothesis, _: f64, split: Split) -> Option<f64> {
        let residual = self.row_residual(hypothesis)?;
        Some(self.rows(split).map(|(row, _)| self.square(row, &residual)).sum())
    }

    fn change(&self, one: &Hypothesis, other: &Hypothesis, _: f64, split: Split) -> Option<f64> {
        let (one, other) = (self.row_residual(one)?, self.row_residual(other)?);
        let of_row = |row: usize| self.log().scatter[row].0 * (one[row] - other[row]).powi(2);
        Some(self.rows(split).map(|(row, _)| of_row(row)).sum())
    }

    fn power(&self, split: Split) -> Power {
        let log = self.log();
        let rows = || self.rows(split).map(|(row, group)| (log.scatter[row], self.record.measured[row], group.noise));
        let count: f64 = rows().map(|((rows, _), ..)| rows).sum();
        let mean = rows().map(|((rows, _), measured, _)| rows * measured).sum::<f64>() / count;
        Power {
            response: rows().map(|((rows, scatter), measured, _)| rows * (measured - mean).powi(2) + scatter).sum(),
            noise: rows().map(|((rows, _), _, noise)| rows * noise * noise).sum(),
        }
    }

    fn noise_std(&self) -> f64 {
        self.log().groups.iter().map(|group| group.noise).fold(0.0, f64::max)
    }
}

/// The part of a range that a value is in, of so many.
fn bin(value: f64, low: f64, high: f64, count: f64) -> (f64, f64) {
    let width = (high - low) / count;
    let index = if width > 0.0 { ((value - low) / width).floor().clamp(0.0, count - 1.0) } else { 0.0 };
    (low + index * width, low + (index + 1.0) * width)
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
