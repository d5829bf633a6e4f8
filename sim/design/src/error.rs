//! Why there is no compensator.

use miette::Diagnostic;
use rotorlead::design::{DesignError, InverseError};
use thiserror::Error;

/// Why no compensator can be designed from a model.
#[derive(Clone, Copy, Debug, PartialEq, Error, Diagnostic)]
pub enum CompensatorError {
    /// The controller's design refuses the parameters.
    #[error(transparent)]
    #[diagnostic(help("{}", remedy(.0)))]
    Refused(#[from] DesignError),
    /// The response rises with the command at one point and falls at another.
    #[error("the gain is {:.4} at {} and {:.4} at {}: one of them has the wrong sign", .first.1, .first.0, .other.1, .other.0)]
    #[diagnostic(help(
        "turn the sign of the response in the records around one of these commands (`rotorlead check` says which), and identify again"
    ))]
    GainsOfBothSigns {
        /// Nominal command of a point, and its gain in response units per unit of command.
        first: (f64, f64),
        /// The same of a point whose gain has another sign.
        other: (f64, f64),
    },
    /// The time constant that the zero would stand on is hardly known.
    #[error(
        "the fastest time constant of the model, {:.1} ms at command {nominal:.3}, is known to be within {:.1} and {:.1} ms only: \
         a factor of {factor:.2}, where a design takes {MOST_FACTOR}",
        1e3 * .time_constant_s, 1e3 * .low_s, 1e3 * .high_s
    )]
    #[diagnostic(help(
        "record more steps to commands around {nominal:.3}, up and down, each level held for a second or longer, and logged \
         without gaps; then identify again"
    ))]
    NotKnown {
        /// Command at which the motor is fastest.
        nominal: f64,
        /// The time constant there, seconds.
        time_constant_s: f64,
        /// Lower end of its 95 % interval, seconds.
        low_s: f64,
        /// Upper end of its 95 % interval, seconds.
        high_s: f64,
        /// By how much it may be off.
        factor: f64,
    },
    /// The controller's design refuses the inverse.
    #[error(transparent)]
    #[diagnostic(help("{}", inverse_remedy(.0)))]
    InverseRefused(#[from] InverseError),
    /// A time constant may be so much shorter than the inverse takes it for that the rotor overshoots.
    #[error(
        "the time constant at command {nominal:.3}, {:.1} ms, may be as short as {:.1} ms: the response would exceed the reference \
         model by a factor of {factor:.2}, where {MOST_OVER_REFERENCE} is allowed",
        1e3 * .time_constant_s, 1e3 * .low_s
    )]
    #[diagnostic(help(
        "record more steps to commands around {nominal:.3} and identify again, or design a lead, which needs the fastest time \
         constant alone"
    ))]
    NotKnownForInverse {
        /// Command at which it is worst.
        nominal: f64,
        /// The time constant there, seconds.
        time_constant_s: f64,
        /// The shortest that the records allow, seconds.
        low_s: f64,
        /// Response over that of the reference model, at its natural frequency.
        factor: f64,
    },
    /// The model's fastest motor is too slow for the bandwidth asked for: the filter's headroom cannot hold the lead.
    #[error("the fastest pole of the model is too slow for this omega_g")]
    #[diagnostic(help("the highest --omega-g that this model allows is {largest_omega_g_rad_s:.1} rad/s"))]
    TooMuchLead {
        /// What the controller's design says.
        source: DesignError,
        /// The highest `omega_g` whose design is accepted, rounded down to 0.1 rad/s.
        largest_omega_g_rad_s: f64,
    },
}

/// Largest upper bound of the response over that of the reference model. Chosen: one decibel, `10^(1/20)`; a rotor that is 10 % faster than
/// its table gives 0.8 dB and overshoots by 14 % (`docs/inverse.md`).
pub const MOST_OVER_REFERENCE: f64 = 1.12;
/// The largest factor by which a 95 % interval may be off its time constant for a design. Chosen: a zero that is off by a factor changes
/// the gain of a loop by as much above the pole, and of the usual gain margin of 2 (6 dB) 2 / 1.6 = 1.25 (2 dB) is left.
pub(super) const MOST_FACTOR: f64 = 1.6;

/// What to do about a curve or a reference model.
fn inverse_remedy(error: &InverseError) -> &'static str {
    match error {
        InverseError::NoPoints => "run `rotorlead identify` first: it finds the points of a model",
        InverseError::RotorTooFast { .. } => "raise --natural, or design a lead",
        InverseError::RotorTooSlow { .. } => "lower --natural",
        InverseError::CurveTooSteep { .. } => "record steps between these commands, and identify again",
        InverseError::RoundingTooLarge { .. } => "lower --loop-rate",
        InverseError::ResponseTooLong => "raise --natural, or lower --damping or --loop-rate",
        InverseError::Parameter(error @ DesignError::SlewTooSlow { .. }) => remedy(error),
        InverseError::LimitsCrossed { .. } => "give the lowest command first",
        _ => "give a value within the range",
    }
}

/// What to do, by the options of `rotorlead design`.
fn remedy(error: &DesignError) -> &'static str {
    match error {
        DesignError::NoPoles => "run `rotorlead identify` first: it finds the points of a model",
        DesignError::ZeroNotBelowPoles { .. } => "raise --omega-g above the fastest pole of the model",
        DesignError::L1GainTooHigh { .. } => "lower --omega-g, or raise --damping",
        DesignError::DampingTooLow { .. } => "raise --damping or --loop-rate",
        DesignError::TooCloseToNyquist { .. } => "raise --loop-rate, or lower --omega-g or --prewarp",
        DesignError::CoefficientOutOfRange { .. } => "change --loop-rate, --omega-g or --damping",
        DesignError::DeviationTooLarge { .. } => "lower --loop-rate",
        DesignError::SlewTooSlow { .. } => "raise --slew to the ESC's own limit, or leave it out",
        DesignError::NotFinite { .. } | DesignError::OutOfRange { .. } => "give a value within the range",
    }
}
