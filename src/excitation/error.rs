//! Why an excitation is refused.

use core::fmt;

/// A parameter that the excitation cannot be built from, and the limit that it breaks.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum ExcitationError {
    /// A parameter is infinite or not a number.
    NotFinite {
        /// Its name.
        parameter: &'static str,
    },
    /// A parameter is outside its range.
    OutOfRange {
        /// Its name.
        parameter: &'static str,
        /// What it was.
        value: f64,
        /// The smallest allowed value.
        min: f64,
        /// The largest allowed value.
        max: f64,
    },
    /// One period of the lines is no whole number of ticks, so it could not repeat exactly.
    PeriodNotWhole {
        /// Ticks in one period at the given loop rate.
        ticks: f64,
    },
    /// The highest line is not below half the loop rate.
    AboveNyquist {
        /// Frequency of the highest line, hertz.
        top_hz: f64,
        /// Half the loop rate, hertz.
        limit_hz: f64,
    },
}

impl fmt::Display for ExcitationError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::NotFinite { parameter } => write!(f, "`{parameter}` is not a finite number"),
            Self::OutOfRange {
                parameter,
                value,
                min,
                max,
            } => {
                write!(f, "`{parameter}` is {value}, outside {min} to {max}")
            }
            Self::PeriodNotWhole { ticks } => {
                write!(
                    f,
                    "`loop_rate_hz` makes one period {ticks} ticks, which is no whole number"
                )
            }
            Self::AboveNyquist { top_hz, limit_hz } => write!(
                f,
                "`loop_rate_hz` is too low: the highest line is at {top_hz} Hz, not below {limit_hz} Hz"
            ),
        }
    }
}

impl core::error::Error for ExcitationError {}
