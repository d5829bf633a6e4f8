//! What an identification from periodic records has to say beside its numbers.

use miette::Diagnostic;
use rotorlead_records::Topic;
use thiserror::Error;

use crate::frequency_response::distortion::STRONG_DISTORTION_DB;
use crate::goodness_of_fit::times_noise;

/// What a user should know about an identification that succeeded.
#[derive(Clone, Debug, PartialEq, Error, Diagnostic)]
pub enum IdentifyWarning {
    /// No multisine record to fit at this nominal command.
    #[error("u_nom {nominal}: no multisine record to fit on; its other records are left out")]
    #[diagnostic(help("give one role = \"fit\""))]
    NothingToFit {
        /// The nominal command.
        nominal: f64,
    },
    /// The first period, or more, was dropped.
    #[error("{file}: a transient in the first {dropped} of {periods} periods (p = {p_value:.1e}), which are left out")]
    #[diagnostic(help("let the motor run in for a period before recording"))]
    TransientDropped {
        /// The record.
        file: String,
        /// Periods dropped.
        dropped: usize,
        /// Periods recorded.
        periods: usize,
        /// Tail probability without transient.
        p_value: f64,
    },
    /// Half of the periods were dropped, as many as there may be.
    #[error(
        "{file}: half of its periods differ from those after them: that is a drift of motor, supply or sensor rather than a start, and gain and lag are those of the last periods"
    )]
    #[diagnostic(help("let it warm up, and record again"))]
    Drifts {
        /// The record.
        file: String,
    },
    /// Nothing to compare the first period with.
    #[error("{file}: no other period to test the first for a transient")]
    #[diagnostic(help("let the motor run in before recording"))]
    TransientUntested {
        /// The record.
        file: String,
    },
    /// Rows outside whole periods.
    #[error("{file}: {rows} rows before the first whole period are left out")]
    RowsLeftOut {
        /// The record.
        file: String,
        /// How many.
        rows: usize,
    },
    /// A sinusoid that is none of the excitation's was subtracted.
    #[error("{file}: a sinusoid of {frequency_hz:.2} Hz and amplitude {amplitude:.3} (mains hum?) is subtracted")]
    SinusoidRemoved {
        /// The record.
        file: String,
        /// Its frequency.
        frequency_hz: f64,
        /// Its amplitude, response units.
        amplitude: f64,
    },
    /// Lines on which something else than the excitation shows.
    #[error(
        "{file}: a disturbance of one frequency, such as mains hum, falls on {count} lines from {first_hz:.1} to {last_hz:.1} Hz; they are left out"
    )]
    LinesDisturbed {
        /// The record.
        file: String,
        /// How many lines.
        count: usize,
        /// The lowest of them.
        first_hz: f64,
        /// The highest of them.
        last_hz: f64,
    },
    /// The noise is known from unexcited lines only.
    #[error("{file}: one period is left; the noise is taken from unexcited lines, with any even-order distortion")]
    #[diagnostic(help("record four periods or more"))]
    NoiseFromUnexcitedLines {
        /// The record.
        file: String,
    },
    /// The lag does not explain the response to within its noise.
    #[error(
        "u_nom {nominal}: a first-order lag leaves {}; the standard errors cover noise only",
        times_noise(*reduced_chi_square, 1)
    )]
    #[diagnostic(help(
        "lower the amplitude; give the stand with --stand-model; `rotorlead diagnose` looks for what is missing"
    ))]
    ModelTooSimple {
        /// The nominal command.
        nominal: f64,
        /// Chi-square of the residual per degree of freedom.
        reduced_chi_square: f64,
    },
    /// A dead time that is longer than those looked for.
    #[error(
        "u_nom {nominal}: a dead time of {:.0} ms explains the response, and none beyond {:.0} ms is a motor's: it is that of the log, or of two clocks",
        1e3 * delay_s, 1e3 * limit_s
    )]
    #[diagnostic(help("move the response by it, or merge two logs with --align, and identify again"))]
    DelayBeyondSearch {
        /// The nominal command.
        nominal: f64,
        /// The dead time, seconds.
        delay_s: f64,
        /// The longest that is looked for, seconds.
        limit_s: f64,
    },
    /// The lag explains the response far better than its noise allows.
    #[error(
        "u_nom {nominal}: a first-order lag leaves only {}: what differs between the periods is no noise (a gain that drifts, a reading that jumps, a sensor that stops), and gain and lag may be wrong by more than their errors",
        times_noise(*reduced_chi_square, 2)
    )]
    #[diagnostic(help("compare the periods, and record again"))]
    NoiseTooLarge {
        /// The nominal command.
        nominal: f64,
        /// Chi-square of the residual per degree of freedom.
        reduced_chi_square: f64,
    },
    /// A response that may as well be none of this command.
    #[error(
        "u_nom {nominal}: the gain is {gain:.3} +- {std:.3} and may as well be zero, so there is no point here: the response does not follow the command"
    )]
    #[diagnostic(help(
        "check that both are of one run and that the sensor was connected; else raise the amplitude or record more periods"
    ))]
    GainMayBeZero {
        /// The nominal command.
        nominal: f64,
        /// The gain, response units per unit of command.
        gain: f64,
        /// Its standard error.
        std: f64,
    },
    /// A response that falls where the command rises.
    #[error("u_nom {nominal}: the gain is {gain:.3}: the response falls where the command rises")]
    #[diagnostic(help("turn the sensor's sign, or find the logs that belong together"))]
    NegativeGain {
        /// The nominal command.
        nominal: f64,
        /// The gain, response units per unit of command.
        gain: f64,
    },
    /// A number that the record hardly determines.
    #[error(
        "u_nom {nominal}: the {what} is known to {:.0} % only, too little to design with",
        100.0 * relative_std
    )]
    #[diagnostic(help("raise the amplitude or record more periods"))]
    Uncertain {
        /// The nominal command.
        nominal: f64,
        /// Which number.
        what: &'static str,
        /// Its relative standard error.
        relative_std: f64,
    },
    /// Readings that no motor can have made.
    #[error(
        "{file}: {}, and {} in the fit",
        match (rows, beat_hz) {
            (rows, Some(beat_hz)) => format!("a steady ripple of {beat_hz:.1} Hz: {rows} readings are off each time it comes round"),
            (1, None) => format!("one reading jumps away and back, at {at_s:.3} s"),
            (rows, None) => format!("{rows} readings jump away and back, the first at {at_s:.3} s"),
        },
        if *rows == 1 { "is" } else { "are" }
    )]
    #[diagnostic(help("replace what jumps by its neighbors', and look at the sensor's cable"))]
    Jumps {
        /// The record.
        file: String,
        /// How many.
        rows: usize,
        /// The time of the first, seconds.
        at_s: f64,
        /// How often they come where that is at a steady beat, hertz.
        beat_hz: Option<f64>,
    },
    /// A sensor that stopped.
    #[error(
        "{file}: the response reads the same for {rows} rows from {from_s:.3} s on: the sensor or the log had stopped, and those rows are in the fit"
    )]
    #[diagnostic(help("cut the record there, or record again"))]
    Frozen {
        /// The record.
        file: String,
        /// How many rows.
        rows: usize,
        /// The time of the first, seconds.
        from_s: f64,
    },
    /// A record around another command than it says.
    #[error(
        "{file}: `nominal` is {nominal}, and the mean command is {mean:.3}: the model would have this motor at the wrong command"
    )]
    #[diagnostic(help("correct `nominal` in experiment.toml"))]
    OtherNominal {
        /// The record.
        file: String,
        /// The nominal command.
        nominal: f64,
        /// The mean command over the whole periods.
        mean: f64,
    },
    /// A period that is several.
    #[error(
        "{file}: the command repeats every {repeats_s} s and `period_s` is {period_s}: fewer periods are left to know the noise from, and distortion cannot be distinguished from it"
    )]
    #[diagnostic(help("correct `period_s` in experiment.toml"))]
    PeriodTooLong {
        /// The record.
        file: String,
        /// The period as stated, seconds.
        period_s: f64,
        /// After how long the command repeats, seconds.
        repeats_s: f64,
    },
    /// A linear model hides a strong nonlinearity.
    #[error(
        "u_nom {nominal}: nonlinear distortion of {level_db:.1} dB of the linear response ({STRONG_DISTORTION_DB:.0} dB counts as strong): a linear model holds for this amplitude only, and its standard errors do not cover the distortion"
    )]
    StronglyNonlinear {
        /// The nominal command.
        nominal: f64,
        /// The stronger of even and odd distortion relative to the linear response, dB.
        level_db: f64,
    },
    /// Lines on which the stand no longer passes the thrust as it is.
    #[error(
        "u_nom {nominal}: {count} of {lines} fitted lines are above {usable_hz:.1} Hz, where the stand is 3 dB off; what is divided out there is only as good as the stand's model"
    )]
    BeyondStand {
        /// The nominal command.
        nominal: f64,
        /// How many lines are beyond the usable range.
        count: usize,
        /// Lines fitted.
        lines: usize,
        /// Where the usable range ends.
        usable_hz: f64,
    },
    /// A column stands on a limit.
    #[error(
        "{file}: {rows} rows of {column} stand exactly on {at}: it ran into a limit there, which no linear model has"
    )]
    #[diagnostic(help("lower the amplitude, or widen the range"))]
    Saturated {
        /// The record.
        file: String,
        /// The column.
        column: &'static str,
        /// How many rows.
        rows: usize,
        /// The limit, in the column's unit.
        at: f64,
    },
    /// The command follows the noise of the response.
    #[error(
        "{file}: the command changes from period to period, by {scatter_percent:.2} % of its RMS, and follows the response's noise (p = {p_value:.0e}): a controller acts on the response, which biases gain and lag toward its inverse"
    )]
    #[diagnostic(help("open the loop"))]
    ClosedLoop {
        /// The record.
        file: String,
        /// RMS of what of the command does not repeat, over that of what does, percent.
        scatter_percent: f64,
        /// Tail probability without a loop.
        p_value: f64,
    },
    /// No line shows the static gain.
    #[error(
        "u_nom {nominal}: the lowest line, {lowest_hz:.2} Hz, is above the pole at {pole_hz:.2} Hz: the static gain is not seen, only its ratio to the time constant"
    )]
    #[diagnostic(help("record longer periods"))]
    PeriodTooShort {
        /// The nominal command.
        nominal: f64,
        /// The lowest line.
        lowest_hz: f64,
        /// The pole that was found.
        pole_hz: f64,
    },
    /// The compensator of a compensated record is not known.
    #[error("{file}: its compensator's response is unknown, so it is neither smoothed nor fitted")]
    #[diagnostic(help("record esc_command"))]
    CompensatorUnknown {
        /// The record.
        file: String,
    },
}

