//! From records to models. Each room takes what the ones below it give:
//!
//! ```text
//! identification   an experiment             -> a model, by the kind of its records
//! check            an experiment             -> what is wrong with it, before anything is fitted
//! validate         records and a model       -> how much of them it explains
//! static_map       steady levels             -> the steady response against the command
//! lag              records                   -> gain, time constant and dead time at each nominal command
//! flight           a motor's record in flight  -> its lag, in closed loop
//! stand            records of a stand        -> its transfer function
//! frequency_response  spectra                -> response over command, its bandwidth, its distortion
//! spectra          periodic records          -> lines at the excited frequencies, with their noise
//! alignment        a command and a response log  -> one record on one clock
//! simulation       a model and a command     -> its response at the rows of a record
//! rows             columns                   -> gaps, spikes, limits
//! ```

pub mod alignment;
pub mod check;
pub mod error;
pub mod estimate;
pub mod flight;
pub mod frequency_response;
pub mod goodness_of_fit;
pub mod identification;
pub mod lag;
pub mod rows;
pub mod simulation;
pub mod spectra;
pub mod stand;
pub mod static_map;
#[cfg(any(test, feature = "testing"))]
#[doc(hidden)]
pub mod testing;
pub mod validate;
