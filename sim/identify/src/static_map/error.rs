//! Why steady points give no static map.

use miette::Diagnostic;
use thiserror::Error;

/// Why there is no static map.
#[derive(Clone, Debug, PartialEq, Error, Diagnostic)]
pub enum StaticMapError {
    /// Too few levels.
    #[error("{levels} levels on which the motor runs; a static map needs 4")]
    #[diagnostic(help(
        "record more levels, or a staircase over the range of commands, a second or more on each: steps show the lag as well"
    ))]
    TooFewLevels {
        /// Levels at hand.
        levels: usize,
    },
    /// Nothing to fit.
    #[error("the response is {response} at every command: it does not change with the command")]
    #[diagnostic(help(
        "the sensor is dead, the motor does not turn, or another column was taken: check the wires, and which column is the response"
    ))]
    Still {
        /// The response.
        response: f64,
    },
    /// No polynomial fits.
    #[error("no polynomial fits the levels")]
    #[diagnostic(help("look at the levels: two of them may have the same command and no other"))]
    NoFit,
}