impl IdentifyWarning {
    /// The record concerned; `None` where it is a nominal command.
    #[must_use]
    pub fn file(&self) -> Option<&str> {
        match self {
            Self::TransientDropped { file, .. }
            | Self::Drifts { file }
            | Self::TransientUntested { file }
            | Self::RowsLeftOut { file, .. }
            | Self::SinusoidRemoved { file, .. }
            | Self::LinesDisturbed { file, .. }
            | Self::NoiseFromUnexcitedLines { file }
            | Self::Jumps { file, .. }
            | Self::Frozen { file, .. }
            | Self::OtherNominal { file, .. }
            | Self::PeriodTooLong { file, .. }
            | Self::Saturated { file, .. }
            | Self::ClosedLoop { file, .. }
            | Self::CompensatorUnknown { file } => Some(file),
            _ => None,
        }
    }

    /// What it is about.
    #[must_use]
    pub fn topic(&self) -> Topic {
        match self {
            Self::TransientDropped { .. }
            | Self::TransientUntested { .. }
            | Self::RowsLeftOut { .. }
            | Self::NoiseFromUnexcitedLines { .. }
            | Self::PeriodTooLong { .. }
            | Self::PeriodTooShort { .. } => Topic::Periods,
            Self::Jumps { .. } | Self::Frozen { .. } | Self::Drifts { .. } => Topic::Response,
            Self::OtherNominal { .. } => Topic::Command,
            Self::Saturated { .. } => Topic::Saturation,
            Self::NegativeGain { .. } => Topic::Sign,
            Self::ModelTooSimple { .. } => Topic::GoodnessOfFit,
            Self::NothingToFit { .. } => Topic::Roles,
            _ => Topic::Identification,
        }
    }
}
