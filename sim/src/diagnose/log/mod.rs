//! Records that do not repeat: steps, staircases, chirps and anything else, with rows as they came.
//!
//! They have no lines to compare on, and what models miss of them is mostly the models' error, not noise: a static map is off by
//! the same all over a plateau. So
//!
//! - start-up, standstill, spikes and what follows a gap of the logger are cut out (`cut`);
//! - the residual is made white with an error that is correlated in time (`correlated`), so that what is missed by the same for
//!   long counts once;
//! - what is held out is whole steps, by splits that are written down beforehand (`split`);
//! - whether anything is left to explain is judged by the scatter of settled rows about their own mean, which no model of the
//!   command can explain, and not by the error that the models leave.

mod correlated;
mod cut;
mod gap;
mod locate;
mod split;
mod start;

use std::ops::Range;

pub use cut::CutRows;
pub(super) use cut::{Prepared, prepare};
pub use gap::SplitGap;
pub(super) use gap::{gaps, log_squares};
pub(super) use locate::{add, excess};
pub(super) use split::Folds;
pub(super) use start::first_lag;

use super::trial::Purpose;
use crate::identify::steps::Plateau;
pub(super) use correlated::{Correlation, Filter, Rows};

/// A stretch of rows that is fitted or held out as a whole: a plateau with the step that leads to it, or a tenth of a record
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
    pub purpose: Purpose,
}

/// While the response moves, a model is off by no more than it moves in this time, seconds.
const MOST_JITTER_S: f64 = 0.1;
/// Noise of a row is at least this share of the scatter of the quietest plateau, most of which may be slow.
const LEAST_WHITE: f64 = 0.03;

/// What a record that does not repeat has beside the rest of a trial.
#[derive(Clone, Debug)]
pub(super) struct Log {
    /// Its groups, which follow each other.
    pub groups: Vec<Group>,
    /// Whether each row is compared.
    pub kept: Vec<bool>,
    /// What was cut out.
    pub cut: CutRows,
    /// Whether it begins settled on a level.
    pub begins_settled: bool,
    /// Whether the experiment says what it is for.
    pub has_role: bool,
    /// Rows of noise that are worth one independent row.
    pub rows_per_sample: f64,
    /// What its residual is taken to be.
    correlation: Correlation,
    /// Slope of the simulated response at each row, per second.
    slope: Vec<f64>,
    fitted: Subset,
    held_out: Subset,
}

/// The rows of a purpose, with what makes them white.
#[derive(Clone, Debug, Default)]
struct Subset {
    rows: Vec<usize>,
    filter: Filter,
}

impl Subset {
    fn take(&self, values: &[f64]) -> Vec<f64> {
        self.rows.iter().map(|&row| values[row]).collect()
    }

    fn white(&self, values: &[f64]) -> Vec<f64> {
        self.filter.apply(&self.take(values))
    }
}

impl Log {
    /// Whether it has rows for this purpose.
    pub fn has(&self, purpose: Purpose) -> bool {
        !self.subset(purpose).rows.is_empty()
    }

    fn subset(&self, purpose: Purpose) -> &Subset {
        match purpose {
            Purpose::Fit => &self.fitted,
            Purpose::HeldOut => &self.held_out,
        }
    }

    /// Rows that are compared for a purpose, with their groups.
    pub fn rows(&self, purpose: Purpose) -> impl Iterator<Item = (usize, &Group)> {
        let groups = self.groups.iter().filter(move |group| group.purpose == purpose);
        groups.flat_map(|group| group.rows.clone().map(move |row| (row, group))).filter(|(row, _)| self.kept[*row])
    }

    /// Says anew what each group is for.
    pub fn assign(&mut self, time_s: &[f64], purpose: impl Fn(&Group) -> Purpose) {
        for group in &mut self.groups {
            group.purpose = purpose(group);
        }
        self.set_filters(time_s);
    }

    /// What a filter has to know of the rows of a purpose; as if the response rested where `moves` does not say otherwise.
    pub fn seen(&self, purpose: Purpose, time_s: &[f64], moves: bool) -> Rows {
        let mut rows = Rows::default();
        let mut before = None;
        for (row, group) in self.rows(purpose) {
            rows.time_s.push(time_s[row]);
            rows.slope.push(if moves { self.slope[row] } else { 0.0 });
            let begin = group.rows.start;
            rows.changed.push(self.begins_settled && before.is_some_and(|before| before != begin));
            before = Some(begin);
        }
        rows
    }

    fn set_filters(&mut self, time_s: &[f64]) {
        let subset = |purpose| {
            let rows: Vec<usize> = self.rows(purpose).map(|(row, _)| row).collect();
            let filter = Filter::new(self.correlation, &self.seen(purpose, time_s, true));
            Subset { rows, filter }
        };
        (self.fitted, self.held_out) = (subset(Purpose::Fit), subset(Purpose::HeldOut));
    }

    /// Takes the correlation from a residual of all rows. `simulated` is what it is the residual of.
    pub fn weigh(&mut self, time_s: &[f64], residual: &[f64], simulated: &[f64]) {
        let last = time_s.len() - 1;
        let slope = |row: usize| {
            let (from, to) = (row.saturating_sub(1), (row + 1).min(last));
            (simulated[to] - simulated[from]) / (time_s[to] - time_s[from])
        };
        self.slope = (0..=last).map(slope).collect();
        let purpose = if self.has(Purpose::Fit) { Purpose::Fit } else { Purpose::HeldOut };
        let subset = self.subset(purpose);
        let floor = LEAST_WHITE * self.groups.iter().map(|group| group.noise).fold(f64::INFINITY, f64::min);
        let residual = subset.take(residual);
        self.correlation = Correlation::of(&self.seen(purpose, time_s, true), &residual, floor, MOST_JITTER_S);
        self.set_filters(time_s);
    }

    /// The white residual of the rows of a purpose. What a sensor's zero, and the state from which a record starts that does
    /// not begin settled, add is taken from the rows that are fitted.
    pub fn white(&self, purpose: Purpose, difference: &[f64], time_s: &[f64], tau_s: f64) -> Vec<f64> {
        let free = self.free(difference, time_s, tau_s);
        let left: Vec<f64> = difference.iter().zip(free).map(|(difference, free)| difference - free).collect();
        self.subset(purpose).white(&left)
    }

    /// What of a difference is offset and start, at each row.
    pub fn free(&self, difference: &[f64], time_s: &[f64], tau_s: f64) -> Vec<f64> {
        let rows = if self.has(Purpose::Fit) { &self.fitted } else { &self.held_out };
        let ones = vec![1.0; time_s.len()];
        let begin_s = time_s.first().copied().unwrap_or_default();
        let decay_at = |time_s: &f64| if self.begins_settled { 0.0 } else { (-(time_s - begin_s) / tau_s).exp() };
        let decay: Vec<f64> = time_s.iter().map(decay_at).collect();
        let (a, b, r) = (rows.white(&ones), rows.white(&decay), rows.white(difference));
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
}
