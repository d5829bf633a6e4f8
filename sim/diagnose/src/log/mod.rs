//! Records that do not repeat: steps, staircases, chirps and anything else, with rows as they came.
//!
//! They have no lines to compare on, and what models miss of them is mostly the models' error, not noise: a static map is off by
//! the same all over a plateau. So
//!
//! - start-up, standstill, spikes and what follows a gap of the logger are cut out (`cut`);
//! - levels and what happens between them are compared separately, each level as one number (`errors`);
//! - what is held out is whole steps, by splits that are written down beforehand (`split`);
//! - whether anything is left to explain is evaluated by the scatter of settled rows about their own mean, which no model of the
//!   command can explain, and not by the error that the models leave.

mod cut;
mod errors;
mod gap;
mod lateness;
mod locate;
mod rows;
mod search;
mod split;
mod start;

use std::ops::Range;

pub use cut::CutRows;
pub(super) use cut::{Prepared, prepare};
pub use gap::SplitGap;
pub(super) use gap::{Left, gaps, log_squares};
pub use lateness::Lateness;
pub(super) use locate::{add, excess};
pub use search::Decision;
pub(super) use start::first_lag;

use rotorlead_identify::steps::Plateau;

use errors::Part;
pub(super) use rows::Blocks;

use super::dataset::Split;
pub(super) use errors::{Errors, Filter};

/// A segment of rows that is fitted or held out as a whole: a plateau with the step that leads to it, or a tenth of a record
/// without plateaus.
#[derive(Clone, Debug)]
pub(super) struct Group {
    /// Its rows.
    pub rows: Range<usize>,
    /// The command there, its mean where it moves.
    pub command: f64,
    /// By how much the command changed to get there.
    pub step: f64,
    /// The plateau, where it is one.
    pub plateau: Option<Plateau>,
    /// Rank of its command among the levels of the record, or its place in the record.
    pub rank: usize,
    /// Standard deviation of a row by noise alone.
    pub noise: f64,
    /// What it is for.
    pub split: Split,
}

/// What a record that does not repeat has beside the rest of a dataset.
#[derive(Clone, Debug)]
pub(super) struct Log {
    /// Its groups, which follow each other.
    pub groups: Vec<Group>,
    /// The response at each row.
    measured: Vec<f64>,
    /// How many rows of the record each row stands for, and the sum of squares of their response about its mean.
    pub scatter: Vec<(f64, f64)>,
    /// What was cut out.
    pub cut: CutRows,
    /// Whether it begins settled on a level.
    pub begins_settled: bool,
    /// Whether the static map is free, a number for each level.
    pub has_free_map: bool,
    /// Whether the experiment says what it is for.
    pub has_role: bool,
    /// Rows of noise that are worth one independent row.
    pub rows_per_sample: f64,
    /// What of each group is compared.
    parts: Vec<Part>,
    /// How much a model of the response is off.
    errors: Errors,
    fitted: Filter,
    held_out: Filter,
}

impl Log {
    fn new(groups: Vec<Group>, parts: Vec<Part>, cut: CutRows, begins_settled: bool, rows_per_sample: f64) -> Self {
        Self {
            groups,
            parts,
            cut,
            begins_settled,
            rows_per_sample,
            measured: Vec::new(),
            scatter: Vec::new(),
            has_free_map: false,
            has_role: false,
            errors: Errors::default(),
            fitted: Filter::default(),
            held_out: Filter::default(),
        }
    }

