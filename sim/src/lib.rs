//! The host side of Rotorlead as a library: from records of a stand to a model of the motor, its compensator, and what the
//! model lacks.
//!
//! What a program needs is here by name. The parts behind it are crates of their own, and their dependencies go one way:
//! [`rotorlead_diagnose`] -> [`rotorlead_identify`] -> [`rotorlead_plant`] -> [`rotorlead_records`] -> the controller's crate
//! [`rotorlead`].
//!
//! # Examples
//!
//! The paper's actuators on a simulated stand, from records to bandwidths:
//!
//! ```
//! use rotorlead_design::{Chain, DesignOptions, bandwidths};
//! use rotorlead_plant::bench::{Plan, run};
//! use rotorlead_results::paper::table_1;
//! use rotorlead_sim::{IdentifyOptions, design, identify};
//!
//! // What is to be found: a lag at each of six nominal commands. A multisine and a square wave at each, with noise.
//! let actuators = table_1();
//! let records = run(&Plan::paper(&actuators), &actuators, None, &|_| ())?;
//!
//! // The lags, each with its standard error.
//! let found = identify(&records, &IdentifyOptions::default())?;
//! for (found, true_point) in found.model.points.iter().zip(&actuators.points) {
//!     let std = found.time_constant_s_std.unwrap();
//!     assert!((found.time_constant_s - true_point.time_constant_s).abs() < 4.0 * std);
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

pub use rotorlead::compensator::Compensator;
pub use rotorlead_design::design;
pub use rotorlead_diagnose::{Diagnosis, diagnose};
pub use rotorlead_identify::estimate::Estimate;
pub use rotorlead_identify::identification::{Identification, IdentifyOptions, identify};
pub use rotorlead_identify::validate::validate;
pub use rotorlead_plant::{Effect, Model, simulate};
pub use rotorlead_records::{Experiment, Record};
