//! What a reader of a fit has to know, each with its advice.

use std::fmt;

use super::Averaging;
use crate::check::decimal;

/// Why part of a record is left out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LeftOut {
    /// The motor does not run steadily.
    NotSteady,
    /// The response is steady, and at most this share of its highest level: the motor stands still or idles.
    Idle {
        /// The highest such level over the highest of all.
        share: f64,
    },
    /// The command is zero, and the reading repeats an old value.
    Frozen {
        /// The value, response units.
        at: f64,
    },
    /// Levels are too short, or the motor runs on one alone.
    Short,
}

impl fmt::Display for LeftOut {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::NotSteady => f.write_str("the motor does not run steadily there"),
            // Less than shows as 0.1 %.
            Self::Idle { share } if share.abs() < 0.0005 => f.write_str("the motor stands still there"),
            Self::Idle { share } => write!(
                f,
                "the motor stands still or idles there, at {:.1} % of its highest level at most. If it runs, correct the \
                 sensor's zero",
                100.0 * share
            ),
            Self::Frozen { at } => write!(
                f,
                "the command is zero and the reading stands on {at}, as telemetry does that repeats its last value once the motor is off"
            ),
            Self::Short => f.write_str("no two levels on which the motor runs and settles follow each other there"),
        }
    }
}

