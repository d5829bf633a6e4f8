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
}

/// What to do, by the options of `rotorlead design`.
fn remedy(error: &DesignError) -> &'static str {
    match error {
        DesignError::NoPoles => "run `rotorlead identify` first: it finds the points of a model",
        DesignError::ZeroNotBelowPoles { .. } => "raise --omega-g above the fastest pole of the model",
        DesignError::L1GainTooHigh { .. } => {
            "lower --omega-g: at a ratio omega_g / omega_z above about 55 a step of the command leaves the filter's headroom"
        }
        DesignError::DampingTooLow { .. } => "raise --damping or --loop-rate",
        DesignError::TooCloseToNyquist { .. } => "raise --loop-rate, or lower --omega-g or --prewarp",
        DesignError::CoefficientOutOfRange { .. } => "change --loop-rate, --omega-g or --damping",
        DesignError::DeviationTooLarge { .. } => "lower --loop-rate",
        DesignError::NotFinite { .. } | DesignError::OutOfRange { .. } => "give a value within the range",
    }
}
