//! What an estimator can find wrong with a record that was read without complaint.

use miette::Diagnostic;
use thiserror::Error;

/// Why a record does not serve an estimator that needs evenly spaced rows or whole periods.
///
/// Rows are counted from one, the header line apart.
#[derive(Clone, Debug, PartialEq, Error, Diagnostic)]
pub enum RecordError {
    /// The rows are not evenly spaced.
    #[error(
        "`{file}`, row {row}: {} s after the row before it; the rows are {} s apart otherwise",
        short(*interval_s),
        short(*typical_s)
    )]
    #[diagnostic(help(
        "cut the record there if rows are missing; \
         where rows are even and only their stamps are not, write even stamps"
    ))]
    Gap {
        /// The record's file.
        file: String,
        /// The row that comes too early or too late.
        row: usize,
        /// Time since the row before it, seconds.
        interval_s: f64,
        /// Median time between rows, seconds.
        typical_s: f64,
    },
    /// The rows get slowly denser or sparser along the record.
    #[error("`{file}`, row {row}: {} s away from where evenly spaced rows would have it", short(*offset_s))]
    #[diagnostic(help(
        "the sampling rate changes along the record: resample it, or write the stamps of the sampling clock"
    ))]
    Drift {
        /// The record's file.
        file: String,
        /// The row that is farthest away.
        row: usize,
        /// How far it is away, seconds; positive: late.
        offset_s: f64,
    },
    /// The record has fewer than two rows (only possible for one made in memory).
    #[error("`{file}`: {rows} rows have no sampling rate")]
    #[diagnostic(help("a record needs two rows at least"))]
    TooFewRows {
        /// The record's file.
        file: String,
        /// How many rows there are.
        rows: usize,
    },
    /// The record's period is not known.
    #[error("`{file}`: the record has no period")]
    #[diagnostic(help("give `period_s` in its [[record]] of experiment.toml, if it is periodic"))]
    NoPeriod {
        /// The record's file.
        file: String,
    },
    /// The period is not a whole number of samples.
    #[error(
        "`{file}`: its period of {period_s} s is {samples:.4} samples at {} Hz, not a whole number",
        short(*rate_hz)
    )]
    #[diagnostic(help("correct `period_s` in experiment.toml, or record at a rate of which it is a multiple"))]
    PartialSample {
        /// The record's file.
        file: String,
        /// Period, seconds.
        period_s: f64,
        /// Period, samples.
        samples: f64,
        /// Sampling rate, hertz.
        rate_hz: f64,
    },
    /// The record ends before its first period does.
    #[error("`{file}`: {rows} rows are less than one period of {samples_per_period} samples")]
    #[diagnostic(help("record one whole period at least, or correct `period_s` in experiment.toml"))]
    PartialPeriod {
        /// The record's file.
        file: String,
        /// Rows of the record.
        rows: usize,
        /// Period, samples.
        samples_per_period: usize,
    },
}

impl RecordError {
    /// The row concerned, counted from one, where it is one row.
    #[must_use]
    pub fn row(&self) -> Option<usize> {
        match self {
            Self::Gap { row, .. } | Self::Drift { row, .. } => Some(*row),
            _ => None,
        }
    }
}

/// A number without digits that only arithmetic made.
pub(super) fn short(value: f64) -> String {
    // Nine digits tell a rate from any other that a record of minutes can show.
    format!("{value:.8e}").parse().map_or_else(|_| value.to_string(), |short: f64| short.to_string())
}
