//! Compensators from models, and the bandwidths that they give.

mod bandwidths;
mod error;
mod lead;
pub mod redesign;

pub use bandwidths::{BandwidthPoint, Chain, bandwidths, bandwidths_with};
pub use error::CompensatorError;
pub use lead::{DesignOptions, compensator_file, design, read_compensator};
