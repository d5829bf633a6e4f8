//! Why records say nothing of a stand.

use miette::Diagnostic;
use thiserror::Error;

/// Why an experiment gives no model of its stand.
#[derive(Clone, Debug, PartialEq, Error, Diagnostic)]
pub enum StandError {
    /// No record of a usable excitation.
    #[error("experiment {name:?} has no record of excitation free, chirp or multisine")]
    #[diagnostic(help("hit the stand where the motor sits, or shake it there, and record force and thrust"))]
    NoRecord {
        /// The experiment's name.
        name: String,
    },
    /// Records that do not go together.
    #[error("{file}: {what} than the first record's")]
    #[diagnostic(help(
        "give records of one kind, rate and length: cut them to the same number of rows, or remove some"
    ))]
    Unlike {
        /// The record.
        file: String,
        /// In what it differs.
        what: &'static str,
    },
    /// A record too short for its noise to be found.
    #[error("{file}: {lines} lines in the band, too few to find the noise from {window} neighbors")]
    #[diagnostic(help("record longer, or widen the band"))]
    TooShort {
        /// The record.
        file: String,
        /// Lines in the band.
        lines: usize,
        /// Lines that the noise is found from.
        window: usize,
    },
    /// The force has no power at a line.
    #[error("the force has no power at {frequency_hz:.1} Hz")]
    #[diagnostic(help("lower the top of the band, or hit with a harder tip: a shorter blow reaches higher"))]
    NoForce {
        /// The line.
        frequency_hz: f64,
    },
    /// A response without a static gain.
    #[error("the response does not follow the force: its static gain is {gain:.2e} +- {std:.1e}, which may be zero")]
    #[diagnostic(help(
        "look whether the sensor is connected, and whether `command` and the response are those of the same blows"
    ))]
    NoResponse {
        /// The static gain.
        gain: f64,
        /// Its standard error.
        std: f64,
    },
    /// More poles than the lines determine.
    #[error(
        "{poles} poles leave {residual_ratio:.3e} times the noise power, {fewer} leave {fewer_residual_ratio:.2}: the lines do not determine {poles}"
    )]
    #[diagnostic(help(
        "leave --order out, and as many poles as predict best are taken, or give --order {fewer}. What is asked beyond \
         cancels against zeros and has no meaning"
    ))]
    OrderTooHigh {
        /// Poles asked for.
        poles: usize,
        /// Chi-square of their residual over its expectation.
        residual_ratio: f64,
        /// Poles of the best fit with fewer.
        fewer: usize,
        /// The same of its residual.
        fewer_residual_ratio: f64,
    },
    /// A band that does not lie within the lines.
    #[error("the band {low_hz} to {high_hz} Hz is none below half of the row rate, {half_rate_hz} Hz")]
    #[diagnostic(help("choose a band above zero and below half of the row rate"))]
    Band {
        /// Its lower end.
        low_hz: f64,
        /// Its upper end.
        high_hz: f64,
        /// Half of the row rate.
        half_rate_hz: f64,
    },
}
