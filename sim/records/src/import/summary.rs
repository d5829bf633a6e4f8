//! What an importer did, in a form that can be printed or written as JSON.

use std::path::PathBuf;

use serde::Serialize;

use super::format::LogFormat;
use super::missing::MissingOption;
use super::plain::Beside;
use super::quantity::Quantity;
use super::table::Table;
use crate::finding::{Finding, Topic};

/// What was found in a log and what became of it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ImportSummary {
    /// The log.
    pub file: PathBuf,
    /// Its format.
    pub format: &'static LogFormat,
    /// Rows with at least one value.
    pub rows_read: usize,
    /// Rows in the record.
    pub rows_taken: usize,
    /// Every column of the log, in its order.
    pub columns: Vec<ColumnUse>,
    /// Rows that were left out.
    pub dropped: Vec<DroppedRows>,
    /// How the times of the rows were found.
    pub timing: Timing,
    /// Whether the command was a pulse width, so that the stated range of the ESC signal was used.
    #[serde(skip)]
    pub pulse_widths: bool,
    /// Whether it is one of several motors, which [`ImportOptions::motor`](super::ImportOptions::motor) takes.
    #[serde(skip)]
    pub has_motors: bool,
    /// Whether the speed was in electrical revolutions, so that the number of poles was used.
    #[serde(skip)]
    pub is_electrical: bool,
    /// What a reader of the record has to know.
    pub notes: Vec<String>,
}

impl ImportSummary {
    /// A finding about the unit of a record's column, with the log's column that it was and how to state another unit of that.
    #[must_use]
    pub fn with_source(&self, finding: Finding, column: &str) -> Finding {
        let is_it = |source: &&ColumnUse| source.taken_as.as_deref() == Some(column);
        let quantity = Quantity::ALL.into_iter().find(|quantity| quantity.column() == column);
        let (Some(source), Some(quantity)) = (self.columns.iter().find(is_it), quantity) else { return finding };
        if finding.topic != Topic::ResponseUnit || !self.format.has_stated_columns {
            return finding;
        }
        let remedy = format!(
            "it is `{}` of the log, {}. `{}` takes it in another unit: {}",
            source.name,
            source.note,
            MissingOption::column(quantity, &source.name, "UNIT"),
            quantity.units()
        );
        Finding { remedy: Some(remedy), ..finding }
    }
}

/// What became of one column.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct ColumnUse {
    /// Its name in the log.
    pub name: String,
    /// The column of the record that it became; `None` when it was not taken.
    pub taken_as: Option<String>,
    /// The conversion, or why it was not taken.
    pub note: String,
}

/// Rows left out, and why.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct DroppedRows {
    /// How many.
    pub rows: usize,
    /// Why.
    pub reason: String,
}

/// How the times of the rows were found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Timing {
    /// The method, in a sentence.
    pub method: String,
    /// Rows per second, on average.
    pub rate_hz: f64,
    /// Rows whose stamps were out of order and were sorted.
    pub rows_reordered: usize,
    /// Rows that never arrived; the record has gaps in their place.
    pub rows_missing: usize,
    /// RMS distance of the stamps from the even grid, seconds; `None` where stamps were kept.
    pub residual_rms_s: Option<f64>,
    /// Largest distance of a stamp from the even grid, seconds; `None` where stamps were kept.
    pub residual_max_s: Option<f64>,
}

/// Collects what becomes of each column.
pub(super) struct ColumnList {
    columns: Vec<ColumnUse>,
}

impl ColumnList {
    /// All of `table`'s columns, none taken so far, and what is beside them.
    pub(super) fn new(table: &Table<'_>, beside: &[Beside]) -> Self {
        let left = |name: &String| ColumnUse {
            name: name.clone(),
            taken_as: None,
            note: String::from("no part of an experiment"),
        };
        let beside = beside.iter().map(|beside| ColumnUse {
            name: beside.name.clone(),
            taken_as: None,
            note: format!("{}, and no vector", beside.shown),
        });
        Self { columns: table.header.iter().map(left).chain(beside).collect() }
    }

    pub(super) fn taken(&mut self, column: usize, taken_as: &str, note: impl Into<String>) {
        self.columns[column].taken_as = Some(taken_as.into());
        self.columns[column].note = note.into();
    }

    pub(super) fn left(&mut self, column: usize, note: impl Into<String>) {
        self.columns[column].taken_as = None;
        self.columns[column].note = note.into();
    }

    /// All of them; trailing commas are no columns.
    pub(super) fn into_vec(mut self) -> Vec<ColumnUse> {
        self.columns.retain(|column| !column.name.is_empty());
        self.columns
    }
}
