//! What can be wrong with records that are to be identified, and what to do about it.

use miette::Diagnostic;
use rotorlead_plant::{ModelError, PlantError};
use rotorlead_records::files::Fault;
use thiserror::Error;

use crate::flight::error::FlightError;
use crate::lag::steps::error::StepsError;
use crate::stand::error::StandError;
use crate::stand::transfer_function::error::ParametricError;
use crate::static_map::error::StaticMapError;
use rotorlead_records::Topic;

/// A record or setting from which nothing can be identified.
#[derive(Clone, Debug, PartialEq, Error, Diagnostic)]
pub enum IdentifyError {
    /// A rate is not a positive number.
    #[error("{name} is {value}, which is not a rate")]
    #[diagnostic(help("give {name} in hertz, above zero, in experiment.toml"))]
    Rate {
        /// The key.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// A setting is outside its range.
    #[error("{name} is {value}, outside {range}")]
    #[diagnostic(help("choose {name} within {range}"))]
    Setting {
        /// The setting.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What it may be.
        range: &'static str,
    },
    /// Tables of steady points that give no static map, which is all that there is to get of them.
    #[error("{experiment}: {reason}")]
    #[diagnostic(help("{}", reason.help().map(|help| help.to_string()).unwrap_or_default()))]
    NoStaticMap {
        /// The experiment.
        experiment: String,
        /// Why not.
        reason: StaticMapError,
    },
    /// Periods that cannot be averaged.
    #[error("{periods} periods of {lines} lines cannot be averaged")]
    #[diagnostic(help("give two periods or more, each with one number per harmonic, harmonics increasing"))]
    Periods {
        /// Periods given.
        periods: usize,
        /// Harmonics given.
        lines: usize,
    },
    /// A periodic record does not say its period.
    #[error("{file}: a periodic record without a period")]
    #[diagnostic(help("add period_s to this record in experiment.toml"))]
    NoPeriod {
        /// The record.
        file: String,
    },
    /// The record has not got the response column, or its columns differ in length.
    #[error("{file}: no response column {column} of {rows} rows")]
    #[diagnostic(help("record this column, or change `output` in experiment.toml"))]
    NoResponse {
        /// The record.
        file: String,
        /// The column's name.
        column: &'static str,
        /// Rows in the time column.
        rows: usize,
    },
    /// Rows are not evenly spaced in time.
    #[error("{file}: row {row} is {off_by:.3} rows away from an even spacing")]
    #[diagnostic(help("a periodic record needs evenly spaced rows: resample it, or log at a fixed rate"))]
    UnevenRows {
        /// The record.
        file: String,
        /// Index of the row that is furthest off, from 0.
        row: usize,
        /// By how much, in rows.
        off_by: f64,
    },
    /// Rows are missing, so that the command is not known for a while.
    #[error(
        "{file}: {:.0} ms lie between two rows, where {:.1} ms are usual: what the command was in between is not known",
        1e3 * interval_s,
        1e3 * usual_s
    )]
    #[diagnostic(help(
        "import the longer part on its own, with --seconds, or record again: the logger lost rows there"
    ))]
    Gap {
        /// The record.
        file: String,
        /// Index of the row behind the gap, from 0.
        row: usize,
        /// How long it is, seconds.
        interval_s: f64,
        /// The median interval, seconds.
        usual_s: f64,
    },
    /// The period is not a whole number of rows.
    #[error("{file}: a period of {} s is {} rows, not a whole number of four or more", plain(*period_s), plain(*rows))]
    #[diagnostic(help(
        "correct period_s or sample_rate_hz, or record at a rate that divides the period; `time_s` is in seconds, not milliseconds"
    ))]
    PeriodRows {
        /// The record.
        file: String,
        /// The period in seconds.
        period_s: f64,
        /// Rows in a period.
        rows: f64,
    },
    /// Less than a period was recorded.
    #[error("{file}: {rows} rows, less than one period of {period_rows}")]
    #[diagnostic(help("record at least one whole period; four are better, their spread gives the noise"))]
    TooShort {
        /// The record.
        file: String,
        /// Rows recorded.
        rows: usize,
        /// Rows in a period.
        period_rows: usize,
    },
    /// The command does not move.
    #[error("{file}: the command is constant")]
    #[diagnostic(help("nothing can be identified from it: excite the actuator, for instance with a multisine"))]
    ConstantCommand {
        /// The record.
        file: String,
    },
    /// The command changes, and nothing of it repeats with the period.
    #[error("{file}: the command changes, but nothing of it repeats every {} s", plain(*period_s))]
    #[diagnostic(help(
        "correct period_s in experiment.toml; where it is right, check that `time_s` is in seconds, not milliseconds"
    ))]
    NothingRepeats {
        /// The record.
        file: String,
        /// The period in seconds.
        period_s: f64,
    },
    /// A response that may as well be none of the command.
    #[error(
        "u_nom {nominal}: the gain is {gain:.3} +- {std:.3} and may as well be zero: the response does not follow the command{signs}"
    )]
    #[diagnostic(help(
        "check that command and response are of one run, and that the sensor was connected; where they are, raise the \
         amplitude or record more periods"
    ))]
    GainMayBeZero {
        /// The nominal command.
        nominal: f64,
        /// The gain, response units per unit of command.
        gain: f64,
        /// Its standard error.
        std: f64,
        /// What else speaks against the records, a sentence each; may be empty.
        signs: String,
    },
    /// The response does not move.
    #[error("{file}: the response is constant")]
    #[diagnostic(help("check the sensor's connection, and that the motor was running"))]
    ConstantResponse {
        /// The record.
        file: String,
    },
    /// The command differs from period to period.
    #[error("{file}: the command differs from period to period by {percent:.1} % (RMS)")]
    #[diagnostic(help(
        "correct period_s in experiment.toml, or record the excitation without gaps. If a controller acts on the response, \
         open that loop: it answers the noise, and the motor cannot be distinguished from it"
    ))]
    NotPeriodic {
        /// The record.
        file: String,
        /// RMS of the difference over RMS of the command's excited lines, percent.
        percent: f64,
    },
    /// One period, and every line of it excited.
    #[error("{file}: one period is left and no unexcited line, so the noise is unknown")]
    #[diagnostic(help("record at least two periods, or a multisine of odd lines only"))]
    NoNoise {
        /// The record.
        file: String,
    },
    /// Too few lines for the parameters.
    #[error("{lines} excited lines cannot determine {parameters} parameters")]
    #[diagnostic(help("excite more lines, below and above the actuator's bandwidth"))]
    TooFewLines {
        /// Lines at hand.
        lines: usize,
        /// Parameters to find.
        parameters: usize,
    },
    /// No time constant fits.
    #[error("no first-order lag fits the response: {reason}")]
    #[diagnostic(help("check that command and response belong together, and that lines reach above the bandwidth"))]
    NoFit {
        /// What went wrong.
        reason: &'static str,
    },
    /// No record of a kind from which lags are identified.
    #[error("{experiment}: no record of `excitation` multisine, step, staircase, chirp or random that may be fitted")]
    #[diagnostic(help(
        "record one (`rotorlead excite` designs a multisine), or correct `excitation` and `role` in experiment.toml"
    ))]
    NoRecord {
        /// The experiment's name.
        experiment: String,
    },
    /// Records do not say what was played.
    #[error("{experiment}: {files} {verb} `free`, which does not say what was played")]
    #[diagnostic(help(
        "in its [[record]] of experiment.toml say what was: excitation = \"multisine\" or \"square\" with period_s in \
         seconds, excitation = \"step\", \"staircase\", \"chirp\" or \"random\""
    ))]
    Free {
        /// The experiment's name.
        experiment: String,
        /// The records.
        files: String,
        /// "is" or "are".
        verb: &'static str,
    },
    /// A random command that is said to be something else.
    #[error("{file}: no level is held for long enough that a motor settles, and the command switches at random")]
    #[diagnostic(help(
        "say so with excitation = \"random\" in its [[record]] of experiment.toml, or `--excitation random` with a log: it is then fitted \
         in the frequency domain; for a fit of steps hold each level for a second or longer"
    ))]
    RandomCommand {
        /// The record.
        file: String,
    },
    /// A ramp, which says nothing of a lag.
    #[error(
        "{file}: the command is a ramp: behind one, a lag and a dead time look alike, since each only shifts the response, and what tells \
         them apart is over as soon as the ramp has begun"
    )]
    #[diagnostic(help(
        "play steps, a multisine or a chirp (`rotorlead excite`); for the static map alone, which a ramp up and down shows, `--excitation steady`"
    ))]
    RampCommand {
        /// The record.
        file: String,
    },
    /// Several records of steps, of which one is fitted.
    #[error("{experiment}: {count} step or staircase records without a role, and one model")]
    #[diagnostic(help(
        "give the one to fit role = \"fit\" in experiment.toml, and the others role = \"validate\", as `rotorlead import --role` does"
    ))]
    SeveralSteps {
        /// The experiment's name.
        experiment: String,
        /// How many.
        count: usize,
    },
    /// A stand is given, and lags are fitted in time.
    #[error("a stand is divided out of multisine records and chirps, and this experiment has none")]
    #[diagnostic(help("leave the stand out: steps are fitted in time, through the stand as it is"))]
    StandOfSteps,
    /// No record to fit on.
    #[error("experiment {name:?} has no multisine record to fit on")]
    #[diagnostic(help("record a multisine, or set role = \"fit\" on one"))]
    NoFitRecord {
        /// The experiment's name.
        name: String,
    },
    /// What was fitted is no actuator's.
    #[error("{experiment}: the records give no actuator: {fault}")]
    #[diagnostic(help(
        "look at the records, `rotorlead check` says what is odd; a model holds what an actuator can have"
    ))]
    NoActuator {
        /// The experiment's name.
        experiment: String,
        /// Which number of the model, and what it may be.
        fault: Fault,
    },
    /// The model says nothing of a record's nominal command.
    #[error("{file}: {source}")]
    #[diagnostic(help("identify the motor at this nominal command too, or leave the record out"))]
    NotInModel {
        /// The record.
        file: String,
        /// Which command, and where the model holds.
        source: ModelError,
    },
    /// The model cannot be simulated.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Plant(PlantError),
    /// The model is of the other response.
    #[error("the model is of {model}, the experiment's output is {experiment}")]
    #[diagnostic(help("identify a model on this experiment's output, or change `output` in experiment.toml"))]
    OtherOutput {
        /// The model's response.
        model: &'static str,
        /// The experiment's response.
        experiment: &'static str,
    },
    /// The model has a static map and no lag.
    #[error("the model has a static map alone: nothing is known of its lag")]
    #[diagnostic(help("record a staircase and identify a model from it"))]
    NoPoints,
    /// A compensated record does not say what the ESC got.
    #[error("{file}: compensated, but without a column `esc_command`")]
    #[diagnostic(help("record the command after the compensator as esc_command"))]
    NoEscCommand {
        /// The record.
        file: String,
    },
    /// A record has no levels to work on.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Steps(#[from] StepsError),
    /// A frequency response has no model of the structure asked for.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Parametric(#[from] ParametricError),
    /// A flight gives no time constant.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Flight(#[from] FlightError),
    /// A record says nothing of the stand.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Stand(#[from] StandError),
}

