//! What a person looks at: tables and figures.

mod bandwidths;
mod bode;
mod distortion;
mod number;
pub mod paper;
mod validation;

pub use bandwidths::{bandwidth_cell, bandwidth_json, bandwidth_table, measured_json, measured_table, rad_s};
pub use bode::{BodeError, Curve, Mark, bode};
pub use distortion::{distortion_json, distortion_table};
pub use number::with_std;
pub use validation::{cells, validation_by_nominal, validation_csv, validation_table, verdict};
