//! A record that is too long to keep in memory: its rows stay in the file and are read block by block.

use std::fs::File;
use std::io::{BufRead as _, BufReader, Read as _, Seek as _, SeekFrom};
use std::path::PathBuf;

use memchr::memchr_iter;

use super::clock::{Clock, WrongClock};
use super::column::Column;
use super::manifest::CommandKind;
use super::sampling::GRID_TOLERANCE;
use super::table::Cells;
use super::{Output, Record};
use crate::files::{FileError, TextBlocks, TextFile};

/// A file longer than this, bytes, is a long record where its estimator can take it block by block: 32 MiB, which is some
/// 700 000 rows of three columns.
pub const LONG_FILE: u64 = 32 << 20;

/// A part of a file's end that holds a whole line.
const TAIL: u64 = 4096;

/// A record whose rows stay in its file.
#[derive(Clone, Debug, PartialEq)]
pub struct LongRecord {
    /// What is said of the record; its columns are empty.
    pub header: Record,
    pub(super) path: PathBuf,
    pub(super) output: Output,
    /// Rows per second, as stated.
    pub(super) stated_hz: Option<f64>,
}

/// Some consecutive rows of a record. All columns have the same length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LongRows<'a> {
    /// Rows of the record before these.
    pub rows_before: usize,
    /// Time in seconds, strictly increasing.
    pub time_s: &'a [f64],
    /// Command before any compensator, 0..1.
    pub command: &'a [f64],
    /// The response column of the experiment.
    pub response: &'a [f64],
    /// Command after the compensator, 0..1.
    pub esc_command: Option<&'a [f64]>,
}

/// How many rows a record has, and from when to when.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RowCount {
    /// Rows.
    pub rows: usize,
    /// Time of the first, seconds.
    pub first_s: f64,
    /// Time of the last, seconds.
    pub last_s: f64,
}

impl LongRecord {
    /// The columns that the file must have.
    fn needed(&self) -> [Column; 3] {
        [Column::TimeS, Column::Command, Column::for_output(self.output)]
    }

    /// Rows and times by the file's line ends and its last line, without reading its numbers: right for a file of one row
    /// per line, which most are. What [`Self::for_each_block`] returns is right for all.
    ///
    /// # Errors
    /// When the file cannot be read, or its first rows are not those of a record.
    pub fn row_count_by_lines(&self) -> Result<RowCount, FileError> {
        let io = |source| FileError::Io { action: "read", path: self.path.clone(), source };
        let mut cells = Cells::default();
        let Some(first) = TextBlocks::open(&self.path)?.next()? else {
            return Err(FileError::Empty { path: self.path.clone() });
        };
        cells.read(&first, &self.needed(), CommandKind::Duty)?;
        let times = cells.column(Column::TimeS).unwrap_or_default();
        let (first_s, last_s) = times.first().zip(times.last()).map_or((0.0, 0.0), |(a, b)| (*a, *b));

        let mut file = BufReader::with_capacity(1 << 18, File::open(&self.path).map_err(io)?);
        let mut lines = 0;
        loop {
            let bytes = file.fill_buf().map_err(io)?;
            if bytes.is_empty() {
                break;
            }
            lines += memchr_iter(b'\n', bytes).count();
            let read = bytes.len();
            file.consume(read);
        }
        let length = file.seek(SeekFrom::End(0)).map_err(io)?;
        file.seek(SeekFrom::Start(length.saturating_sub(TAIL))).map_err(io)?;
        let mut tail = Vec::new();
        file.read_to_end(&mut tail).map_err(io)?;
        let tail = String::from_utf8_lossy(&tail);
        let full = tail.trim_end();
        // Empty lines at the end are no rows, and the header is none: as many rows as line ends before the last row.
        let rows = lines.saturating_sub(tail[full.len()..].matches('\n').count());
        let last = full.rsplit('\n').next().zip(cells.index(Column::TimeS));
        let time = last.and_then(|(line, index)| line.split(',').nth(index)?.trim().parse().ok());
        Ok(RowCount { rows, first_s, last_s: time.unwrap_or(last_s) })
    }

