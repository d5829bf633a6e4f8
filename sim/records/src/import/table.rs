//! A log as text cells that know their line, and the strict reading of numbers from it.

use std::path::{Path, PathBuf};

use csv::StringRecord;

use super::ImportError;

/// A CSV file in memory: trimmed header names, and rows with the line they start on.
pub(super) struct Table {
    pub(super) file: PathBuf,
    pub(super) header: Vec<String>,
    pub(super) rows: Vec<Row>,
    /// Whether a comma in a number is its decimal mark; otherwise it makes it none.
    pub(super) decimal_comma: bool,
}

/// One line of the log.
pub(super) struct Row {
    pub(super) line: u64,
    cells: StringRecord,
}

/// A column of a [`Table`], found by name.
#[derive(Clone, Copy)]
pub(super) struct Column<'a> {
    table: &'a Table,
    index: usize,
}

impl Table {
    /// Reads all of `bytes`, which are `file`'s. A byte-order mark is skipped, rows may be shorter or
    /// longer than the header (both formats end lines with stray commas), lines without any value are
    /// left out.
    pub(super) fn parse(file: &Path, bytes: &[u8]) -> Result<Self, ImportError> {
        let mut reader = reader(bytes);
        let header = header(file, &mut reader)?;
        Ok(Self { file: file.into(), header, rows: rows(file, &mut reader, 0)?, decimal_comma: false })
    }

    /// The header that [`Self::parse`] reads.
    pub(super) fn parse_header(file: &Path, bytes: &[u8]) -> Result<Vec<String>, ImportError> {
        header(file, &mut reader(bytes))
    }

    /// Reads `bytes`, which are `file`'s from the line after `lines_before` on and have no header: that is `header`. Lines
    /// that begin with `#` are left out, like those without any value.
    pub(super) fn parse_rows(
        file: &Path,
        header: Vec<String>,
        bytes: &[u8],
        separator: u8,
        lines_before: u64,
    ) -> Result<Self, ImportError> {
        let mut reader = csv::ReaderBuilder::new()
            .delimiter(separator)
            .has_headers(false)
            .comment(Some(b'#'))
            .flexible(true)
            .trim(csv::Trim::All)
            .from_reader(bytes);
        let rows = rows(file, &mut reader, lines_before)?;
        Ok(Self { file: file.into(), header, rows, decimal_comma: false })
    }

    /// The column of that name, if there is one.
    pub(super) fn find(&self, name: &str) -> Option<Column<'_>> {
        let index = self.header.iter().position(|h| h == name)?;
        Some(Column { table: self, index })
    }

    /// The column of that name, or an error that names it.
    pub(super) fn need(&self, name: &str) -> Result<Column<'_>, ImportError> {
        self.find(name).ok_or_else(|| ImportError::MissingColumn { file: self.file.clone(), column: name.into() })
    }
}

/// A reader of all of a log.
fn reader(bytes: &[u8]) -> csv::Reader<&[u8]> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    csv::ReaderBuilder::new().flexible(true).trim(csv::Trim::All).from_reader(bytes)
}

fn header(file: &Path, reader: &mut csv::Reader<&[u8]>) -> Result<Vec<String>, ImportError> {
    let header = reader.headers().map_err(|source| ImportError::Csv { file: file.into(), source })?;
    Ok(header.iter().map(String::from).collect())
}

/// The rows that have a value, of a reader that begins after `lines_before`.
fn rows(file: &Path, reader: &mut csv::Reader<&[u8]>, lines_before: u64) -> Result<Vec<Row>, ImportError> {
    let mut rows = Vec::new();
    for cells in reader.records() {
        let cells = cells.map_err(|source| ImportError::Csv { file: file.into(), source })?;
        if cells.iter().any(|cell| !cell.is_empty()) {
            let line = lines_before + cells.position().map_or(0, csv::Position::line);
            rows.push(Row { line, cells });
        }
    }
    Ok(rows)
}

impl<'a> Column<'a> {
    /// The column at `index` of the header.
    pub(super) fn at(table: &'a Table, index: usize) -> Self {
        Self { table, index }
    }

    /// Its place in the header.
    pub(super) fn index(self) -> usize {
        self.index
    }

