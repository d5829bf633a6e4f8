//! Records that do not repeat: steps, staircases, chirps and anything else, with rows as they came.
//!
//! They have no lines to compare on, and what models miss of them is mostly the models' error, not noise: a static map is off by
//! the same all over a plateau. So
//!
//! - start-up, standstill, spikes and what follows a gap of the logger are cut out (`cut`);
//! - levels and what happens between them are compared separately, each level as one number (`noise::plateau_errors`);
//! - what is held out is whole steps, by splits that are written down beforehand (`split`);
//! - whether anything is left to explain is evaluated by the scatter of settled rows about their own mean, which no model of the
//!   command can explain, and not by the error that the models leave.

pub(crate) mod cut;
pub(crate) mod rows;
pub(crate) mod split;

use std::ops::Range;

use rotorlead_identify::lag::steps::Plateau;

use super::dataset::Split;
use crate::noise::plateau_errors::Part;
use cut::CutRows;

/// A segment of rows that is fitted or held out as a whole: a plateau with the step that leads to it, or a tenth of a record
/// without plateaus.
#[derive(Clone, Debug)]
pub(crate) struct Group {
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
    /// What it is for, unless a fold says another.
    pub split: Split,
}

/// What a record that does not repeat has beside the rest of a dataset.
#[derive(Clone, Debug)]
pub(crate) struct Log {
    /// Its groups, which follow each other.
    pub groups: Vec<Group>,
    /// The response at each row.
    pub measured: Vec<f64>,
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
    pub parts: Vec<Part>,
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
        }
    }

    /// With all of it for one purpose.
    pub fn assign(&mut self, split: Split, has_role: bool) {
        self.groups.iter_mut().for_each(|group| group.split = split);
        self.has_role = has_role;
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
}
