//! Why there is no such inverse.

use core::fmt;

use super::super::DesignError;
use super::table_command;
use crate::inverse::{TABLE_POINTS, TableError};
use crate::throttle::Command;

/// Longest response that is summed, in ticks: a twentieth of a second on a controller. For a damping of 0.7 and 5 kHz that of
/// 7.3 rad/s, about that of the slowest rotors.
pub(super) const LONGEST_RESPONSE_TICKS: u32 = 1 << 13;

/// Why a conditioned inverse is refused. Every variant names the parameter, its place and its limit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum InverseError {
    /// A parameter is not finite, or outside its range.
    Parameter(DesignError),
    /// The curve has no points.
    NoPoints,
    /// The curve has more than 33 points.
    TooManyPoints {
        /// Number of points.
        count: usize,
    },
    /// A number of a point is not finite, or outside its range.
    Point {
        /// Its place in the curve, from 0.
        index: usize,
        /// What is wrong with it.
        error: DesignError,
    },
    /// The command of a point is not above that of the point before.
    NotIncreasing {
        /// Place of the point in the curve, from 0.
        index: usize,
        /// Its command.
        command: f64,
        /// The command of the point before.
        previous: f64,
    },
    /// The rotor is hardly slower than the reference model: `g <= 1/2`, about `omega_f tau <= 1/2`.
    RotorTooFast {
        /// The command of the table at which it is.
        command: f64,
        /// The rotor's time constant there.
        tau_s: f64,
        /// About the lowest natural frequency that this rotor allows.
        min_omega_f_rad_s: f64,
    },
    /// The rotor is too slow for the reference model: `g >= 512`, about `omega_f tau >= 512`.
    RotorTooSlow {
        /// The command of the table at which it is.
        command: f64,
        /// The rotor's time constant there.
        tau_s: f64,
        /// About the highest natural frequency that this rotor allows.
        max_omega_f_rad_s: f64,
    },
    /// The gain `g` of the inverse, about `omega_f tau`, changes by more than a factor of 1.25 over 1/32 of the command.
    CurveTooSteep {
        /// The command of the table where the interval begins.
        command: f64,
        /// The rotor's time constant at its begin.
        tau_s: f64,
        /// The rotor's time constant at its end.
        next_tau_s: f64,
    },
    /// The response of the reference model takes more control ticks than a controller has time to check.
    ResponseTooLong,
    /// Rounding could keep the steady output from its reference.
    RoundingTooLarge {
        /// The command of the table at which the rotor is slowest.
        command: f64,
        /// Largest bound allowed on the error, in steps of 2^-29.
        max: f64,
    },
    /// The lowest output is above the highest.
    LimitsCrossed {
        /// The lowest output.
        min: Command,
        /// The highest output.
        max: Command,
    },
}

impl InverseError {
    /// The table's own error, in terms of the rotor.
    pub(super) fn from_table_error(error: TableError, poles_rad_s: &[f64; TABLE_POINTS]) -> Self {
        let tau_s = |index: usize| poles_rad_s.get(index).map_or(0.0, |pole| 1.0 / pole);
        let (TableError::GainTooLow { index } | TableError::GainTooHigh { index } | TableError::StepTooLarge { index }) =
            error;
        let (command, tau_s, next_tau_s) = (table_command(index), tau_s(index), tau_s(index + 1));
        match error {
            TableError::GainTooLow { .. } => Self::RotorTooFast { command, tau_s, min_omega_f_rad_s: 0.5 / tau_s },
            TableError::GainTooHigh { .. } => Self::RotorTooSlow { command, tau_s, max_omega_f_rad_s: 512.0 / tau_s },
            TableError::StepTooLarge { .. } => Self::CurveTooSteep { command, tau_s, next_tau_s },
        }
    }
}

impl From<DesignError> for InverseError {
    fn from(error: DesignError) -> Self {
        Self::Parameter(error)
    }
}

impl fmt::Display for InverseError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Parameter(error) => write!(f, "{error}"),
            Self::NoPoints => write!(f, "the curve has no points: an inverse needs at least one time constant"),
            Self::TooManyPoints { count } => {
                write!(f, "the curve has {count} points, more than {TABLE_POINTS}: leave some out")
            }
            Self::Point { index, error } => write!(f, "point {index} of the curve: {error}"),
            Self::NotIncreasing { index, command, previous } => write!(
                f,
                "point {index} of the curve: command is {command}, not above that of the point before, {previous}: sort the \
                 points, and merge those at one command"
            ),
            Self::RotorTooFast { command, tau_s, min_omega_f_rad_s } => write!(
                f,
                "tau_s is {tau_s:.4} at command {command:.4}: the rotor is faster than the inverse can slow down; raise the \
                 natural frequency above {min_omega_f_rad_s:.2} rad/s"
            ),
            Self::RotorTooSlow { command, tau_s, max_omega_f_rad_s } => write!(
                f,
                "tau_s is {tau_s:.4} at command {command:.4}: the gain of the inverse does not fit its format; lower the \
                 natural frequency below {max_omega_f_rad_s:.2} rad/s"
            ),
            Self::CurveTooSteep { command, tau_s, next_tau_s } => write!(
                f,
                "tau_s changes from {tau_s:.4} at command {command:.4} to {next_tau_s:.4} at {:.4}: the gain of the inverse \
                 may change by a factor of 1.25 at most over 1/32 of the command; check the points on either side",
                command + table_command(1)
            ),
            Self::ResponseTooLong => write!(
                f,
                "the reference model takes more than {LONGEST_RESPONSE_TICKS} ticks to settle: raise its natural \
                 frequency, lower its damping, or lower loop_rate_hz"
            ),
            Self::RoundingTooLarge { command, max } => write!(
                f,
                "rounding could move the steady output by more than {max} steps of 2^-29, half a step of the output, where the \
                 rotor is slowest, at command {command:.4}: lower loop_rate_hz"
            ),
            Self::LimitsCrossed { min, max } => {
                write!(f, "min is {:.4}, above max, {:.4}: exchange them", min.to_f64(), max.to_f64())
            }
        }
    }
}

impl core::error::Error for InverseError {}
