//! Why there is no picture.

use miette::Diagnostic;
use thiserror::Error;

/// Why there is no picture.
#[derive(Debug, Error, Diagnostic)]
pub enum FigureError {
    /// No series has a point that can be drawn.
    #[error("figure `{name}`: there is nothing to draw in panel {panel}")]
    #[diagnostic(help("give records or models with at least one finite number, above zero on a logarithmic axis"))]
    Empty {
        /// The figure's.
        name: String,
        /// Counted from 1.
        panel: usize,
    },
    /// The drawing library failed.
    #[error("figure `{name}` cannot be drawn: {reason}")]
    Drawing {
        /// The figure's.
        name: String,
        /// In the library's words.
        reason: String,
    },
}

impl FigureError {
    /// Why there is no picture, in the words of a library.
    #[cfg(feature = "drawing")]
    pub(super) fn drawing(figure: &rotorlead_answer::Figure, reason: impl ToString) -> Self {
        Self::Drawing { name: figure.name.clone(), reason: reason.to_string() }
    }
}
