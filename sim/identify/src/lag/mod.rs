//! The motor's first-order lag, by the records that show it.
//!
//! | records | estimator |
//! |---|---|
//! | multisines, whole periods | [`multisine`]: a frequency response for each, and the lag by maximum likelihood ([`first_order`]) |
//! | chirps | [`chirp`]: the same lag from a frequency response by local polynomials |
//! | steps between levels | [`steps`]: output error in time, a lag for each operating point |
//!
//! All give gain, time constant and dead time with their standard errors, for each nominal command.

pub mod chirp;
pub mod first_order;
pub mod multisine;
pub mod steps;
