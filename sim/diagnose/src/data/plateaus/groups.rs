//! The groups of rows of a record that does not repeat, and what was cut out of it.

use serde::Serialize;
use std::fmt;
use std::ops::Range;

use rotorlead_identify::lag::steps::Plateau;

use crate::data::split::Split;
use crate::noise::plateau_errors::ComparedRows;

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

/// The groups of a record that does not repeat, with its rows.
#[derive(Clone, Debug)]
pub(crate) struct LogGroups {
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
    pub parts: Vec<ComparedRows>,
}

impl LogGroups {
    pub fn new(
        groups: Vec<Group>,
        parts: Vec<ComparedRows>,
        cut: CutRows,
        begins_settled: bool,
        rows_per_sample: f64,
    ) -> Self {
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

/// Rows of a record that are not compared.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct CutRows {
    /// The record's file.
    pub file: String,
    /// Rows of the record.
    pub rows: usize,
    /// Rows before the motor runs settled on a level.
    pub start: usize,
    /// Rows after it stops.
    pub end: usize,
    /// Readings that no rotor can have made.
    pub spikes: usize,
    /// Rows after gaps of the logger during a step.
    pub after_gaps: usize,
    /// Steps of which therefore only the level is compared.
    pub stalled_steps: usize,
    /// Steps of the record.
    pub steps: usize,
    /// Rows on which the response stands on a limit of its scale, or comes back from one.
    #[serde(skip)]
    pub limited: usize,
}

impl CutRows {
    /// Whether anything was cut.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.start + self.end + self.spikes + self.after_gaps + self.limited == 0
    }

    /// Of how many steps the log shows nothing but the level, and why; `None` where it shows all.
    #[must_use]
    pub fn stalls(&self) -> Option<String> {
        (self.stalled_steps > 0).then(|| {
            format!(
                "{}: the log stands still during {} of {} steps, for longer than the step takes to begin. Of these only the levels are \
                 compared, and how late they begin at least: what a log reads when it goes on is old. Find out why it stalls",
                self.file, self.stalled_steps, self.steps
            )
        })
    }
}

impl fmt::Display for CutRows {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let parts = [
            (self.start, "before the motor runs steadily"),
            (self.end, "after it stops"),
            (self.spikes, "that are spikes"),
            (self.after_gaps, "after gaps of the logger during a step"),
            (self.limited, "on which the response stands on a limit of its scale"),
        ];
        let said = parts.iter().filter(|(rows, _)| *rows > 0).map(|(rows, what)| format!("{rows} {what}"));
        let said = said.collect::<Vec<_>>().join(", ");
        write!(f, "{}: of {} rows {}", self.file, self.rows, if said.is_empty() { "none" } else { &said })
    }
}
