//! What a person looks at: tables and figures.

mod bode;

pub use bode::{BodeError, Curve, Mark, bode};
