//! Logs of other tools, taken as an [`Experiment`].
//!
//! The format is told from the content. Each format has its file: `rcbenchmark`, `esc32`, `mat`, `ulog` and
//! `blackbox`. What was found in a log, what of it was taken and as what, and what was done to the rows and their
//! times is in the [`ImportSummary`].

mod blackbox;
mod blackbox_frames;
mod error;
mod esc32;
mod mat;
mod mat5;
mod rcbenchmark;
mod stamps;
mod summary;
mod table;
mod ulog;
mod ulog_messages;
mod vectors;

use std::path::Path;

pub use error::ImportError;
pub use summary::{ColumnUse, DroppedRows, ImportSummary, LogFormat, Timing};

use super::{Excitation, Experiment, Output, Record};
use table::Table;

/// What a log does not say of itself.
#[derive(Clone, Debug, PartialEq)]
pub struct ImportOptions {
    /// What to call the experiment; the log's file name where absent.
    pub name: Option<String>,
    /// Pulse widths in microseconds that mean command 0 and command 1; 1000 and 2000 unless stated.
    /// Used for logs whose command is a pulse width.
    pub esc_signal_us: (f64, f64),
    /// Which motor to take of a flight log, from 1.
    pub motor: usize,
    /// Which log to take of a file that has several, from 1; the longest where absent.
    pub log: Option<usize>,
}

impl Default for ImportOptions {
    fn default() -> Self {
        Self { name: None, esc_signal_us: (1000.0, 2000.0), motor: 1, log: None }
    }
}

/// A log, taken.
#[derive(Clone, Debug, PartialEq)]
pub struct Import {
    /// One staircase record, response in revolutions per minute unless the log has thrust.
    pub experiment: Experiment,
    /// What was done to get it.
    pub summary: ImportSummary,
}

/// Rows under which a log is no recording.
const MIN_ROWS: usize = 100;

/// Takes a log whose format is told from its content.
///
/// # Errors
/// [`ImportError`]: unreadable file, unknown header, missing column, text in a number column, command
/// outside its range or constant, time that runs backwards, too few rows, a damaged binary file.
pub fn import(file: &Path, options: &ImportOptions) -> Result<Import, ImportError> {
    let bytes = std::fs::read(file).map_err(|source| ImportError::Read { file: file.into(), source })?;
    import_bytes(file, &bytes, options)
}

/// [`import`] of a log that is in memory. `file` is what messages call it.
///
/// Memory stays within a fixed multiple of the log's length, whatever the log says of itself.
///
/// # Errors
/// As [`import`].
pub fn import_bytes(file: &Path, bytes: &[u8], options: &ImportOptions) -> Result<Import, ImportError> {
    if bytes.iter().all(u8::is_ascii_whitespace) {
        return Err(ImportError::Empty { file: file.into() });
    }
    let (low_us, high_us) = options.esc_signal_us;
    if !(low_us.is_finite() && high_us.is_finite() && low_us < high_us) {
        return Err(ImportError::SignalRange { low_us, high_us });
    }
    let taken = match mat5::header(bytes) {
        Some(mat5::Header::Level5) => mat::take(file, bytes, options)?,
        Some(mat5::Header::Hdf5) => return Err(ImportError::Hdf5 { file: file.into() }),
        None if ulog_messages::is_ulog(bytes) => ulog::take(file, bytes, options)?,
        None => match &blackbox_frames::logs(bytes)[..] {
            [] => take_table(&Table::parse(file, bytes)?, options)?,
            logs => blackbox::take(file, bytes, logs, options)?,
        },
    };
    taken.into_import(file, options)
}

/// Takes a log of text, whose format is told from its header.
fn take_table(table: &Table, options: &ImportOptions) -> Result<Taken, ImportError> {
    if table.find(esc32::TIME).is_some() && table.find(esc32::COMMAND).is_some() {
        esc32::take(table)
    } else if table.find(rcbenchmark::TIME).is_some() && table.find(rcbenchmark::COMMAND).is_some() {
        rcbenchmark::take(table, options)
    } else {
        let header = table.header.join(",");
        Err(ImportError::UnknownFormat { file: table.file.clone(), header: header.chars().take(120).collect() })
    }
}

/// What a format's reader hands over: columns of equal length, and how they came about.
struct Taken {
    time_s: Vec<f64>,
    command: Vec<f64>,
    /// Thrust; the response where there is one.
    thrust_n: Option<Vec<f64>>,
    rpm: Option<Vec<f64>>,
    voltage_v: Option<Vec<f64>>,
    current_a: Option<Vec<f64>>,
    /// Rows per second where evenly spaced without a gap.
    sample_rate_hz: Option<f64>,
    summary: ImportSummary,
}

impl Taken {
    fn into_import(self, file: &Path, options: &ImportOptions) -> Result<Import, ImportError> {
        let stem = file.file_stem().map_or_else(|| "log".into(), |s| s.to_string_lossy().into_owned());
        let low = self.command.iter().copied().fold(f64::INFINITY, f64::min);
        let high = self.command.iter().copied().fold(0.0, f64::max);
        // A folder of it could not be written: a record says how far its command moves.
        if high <= low {
            return Err(ImportError::ConstantCommand { file: file.into(), command: high, rows: self.command.len() });
        }
        let output = if self.thrust_n.is_some() { Output::ThrustN } else { Output::Rpm };
        let record = Record {
            file: "staircase.csv".into(),
            nominal: (low + high) / 2.0,
            excitation: Excitation::Staircase,
            period_s: None,
            amplitude: Some((high - low) / 2.0),
            compensated: false,
            compensator: None,
            role: None,
            time_s: self.time_s,
            command: self.command,
            thrust_n: self.thrust_n,
            rpm: self.rpm,
            esc_command: None,
            voltage_v: self.voltage_v,
            current_a: self.current_a,
        };
        Ok(Import {
            experiment: Experiment {
                name: options.name.clone().unwrap_or(stem),
                output,
                sample_rate_hz: self.sample_rate_hz,
                esc_frame_hz: None,
                command_rate_hz: None,
                records: vec![record],
            },
            summary: self.summary,
        })
    }
}
