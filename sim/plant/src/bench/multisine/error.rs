//! Why a multisine cannot be designed.

use miette::Diagnostic;
use thiserror::Error;

/// A set of lines that makes no multisine.
#[derive(Clone, Debug, PartialEq, Error, Diagnostic)]
pub enum MultisineError {
    /// There is not a single line.
    #[error("the set has no line")]
    #[diagnostic(help("give at least one harmonic; a band must hold an odd multiple of 1 / period"))]
    NoLine,
    /// The harmonics are not positive and increasing.
    #[error("harmonic {harmonic} at place {place} is not above the one before it")]
    #[diagnostic(help("list each harmonic once, by increasing number, from 1"))]
    NotIncreasing {
        /// Place in the list, from 0.
        place: usize,
        /// The harmonic there.
        harmonic: u32,
    },
    /// A harmonic is above what the grid of the search can hold in memory.
    #[error("harmonic {harmonic} is above {limit}")]
    #[diagnostic(help("shorten the period or lower the top of the band"))]
    TooHigh {
        /// The top harmonic.
        harmonic: u32,
        /// The highest allowed.
        limit: u32,
    },
    /// An amplitude is not a positive number, or one is missing.
    #[error("the amplitude at place {place} is missing or no positive number")]
    #[diagnostic(help("give one positive amplitude for each harmonic"))]
    Amplitude {
        /// Place in the list, from 0.
        place: usize,
    },
    /// A band edge or the period is not a positive number, or the band is empty.
    #[error("`{parameter}` is {value}, which leaves no band")]
    #[diagnostic(help("the band needs 0 <= low < high, and the period must be positive"))]
    Band {
        /// Which parameter.
        parameter: &'static str,
        /// What it was.
        value: f64,
    },
    /// No line can be skipped.
    #[error("one line in {group} is to be skipped, and the band holds {lines} odd lines")]
    #[diagnostic(help("skip one line in 2 or more, in a band of at least that many odd lines, and of 3"))]
    Group {
        /// Lines of which one is skipped.
        group: u32,
        /// Odd lines in the band.
        lines: usize,
    },
}