    pub(super) fn name(self) -> &'a str {
        &self.table.header[self.index]
    }

    /// The text in `row`; empty where the row ends before this column.
    pub(super) fn text(self, row: usize) -> &'a str {
        self.table.rows[row].cells.get(self.index).unwrap_or("")
    }

    /// Line of `row` in the file, the header being 1.
    pub(super) fn line(self, row: usize) -> u64 {
        self.table.rows[row].line
    }

    /// The number in `row`, `None` where the cell is empty.
    pub(super) fn number(self, row: usize) -> Result<Option<f64>, ImportError> {
        let text = self.text(row);
        if text.is_empty() {
            return Ok(None);
        }
        let parsed = match text.split_once(',') {
            Some((whole, fraction)) if self.table.decimal_comma => format!("{whole}.{fraction}").parse::<f64>(),
            _ => text.parse::<f64>(),
        };
        match parsed {
            Ok(value) if value.is_finite() => Ok(Some(value)),
            _ => Err(ImportError::NotANumber {
                file: self.table.file.clone(),
                line: self.line(row),
                column: self.name().into(),
                text: text.into(),
            }),
        }
    }

    /// Whether its first filled cell is a reading of a clock.
    pub(super) fn shows_a_clock(self) -> bool {
        let mut filled = (0..self.table.rows.len()).map(|row| self.text(row)).filter(|text| !text.is_empty());
        filled.next().is_some_and(|text| seconds_since_midnight(text).is_some())
    }

    /// The reading of the clock in `row`, in seconds since midnight.
    pub(super) fn clock_s(self, row: usize) -> Result<f64, ImportError> {
        let text = self.text(row);
        seconds_since_midnight(text).ok_or_else(|| {
            let (file, line, column) = (self.table.file.clone(), self.line(row), self.name().into());
            if text.is_empty() {
                ImportError::Blank { file, line, column }
            } else {
                ImportError::NotANumber { file, line, column, text: text.into() }
            }
        })
    }

    /// The number in `row`; an empty cell is an error.
    pub(super) fn required(self, row: usize) -> Result<f64, ImportError> {
        self.number(row)?.ok_or_else(|| ImportError::Blank {
            file: self.table.file.clone(),
            line: self.line(row),
            column: self.name().into(),
        })
    }

    /// The numbers of `rows`, or `None` when not every one of them is filled; and how many are.
    pub(super) fn where_filled(self, rows: &[usize]) -> Result<(Option<Vec<f64>>, usize), ImportError> {
        let cells = rows.iter().map(|&row| self.number(row)).collect::<Result<Vec<_>, _>>()?;
        let filled = cells.iter().flatten().count();
        Ok((cells.into_iter().collect(), filled))
    }
}

/// Of `13:07:59.250`, with or without a date in front of it; the fraction may have a comma.
fn seconds_since_midnight(text: &str) -> Option<f64> {
    let is_of_date = |c: char| c.is_ascii_digit() || "-/.".contains(c);
    let time = match text.rsplit_once([' ', 'T']) {
        Some((date, time)) if date.chars().all(is_of_date) => time,
        Some(_) => return None,
        None => text,
    };
    let mut parts = time.split(':');
    let (hours, minutes, seconds) = (parts.next()?, parts.next()?, parts.next()?);
    let whole = |text: &str, most: u32| {
        let is_short = (1..=2).contains(&text.len()) && text.bytes().all(|byte| byte.is_ascii_digit());
        text.parse::<u32>().ok().filter(|value| is_short && *value <= most)
    };
    let (hours, minutes) = (whole(hours, 23)?, whole(minutes, 59)?);
    let is_decimal = seconds.starts_with(|c: char| c.is_ascii_digit());
    let seconds: f64 = seconds.replacen(',', ".", 1).parse().ok().filter(|s| is_decimal && (0.0..61.0).contains(s))?;
    parts.next().is_none().then(|| f64::from(3600 * hours + 60 * minutes) + seconds)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clock_is_read_with_and_without_a_date() {
        for (text, seconds) in [
            ("00:00:00", 0.0),
            ("13:07:59.250", 47_279.25),
            ("13:07:59,250", 47_279.25),
            ("9:05:01.5", 32_701.5),
            ("2026-11-22 23:59:59.999", 86_399.999),
            ("2026-11-22T01:00:00", 3600.0),
            ("22.11.2026 01:00:00", 3600.0),
        ] {
            let found = seconds_since_midnight(text).unwrap();
            assert!((found - seconds).abs() < 1e-9, "{text}: {found}");
        }
        for text in
            ["", "12.5", "12:30", "24:00:00", "12:60:00", "12:30:61", "1:2:3:4", "a 12:30:00", "12:30:-1", "12:+3:00"]
        {
            assert_eq!(seconds_since_midnight(text), None, "{text}");
        }
    }
}
