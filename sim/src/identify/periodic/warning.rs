//! What an identification from periodic records has to say beside its numbers.

use crate::identify::STRONG_DISTORTION_DB;

/// What a user should know about an identification that succeeded.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum IdentifyWarning {
    /// No multisine record to fit at this nominal command.
    #[error("u_nom {nominal}: no multisine record to fit on; its other records are left out")]
    NothingToFit {
        /// The nominal command.
        nominal: f64,
    },
    /// The first period, or more, was dropped.
    #[error("{file}: a transient in the first {dropped} of {periods} periods (p = {p_value:.1e}), which are left out")]
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
    /// Nothing to compare the first period with.
    #[error("{file}: no other period to test the first for a transient; let the motor run in before recording")]
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
    NoiseFromUnexcitedLines {
        /// The record.
        file: String,
    },
    /// The lag does not explain the response to within its noise.
    #[error(
        "u_nom {nominal}: a first-order lag leaves {reduced_chi_square:.1} times the noise power; the standard errors cover noise only"
    )]
    ModelTooSimple {
        /// The nominal command.
        nominal: f64,
        /// Chi-square of the residual per degree of freedom.
        reduced_chi_square: f64,
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
        "{file}: {rows} rows of {column} stand exactly on {at}: it ran into a limit there, which no linear model has; lower the amplitude, or widen the range"
    )]
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
        "{file}: the command changes from period to period, by {scatter_percent:.2} % of its RMS, and follows the response's noise (p = {p_value:.0e}): a controller acts on the response, which biases gain and lag toward its inverse; open the loop"
    )]
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
        "u_nom {nominal}: the lowest line, {lowest_hz:.2} Hz, is above the pole at {pole_hz:.2} Hz: the static gain is not seen, only its ratio to the time constant; record longer periods"
    )]
    PeriodTooShort {
        /// The nominal command.
        nominal: f64,
        /// The lowest line.
        lowest_hz: f64,
        /// The pole that was found.
        pole_hz: f64,
    },
    /// The compensator of a compensated record is not known.
    #[error("{file}: its compensator's response is unknown, so it is neither smoothed nor fitted; record esc_command")]
    CompensatorUnknown {
        /// The record.
        file: String,
    },
}
