//! Runs experiments: what a stand with a motor would measure, on a simulated actuator.
//!
//! A [`Plan`] says what to run. [`run`] plays it tick by tick through the controller's own code (its excitation, its
//! compensator, its command format) into an [`Actuator`](crate::Actuator), and gives the
//! [`Experiment`](rotorlead_records::Experiment) that a logger would have written. [`Prediction`] says in closed form what
//! an estimate from that experiment should find. The crate `rotorlead-device` does
//! the same on a controller, over its link.

mod error;
pub mod multisine;
mod plan;
mod predict;
mod run;
mod signal;

pub use error::BenchError;
pub use plan::{PAPER_AMPLITUDE, Plan, PlannedRecord};
pub use predict::Prediction;
pub use run::file_stem;
pub use run::{Progress, add_noise, run, run_on, run_through};
pub use signal::first_period;

#[cfg(test)]
mod tests;
