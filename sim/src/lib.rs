//! The host side of Rotorlead: simulated actuators, and everything that is computed from records.
//!
//! Dependencies go one way: [`command`] -> [`report`] -> [`design`] -> {[`identify`], [`mod@bench`]} ->
//! {[`record`], [`plant`]} -> {[`files`], the controller's crate `rotorlead`}.
//!
//! # Examples
//!
//! The paper's actuators on a simulated stand, from records to bandwidths:
//!
//! ```
//! use rotorlead_sim::bench::{Plan, run};
//! use rotorlead_sim::design::{Chain, DesignOptions, bandwidths, design};
//! use rotorlead_sim::identify::{PeriodicOptions, identify_periodic};
//! use rotorlead_sim::report::paper::table_1;
//!
//! // What is to be found: a lag at each of six nominal commands. A multisine and a square wave at each, with noise.
//! let actuators = table_1();
//! let records = run(&Plan::paper(&actuators), &actuators, None, &|_| ())?;
//!
//! // The lags, each with its standard error.
//! let found = identify_periodic(&records, &PeriodicOptions::default())?;
//! for (nominal, point) in found.nominals.iter().zip(&actuators.points) {
//!     let tau = &nominal.fit.time_constant_s;
//!     assert!((tau.value - point.time_constant_s).abs() < 4.0 * tau.std);
//! }
//!
//! // One compensator for all of them, and the bandwidths of the paper's Table 3, rad/s.
//! let design = design(&actuators, &DesignOptions::default())?;
//! let points = bandwidths(&actuators, Chain::Continuous(design.lead()));
//! let fastest = points.last().unwrap();
//! assert!((fastest.uncompensated.rad_s().unwrap() - 14.0940).abs() < 1e-3);
//! assert!((fastest.compensated.rad_s().unwrap() - 94.1039).abs() < 1e-3);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod bench;
pub mod command;
pub mod design;
pub mod diagnose;
pub mod files;
pub mod identify;
pub mod plant;
pub mod record;
pub mod report;
