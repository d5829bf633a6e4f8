//! The records as they are compared: what drove the actuator, what was measured, what is fitted and what is held out.

pub(crate) mod auxiliary;
pub(crate) mod columns;
pub(crate) mod compensated;
pub(crate) mod dataset;
pub(crate) mod plateaus;
mod simulation_input;
pub(crate) mod split;
