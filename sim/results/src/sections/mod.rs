//! The parts of a report: one for each thing that is done, so that a report of a whole experiment is made of the same.

mod experiment;
mod stand;

pub use experiment::{excitation_section, experiment_facts, simulation_section};
pub use stand::{stand_section, stand_table};

use rotorlead_answer::Cell;

use rotorlead_answer::with_std;

/// A value with its standard error, both times `scale`.
pub(crate) fn estimate(value: f64, std: Option<f64>, scale: f64, digits: usize) -> Cell {
    Cell::shown(scale * value, with_std(value, std, scale, digits).replace("+-", "±"))
}
