//! Where simulation and measurement disagree, which effect is missing, and how much smaller the gap becomes with it.
//!
//! One way up, a folder each: `noise` (spectra, errors), `data` (records, which do not change), `model` (hypotheses and their response),
//! `likelihood` (white residuals by weights that are values: where only noise is left, their sum of squares is a chi-square), `estimate`
//! (fits and what they predict), `propose` (initial values of searches), `policy` (the criteria for naming an effect), `assess` (the
//! residual, and what matters), `select` (which effects the records ask for), `diagnose` and `plan` (the answer, and the experiment that
//! would say more).

mod assess;
mod data;
mod diagnose;
mod error;
mod estimate;
mod likelihood;
mod model;
mod noise;
mod outcome;
mod plan;
mod policy;
mod propose;
mod select;
mod square_of_speed;
#[cfg(test)]
mod testing;
mod through_levels;

pub use assess::conditions::Conditions;
pub use assess::esc_ramp::{EscRamp, RampRate};
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
pub use data::plateaus::groups::CutRows;
pub use diagnose::{Options, diagnose};
pub use error::DiagnoseError;
pub use likelihood::excess::Excess;
pub use outcome::{Diagnosis, NEEDS_STEADY_START, NamedEffect, TriedKind, by_name};
pub use plan::NextExperiment;
pub use policy::Policy;
pub use select::decision::Decision;
pub use select::weak_evidence::WeakEvidence;
pub use square_of_speed::SquareOfSpeed;
