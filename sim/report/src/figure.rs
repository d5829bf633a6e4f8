//! A figure drawn: [`svg`], [`png`], and the interactive form in a report ([`interactive`]).

mod drawing;
mod error;
mod extent;
pub(super) mod interactive;
mod png;
pub(super) mod still;
mod svg;
mod ticks;

pub use error::FigureError;
pub use png::png;
pub use svg::svg;

/// Whether a file that begins so is a picture of [`svg()`] or [`png()`].
#[must_use]
pub fn is_drawn(beginning: &str) -> bool {
    [svg::MARK, png::MARK].iter().any(|mark| beginning.contains(mark))
}

/// How much of their color dots have: what was measured is paler than the line that is held against it.
const PALE: f64 = 0.6;
