//! What the rows of a record show to be wrong with it, before anything is fitted.

use miette::Diagnostic;
use rotorlead_records::files::{shown, shown_to};
use thiserror::Error;

use super::units::{CommandUnit, ResponseUnit};

/// A sign that a record is not what its folder states, or holds too little information.
#[derive(Clone, Debug, PartialEq, Error, Diagnostic)]
pub enum RecordFault {
    /// Rows are missing.
    #[error(
        "{file}: {} of {longest_s:.3} s before row {row}",
        if *count == 1 { String::from("one gap") } else { format!("{count} gaps, the longest") }
    )]
    #[diagnostic(help(
        "cut the record at its gaps, or record again: nothing is filled in, and a multisine or a chirp needs every row"
    ))]
    Gaps {
        /// The record.
        file: String,
        /// How many.
        count: usize,
        /// The row after the longest, from one.
        row: usize,
        /// Its length, seconds.
        longest_s: f64,
    },
    /// Rows that are too slow for any motor.
    #[error("{file}: {rate_hz:.1} rows a second are too few for a motor's lag, which is over in 0.02 to 0.2 s")]
    #[diagnostic(help("record 100 rows a second or more; 1000 are usual"))]
    SlowRows {
        /// The record.
        file: String,
        /// Rows per second.
        rate_hz: f64,
    },
    /// Rows that are too slow for the lag that was found.
    #[error("{file}: {rate_hz:.0} rows a second are {rows_per_lag:.1} in one time constant of {time_constant_s:.3} s")]
    #[diagnostic(help("record {needed_hz:.0} rows a second or more: five in a time constant at least"))]
    FewRowsPerLag {
        /// The record.
        file: String,
        /// Rows per second.
        rate_hz: f64,
        /// The time constant that was found, seconds.
        time_constant_s: f64,
        /// Rows in it.
        rows_per_lag: f64,
        /// The least rate, hertz.
        needed_hz: f64,
    },
    /// Times that are not in seconds.
    #[error("{file}: the rows are {interval} apart in `time_s`, {reason}: the times are in {unit}, not in seconds")]
    #[diagnostic(help("divide `time_s` by {factor}"))]
    TimeUnit {
        /// The record.
        file: String,
        /// Usual difference of the times, in their own unit.
        interval: f64,
        /// What shows it.
        reason: String,
        /// Their unit, as it seems.
        unit: &'static str,
        /// Of how many a second consists.
        factor: f64,
    },
    /// A command that is no duty.
    #[error("{file}, row {row}: `command` runs from {} to {}, {}", shown_to(*low, 3), shown_to(*high, 3), unit.words())]
    #[diagnostic(help("{}", unit.remedy()))]
    CommandUnit {
        /// The record.
        file: String,
        /// The first row with a value outside 0 to 1, from one.
        row: usize,
        /// The lowest.
        low: f64,
        /// The highest.
        high: f64,
        /// The unit, as it seems.
        unit: CommandUnit,
    },
    /// A response in another unit than its column says.
    #[error("{file}: {evidence}: `{}` seems to be in another unit than {}", unit.column(), unit.unit())]
    #[diagnostic(help("{}", unit.remedy()))]
    ResponseUnit {
        /// The record.
        file: String,
        /// What shows it.
        evidence: String,
        /// The unit, as it seems.
        unit: ResponseUnit,
    },
    /// A response that falls where the command rises.
    #[error("{file}: `{column}` falls where the command rises (correlation {correlation:.2})")]
    #[diagnostic(help(
        "turn the sensor's sign: multiply the column by -1. Where the sign is right, command and response are of different runs"
    ))]
    ReversedSign {
        /// The record.
        file: String,
        /// The response's column.
        column: &'static str,
        /// Of the command behind a short lag with the response.
        correlation: f64,
    },
    /// A command that was cut off.
    #[error("{file}: {rows} rows of `command` stand exactly on {at}: the excitation was cut off there")]
    #[diagnostic(help("lower the amplitude, or move `nominal` away from the limit, and record again"))]
    CommandCutOff {
        /// The record.
        file: String,
        /// How many.
        rows: usize,
        /// The limit.
        at: f64,
    },
    /// Few periods.
    #[error("{file}: {periods} whole {}", if *periods == 1 { "period" } else { "periods" })]
    #[diagnostic(help(
        "record four or more: the noise is known from what differs between them, and the first often carries a transient"
    ))]
    FewPeriods {
        /// The record.
        file: String,
        /// How many.
        periods: usize,
    },
    /// Another level than stated.
    #[error("{file}: `nominal` is {}, and the mean command is {}", shown(*nominal), shown_to(*mean, 3))]
    #[diagnostic(help("correct `nominal` in experiment.toml: the motor is taken to run around it"))]
    OtherNominal {
        /// The record.
        file: String,
        /// As stated.
        nominal: f64,
        /// As it is over whole periods.
        mean: f64,
    },
    /// Another period than stated.
    #[error("{file}: `period_s` is {stated_s}, and the command goes up and down every {found_s:.4} s")]
    #[diagnostic(help("correct `period_s` in experiment.toml: rows are averaged and compared period by period"))]
    OtherPeriod {
        /// The record.
        file: String,
        /// As stated, seconds.
        stated_s: f64,
        /// As it is, seconds.
        found_s: f64,
    },
    /// Another amplitude than stated.
    #[error("{file}: `amplitude` is {stated}, and the command goes {found:.4} to either side")]
    #[diagnostic(help("correct `amplitude` in experiment.toml, or look for what scaled the command"))]
    OtherAmplitude {
        /// The record.
        file: String,
        /// As stated.
        stated: f64,
        /// As it is.
        found: f64,
    },
    /// A sensor that is slower than the rows.
    #[error(
        "{file}: `{column}` changes every {} rows only: the sensor gives {readings_hz:.0} readings a second, and each is \
         repeated", crate::check::decimal(*rows_per_reading)
    )]
    #[diagnostic(help("set the sensor or its logger to a faster rate: {cost}"))]
    Repeats {
        /// The record.
        file: String,
        /// The response's column.
        column: &'static str,
        /// Rows from one reading to the next, on average.
        rows_per_reading: f64,
        /// Readings per second.
        readings_hz: f64,
        /// What it costs the identification.
        cost: String,
    },
    /// Command and response in each other's column.
    #[error(
        "{file}, row {row}: `command` runs from {} to {} and `{column}` around the nominal {nominal}: the two \
         columns seem to be swapped", shown_to(*low, 3), shown_to(*high, 3)
    )]
    #[diagnostic(help("swap the names `command` and `{column}` in the first line of {file}"))]
    Swapped {
        /// The record.
        file: String,
        /// The first row with a command outside 0 to 1, from one.
        row: usize,
        /// The lowest command.
        low: f64,
        /// The highest.
        high: f64,
        /// The response's column.
        column: &'static str,
        /// The stated nominal command.
        nominal: f64,
    },
    /// A folder with a description and no record.
    #[error("nothing is recorded yet: experiment.toml names {files}, and {}", if *count == 1 { "it is not there" } else { "none of them is there" })]
    #[diagnostic(help(
        "record each on the stand and put it into this folder under its name, then check again. What is not to be recorded: take \
         its [[record]] out"
    ))]
    NotRecorded {
        /// How many.
        count: usize,
        /// Their names.
        files: String,
    },
    /// A file that no record names.
    #[error("{file} is in the folder, and no record names it")]
    #[diagnostic(help("add a [[record]] for it in experiment.toml, or move it elsewhere"))]
    Unnamed {
        /// The file.
        file: String,
    },
}

impl RecordFault {
    /// The row concerned, from one, where it is about one.
    #[must_use]
    pub fn row(&self) -> Option<usize> {
        match self {
            Self::Gaps { row, .. } | Self::CommandUnit { row, .. } | Self::Swapped { row, .. } => Some(*row),
            _ => None,
        }
    }
}
