//! Measured data: one [`Experiment`] that every tool takes.

mod experiment;
pub mod import;

pub use experiment::{Excitation, Experiment, Output, Record, Role};
