//! Why a record gives no staircase fit.

use miette::Diagnostic;
use thiserror::Error;

use super::plateaus::{MIN_PLATEAU_ROWS, MIN_PLATEAU_S};

/// Why a record gives no staircase fit, or a fit no model.
#[derive(Clone, Debug, PartialEq, Error, Diagnostic)]
pub enum StepsError {
    /// The response is not in the record.
    #[error("{record}: no column `{column}`, which the experiment names as its output")]
    #[diagnostic(help("name the column that was measured as `output` in experiment.toml"))]
    NoResponse {
        /// The record.
        record: String,
        /// The missing column.
        column: &'static str,
    },
    /// Columns of different lengths, or values that are not finite.
    #[error("{record}: columns differ in length, or a value is not finite")]
    #[diagnostic(help("read the record with the checks of an experiment folder"))]
    Malformed {
        /// The record.
        record: String,
    },
    /// The command never changes.
    #[error("{record}: the command never changes, so nothing can be compared")]
    #[diagnostic(help("record at least two plateaus of some seconds each"))]
    ConstantCommand {
        /// The record.
        record: String,
    },
    /// The command is hardly ever held.
    #[error(
        "{record}: it is no staircase: of {segments} levels of the command {long} are held for {MIN_PLATEAU_S} s and \
         {MIN_PLATEAU_ROWS} rows or more"
    )]
    #[diagnostic(help(
        "hold each level for at least a second. A ramp is `triangle`, a flight `free` or, where the command repeats, another \
         `excitation` in experiment.toml"
    ))]
    NoPlateaus {
        /// The record.
        record: String,
        /// Segments of constant command.
        segments: usize,
        /// Those that are held for long.
        long: usize,
    },
    /// No two plateaus in a row on which the motor runs steadily.
    #[error(
        "{record}: the motor runs steadily on no two levels in a row: of {long} that are held for long it stands still or idles on \
         {idle}, and its response is not steady on {not_steady}"
    )]
    #[diagnostic(help("hold each level for at least a second, and begin above the command at which the motor starts"))]
    NotRunning {
        /// The record.
        record: String,
        /// Levels that are held for long.
        long: usize,
        /// Of them, those on which the response is not above that of a motor that stands still.
        idle: usize,
        /// Of them, those on which the response is not steady.
        not_steady: usize,
    },
    /// The response has another zero than a motor that stands still.
    #[error("{record}: the response is {response:.3} at command {command:.3}, and follows the command below zero")]
    #[diagnostic(help(
        "steps are fitted as a lag toward a static map, which begins at zero: take the tare off the sensor, or turn its \
         sign. A simulated response counts from the model's first point where the model has no [static_map]: give it one"
    ))]
    BelowZero {
        /// The record.
        record: String,
        /// The command at which it is lowest.
        command: f64,
        /// The response there.
        response: f64,
    },
    /// Every step begins or ends on a limit.
    #[error("{record}: every step of the response begins or ends on a limit, {at}")]
    #[diagnostic(help("widen the range of sensor and logger, or record levels within it"))]
    AtLimit {
        /// The record.
        record: String,
        /// The limit, response units.
        at: f64,
    },
    /// Every step has a fault.
    #[error("{record}: no step carries a lag. {reasons}")]
    #[diagnostic(help(
        "hold each level for a second or longer, log 50 rows a second or more without gaps, and step by 5 % of full command or \
         more"
    ))]
    NoUsableStep {
        /// The record.
        record: String,
        /// How many steps for which reason.
        reasons: String,
    },
    /// The search found no minimum.
    #[error("{record}: the fit did not converge after {iterations} iterations")]
    #[diagnostic(help("look at the record: its steps may not resemble a lag at all"))]
    NotConverged {
        /// The record.
        record: String,
        /// Iterations done.
        iterations: usize,
    },
    /// No level has both a rising map and a time constant.
    #[error("{record}: no level has both a positive gain and a known time constant")]
    #[diagnostic(help("see the warnings of the fit for what was wrong at each level"))]
    NoUsableLevel {
        /// The record.
        record: String,
    },
}

impl StepsError {
    /// The record concerned.
    #[must_use]
    pub fn record(&self) -> &str {
        match self {
            Self::NoResponse { record, .. }
            | Self::Malformed { record }
            | Self::ConstantCommand { record }
            | Self::NoPlateaus { record, .. }
            | Self::NotRunning { record, .. }
            | Self::BelowZero { record, .. }
            | Self::AtLimit { record, .. }
            | Self::NoUsableStep { record, .. }
            | Self::NotConverged { record, .. }
            | Self::NoUsableLevel { record } => record,
        }
    }
}