impl IdentifyError {
    /// The record concerned, where it is one.
    #[must_use]
    pub fn file(&self) -> Option<&str> {
        match self {
            Self::NoPeriod { file }
            | Self::NoResponse { file, .. }
            | Self::UnevenRows { file, .. }
            | Self::Gap { file, .. }
            | Self::PeriodRows { file, .. }
            | Self::TooShort { file, .. }
            | Self::ConstantCommand { file }
            | Self::NothingRepeats { file, .. }
            | Self::ConstantResponse { file }
            | Self::NotPeriodic { file, .. }
            | Self::NoNoise { file }
            | Self::NotInModel { file, .. }
            | Self::NoEscCommand { file } => Some(file),
            Self::Steps(error) => Some(error.record()),
            _ => None,
        }
    }

    /// The row concerned, from one, where it is one.
    #[must_use]
    pub fn row(&self) -> Option<usize> {
        match self {
            Self::UnevenRows { row, .. } | Self::Gap { row, .. } => Some(row + 1),
            _ => None,
        }
    }

    /// What it is about.
    #[must_use]
    pub fn topic(&self) -> Topic {
        self.topic_and_causes().0
    }

    /// What it is about, and the findings of the same record that would have the same cause.
    pub(super) fn topic_and_causes(&self) -> (Topic, &'static [Topic]) {
        match self {
            Self::UnevenRows { .. } => (Topic::Sampling, &[Topic::Sampling]),
            Self::NoPeriod { .. } => (Topic::Periods, &[]),
            Self::PeriodRows { .. }
            | Self::TooShort { .. }
            | Self::NothingRepeats { .. }
            | Self::NotPeriodic { .. } => (Topic::Periods, &[Topic::TimeUnit]),
            Self::NoNoise { .. } => (Topic::Periods, &[Topic::Periods]),
            Self::ConstantCommand { .. } | Self::Steps(StepsError::ConstantCommand { .. }) => {
                (Topic::Command, &[Topic::Command])
            }
            Self::NoResponse { .. } | Self::ConstantResponse { .. } => (Topic::Response, &[Topic::Response]),
            Self::Steps(StepsError::NoUsableStep { .. } | StepsError::BelowZero { .. }) => {
                (Topic::Identification, &[Topic::Sign])
            }
            Self::NoRecord { .. }
            | Self::Free { .. }
            | Self::RandomCommand { .. }
            | Self::RampCommand { .. }
            | Self::SeveralSteps { .. }
            | Self::NoFitRecord { .. } => (Topic::Roles, &[]),
            _ => (Topic::Identification, &[]),
        }
    }
}

/// A number as it was written, unless that is a long row of zeros.
fn plain(value: f64) -> String {
    if value == 0.0 || (1e-4..1e7).contains(&value.abs()) { format!("{value}") } else { format!("{value:e}") }
}

/// What is wrong, and behind a semicolon what to do about it, where it says so.
#[must_use]
pub fn with_advice(warning: &impl Diagnostic) -> String {
    match warning.help() {
        Some(help) => format!("{warning}; {help}"),
        None => warning.to_string(),
    }
}