    /// Reads all rows, with every check of [`Experiment::read`](super::Experiment::read), and gives them to `each` in
    /// order, some ten thousand at a time. Returns how many there were.
    ///
    /// A quoted cell ends on its line.
    ///
    /// # Errors
    /// As for [`Experiment::read`](super::Experiment::read). `each` has by then seen the rows before the faulty one.
    pub fn for_each_block(&self, mut each: impl FnMut(LongRows<'_>)) -> Result<RowCount, FileError> {
        let mut lateness = self.stated_hz.map(Lateness::new);
        let mut clock = Clock::default();
        let (count, _) = self.blocks(|_, rows| {
            clock.add(rows.time_s);
            if let Some(lateness) = &mut lateness {
                lateness.add(rows.time_s);
            }
            each(rows);
            Ok(())
        })?;
        if let (Some(lateness), Some(stated_hz)) = (lateness, self.stated_hz)
            && let (row, late_s) = lateness.farthest()
            && late_s.abs() > GRID_TOLERANCE / stated_hz
        {
            let message = format!(
                "row {} is {late_s:.9} s away from where `sample_rate_hz` of experiment.toml, {stated_hz}, has it",
                row + 1
            );
            let help = "correct `sample_rate_hz` in experiment.toml, or the times of the record where they are wrong";
            return Err(self.wrong_time(WrongClock { row: row + 1, message, help: help.to_owned() })?);
        }
        match clock.wrong() {
            Some(wrong) => Err(self.wrong_time(wrong)?),
            None => Ok(count),
        }
    }

    /// Gives all rows to `each`, with the text they are in. Returns how many there were, and the last text.
    fn blocks(
        &self,
        mut each: impl FnMut((&Cells, &TextFile), LongRows<'_>) -> Result<(), FileError>,
    ) -> Result<(RowCount, Option<TextFile>), FileError> {
        let needed = self.needed();
        let mut blocks = TextBlocks::open(&self.path)?;
        let mut cells = Cells::default();
        let mut count = RowCount { rows: 0, first_s: 0.0, last_s: 0.0 };
        let mut last = None;
        while let Some(text) = blocks.next()? {
            cells.read(&text, &needed, CommandKind::Duty)?;
            let [time_s, command, response] = needed.map(|column| cells.column(column).unwrap_or_default());
            if let (Some(first_s), Some(last_s)) = (time_s.first(), time_s.last()) {
                if count.rows == 0 {
                    count.first_s = *first_s;
                }
                count.last_s = *last_s;
                count.rows += time_s.len();
                let esc_command = cells.column(Column::EscCommand);
                let rows_before = cells.rows_before();
                each((&cells, &text), LongRows { rows_before, time_s, command, response, esc_command })?;
            }
            last = Some(text);
        }
        match &last {
            Some(text) => cells.check_rows(text)?,
            None => return Err(FileError::Empty { path: self.path.clone() }),
        }
        Ok((count, last))
    }

    /// The error at the time of a row. The file is read again for its place.
    fn wrong_time(&self, WrongClock { row, message, help }: WrongClock) -> Result<FileError, FileError> {
        let found = self.blocks(|(cells, text), rows| {
            if row <= rows.rows_before + rows.time_s.len() {
                return Err(cells.wrong_time(text, row, message.clone(), help.clone()));
            }
            Ok(())
        });
        match found {
            Err(error) => Ok(error),
            // The file has changed meanwhile: what is said is still so.
            Ok((_, text)) => text
                .map(|text| text.complaint(0..0, message, "in this file", "read it again: it has changed"))
                .ok_or_else(|| FileError::Empty { path: self.path.clone() }),
        }
    }
}

/// How late rows are on a grid of known interval, relative to the first.
struct Lateness {
    interval_s: f64,
    first_s: Option<f64>,
    rows: usize,
    sum_s: f64,
    earliest: (usize, f64),
    latest: (usize, f64),
}

impl Lateness {
    fn new(rate_hz: f64) -> Self {
        Self {
            interval_s: 1.0 / rate_hz,
            first_s: None,
            rows: 0,
            sum_s: 0.0,
            earliest: (0, f64::INFINITY),
            latest: (0, f64::NEG_INFINITY),
        }
    }

    fn add(&mut self, time_s: &[f64]) {
        for time in time_s {
            let first_s = *self.first_s.get_or_insert(*time);
            let late_s = (time - first_s) - self.rows as f64 * self.interval_s;
            self.sum_s += late_s;
            if late_s < self.earliest.1 {
                self.earliest = (self.rows, late_s);
            }
            if late_s > self.latest.1 {
                self.latest = (self.rows, late_s);
            }
            self.rows += 1;
        }
    }

    /// The row (from zero) that is farthest from the grid that is nearest to all of them, and how late it is, seconds.
    fn farthest(&self) -> (usize, f64) {
        let mean_s = self.sum_s / self.rows.max(1) as f64;
        [self.earliest, self.latest]
            .map(|(row, late_s)| (row, late_s - mean_s))
            .into_iter()
            .max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))
            .unwrap_or((0, 0.0))
    }
}
