//! Copies of logs that can be handed to others: what is read of a log, without names, places and dates.
//!
//! What is kept is listed, and all else is dropped: of a table the columns whose names say what they measure, of a binary log the
//! messages that the importer reads. A copy is given only if it imports as the log does: [`redact_bytes`] compares the two.

pub(super) mod blackbox;
mod clock;
pub(super) mod dataflash;
mod table;
pub(super) mod ulog;

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::Path;

use serde::Serialize;

use super::format::Reader;
use super::{FORMATS, Import, ImportError, ImportOptions, foreign, import_bytes, read_log};
use crate::Experiment;
use crate::command_log::SAME_COMMAND;

/// How far the times of a copy may be from those of the log, seconds. Derived: a double of seconds since 1970 is good to 0.24 us, and a
/// time is the difference of two.
const TIMES_WITHIN_S: f64 = 1e-6;
/// The same of a rate, relative. Derived: the times above over the tenth of a second that a log has at the least.
const RATE_WITHIN: f64 = 1e-5;

/// A log without what no reader needs.
#[derive(Clone, Debug, PartialEq)]
pub struct Redacted {
    /// The copy.
    pub bytes: Vec<u8>,
    /// What it has, each by its name in the log.
    pub kept: Vec<String>,
    /// What it does not have.
    pub dropped: Vec<Dropped>,
    /// What was changed in what it has.
    pub changes: Vec<String>,
    /// Rows that both are imported as; `None` where the importer refuses both.
    pub rows: Option<usize>,
    /// Why the importer refuses the copy, which is why it refuses the log; `None` where it takes both.
    pub refused: Option<String>,
}

/// What a copy does not have.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Dropped {
    /// `column`, `message`, `header`...
    pub kind: &'static str,
    /// Its name in the log; empty where there is none.
    pub name: String,
    /// How many of it: cells of a column that are not empty, messages, lines, bytes.
    pub count: usize,
}

/// What a format's copier hands over.
#[derive(Default)]
pub(super) struct Copied {
    bytes: Vec<u8>,
    kept: Vec<String>,
    dropped: Tally,
    changes: Vec<String>,
}

/// Counts what is dropped, by kind and name.
#[derive(Default)]
struct Tally(BTreeMap<&'static str, BTreeMap<String, usize>>);

impl Tally {
    fn add(&mut self, kind: &'static str, name: &str, count: usize) {
        let of_kind = self.0.entry(kind).or_default();
        match of_kind.get_mut(name) {
            Some(total) => *total += count,
            None => drop(of_kind.insert(name.to_owned(), count)),
        }
    }

    fn into_vec(self) -> Vec<Dropped> {
        let of_kind = |(kind, names): (&'static str, BTreeMap<String, usize>)| {
            names.into_iter().map(move |(name, count)| Dropped { kind, name, count })
        };
        self.0.into_iter().flat_map(of_kind).filter(|dropped| dropped.count > 0).collect()
    }
}

/// A copy of a log with what the importer reads of it, and nothing else: no names, places or dates.
///
/// # Errors
/// As [`redact_bytes`], and where the file cannot be read.
pub fn redact(file: &Path, options: &ImportOptions) -> Result<Redacted, ImportError> {
    redact_bytes(file, &read_log(file)?, options)
}

/// [`redact`] of a log that is in memory. `file` is what messages call it, `options` say what the log does not say of itself: columns
/// that they name are kept.
///
/// # Errors
/// [`ImportError`]: an unknown format, a damaged binary file, a table none of whose columns is known, a log of a kind that is not copied,
/// or whose copy would be imported as something else.
pub fn redact_bytes(file: &Path, bytes: &[u8], options: &ImportOptions) -> Result<Redacted, ImportError> {
    let Copied { bytes: copy, kept, dropped, changes } = copied(file, bytes, options)?;
    let imported = import_bytes(file, &copy, options);
    if !is_same(&import_bytes(file, bytes, options), &imported) {
        let problem = ": a copy of it without names and places would be read as something else than the log is";
        return Err(ImportError::not_redacted(file, problem));
    }
    let (rows, refused) = match imported {
        Ok(import) => (Some(import.summary.rows_taken), None),
        Err(error) => (None, Some(error.to_string())),
    };
    Ok(Redacted { bytes: copy, kept, dropped: dropped.into_vec(), changes, rows, refused })
}

fn copied(file: &Path, bytes: &[u8], options: &ImportOptions) -> Result<Copied, ImportError> {
    for format in FORMATS {
        if let Reader::Bytes { redact, .. } = format.reader
            && let Some(copied) = redact(file, bytes)?
        {
            return Ok(copied);
        }
    }
    foreign::refuse(file, bytes)?;
    let (text, encoding) = foreign::text(file, bytes)?;
    let mut copied = table::copy(file, &text, options)?;
    copied.changes.extend(encoding.map(|encoding| format!("the log is {encoding} text, and the copy UTF-8")));
    Ok(copied)
}

/// Whether two logs are imported alike, or refused for the same reason.
fn is_same(log: &Result<Import, ImportError>, copy: &Result<Import, ImportError>) -> bool {
    match (log, copy) {
        (Ok(log), Ok(copy)) => {
            log.summary.format == copy.summary.format && is_same_experiment(&log.experiment, &copy.experiment)
        }
        (Err(log), Err(copy)) => reason(log) == reason(copy),
        _ => false,
    }
}

/// Why a log is refused, without what is quoted of it.
fn reason(error: &ImportError) -> String {
    error.to_string().split('`').step_by(2).collect()
}

/// Whether all numbers are the same; times and rates, and means of the command over times, as far as a clock that begins elsewhere lets them.
fn is_same_experiment(log: &Experiment, copy: &Experiment) -> bool {
    let is_near_rate = match (log.sample_rate_hz, copy.sample_rate_hz) {
        (Some(a), Some(b)) => (a - b).abs() <= RATE_WITHIN * a,
        (a, b) => a == b,
    };
    let mut copy = Cow::Borrowed(copy);
    if *copy != *log {
        let copy = copy.to_mut();
        copy.sample_rate_hz = log.sample_rate_hz;
        for (copy, log) in copy.records.iter_mut().zip(&log.records) {
            take_if_near(&mut copy.time_s, &log.time_s, TIMES_WITHIN_S);
            take_if_near(&mut copy.command, &log.command, SAME_COMMAND);
            if let (Some(copy), Some(log)) = (&mut copy.command_log, &log.command_log) {
                take_if_near(&mut copy.time_s, &log.time_s, TIMES_WITHIN_S);
            }
        }
    }
    is_near_rate && *copy == *log
}

/// Takes the numbers of a log in place of those of its copy, where none is farther from its like than `within`.
fn take_if_near(copy: &mut [f64], log: &[f64], within: f64) {
    if copy.len() == log.len() && copy.iter().zip(log).all(|(a, b)| (a - b).abs() <= within) {
        copy.copy_from_slice(log);
    }
}

/// Zero in place of what is in these ranges of a message.
fn without(message: &[u8], ranges: impl IntoIterator<Item = std::ops::Range<usize>>) -> Vec<u8> {
    let mut message = message.to_vec();
    for range in ranges {
        let end = range.end.min(message.len());
        message[range.start.min(end)..end].fill(0);
    }
    message
}
