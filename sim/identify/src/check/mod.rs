//! What is wrong with a folder, before anything is identified from it.
//!
//! Records are looked at one by one ([`check_record`]), also those that an identification would not use or could not read; what an
//! identification itself says of them is for the caller to add ([`Findings::refuse`], [`Findings::warn`]), so that both agree.

mod fault;
mod findings;
mod period;
mod repeats;
mod rows;
mod units;

pub use fault::RecordFault;
pub use findings::Findings;
pub use rows::{check_rate, check_record};
pub use units::{CommandUnit, ResponseUnit};

/// Whole numbers without decimals, others with one: within 0.05 of a whole number, the one decimal is zero.
pub(crate) fn decimal(value: f64) -> String {
    if (value - value.round()).abs() < 0.05 { format!("{value:.0}") } else { format!("{value:.1}") }
}
