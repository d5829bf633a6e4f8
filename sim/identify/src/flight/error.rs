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
    /// The command between two rows is not known.
    #[error(
        "{file}: rows of this flight are {interval_ms:.1} ms apart, and {longest_ms:.1} ms are the most: a controller moves its command in between"
    )]
    #[diagnostic(help(
        "log faster: in Betaflight `set blackbox_sample_rate = 1/4`; logs of ArduPilot and PX4 have the speed of an ESC too seldom"
    ))]
    TooSlow {
        /// The record.
        file: String,
        /// Interval of its rows, ms.
        interval_ms: f64,
        /// The longest that is taken, ms.
        longest_ms: f64,
    },
    /// The search for the parameters did not end.
    #[error("{file}: no first-order lag explains how the speed follows the command")]
    #[diagnostic(help("check that command and speed are of the same motor, and that the motor has a propeller on"))]
    NoFit {
        /// The record.
        file: String,
    },
    /// The command moved too little, or gusts too much.
    #[error(
        "{experiment}: this flight says the time constant to {known_percent:.0} % only (one standard error), and {largest_percent:.0} % are \
         needed: the command moved too little above what gusts do to the speed"
    )]
    #[diagnostic(help("fly with more stick, or with a chirp of the rates, for a minute, on a calm day"))]
    TooLittleMotion {
        /// The experiment.
        experiment: String,
        /// Relative standard error, percent.
        known_percent: f64,
        /// That from which on it is refused, percent.
        largest_percent: f64,
    },
    /// What moves command and noise alike has moved the estimate.
    #[error(
        "{experiment}: by what {instruments} move alone the time constant is {difference_percent:+.0} % of the fit, {standard_errors:.1} standard \
         errors away: gusts move command and speed alike in this flight"
    )]
    #[diagnostic(help("fly with more stick, or with a chirp of the rates, for a minute, on a calm day"))]
    Biased {
        /// The experiment.
        experiment: String,
        /// What served as instruments.
        instruments: &'static str,
        /// Difference of the two estimates, percent.
        difference_percent: f64,
        /// The same in standard errors.
        standard_errors: f64,
    },
}
