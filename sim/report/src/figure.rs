//! A figure drawn: [`svg`], [`png`], and the interactive form in a report ([`interactive`]).

#[cfg(feature = "drawing")]
mod drawing;
mod error;
mod extent;
pub(super) mod interactive;
#[cfg(feature = "drawing")]
mod png;
#[cfg(feature = "drawing")]
pub(super) mod still;
#[cfg(feature = "drawing")]
mod svg;
mod ticks;

pub use error::FigureError;
#[cfg(feature = "drawing")]
pub use png::png;
#[cfg(feature = "drawing")]
pub use svg::svg;

/// Whether a file that begins so is a picture of [`svg()`] or [`png()`].
#[cfg(feature = "drawing")]
#[must_use]
pub fn is_drawn(beginning: &str) -> bool {
    [svg::MARK, png::MARK].iter().any(|mark| beginning.contains(mark))
}

/// How much of their color dots have: what was measured is paler than the line that is held against it.
const PALE: f64 = 0.6;
