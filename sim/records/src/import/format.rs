//! The formats of logs. A format is a file of its own, which ends in its [`LogFormat`], and a line in [`FORMATS`]: help, errors,
//! fuzzers and tests go by these.

use std::path::Path;

use serde::{Serialize, Serializer};

use super::quantity::Quantity;
use super::{ImportError, ImportOptions, Taken, blackbox, dataflash, esc32, mat, plain, rcbenchmark, ulog};
use crate::experiment::Excitation;

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
    Table { is_header: fn(&[String]) -> bool, dialect: &'static Dialect },
}

/// Names of columns, as [`spelled`] gives them, what each measures, and its unit.
pub(super) type Names = &'static [(Quantity, &'static str, &'static [&'static str])];

/// What is known of a format's table beside what the names of its columns say in any.
#[derive(Debug)]
pub(super) struct Dialect {
    /// Names that say quantity and unit in this format.
    pub(super) names: Names,
    /// Whether it comes from a thrust stand: rows may overtake each other on their way, and the response is the speed.
    pub(super) is_stand: bool,
    /// What drives logs of this kind, unless stated.
    pub(super) usual: Option<Excitation>,
}

impl Dialect {
    /// What a column of this name measures, and its unit.
    pub(super) fn meaning(&self, name: &str) -> Option<(Quantity, &'static str)> {
        let spelled = spelled(name);
        let named = self.names.iter().find(|(.., names)| names.contains(&spelled.as_str()));
        named.map(|(quantity, unit, _)| (*quantity, *unit))
    }
}

/// A name in small letters without underscores. Of one letter it is kept: `t` is the time, `T` may be a torque.
pub(super) fn spelled(name: &str) -> String {
    if name.chars().count() == 1 { name.to_owned() } else { name.to_lowercase().replace('_', "") }
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
