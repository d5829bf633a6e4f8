//! A record's CSV file: every cell a number that its column accepts, or an error that shows it.

use std::ops::Range;

use csv::StringRecord;
use memchr::memchr_iter;
use miette::Diagnostic as _;

use super::clock::{Clock, WrongClock};
use super::column::{Column, LEAST_ROWS, Refusal, TOO_FEW_ROWS};
use super::command_log::{CommandLog, SAME_COMMAND};
use super::error::short;
use super::manifest::CommandKind;
use super::sampling::Grid;
use super::{Record, plain};
use crate::files::csv_rows::{cell_span, next, quoted, reader, row_span};
use crate::files::{FileError, KeyPath, TextFile, TomlFile, did_you_mean, shown};

/// Bytes of the longest row: eleven numbers with all the digits that anyone writes, quoted and with spaces.
const LONGEST_ROW: usize = 10_000;

/// The columns of a CSV file, with the text to show errors in.
pub(super) struct Table {
    text: TextFile,
    cells: Cells,
}

impl Table {
    /// Reads all columns, of which those `needed` have to be there; `kind` says what the command is.
    pub(super) fn read(text: TextFile, needed: &[Column], kind: CommandKind) -> Result<Self, FileError> {
        let mut cells = Cells::default();
        cells.read(&text, needed, kind)?;
        cells.check_rows(&text)?;
        Ok(Self { text, cells })
    }

    /// Refuses rows that the rate stated in `manifest` contradicts: shown there where the rows are even, in the rows otherwise.
    pub(super) fn check_rate(&self, record: &Record, stated_hz: f64, manifest: &TomlFile) -> Result<(), FileError> {
        let time_s = &record.time_s;
        if Grid::through(time_s, 1.0 / stated_hz).holds(time_s) {
            return Ok(());
        }
        let uneven = match record.sample_rate_hz() {
            Ok(rate_hz) => {
                let rate_hz = short(rate_hz);
                let fault = KeyPath::root().key("sample_rate_hz").fault(
                    format!("the rows of `{}` come at {rate_hz} Hz, not at {stated_hz}", record.file),
                    format!(
                        "write `sample_rate_hz = {rate_hz}`, or correct the times of the record where they are wrong"
                    ),
                );
                return Err(manifest.show(&fault));
            }
            Err(uneven) => uneven,
        };
        let message = format!("{uneven}; `sample_rate_hz` of experiment.toml says {stated_hz}");
        let help = uneven.help().map(|help| help.to_string()).unwrap_or_default();
        let help = format!("{help}. Steps need no even rows: without `sample_rate_hz` they are taken as they come");
        Err(self.cells.wrong_time(&self.text, uneven.row().unwrap_or(1), message, help))
    }

    /// Refuses times that are no motor's record's.
    pub(super) fn check_clock(&self, record: &Record) -> Result<(), FileError> {
        match Clock::from_record(record).wrong() {
            Some(WrongClock { row, message, help }) => Err(self.cells.wrong_time(&self.text, row, message, help)),
            None => Ok(()),
        }
    }

    /// Refuses commands that contradict those of a command log, for which `expected` are what the rows have.
    pub(super) fn check_command(&self, record: &Record, expected: &[f64], log: &CommandLog) -> Result<(), FileError> {
        let mut rows = record.command.iter().zip(expected);
        let Some(row) = rows.position(|(here, there)| (here - there).abs() > SAME_COMMAND) else { return Ok(()) };
        let (here, there) = (shown(record.command[row]), shown(expected[row]));
        let message = format!("the command is {here}, and `{}` has {there} at that time", log.file);
        let help = "correct the one that is wrong, or leave the column out: the command is taken from that file";
        Err(self.cells.wrong(Column::Command, &self.text, row + 1, message, help.into()))
    }

    /// Refuses a command log that starts after the rows that it drives.
    pub(super) fn check_start(&self, first_s: f64, start_s: f64) -> Result<(), FileError> {
        if start_s <= first_s {
            return Ok(());
        }
        let message = format!(
            "the first command is at {} s, after the record's first row at {} s",
            shown(start_s),
            shown(first_s)
        );
        let help = "start it with the command that is in force at the first row";
        Err(self.cells.wrong(Column::TimeS, &self.text, 1, message, help.into()))
    }

    /// Takes a column out; empty where it is not there.
    pub(super) fn take(&mut self, column: Column) -> Vec<f64> {
        self.cells.index(column).map(|index| std::mem::take(&mut self.cells.values[index])).unwrap_or_default()
    }

