//! What the rows of a log are like before anything is fitted to them: gaps, uneven times, spikes, limits that cut a column off.

pub(crate) mod clipping;
pub mod columns;
pub(crate) mod even;
pub mod gaps;
pub mod readings;
pub mod resolution;
pub mod ripple;
pub mod spikes;
