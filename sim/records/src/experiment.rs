//! The data every estimator works on.

use std::ops::Range;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use super::{CommandLog, CommandShape};

/// Nominal commands closer than this are one. Chosen: above the rounding of decimals, far below a 12-bit command's step of 2.4e-4.
pub const SAME_NOMINAL: f64 = 1e-6;
/// A mean command is that of a nominal command, and two logs are at one, within this. Chosen: a time constant changes by a percent or two
/// over it; less splits levels that are rounded differently.
pub const NOMINAL_TOLERANCE: f64 = 0.01;

/// A set of records of one actuator: an `experiment.toml` and its CSV files, in memory.
#[derive(Clone, Debug, PartialEq)]
pub struct Experiment {
    /// What the person who measured it calls it.
    pub name: String,
    /// Which column is the response.
    pub output: Output,
    /// Rows per second, where the rows are evenly spaced.
    pub sample_rate_hz: Option<f64>,
    /// Rate at which the ESC takes over a new command; `None` when unknown or irrelevant.
    pub esc_frame_hz: Option<f64>,
    /// Rate at which the command itself is updated, where that is faster than the rows
    /// (a 5 kHz control loop logged at 1 kHz). `None`: the command holds from row to row.
    pub command_rate_hz: Option<f64>,
    /// The records, in the order of the file.
    pub records: Vec<Record>,
}

/// Which column is the response, and its unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Output {
    /// Thrust in newtons.
    ThrustN,
    /// Rotor speed in revolutions per minute.
    Rpm,
}

impl Output {
    /// Name of its column in files.
    #[must_use]
    pub fn column(self) -> &'static str {
        match self {
            Self::ThrustN => "thrust_n",
            Self::Rpm => "rpm",
        }
    }

    /// What options call it.
    #[must_use]
    pub fn option(self) -> &'static str {
        match self {
            Self::ThrustN => "thrust",
            Self::Rpm => "rpm",
        }
    }
}

/// What drives a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Excitation {
    /// A periodic sum of sinusoids around `nominal`.
    Multisine,
    /// A periodic square wave around `nominal`.
    Square,
    /// A periodic triangle around `nominal`.
    Triangle,
    /// One step.
    Step,
    /// Several plateaus, one after the other.
    Staircase,
    /// A sine of changing frequency.
    Chirp,
    /// A random or pseudo-random command: of two levels, or of more.
    #[serde(alias = "prbs")]
    Random,
    /// A table of steady operating points, one in each row, in the order in which they were measured. Where the points have no
    /// times they are numbered, so that a row's time says nothing of a lag.
    Steady,
    /// A flight: a controller moves the command by what the motors do to the vehicle. One record for each motor, over the same time.
    Flight,
    /// Anything else.
    Free,
}

impl Excitation {
    /// Every one.
    pub const ALL: [Self; 10] = [
        Self::Multisine,
        Self::Square,
        Self::Triangle,
        Self::Step,
        Self::Staircase,
        Self::Chirp,
        Self::Random,
        Self::Steady,
        Self::Flight,
        Self::Free,
    ];

    /// Whether it repeats, so that its record has a period.
    #[must_use]
    pub fn is_periodic(self) -> bool {
        matches!(self, Self::Multisine | Self::Square | Self::Triangle)
    }

    /// Whether it moves over a band of frequencies all the time, without repeating.
    #[must_use]
    pub fn is_broadband(self) -> bool {
        matches!(self, Self::Chirp | Self::Random)
    }

    /// What files and tables call it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Multisine => "multisine",
            Self::Square => "square",
            Self::Triangle => "triangle",
            Self::Step => "step",
            Self::Staircase => "staircase",
            Self::Chirp => "chirp",
            Self::Random => "random",
            Self::Steady => "steady",
            Self::Flight => "flight",
            Self::Free => "free",
        }
    }
}

/// What a record is used for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// Parameters are estimated on it.
    Fit,
    /// It is kept out of the fit.
    Validate,
}