    /// Moves the columns into `record`.
    pub(super) fn fill(&mut self, record: &mut Record) {
        for (column, values) in self.cells.columns.iter().zip(&mut self.cells.values) {
            let values = std::mem::take(values);
            match column {
                Column::TimeS => record.time_s = values,
                Column::Command => record.command = values,
                Column::ThrustN => record.thrust_n = Some(values),
                Column::Rpm => record.rpm = Some(values),
                Column::EscCommand => record.esc_command = Some(values),
                Column::VoltageV => record.voltage_v = Some(values),
                Column::CurrentA => record.current_a = Some(values),
                Column::SetpointRoll => record.setpoints.roll_rad_s = Some(values),
                Column::SetpointPitch => record.setpoints.pitch_rad_s = Some(values),
                Column::SetpointYaw => record.setpoints.yaw_rad_s = Some(values),
                Column::SetpointThrottle => record.setpoints.throttle = Some(values),
            }
        }
    }
}

/// The numbers of a CSV file, all of them or those of one part after the other.
#[derive(Default)]
pub(super) struct Cells {
    /// The columns in the order of the file; none before its header is read.
    columns: Vec<Column>,
    /// Their values.
    values: Vec<Vec<f64>>,
    /// What stood last in each column before these.
    before: Vec<Option<f64>>,
    /// Rows before these.
    rows_before: usize,
}

impl Cells {
    /// Reads the rows of `text` in place of those of the part before it. The first part begins with the header.
    ///
    /// Rows of plain numbers are read as such ([`plain`]); where anything else stands in the text, a CSV reader takes it
    /// from its start, and says what is wrong.
    pub(super) fn read(&mut self, text: &TextFile, needed: &[Column], kind: CommandKind) -> Result<(), FileError> {
        let mut reader = reader(text);
        let mut row = StringRecord::new();
        let mut start = 0;
        if self.columns.is_empty() {
            let first = text.text().lines().next().unwrap_or_default();
            if first.len() > LONGEST_ROW {
                let message = format!("line 1: {} characters are no header", first.len());
                return Err(text.complaint(0..first.len(), message, "this line", "begin with time_s,command,thrust_n"));
            }
            next(&mut reader, &mut row);
            start = reader.position().byte() as usize;
            self.columns = header(text, &row, needed)?;
            self.values = vec![Vec::new(); self.columns.len()];
            self.before = vec![None; self.columns.len()];
        }
        self.forget();
        if let Some(line) = long_line(&text.text()[start..]) {
            let message = format!("line {}: {} characters are no row", text.line(start + line.start), line.len());
            let help = "a row has a number for each column of the header, and a line end";
            return Err(text.complaint(start + line.start..start + line.end, message, "this line", help));
        }
        let lines = memchr_iter(b'\n', &text.text().as_bytes()[start..]).count();
        for values in &mut self.values {
            values.reserve_exact(lines + 1);
        }
        if plain::read(&text.text().as_bytes()[start..], &self.columns, kind, &self.before, &mut self.values) {
            return Ok(());
        }
        self.values.iter_mut().for_each(Vec::clear);
        while next(&mut reader, &mut row) {
            if row.len() != self.columns.len() {
                return Err(uneven_row(text, &row, self.columns.len()));
            }
            let cells = row.iter().zip(&self.columns).zip(self.values.iter_mut().zip(&self.before));
            for (index, ((cell, column), (values, before))) in cells.enumerate() {
                let value = number(cell)
                    .and_then(|value| column.accept(kind, values.last().copied().or(*before), value))
                    .map_err(|refusal| refused(text, &row, index, *column, &refusal))?;
                values.push(value);
            }
        }
        Ok(())
    }

    /// Refuses a file that has ended after fewer rows than a record needs; `text` is its last part.
    pub(super) fn check_rows(&self, text: &TextFile) -> Result<(), FileError> {
        let rows = self.rows_before + self.rows();
        if rows >= LEAST_ROWS {
            return Ok(());
        }
        let end = text.text().trim_end().len();
        let message = format!("too few rows of numbers: {rows}");
        let last_line = text.text()[..end].rfind('\n').map_or(0, |newline| newline + 1);
        Err(text.complaint(last_line..end, message, "the file ends here", TOO_FEW_ROWS))
    }

    /// The values of a column; `None` where it is not there.
    pub(super) fn column(&self, column: Column) -> Option<&[f64]> {
        self.index(column).map(|index| self.values[index].as_slice())
    }

    /// Where a column stands in a row, from zero; `None` where it is not there.
    pub(super) fn index(&self, column: Column) -> Option<usize> {
        self.columns.iter().position(|c| *c == column)
    }

    /// An error at the time of row `row`, counted from one over the whole file, which `text` holds; its header is row zero.
    pub(super) fn wrong_time(&self, text: &TextFile, row: usize, message: String, help: String) -> FileError {
        self.wrong(Column::TimeS, text, row, message, help)
    }

