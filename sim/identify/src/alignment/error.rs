//! Why two logs cannot be put on one clock.

use miette::Diagnostic;
use thiserror::Error;

/// Why the delay between a command log and a response log cannot be identified.
#[derive(Clone, Debug, PartialEq, Error, Diagnostic)]
pub enum AlignmentError {
    /// Columns of different lengths, values that are not finite, or times that do not increase.
    #[error("{log}: columns differ in length, a value is not finite, or a time does not increase")]
    #[diagnostic(help("read the log with the checks of an experiment folder"))]
    Malformed {
        /// The log.
        log: String,
    },
    /// The command never changes.
    #[error("{log}: the command never changes, so no delay can be seen")]
    #[diagnostic(help("record some steps, or a multisine"))]
    ConstantCommand {
        /// The command log.
        log: String,
    },
    /// The response never changes.
    #[error("{log}: the response never changes, so no delay can be seen")]
    #[diagnostic(help("check the sensor's connection, and that the motor was running"))]
    ConstantResponse {
        /// The response log.
        log: String,
    },
    /// The logs have too little in common.
    #[error("{log}: {rows} rows of the response fall within the command log; {needed} are needed")]
    #[diagnostic(help("record longer, and let both logs run over the whole excitation"))]
    TooShort {
        /// The response log.
        log: String,
        /// Rows in common.
        rows: usize,
        /// Rows needed.
        needed: usize,
    },
    /// No shift lies within the limit on the delay.
    #[error("no delay within {within_s} s of {near_s:.3} s lets the two logs overlap")]
    #[diagnostic(help(
        "their clocks start at different times: say where the delay is (--align-near), allow a larger --align-within, or \
         leave both out"
    ))]
    NoOverlap {
        /// The limit, seconds.
        within_s: f64,
        /// Where the delay was expected, seconds.
        near_s: f64,
    },
    /// The response does not follow the command.
    #[error("{log}: the response does not follow this command, whatever the delay")]
    #[diagnostic(help("check that the two logs are of the same run"))]
    NotRelated {
        /// The response log.
        log: String,
    },
    /// Both logs have the response, and not the same one.
    #[error(
        "{log}: at the best delay the responses of the two logs agree to {fit_percent:.1} % fit only, where two meters of one run \
         agree to 90 %"
    )]
    #[diagnostic(help(
        "check that the two logs are of the same run, and that one of the two speeds does not follow the other through a filter"
    ))]
    OtherRun {
        /// The response log.
        log: String,
        /// The % fit.
        fit_percent: f64,
    },
    /// Two delays explain the logs alike.
    #[error("delays of {first_s:.3} s and {second_s:.3} s explain the logs equally well")]
    #[diagnostic(help(
        "the command repeats, and the logs alone do not tell one period from the next. Where both were started together, \
         give --align-near start with --align-within SECONDS, less than half a period; where the difference of the clocks \
         is known, give it to --align-near. Else record again, both logs from before the excitation on"
    ))]
    Ambiguous {
        /// The better one, seconds.
        first_s: f64,
        /// The other one, seconds.
        second_s: f64,
    },
    /// The best skew is at the limit of the search.
    #[error("the clocks seem to differ by {ppm:.0} ppm, more than the {limit_ppm:.0} ppm that were searched")]
    #[diagnostic(help("check the units of both time columns, or allow a larger skew"))]
    SkewOutOfRange {
        /// What came out, parts per million.
        ppm: f64,
        /// The limit, parts per million.
        limit_ppm: f64,
    },
    /// The delay's interval is too wide to be of use.
    #[error("{log}: the delay is known to {std_s:.3} s only")]
    #[diagnostic(help("use larger steps, or record longer"))]
    Undetermined {
        /// The response log.
        log: String,
        /// Its standard error, seconds.
        std_s: f64,
    },
    /// The search found no minimum.
    #[error("{log}: the fit of delay, skew and lag did not converge")]
    #[diagnostic(help("look at the two logs: the response may not resemble a lag at all"))]
    NotConverged {
        /// The response log.
        log: String,
    },
    /// Nothing is left to merge.
    #[error("{log}: only {rows} merged rows have both a command and a response")]
    #[diagnostic(help("the gaps of the response log leave nothing: record it again"))]
    NothingMerged {
        /// The response log.
        log: String,
        /// Rows left.
        rows: usize,
    },
}
