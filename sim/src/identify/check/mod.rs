//! What is wrong with a folder, before anything is identified from it.
//!
//! Records are looked at one by one ([`of_record`]), also those that an identification would not use or could not read; what an
//! identification itself says of them is for the caller to add ([`Findings::refuse`], [`Findings::warn`]), so that both agree.

mod doubt;
mod finding;
mod findings;
mod rows;
mod units;

pub use doubt::RecordDoubt;
pub use finding::{Finding, Severity, Topic};
pub use findings::Findings;
pub use rows::{of_lag, of_record};
pub use units::{CommandUnit, ResponseUnit};
