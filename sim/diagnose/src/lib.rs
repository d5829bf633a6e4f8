//! Where simulation and measurement disagree, which effect is missing, and how much smaller the gap becomes with it.
//!
//! Four steps, a file each: `locate` shares the chi-square out over frequency, nominal command, amplitude and more;
//! `explain` finds the effects of the catalog that the chi-square asks for; the improved [`Model`] has them; `gap` compares
//! both models with what was held out. All of it rests on white residuals (`whitening`): where only noise is left, their
//! sum of squares is a chi-square.

mod assess;
pub mod bandwidth_table;
mod data;
mod diagnose;
mod error;
mod estimate;
mod likelihood;
mod model;
mod noise;
mod outcome;
mod plan;
mod propose;
mod select;
#[cfg(test)]
mod testing;

pub use assess::gap::{Gap, RecordGap, Residual};
pub use assess::lateness::Lateness;
pub use assess::locate::{Axis, Location, MapCell};
pub use assess::minor::MinorEffect;
pub use assess::plateau_gap::SplitGap;
pub use assess::steadiness::Steadiness;
pub use assess::timing::Timing;
pub use assess::verdict::Verdict;
pub use data::columns::Column;
pub use data::compensated::fill_in_esc_commands;
pub use data::dataset::LeftOut;
pub use data::plateaus::cut::CutRows;
pub use diagnose::{Options, diagnose};
pub use error::DiagnoseError;
pub use likelihood::excess::Excess;
pub use outcome::{Diagnosis, NEEDS_STEADY_START, NamedEffect, TriedKind, by_name};
pub use plan::{Conditions, NextExperiment};
pub use select::plateau_search::Decision;
pub use select::weak_evidence::WeakEvidence;
