//! What a person looks at: tables and figures.

mod bode;
pub mod paper;

pub use bode::{BodeError, Curve, Mark, bode};
