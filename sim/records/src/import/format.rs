//! The formats of logs. A format is a file of its own, which ends in its [`LogFormat`], and a line in [`FORMATS`]: help, errors,
//! fuzzers and tests go by these.

use std::path::Path;

use serde::{Serialize, Serializer};

use super::MOST_MOTORS;
use super::quantity::Quantity;
use super::redact::Copied;
use super::{
    ImportError, ImportOptions, Taken, blackbox, blackbox_csv, crazyflie, dataflash, esc32, flight_stand, mat, plain,
    rcbenchmark, ulog, vesc,
};
use crate::experiment::Excitation;

/// All formats, in the order in which a log is tried as one: any table comes last.
pub const FORMATS: [&LogFormat; 11] = [
    &mat::FORMAT,
    &ulog::FORMAT,
    &dataflash::FORMAT,
    &blackbox::FORMAT,
    &esc32::FORMAT,
    &rcbenchmark::FORMAT,
    &flight_stand::FORMAT,
    &blackbox_csv::FORMAT,
    &vesc::FORMAT,
    &crazyflie::FORMAT,
    &plain::FORMAT,
];

/// A format of logs.
#[derive(Debug)]
pub struct LogFormat {
    /// What programs call it.
    pub name: &'static str,
    /// What a list of formats calls it.
    pub title: &'static str,
    /// Whether a log may have several motors, of which [`ImportOptions::motor`] takes one.
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

/// Copies a log without names and places, `None` where it is of another format.
type Redact = fn(&Path, &[u8]) -> Result<Option<Copied>, ImportError>;

/// How a format is recognized and read.
#[derive(Debug)]
pub(super) enum Reader {
    /// From bytes. What copies a log without names and places stands beside it.
    Bytes { read: Read<[u8]>, redact: Redact },
    /// From text.
    Text(Read<str>),
    /// As a table, where the names of its columns are the format's.
    Table { is_header: fn(&[String]) -> bool, dialect: &'static Dialect },
}

/// Names of columns, as [`spelled`] gives them, what each measures, and its unit, empty where its numbers say it. In a name `#` stands for
/// the number of a motor, from 1 or `a` on, and `@` for one from 0 on.
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
    /// Whether commands without a unit are DShot numbers where they go beyond 1000 to 2000, and pulse widths where not: there is no third.
    pub(super) is_dshot_or_pulse: bool,
    /// Whether a controller may have flown it, so that a flight is refused.
    pub(super) may_be_flight: bool,
    /// What a reader of the record has to know.
    pub(super) note: Option<&'static str>,
    /// Where else a speed may be that no name says, as a sentence.
    pub(super) speed_elsewhere: Option<&'static str>,
}

/// What the name of a column says in a format.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Meaning {
    pub(super) quantity: Quantity,
    pub(super) unit: &'static str,
    /// Which motor it is of, from 1, where it says that.
    pub(super) motor: Option<usize>,
}

impl Dialect {
    /// One whose columns' names speak for themselves, and of which nothing else is known.
    pub(super) const PLAIN: Self = Self {
        names: &[],
        is_stand: false,
        usual: None,
        is_dshot_or_pulse: false,
        may_be_flight: false,
        note: None,
        speed_elsewhere: None,
    };

    /// What a column of this name says.
    pub(super) fn meaning(&self, name: &str) -> Option<Meaning> {
        let spelled = spelled(name);
        self.names.iter().find_map(|&(quantity, unit, names)| {
            let motor = names.iter().find_map(|pattern| match_motor(pattern, &spelled))?;
            Some(Meaning { quantity, unit, motor })
        })
    }
}

/// The motor, where a name is as a pattern of [`Names`]; `None` inside where the pattern has none.
fn match_motor(pattern: &str, name: &str) -> Option<Option<usize>> {
    let Some(at) = pattern.find(['#', '@']) else { return (pattern == name).then_some(None) };
    let first = usize::from(pattern[at..].starts_with('@'));
    let number = name.strip_prefix(&pattern[..at])?.strip_suffix(&pattern[at + 1..])?;
    let letter =
        |letter: &str| Some(usize::from(letter.bytes().next()?.checked_sub(b'a')?) + 1).filter(|_| letter.len() == 1);
    let is_digits = !number.is_empty() && number.len() <= 2 && number.bytes().all(|byte| byte.is_ascii_digit());
    let number = if is_digits { number.parse().ok()? } else { letter(number).filter(|&motor| motor <= MOST_MOTORS)? };
    let motor = number + first;
    (1..=MOST_MOTORS).contains(&motor).then_some(Some(motor))
}

/// A name in small letters without underscores. Of one letter it is kept: `t` is the time, `T` may be a torque.
pub(super) fn spelled(name: &str) -> String {
    if name.chars().count() == 1 { name.to_owned() } else { name.to_lowercase().replace('_', "").replace('μ', "µ") }
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
