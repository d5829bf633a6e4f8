//! Why a frequency response gives no parametric model.

use miette::Diagnostic;
use thiserror::Error;

/// Why a frequency response gives no model of the structure asked for.
#[derive(Clone, Debug, PartialEq, Error, Diagnostic)]
pub enum ParametricError {
    /// A structure that cannot be fitted.
    #[error("a model of {poles} poles and {zeros} zeros cannot be fitted")]
    #[diagnostic(help("choose 1 to {most} poles, and no more zeros than poles"))]
    Structure {
        /// Poles asked for.
        poles: usize,
        /// Zeros asked for.
        zeros: usize,
        /// The most poles that can be asked for.
        most: usize,
    },
    /// Fewer lines than a fit with a residual needs.
    #[error("{lines} lines cannot determine {parameters} parameters")]
    #[diagnostic(help("measure more lines, or choose a lower order"))]
    TooFewLines {
        /// Lines at hand.
        lines: usize,
        /// Parameters to find.
        parameters: usize,
    },
    /// A line that is no number, or has no usable variance.
    #[error("the line at {omega_rad_s} rad/s is {what}")]
    #[diagnostic(help("leave the line out; frequencies must be above zero and increase"))]
    Line {
        /// Its frequency in rad/s.
        omega_rad_s: f64,
        /// What is wrong with it.
        what: &'static str,
    },
    /// Variances that were estimated from too few samples to weight with.
    #[error("the noise variances have {degrees_of_freedom} degrees of freedom; weights need 3 at least")]
    #[diagnostic(help("record more periods, or pool the variances of neighboring lines"))]
    NoiseUnknown {
        /// Degrees of freedom (of complex samples) behind each variance.
        degrees_of_freedom: f64,
    },
    /// The search ended nowhere.
    #[error("no model of {poles} poles and {zeros} zeros was found: {reason}")]
    #[diagnostic(help("choose a lower order, or check that input and output belong together"))]
    NoFit {
        /// Poles asked for.
        poles: usize,
        /// Zeros asked for.
        zeros: usize,
        /// What went wrong.
        reason: &'static str,
    },
}
