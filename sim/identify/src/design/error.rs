//! Why there is no compensator.

use miette::Diagnostic;
use rotorlead::design::DesignError;
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
        DesignError::NotFinite { .. } | DesignError::OutOfRange { .. } => "give a value within the range",
    }
}
