//! What a person looks at: tables and figures.

mod bandwidths;
mod bode;
mod catalog;
mod diagnosis;
mod distortion;
mod number;
pub mod paper;
mod validation;

pub use bandwidths::{bandwidth_cell, bandwidth_json, bandwidth_table, measured_json, measured_table, rad_s};
pub use bode::{BodeError, Curve, Mark, bode};
pub use catalog::{catalog_markdown, with_catalog};
pub use diagnosis::{Figure, diagnosis_figures};
pub use distortion::{distortion_json, distortion_table};
pub use number::with_std;
pub use validation::{cells, validation_by_nominal, validation_csv, validation_table, verdict};
