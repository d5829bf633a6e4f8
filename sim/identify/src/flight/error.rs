//! Why a flight gives no time constant.

use miette::Diagnostic;
use thiserror::Error;

/// A flight from which nothing is known of its motors, with what was found and what is needed.
#[derive(Clone, Debug, PartialEq, Error, Diagnostic)]
pub enum FlightError {
    /// Little is left of it.
    #[error(
        "{file}: {usable_s:.1} s of this flight can be used, {needed_s:.0} s are needed: the rest is at idle, at full command, behind a gap, or \
         without a speed"
    )]
    #[diagnostic(help("log a minute in the air, with the motors off idle"))]
    TooShort {
        /// The record.
        file: String,
        /// What can be used, s.
        usable_s: f64,
        /// What is needed, s.
        needed_s: f64,
    },
    /// The search for the parameters did not end.
    #[error("{file}: no first-order lag explains how the speed follows the command")]
    #[diagnostic(help("check that command and speed are of the same motor, and that the motor has a propeller on"))]
    NoFit {
        /// The record.
        file: String,
    },
}
