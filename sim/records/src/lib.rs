//! Measured data: one [`Experiment`] that every tool takes.
//!
//! On disk it is a folder with `experiment.toml` and one CSV file per record. Both are read
//! strictly: whatever is missing, unknown, impossible or contradictory is an error that shows file,
//! line and column and says what to do. Nothing is guessed.

mod append;
mod clock;
mod column;
mod command_log;
mod command_shape;
mod error;
mod experiment;
pub mod files;
mod finding;
mod fleet;
pub mod import;
mod inspect;
mod long;
mod manifest;
mod plain;
mod read;
mod sampling;
mod table;
mod write;

#[cfg(any(test, feature = "testing"))]
#[doc(hidden)]
pub mod shared_data;

#[cfg(test)]
mod tests;

pub use clock::SLOWEST_ROWS_S;
pub use command_log::CommandLog;
pub use command_shape::CommandShape;
pub use error::RecordError;
pub use experiment::{Excitation, Experiment, NOMINAL_TOLERANCE, Output, Record, Role, SAME_NOMINAL, Setpoints};
pub use finding::{Finding, Severity, Topic};
pub use fleet::{FLEET_LIST, FleetList, FleetLog};
pub use inspect::{Inspection, Unreadable};
pub use long::{LONG_FILE, LongRecord, LongRows, RowCount};
pub use read::{CommandFile, read_command_log};
pub use sampling::{GRID_TOLERANCE, PERIOD_TOLERANCE, Periods};
