//! The formats of logs. A format is a file of its own, which ends in its [`LogFormat`], and a line in [`FORMATS`]: help, errors,
//! fuzzers and tests go by these.

use std::path::Path;

use serde::{Serialize, Serializer};

use super::{ImportError, ImportOptions, Taken, blackbox, dataflash, esc32, mat, plain, rcbenchmark, ulog};

/// All formats, in the order in which a log is tried as one: any table comes last.
pub const FORMATS: [&LogFormat; 7] = [
    &mat::FORMAT,
    &ulog::FORMAT,
    &dataflash::FORMAT,
    &blackbox::FORMAT,
    &esc32::FORMAT,
    &rcbenchmark::FORMAT,
    &plain::FORMAT,
];

/// A format of logs.
#[derive(Debug)]
pub struct LogFormat {
    /// What programs call it.
    pub name: &'static str,
    /// What a list of formats calls it.
    pub title: &'static str,
    /// Whether a log has several motors, of which [`ImportOptions::motor`] takes one.
    pub has_motors: bool,
    /// Whether a file may have several logs, of which [`ImportOptions::log`] takes one.
    pub has_several_logs: bool,
    /// Whether [`ImportOptions::columns`] may say which column is what.
    pub has_stated_columns: bool,
    /// Bytes of memory that reading one byte of a log takes at the most, beside the log.
    pub memory_per_byte: usize,
    pub(super) reader: Reader,
}

/// Reads a log, `None` where it is of another format. The path is what messages call it.
type Read<T> = fn(&Path, &T, &ImportOptions) -> Result<Option<Taken>, ImportError>;

/// How a format is recognized and read.
#[derive(Debug)]
pub(super) enum Reader {
    /// From bytes.
    Bytes(Read<[u8]>),
    /// From text.
    Text(Read<str>),
    /// As a table, where the names of its columns are the format's.
    Table {
        is_header: fn(&[String]) -> bool,
        /// Whether it comes from a thrust stand: rows may overtake each other on their way, the response is the speed, and a staircase
        /// drives it.
        is_stand: bool,
    },
}

/// Bytes of memory per byte of a log that is not compressed. A row of two bytes takes up to 400: doubles in the column that was read,
/// in the record and as its time, the place of its row, and lists take twice as much while they grow.
pub(super) const UNCOMPRESSED: usize = 200;

impl LogFormat {
    /// All titles in a sentence's list.
    pub(super) fn titles() -> String {
        FORMATS.map(|format| format.title).join("; ")
    }
}

impl PartialEq for LogFormat {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

/// As its name.
impl Serialize for LogFormat {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name)
    }
}
