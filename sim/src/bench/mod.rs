//! bench
pub mod multisine;
