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

/// How much of their color dots have: what was measured is paler than the line that is held against it.
const PALE: f64 = 0.6;
