//! The host side of Rotorlead: simulated actuators, and everything that is computed from records.
//!
//! Dependencies go one way: [`command`] -> [`report`] -> [`design`] -> {[`identify`], [`mod@bench`]} ->
//! {[`record`], [`plant`]} -> {[`files`], the controller's crate `rotorlead`}.

pub mod bench;
pub mod command;
pub mod design;
pub mod diagnose;
pub mod files;
pub mod identify;
pub mod plant;
pub mod record;
pub mod report;