    /// The same in another column.
    fn wrong(&self, column: Column, text: &TextFile, row: usize, message: String, help: String) -> FileError {
        let index = self.index(column);
        let mut reader = reader(text);
        let mut cells = StringRecord::new();
        // A part after the first has no header.
        for _ in usize::from(self.rows_before > 0)..=row - self.rows_before {
            next(&mut reader, &mut cells);
        }
        let span = cell_span(text, &cells, index.unwrap_or(0));
        text.complaint(span, message, "here", help)
    }

    /// How many rows there are in this part.
    pub(super) fn rows(&self) -> usize {
        self.values.first().map_or(0, Vec::len)
    }

    /// How many rows there are in the parts before.
    pub(super) fn rows_before(&self) -> usize {
        self.rows_before
    }

    /// Empties the columns, and remembers what stood last in them.
    fn forget(&mut self) {
        self.rows_before += self.rows();
        for (values, before) in self.values.iter_mut().zip(&mut self.before) {
            *before = values.last().copied().or(*before);
            values.clear();
        }
    }
}

/// The first line that is longer than a row can be.
fn long_line(text: &str) -> Option<Range<usize>> {
    let mut start = 0;
    let ends = memchr_iter(b'\n', text.as_bytes()).chain(std::iter::once(text.len()));
    ends.map(|end| std::mem::replace(&mut start, end + 1)..end).find(|line| line.len() > LONGEST_ROW)
}

/// A cell as a number.
fn number(cell: &str) -> Result<f64, Refusal> {
    let cell = cell.trim();
    cell.parse().map_err(|_| {
        if cell.is_empty() {
            Refusal::new("the cell is empty".to_owned(), "fill the cell, remove its row, or leave the column out")
        } else {
            Refusal::new(
                format!("`{}` is not a number", quoted(cell)),
                "write a plain number with a decimal point, without its unit",
            )
        }
    })
}

fn header(text: &TextFile, row: &StringRecord, needed: &[Column]) -> Result<Vec<Column>, FileError> {
    let complaint = |index, message, help| {
        let span = cell_span(text, row, index);
        Err(text.complaint(span, message, "here", help))
    };
    let mut columns = Vec::new();
    for (index, cell) in row.iter().enumerate() {
        let name = cell.trim();
        match Column::named(name) {
            Some(column) if columns.contains(&column) => {
                let message = format!("duplicate column `{name}`");
                return complaint(index, message, "remove one of the two".to_owned());
            }
            Some(column) => columns.push(column),
            None if name.is_empty() => {
                let message = format!("column {} has no name", index + 1);
                let help = "name it, or remove it with the commas that make it".to_owned();
                return complaint(index, message, help);
            }
            None => {
                let message = format!("column `{}` is not known", quoted(name));
                return complaint(index, message, unknown_column(name));
            }
        }
    }
    for column in needed {
        if !columns.contains(column) {
            let line = row_span(text, row);
            let message = format!("column `{}` is missing", column.name());
            let help = match (column, needed.contains(&Column::Command)) {
                (Column::Command, true) if needed.len() > 2 => {
                    "add it: every record has time_s, command and its response. Where the command was logged apart, \
                     `rotorlead identify --align LOG` merges the two"
                }
                (Column::TimeS, true) if needed.len() > 2 => {
                    "add it: every record has time_s, command and its response"
                }
                (Column::TimeS | Column::Command, true) => "add it: a command log has time_s and command",
                (Column::TimeS | Column::Command, false) => "add it: a response log has time_s and its response",
                _ => "add it, or correct `output` in experiment.toml: it names the response",
            };
            return Err(text.complaint(line, message, "the header", help));
        }
    }
    Ok(columns)
}

fn unknown_column(name: &str) -> String {
    if name.contains([';', '\t']) {
        return "separate the columns with commas, and write numbers with a decimal point".to_owned();
    }
    if name.parse::<f64>().is_ok() {
        return "begin the file with a header line: time_s,command,thrust_n".to_owned();
    }
    let known: Vec<_> = Column::ALL.iter().map(|column| column.name()).collect();
    let meant = did_you_mean(name, known.iter().copied()).map(|question| question + " ").unwrap_or_default();
    format!("{meant}rename or remove it; the columns are {}", known.join(", "))
}

fn uneven_row(text: &TextFile, row: &StringRecord, columns: usize) -> FileError {
    let line = row_span(text, row);
    let cells = row.len();
    let message = format!("line {}: {cells} cells, but the header has {columns}", text.line(line.start));
    let help = "give every row one cell per column; decimals are written with a point";
    text.complaint(line, message, "this row", help)
}

fn refused(text: &TextFile, row: &StringRecord, index: usize, column: Column, refusal: &Refusal) -> FileError {
    let span = cell_span(text, row, index);
    let (line, name) = (text.line(span.start), column.name());
    let message = format!("line {line}, column `{name}`: {}", refusal.message);
    text.complaint(span, message, "here", refusal.help)
}
