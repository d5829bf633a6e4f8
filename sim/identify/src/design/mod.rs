//! Compensators from models, the bandwidths that they give, and how late the whole chain is.

mod bandwidths;
mod error;
mod inverse;
mod latency;
mod lead;
mod phase;
pub mod redesign;
mod robustness;
mod steps;

pub use bandwidths::{BandwidthPoint, Chain, bandwidths, bandwidths_with};
pub use error::CompensatorError;
pub use inverse::{DesignedInverse, InverseOptions, MOST_OVER_REFERENCE, REACH, Setting, design_inverse};
pub use latency::{Delay, FrameStart, Latency, STANDARD_FRAMES_HZ};
pub use lead::{DesignOptions, design};
pub use phase::{ChainPhase, PhaseAtBandwidth, chain_phases};
pub use robustness::{DEVIATIONS, Deviation, Robustness, robustness};
pub use steps::{StepPoint, StepResponse, Stepped, steps};
