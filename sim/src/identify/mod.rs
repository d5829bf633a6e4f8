//! Models from records.

pub mod least_squares;
pub mod steps;
