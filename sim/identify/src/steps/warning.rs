//! What a reader of a fit has to know, each with its advice.

use std::fmt;

use super::plateaus::Direction;

/// Why part of a record is left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LeftOut {
    /// The motor does not run steadily.
    NotSteady,
    /// The response is steady and not above zero.
    NotAboveZero,
}

impl LeftOut {
    fn words(self) -> &'static str {
        match self {
            Self::NotSteady => "the motor does not run steadily there",
            Self::NotAboveZero => {
                "the response is not above zero there. A motor that stands still is left out rightly; if it turns, correct the sensor's zero"
            }
        }
    }
}

/// Something odd in a staircase.
#[derive(Clone, Debug, PartialEq)]
pub enum StepsWarning {
    /// Readings that no rotor can have made were left out.
    Spikes {
        /// How many.
        rows: usize,
    },
    /// Part of the record before the motor ran steadily was left out.
    StartLeftOut {
        /// Until when, seconds.
        until_s: f64,
        /// Why.
        reason: LeftOut,
    },
    /// Part of the record after the motor last ran steadily was left out.
    EndLeftOut {
        /// From when, seconds.
        from_s: f64,
        /// Why.
        reason: LeftOut,
    },
    /// The response stands on a limit.
    Limited {
        /// How many rows.
        rows: usize,
        /// The limit, response units.
        at: f64,
        /// The lowest and the highest command at which it does.
        commands: (f64, f64),
    },
    /// The log has gaps.
    Gaps {
        /// How many in the part that was used.
        count: usize,
        /// The longest, seconds.
        longest_s: f64,
        /// Steps that began in one, left out.
        steps: usize,
    },
    /// Levels that are left before the response settles.
    NotSettled {
        /// How many.
        count: usize,
        /// Of how many.
        of: usize,
        /// Time constants for which the shortest is held.
        least: f64,
        /// How long each should be held, seconds.
        needed_s: f64,
    },
    /// A level whose steady response is not above that of the level below.
    NotRising {
        /// The level.
        command: f64,
    },
    /// A level to which no usable step leads.
    NoStep {
        /// The level.
        command: f64,
    },
    /// A time constant that its steps hardly determine.
    Uncertain {
        /// The level.
        command: f64,
        /// Its relative standard error.
        relative_std: f64,
    },
    /// A time constant far from those of the levels around.
    Odd {
        /// The level.
        command: f64,
        /// The direction of its steps.
        direction: Direction,
        /// It, over the median of its neighbors'.
        ratio: f64,
    },
    /// Steps up and down to the same level differ.
    Asymmetric {
        /// The level.
        command: f64,
        /// Time constant down over time constant up.
        ratio: f64,
    },
    /// Large steps are not those of a first-order lag.
    Curved {
        /// the curvature.
        curvature: f64,
        /// Its standard error.
        std: f64,
    },
    /// The response begins before the command.
    NegativeDelay {
        /// The delay, seconds.
        delay_s: f64,
    },
}

impl fmt::Display for StepsWarning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Spikes { rows: 1 } => f.write_str(
                "one reading jumps away and back; it was left out. Look at the speed probe if there are more",
            ),
            Self::Spikes { rows } => {
                write!(
                    f,
                    "{rows} readings jump away and back; they were left out. Look at the speed probe if there are many"
                )
            }
            Self::StartLeftOut { until_s, reason } => {
                write!(f, "everything before {until_s:.2} s was left out: {}", reason.words())
            }
            Self::EndLeftOut { from_s, reason } => {
                write!(f, "everything from {from_s:.2} s was left out: {}", reason.words())
            }
            Self::Limited { rows, at, commands: (low, high) } => {
                write!(f, "{rows} rows of the response stand exactly on {at}, at ")?;
                if low == high {
                    write!(f, "command {low:.3}")?
                } else {
                    write!(f, "commands {low:.3} to {high:.3}")?
                }
                write!(
                    f,
                    ": it ran into a limit. These levels, and the steps to and from them, were left out. Widen the range of sensor and logger, or record levels within it"
                )
            }
            Self::Gaps { count, longest_s, steps } => {
                write!(
                    f,
                    "{count} gaps in the log, the longest {longest_s:.3} s: nothing was interpolated through them, and {steps} steps that began in one were left out"
                )
            }
            Self::NotSettled { count, of, least, needed_s } => {
                write!(
                    f,
                    "{count} of {of} levels are left before the response settles, the shortest after {least:.1} time constants: level and time constant cannot be separated. Hold each for {needed_s:.1} s or longer"
                )
            }
            Self::NotRising { command } => {
                write!(
                    f,
                    "at command {command:.3} the response is not above that of the level below; no compensator can be designed there. Stay below it in flight"
                )
            }
            Self::NoStep { command } => {
                write!(
                    f,
                    "no usable step leads to command {command:.3}, so its time constant is not known. Begin the staircase one level lower"
                )
            }
            Self::Uncertain { command, relative_std } => {
                write!(
                    f,
                    "the time constant at command {command:.3} is known to {:.0} % only; it was left out. Use a larger step or repeat it",
                    100.0 * relative_std
                )
            }
            Self::Odd { command, direction, ratio } => {
                let way = if direction == Direction::Up { "up" } else { "down" };
                write!(
                    f,
                    "the time constant of steps {way} to command {command:.3} is {ratio:.2} times that of its neighbors. It was left out, since a design rests on the fastest level: repeat this step"
                )
            }
            Self::Asymmetric { command, ratio } => {
                write!(
                    f,
                    "at command {command:.3} steps down take {ratio:.2} times as long as steps up; the model has the mean of the two rates"
                )
            }
            Self::Curved { curvature, std } => {
                let what = if curvature < 0.0 {
                    "start more gently than a first-order lag, as behind a second lag or a slew limit"
                } else {
                    "slow down as the rotor does, as drag makes them"
                };
                write!(f, "large steps {what} (curvature of the lag {curvature:.2}, standard error {std:.2})")
            }
            Self::NegativeDelay { delay_s } => {
                write!(
                    f,
                    "the response begins {:.1} ms before its row says that the command changed: the log stamps commands late. The model has no delay",
                    -1e3 * delay_s
                )
            }
        }
    }
}