    /// Deviation of the command about a level that the log stands for: half its smallest step, or half of what the command goes
    /// through where there are no plateaus.
    pub fn amplitude(&self, command: &[f64]) -> f64 {
        let steps = self.groups.iter().map(|group| group.step.abs()).filter(|step| *step > 0.0);
        let range = || {
            let (low, high) =
                command.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), u| (low.min(*u), high.max(*u)));
            high - low
        };
        0.5 * steps.reduce(f64::min).unwrap_or_else(range)
    }

    /// Whether it has rows in this split.
    pub fn has(&self, split: Split) -> bool {
        self.rows(split).next().is_some()
    }

    /// Rows that are compared in a split, with their groups.
    pub fn rows(&self, split: Split) -> impl Iterator<Item = (usize, &Group)> {
        let groups = self.groups.iter().filter(move |group| group.split == split);
        groups.flat_map(|group| group.rows.clone().map(move |row| (row, group)))
    }

    /// Says anew what each group is for.
    pub fn assign(&mut self, split: impl Fn(&Group) -> Split) {
        for group in &mut self.groups {
            group.split = split(group);
        }
        self.set_filters();
    }

    /// What is compared in a split of a column with these errors; `relative` where the size of the step counts.
    pub fn filter(&self, errors: Errors, split: Split, relative: bool) -> Filter {
        let parts = self.groups.iter().zip(&self.parts).enumerate().filter(|(_, (group, _))| group.split == split);
        let part = |(place, (group, part)): (usize, (&Group, &Part))| {
            let is_kept_out = |before: usize| self.groups[before].split == Split::Holdout;
            let enters = split == Split::Train && place.checked_sub(1).is_some_and(is_kept_out);
            // The noise is that of the response.
            if enters && relative { part.clone().entered(group.rows.start, group.noise) } else { part.clone() }
        };
        Filter::new(errors, parts.map(part), relative)
    }

    fn set_filters(&mut self) {
        let filter = |split| self.filter(self.errors, split, true);
        (self.fitted, self.held_out) = (filter(Split::Train), filter(Split::Holdout));
    }

    fn of(&self, split: Split) -> &Filter {
        if split == Split::Train { &self.fitted } else { &self.held_out }
    }

    /// The split whose rows say what is free: that which is fitted where there is such.
    pub fn known_by(&self) -> Split {
        if self.has(Split::Train) { Split::Train } else { Split::Holdout }
    }

    /// Takes the errors from a residual of all rows. `simulated` is what it is the residual of.
    pub fn weigh(&mut self, residual: &[f64], simulated: &[f64]) {
        self.parts.iter_mut().for_each(|part| part.follow(simulated));
        self.set_filters();
        self.errors = self.of(self.known_by()).errors_of(residual);
        self.set_filters();
    }

    /// Number and sum of squares of levels, and the mean square of each step's motion, over the rows of a split.
    pub fn squares(&self, split: Split, difference: &[f64], time_s: &[f64], tau_s: f64) -> ((f64, f64), Vec<f64>) {
        let free = self.free(difference, time_s, tau_s);
        let left: Vec<f64> = difference.iter().zip(free).map(|(difference, free)| difference - free).collect();
        self.of(split).squares(&left)
    }

    /// Minus twice the log likelihood of a difference over the rows of a split, with the errors that it has itself.
    pub fn deviance(&self, split: Split, difference: &[f64], time_s: &[f64], tau_s: f64) -> f64 {
        let free = self.free(difference, time_s, tau_s);
        let left: Vec<f64> = difference.iter().zip(free).map(|(difference, free)| difference - free).collect();
        self.of(split).deviance(&left)
    }

    /// The white residual of the rows of a split. What a sensor's zero, and the state from which a record starts that does
    /// not begin settled, add is taken from the rows that are fitted.
    pub fn white(&self, split: Split, difference: &[f64], time_s: &[f64], tau_s: f64) -> Vec<f64> {
        let free = self.free(difference, time_s, tau_s);
        let left: Vec<f64> = difference.iter().zip(free).map(|(difference, free)| difference - free).collect();
        self.of(split).apply(&left)
    }

    /// What of a difference is offset and start, at each row; what the static map is off by where that is free.
    pub fn free(&self, difference: &[f64], time_s: &[f64], tau_s: f64) -> Vec<f64> {
        if self.has_free_map {
            return self.off_the_map(difference);
        }
        let filter = self.of(self.known_by());
        let ones = vec![1.0; time_s.len()];
        let begin_s = time_s.first().copied().unwrap_or_default();
        let decay_at = |time_s: &f64| if self.begins_settled { 0.0 } else { (-(time_s - begin_s) / tau_s).exp() };
        let decay: Vec<f64> = time_s.iter().map(decay_at).collect();
        let (a, b, r) = (filter.apply(&ones), filter.apply(&decay), filter.apply(difference));
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let (aa, ab, bb, ar, br) = (dot(&a, &a), dot(&a, &b), dot(&b, &b), dot(&a, &r), dot(&b, &r));
        let determinant = aa * bb - ab * ab;
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
        let levels = self.groups.iter().map(|group| group.rank + 1).max().unwrap_or(0);
        let mut sums = vec![(0.0, 0.0); levels];
        for (group, part) in self.groups.iter().zip(&self.parts).filter(|(_, part)| !part.settled.is_empty()) {
            let (sum, visits) = &mut sums[group.rank];
            *sum += errors::mean(difference, &part.settled);
            *visits += 1.0;
        }
        let off = |group: &Group| {
            let (sum, visits) = sums[group.rank];
            if visits > 0.0 { sum / visits } else { 0.0 }
        };
        let mut free = vec![0.0; difference.len()];
        for group in &self.groups {
            free[group.rows.clone()].fill(off(group));
        }
        for (place, (group, part)) in self.groups.iter().zip(&self.parts).enumerate().skip(1) {
            let own = off(group);
            if part.settled.is_empty() || part.before.is_empty() {
                continue;
            }
            let before = off(&self.groups[place - 1]);
            let of_rows = |values: &dyn Fn(usize) -> f64, rows: &[usize]| {
                rows.iter().map(|&row| values(row)).sum::<f64>() / rows.len() as f64
            };
            let measured = |row: usize| self.measured[row];
            let simulated = |row: usize| self.measured[row] - difference[row];
            let [from, to] = [&part.before, &part.settled].map(|rows| of_rows(&measured, rows));
            let [start, end] = [&part.before, &part.settled].map(|rows| of_rows(&simulated, rows));
            let off_level =
                [errors::mean(difference, &part.before) - before, errors::mean(difference, &part.settled) - own];
            for (row, _) in &part.moving {
                let way = (simulated(*row) - start) / (end - start);
                let way = if way.is_finite() { way.clamp(-1.0, 2.0) } else { 1.0 };
                let left = self.measured[*row] - (1.0 - way) * from - way * to;
                free[*row] = difference[*row] - left - (1.0 - way) * off_level[0] - way * off_level[1];
            }
        }
        free
    }
}
