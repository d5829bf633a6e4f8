//! Entry points for fuzzers: each takes any bytes, and panics where a claim does not hold.

mod capture;
mod import;
mod link;

pub use capture::*;
pub use import::*;
pub use link::*;