/// Something odd in a staircase.
#[derive(Clone, Debug, PartialEq)]
pub enum StepsWarning {
    /// Steps that carry no lag.
    StepsLeftOut {
        /// How many.
        count: usize,
        /// Of how many.
        of: usize,
        /// How many for which reason.
        reasons: String,
    },
    /// A step whose time constant contradicts those of the others.
    Contradicts {
        /// When, seconds.
        at_s: f64,
        /// Commands before and after.
        commands: (f64, f64),
        /// Its time constant over what the others say.
        ratio: f64,
    },
    /// Steps differ by more than their own errors explain.
    Scattered {
        /// Standard deviation, as a share of the time constant.
        share: f64,
    },
    /// Readings that no rotor can have made were left out.
    Spikes {
        /// How many.
        rows: usize,
        /// What they are readings of.
        column: &'static str,
    },
    /// Readings that are off at a steady beat were left out.
    Ripple {
        /// How many.
        rows: usize,
        /// What they are readings of.
        column: &'static str,
        /// How often they come, hertz.
        frequency_hz: f64,
        /// How far they are off, in the column's unit.
        off_by: f64,
    },
    /// Each reading of a sensor stands in several rows.
    Repeats {
        /// What they are readings of.
        column: &'static str,
        /// In how many.
        rows_per_reading: f64,
        /// From one reading to the next, seconds.
        interval_s: f64,
        /// What a reading was taken as.
        averaging: Averaging,
    },
    /// A part of the record was left out.
    PartLeftOut {
        /// From when, seconds; `None` from its first row on.
        from_s: Option<f64>,
        /// Until when, seconds; `None` to its last row.
        until_s: Option<f64>,
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
        /// Steps whose command or response falls in one, left out.
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
    /// A level beside which none was reached from the same side.
    NoGain {
        /// The level.
        command: f64,
    },
    /// Levels beyond those that steps with a lag lead to.
    Beyond {
        /// How many.
        count: usize,
        /// The lowest and the highest command of a step with a lag.
        range: (f64, f64),
    },
    /// Steps up and down differ.
    Asymmetric {
        /// Time constant down over time constant up.
        ratio: f64,
    },
    /// Large steps are not those of a first-order lag.
    Curved {
        /// The curvature.
        curvature: f64,
        /// Its standard error.
        std: f64,
    },
    /// Large steps are those of a thrust that is the square of a speed with a first-order lag.
    Square {
        /// Time constants of that speed up and down, seconds, where there are such steps.
        time_constants_s: [Option<f64>; 2],
    },
    /// The response begins before the command.
    NegativeDelay {
        /// The delay, seconds.
        delay_s: f64,
    },
}

impl fmt::Display for StepsWarning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::StepsLeftOut { count, of, reasons } => {
                write!(f, "{count} of {of} steps carry no lag and were left out: {reasons}")
            }
            Self::Contradicts { at_s, commands: (from, to), ratio } => write!(
                f,
                "the step from {from:.3} to {to:.3} at {at_s:.2} s has a time constant of {ratio:.2} times what the other steps \
                 say of this operating point. It was left out: repeat it"
            ),
            Self::Scattered { share } => write!(
                f,
                "time constants of single steps differ by {:.0} % (standard deviation) beyond their own errors; the intervals \
                 include that. Repeat the staircase",
                100.0 * share
            ),
            Self::Spikes { rows: 1, column } => {
                write!(f, "one reading of {column} jumps away and back; it was left out")
            }
            Self::Spikes { rows, column } => write!(
                f,
                "{rows} readings of {column} jump away and back; they were left out. Look at that sensor if there are many"
            ),
            Self::Ripple { rows, column, frequency_hz, off_by } => write!(
                f,
                "{column} has a steady ripple of {frequency_hz:.1} Hz: {rows} readings are off by some {} each time it comes round; \
                 they were left out. Look for what beats so: telemetry whose slots meet the log's, a count that is read while it changes",
                if *off_by < 100.0 { format!("{off_by:.3}") } else { format!("{off_by:.0}") }
            ),
            Self::Repeats { column, rows_per_reading, interval_s, averaging } => write!(
                f,
                "each reading of {column} stands in {} rows and counts once; {}",
                decimal(*rows_per_reading),
                averaging.in_words(*interval_s)
            ),
            Self::PartLeftOut { from_s, until_s, reason } => {
                match (from_s, until_s) {
                    (None, Some(until_s)) => write!(f, "everything before {until_s:.2} s")?,
                    (Some(from_s), None) => write!(f, "everything from {from_s:.2} s")?,
                    (Some(from_s), Some(until_s)) => write!(f, "what is from {from_s:.2} to {until_s:.2} s")?,
                    (None, None) => f.write_str("everything")?,
                }
                write!(f, " was left out: {reason}")
            }
            Self::Limited { rows, at, commands: (low, high) } => {
                write!(f, "{rows} rows of the response stand exactly on {at}, at ")?;
                if low == high {
                    write!(f, "command {low:.3}")?;
                } else {
                    write!(f, "commands {low:.3} to {high:.3}")?;
                }
                f.write_str(
                    ": it ran into a limit. These levels, and the steps to and from them, were left out. Widen the range of \
                     sensor and logger, or record levels within it",
                )
            }
            Self::Gaps { count, longest_s, steps } => write!(
                f,
                "{} in the log, the longest {longest_s:.3} s: nothing was interpolated through them, and {} left out because \
                 command or response falls in one. Log to a faster disk or at a lower rate",
                counted(*count, "gap"),
                match steps {
                    0 => String::from("no step was"),
                    1 => String::from("one step was"),
                    _ => format!("{steps} steps were"),
                }
            ),
            Self::NotSettled { count, of, least, needed_s } => write!(
                f,
                "{count} of {of} levels are left before the response settles, the shortest after {least:.1} time constants: \
                 level and time constant cannot be separated. Hold each for {needed_s:.1} s or longer"
            ),
            Self::NotRising { command } => write!(
                f,
                "at command {command:.3} the response is not above that of the level below; no compensator can be designed \
                 there. Stay below it in flight"
            ),
            Self::NoGain { command } => write!(
                f,
                "at command {command:.3} the gain is not known and the model has no point: no other level was reached from the same side. \
                 Go through the levels one by one, up and down"
            ),
            Self::Beyond { count, range: (low, high) } => write!(
                f,
                "{} no point in the model: steps with a known lag lead to commands from {low:.3} to {high:.3} only. Begin the \
                 staircase one level lower and end it one level higher, or repeat the steps at its ends",
                if *count == 1 { String::from("one level has") } else { format!("{count} levels have") }
            ),
            Self::Asymmetric { ratio } => write!(
                f,
                "steps down take {ratio:.2} times as long as steps up; the model has the mean of the two rates"
            ),
            Self::Curved { curvature, std } => write!(
                f,
                "large steps slow down as the rotor does, as drag makes them, or a thrust that goes with the square of the speed (curvature of \
                 the lag {curvature:.2}, standard error {std:.2}); time constants are those of small motions"
            ),
            Self::Square { time_constants_s: [up, down] } => {
                let lags = [(up, "up"), (down, "down")].into_iter();
                let lags = lags.filter_map(|(tau, way)| Some(format!("{:.1} ms {way}", 1e3 * (*tau)?)));
                write!(
                    f,
                    "large steps are those of a thrust that is the square of a speed, which lags {}: the model has that lag, and the \
                     square behind it",
                    lags.collect::<Vec<_>>().join(" and ")
                )
            }
            Self::NegativeDelay { delay_s } => write!(
                f,
                "the response begins {:.1} ms before its row says that the command changed: the log stamps commands late. The \
                 model has no delay",
                -1e3 * delay_s
            ),
        }
    }
}

/// "1 gap", "2 gaps".
fn counted(count: usize, what: &str) -> String {
    format!("{count} {what}{}", if count == 1 { "" } else { "s" })
}
