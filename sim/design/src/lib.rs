//! Compensators from models, the bandwidths that they give, and how late the whole chain is.
//!
//! In: a [`Model`](rotorlead_plant::Model), which `rotorlead-identify` makes or a file gives. Out: the numbers of a compensator
//! ([`design`] for a lead, [`design_inverse`] for an inverse), and what it does to bandwidth, phase, steps and delay. Source: C(s) of
//! the paper for the lead, `docs/design.md` for the inverse.

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
pub use error::{CompensatorError, MOST_OVER_REFERENCE};
pub use inverse::{DesignedInverse, InverseOptions, REACH, Setting, design_inverse};
pub use latency::{Delay, FrameStart, Latency};
pub use lead::{DesignOptions, design};
pub use phase::{ChainPhase, PhaseAtBandwidth, chain_phases};
pub use robustness::{DEVIATIONS, Deviation, Robustness, robustness};
pub use steps::{StepPoint, StepResponse, StepSimulation, steps};