/// One run: columns of equal length. Row `k` is the response at `time_s[k]`; its command takes
/// effect from then until row `k + 1`.
#[derive(Clone, Debug, PartialEq)]
pub struct Record {
    /// File name, relative to the experiment's folder.
    pub file: String,
    /// The command around which it was run, 0..1.
    pub nominal: f64,
    /// What drives it.
    pub excitation: Excitation,
    /// Period in seconds, for periodic excitations.
    pub period_s: Option<f64>,
    /// Peak deviation of the command from `nominal`, 0..1.
    pub amplitude: Option<f64>,
    /// Whether a compensator was in front of the ESC.
    pub compensated: bool,
    /// The compensator's file, for a compensated record.
    pub compensator: Option<PathBuf>,
    /// What it is used for; the tools choose where absent.
    pub role: Option<Role>,
    /// Time in seconds, strictly increasing.
    pub time_s: Vec<f64>,
    /// Command before any compensator, 0..1; empty where it was logged apart.
    pub command: Vec<f64>,
    /// The command on stamps of its own, where it was logged so; `command` is what the rows show of it ([`CommandLog::at_rows`]).
    pub command_log: Option<CommandLog>,
    /// Thrust in newtons.
    pub thrust_n: Option<Vec<f64>>,
    /// Rotor speed in revolutions per minute.
    pub rpm: Option<Vec<f64>>,
    /// Command after the compensator, 0..1.
    pub esc_command: Option<Vec<f64>>,
    /// Supply voltage in volts.
    pub voltage_v: Option<Vec<f64>>,
    /// Supply current in amperes.
    pub current_a: Option<Vec<f64>>,
    /// What the controller was asked for, of a flight.
    pub setpoints: Setpoints,
}

/// What a controller in flight was asked for, by pilot, chirp or autopilot: it moves the motors, and what the motors do does not move it.
/// Each has a value for every row, where it was logged.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Setpoints {
    /// Rate of roll, rad/s.
    pub roll_rad_s: Option<Vec<f64>>,
    /// Rate of pitch, rad/s.
    pub pitch_rad_s: Option<Vec<f64>>,
    /// Rate of yaw, rad/s.
    pub yaw_rad_s: Option<Vec<f64>>,
    /// Throttle, 0..1.
    pub throttle: Option<Vec<f64>>,
}

impl Setpoints {
    /// Those that there are, to be cut as the other columns are.
    pub(crate) fn columns_mut(&mut self) -> impl Iterator<Item = &mut Vec<f64>> {
        let Self { roll_rad_s, pitch_rad_s, yaw_rad_s, throttle } = self;
        [roll_rad_s, pitch_rad_s, yaw_rad_s, throttle].into_iter().flatten()
    }

    /// Those that there are.
    pub fn columns(&self) -> impl Iterator<Item = &[f64]> {
        [&self.roll_rad_s, &self.pitch_rad_s, &self.yaw_rad_s, &self.throttle].into_iter().filter_map(Option::as_deref)
    }
}

impl Record {
    /// The response column that `output` names; `None` when the record has not got it.
    #[must_use]
    pub fn response(&self, output: Output) -> Option<&[f64]> {
        match output {
            Output::ThrustN => self.thrust_n.as_deref(),
            Output::Rpm => self.rpm.as_deref(),
        }
    }

    /// What its command looks like, whatever it is said to be.
    #[must_use]
    pub fn command_shape(&self) -> Option<CommandShape> {
        match &self.command_log {
            Some(log) => CommandShape::from_command(&log.time_s, &log.command),
            None => CommandShape::from_command(&self.time_s, &self.command),
        }
    }

    /// When the command changes over some rows, seconds, and to what, by its own stamps. `None` where the rows say all that is known: no
    /// such stamps, a column behind a compensator, or a command that moves all the time.
    #[must_use]
    pub fn command_changes(&self, rows: Range<usize>) -> Option<(Vec<f64>, Vec<f64>)> {
        let log = self.command_log.as_ref()?;
        let holds = !self.compensated && CommandLog::holds(self.excitation);
        let times = self.time_s.get(rows).filter(|times| holds && !times.is_empty())?;
        Some(log.changes(times[0], times[times.len() - 1]))
    }
}
