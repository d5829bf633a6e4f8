//! A log as rows of text cells that know their line, and the strict reading of numbers from it.
//!
//! The cells are not kept: a log may be larger than the memory that its cells would take. Each question about a column goes
//! through the text once.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use csv::ByteRecord;
use memchr::memchr_iter;

use super::error::{ImportError, Place};
use super::quantity::Unit;

/// A table in memory: trimmed header names, and the text of its rows.
pub(super) struct Table<'a> {
    pub(super) file: PathBuf,
    pub(super) header: Vec<String>,
    /// What a comma in a number is.
    pub(super) comma: Comma,
    text: Cow<'a, str>,
    separator: u8,
    /// Lines of the file before `text`.
    lines_before: u64,
    /// How many numbers each column has, where the log is a binary one; empty where rows are lines of it.
    counts: Vec<usize>,
}

/// What a comma in a number is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Comma {
    /// Nothing that belongs in a number.
    Wrong,
    /// The decimal mark.
    Decimal,
    /// A separator of thousands.
    Thousands,
}

/// How the cells of a column become numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum CellFormat {
    /// Decimal numbers.
    Decimal,
    /// Readings of a clock, in seconds since midnight.
    Clock,
}

/// One row.
pub(super) struct Row<'r> {
    /// Where it begins in the file.
    pub(super) line: Place,
    cells: &'r ByteRecord,
}

impl Row<'_> {
    /// The text at `column`; empty where the row ends before it.
    pub(super) fn text(&self, column: usize) -> &str {
        // Cells of a text are text.
        std::str::from_utf8(self.bytes(column)).unwrap_or("")
    }

    fn bytes(&self, column: usize) -> &[u8] {
        self.cells.get(column).unwrap_or(b"").trim_ascii()
    }
}

/// What a cell is as a number.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Cell {
    Number(f64),
    /// Nothing, or a word for it.
    Blank,
    /// Text that is no number.
    Text,
}

/// What programs write where they have no number, in small letters, signs apart.
const BLANKS: [&str; 16] = [
    "",
    "nan",
    "inf",
    "infinity",
    "na",
    "n/a",
    "#n/a",
    "#value!",
    "#div/0!",
    "null",
    "none",
    "-nan(ind)",
    "nan(ind)",
    "1.#qnan",
    "1.#ind",
    "1.#inf",
];

impl Cell {
    /// `unit` is what stands behind each number of the column.
    fn parse(text: &[u8], comma: Comma, unit: &str) -> Self {
        if let Ok(value) = fast_float2::parse::<f64, _>(text)
            && value.is_finite()
        {
            return Self::Number(value);
        }
        let text = String::from_utf8_lossy(text).to_lowercase();
        if BLANKS.contains(&text.trim_start_matches(['-', '+'])) {
            return Self::Blank;
        }
        let text = match without_unit(&text) {
            (number, "") => number.to_owned(),
            (number, found) if found == unit => number.to_owned(),
            _ => return Self::Text,
        };
        if !unit.is_empty()
            && let Ok(value) = text.parse::<f64>()
            && value.is_finite()
        {
            return Self::Number(value);
        }
        let text = match comma {
            Comma::Wrong => return Self::Text,
            Comma::Decimal => text.replacen(',', ".", 1),
            Comma::Thousands if Grouping::parse(&text).is_some_and(|found| found != Grouping::Not) => {
                text.replace(',', "")
            }
            Comma::Thousands => return Self::Text,
        };
        text.parse().ok().filter(|value: &f64| value.is_finite()).map_or(Self::Text, Self::Number)
    }
}

/// A number's text, and the unit that stands behind it, empty where there is none: `30%`, `0.005 sec`.
pub(super) fn without_unit(text: &str) -> (&str, &str) {
    let end = text.rfind(|c: char| c.is_ascii_digit() || c == '.').map_or(0, |last| last + 1);
    let (number, unit) = (&text[..end], text[end..].trim());
    if !number.is_empty() && Unit::is_any(unit) { (number, unit) } else { (text, "") }
}

/// What the commas of a number may be, as far as it says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Grouping {
    /// Separators of thousands: `1,234,567` or `1,234.5`.
    Sure,
    /// Either: `1,234`.
    Possible,
    /// A decimal mark: `1,5` or `0,250`.
    Not,
}

impl Grouping {
    /// `None` of what has no comma, or is no number whatever its commas are.
    fn parse(text: &str) -> Option<Self> {
        let number = text.trim_start_matches(['-', '+']);
        let (whole, fraction) = number.split_once('.').map_or((number, None), |(whole, rest)| (whole, Some(rest)));
        let is_digits = |text: &str| text.bytes().all(|byte| byte.is_ascii_digit());
        let (first, groups) = whole.split_once(',')?;
        let is_grouped = matches!(first.len(), 1..=3)
            && is_digits(first)
            && !first.starts_with('0')
            && groups.split(',').all(|group| group.len() == 3 && is_digits(group));
        match (is_grouped, fraction) {
            (true, Some(fraction)) => is_digits(fraction).then_some(Self::Sure),
            (true, None) => Some(if groups.contains(',') { Self::Sure } else { Self::Possible }),
            (false, None) => whole.replacen(',', ".", 1).parse::<f64>().is_ok().then_some(Self::Not),
            (false, Some(_)) => None,
        }
    }
}

impl<'a> Table<'a> {
    /// The table whose names are `header` and whose rows are `text`, which begins behind `lines_before` lines of `file`. Rows may be
    /// shorter or longer than the header.
    pub(super) fn new(file: &Path, header: Vec<String>, text: Cow<'a, str>, separator: u8, lines_before: u64) -> Self {
        Self { file: file.into(), header, comma: Comma::Wrong, text, separator, lines_before, counts: Vec::new() }
    }

    /// The same of a binary log, whose rows are samples: `counts` in each column, in `text` with commas.
    pub(super) fn from_samples(file: &Path, header: Vec<String>, text: Cow<'a, str>, counts: Vec<usize>) -> Self {
        Self { counts, ..Self::new(file, header, text, b',', 0) }
    }

    /// Refuses columns that have more numbers than others, of which some are missing who knows where.
    pub(super) fn check_lengths(&self, columns: &[usize]) -> Result<(), ImportError> {
        let count = |column: &usize| self.counts.get(*column);
        let Some(first) = columns.first() else { return Ok(()) };
        let differs = columns.iter().find(|column| count(column) != count(first));
        let Some((column, (found, needed))) =
            differs.and_then(|column| Some((column, count(column).zip(count(first))?)))
        else {
            return Ok(());
        };
        let problem = format!("{found} numbers, but `{}` has {needed}", self.header[*first]);
        Err(ImportError::vector(&self.file, &self.header[*column], problem))
    }

    /// What stands between two cells.
    pub(super) fn separator(&self) -> u8 {
        self.separator
    }

    /// Whether a cell is a number, or a word for none, whatever its commas are. `unit` is what stands behind each number of its column.
    pub(super) fn is_numeric(text: &str, unit: &str) -> bool {
        let is_number = |comma| Cell::parse(text.as_bytes(), comma, unit) != Cell::Text;
        [Comma::Wrong, Comma::Decimal, Comma::Thousands].into_iter().any(is_number)
    }

    /// How many cells a row has.
    pub(super) fn cells(row: &Row<'_>) -> usize {
        row.cells.len()
    }

    /// The place of the column of that name.
    pub(super) fn find(&self, name: &str) -> Option<usize> {
        self.header.iter().position(|column| column == name)
    }

    /// Shows each row that has a value, but no line that begins with `#`, to `see`; in the order of the file.
    pub(super) fn each<E>(&self, mut see: impl FnMut(&Row<'_>) -> Result<(), E>) -> Result<(), E> {
        let mut reader = csv::ReaderBuilder::new()
            .delimiter(self.separator)
            .has_headers(false)
            .comment(Some(b'#'))
            .flexible(true)
            .from_reader(self.text.as_bytes());
        let mut cells = ByteRecord::new();
        // Bytes in memory cannot fail to be read, and rows may have any length.
        while reader.read_byte_record(&mut cells).unwrap_or(false) {
            if cells.iter().any(|cell| !cell.trim_ascii().is_empty()) {
                let number = self.lines_before + cells.position().map_or(0, csv::Position::line);
                see(&Row { line: self.place(number), cells: &cells })?;
            }
        }
        Ok(())
    }

    /// Whether rows are samples of a binary log.
    pub(super) fn has_samples(&self) -> bool {
        !self.counts.is_empty()
    }

    fn place(&self, number: u64) -> Place {
        if self.has_samples() { Place::Sample(number) } else { Place::Line(number) }
    }

    /// The first thing that `find` finds in a row.
    pub(super) fn first<T>(&self, mut find: impl FnMut(&Row<'_>) -> Option<T>) -> Option<T> {
        self.each(|row| find(row).map_or(Ok(()), Err)).err()
    }

    /// Lines of remarks among the rows.
    pub(super) fn remarks(&self) -> usize {
        let is_remark = |at: &usize| self.text.as_bytes().get(at + 1) == Some(&b'#');
        memchr_iter(b'\n', self.text.as_bytes()).filter(is_remark).count() + usize::from(self.text.starts_with('#'))
    }

    /// Row `index`, as `see` sees it.
    pub(super) fn at<T>(&self, index: usize, see: impl Fn(&Row<'_>) -> T) -> Option<T> {
        let mut before = 0;
        self.first(|row| {
            before += 1;
            (before > index).then(|| see(row))
        })
    }

    /// Where row `index` is.
    pub(super) fn line(&self, index: usize) -> Place {
        self.at(index, |row| row.line).unwrap_or(self.place(0))
    }

    /// The unit behind the first number of a column, in small letters; empty where there is none. All others need the same.
    pub(super) fn unit_behind_numbers(&self, column: usize) -> String {
        let unit = |text: &str| (!text.is_empty()).then(|| without_unit(text).1.to_lowercase());
        self.first(|row| unit(row.text(column))).unwrap_or_default()
    }

    /// The numbers of each of `columns`, row by row; NaN where a cell is blank.
    pub(super) fn numbers(&self, columns: &[(usize, CellFormat)]) -> Result<Vec<Vec<f64>>, ImportError> {
        let lines = memchr_iter(b'\n', self.text.as_bytes()).count() + 1;
        let mut numbers = vec![Vec::new(); columns.len()];
        for values in &mut numbers {
            values.reserve_exact(lines);
        }
        let units: Vec<String> = columns.iter().map(|&(column, _)| self.unit_behind_numbers(column)).collect();
        self.each(|row| {
            for ((values, &(column, reading)), unit) in numbers.iter_mut().zip(columns).zip(&units) {
                let cell = match reading {
                    CellFormat::Decimal => Cell::parse(row.bytes(column), self.comma, unit),
                    CellFormat::Clock => match seconds_since_midnight(row.text(column)) {
                        Some(seconds) => Cell::Number(seconds),
                        None if row.text(column).is_empty() => Cell::Blank,
                        None => Cell::Text,
                    },
                };
                values.push(match cell {
                    Cell::Number(value) => value,
                    Cell::Blank => f64::NAN,
                    Cell::Text => return Err(self.text_for_a_number(row, column)),
                });
            }
            Ok(())
        })?;
        Ok(numbers)
    }

    fn text_for_a_number(&self, row: &Row<'_>, column: usize) -> ImportError {
        let (line, text, name) = (row.line, row.text(column), &self.header[column]);
        if text == name {
            let remedy = "two logs are in one file: cut it there and import the parts one by one";
            return ImportError::value(&self.file, line.to_string(), "the header stands here once more", remedy);
        }
        let remedy = "correct the value, or delete the row if it is a remark or a damaged line";
        ImportError::cell(&self.file, line, name, format!("`{text}` is not a finite number"), remedy)
    }

    /// The error of a blank in `column` in row `index`.
    pub(super) fn blank(&self, index: usize, column: usize) -> ImportError {
        let (line, text) = (self.line(index), self.at(index, |row| row.text(column).to_owned()).unwrap_or_default());
        let found = if text.is_empty() { String::from("empty") } else { format!("`{text}`") };
        let problem = format!("{found}, though rows before and after have a value");
        let remedy = "delete the row, or cut the log there and import the parts one by one";
        ImportError::cell(&self.file, line, &self.header[column], problem, remedy)
    }

    /// Finds out what commas in the numbers of `columns` are, and says it.
    pub(super) fn infer_comma(&mut self, columns: &[usize]) -> Result<Option<&'static str>, ImportError> {
        // Where commas are between the cells, one in a number is in quotes.
        let mark = if self.separator == b',' { b'"' } else { b',' };
        if memchr::memchr(mark, self.text.as_bytes()).is_none() {
            return Ok(None);
        }
        let (mut thousands, mut decimal, mut points, mut either) = (false, false, false, None);
        let seen: Result<(), ImportError> = self.each(|row| {
            for &column in columns {
                let (text, _) = without_unit(row.text(column));
                match Grouping::parse(text) {
                    Some(Grouping::Sure) => thousands = true,
                    Some(Grouping::Not) => decimal = true,
                    Some(Grouping::Possible) => {
                        either.get_or_insert_with(|| (row.line, column, text.to_owned()));
                    }
                    None => points |= text.contains('.'),
                }
            }
            Ok(())
        });
        seen?;
        let is_any = thousands || decimal || either.is_some();
        self.comma = match (decimal, thousands || points, either) {
            (true, false, _) => Comma::Decimal,
            (false, true, _) if is_any => Comma::Thousands,
            (false, false, Some((line, column, text))) => {
                let problem = format!("`{text}` may be a number of thousands or have a decimal comma");
                let remedy = "export the log with decimal points and without separators of thousands";
                return Err(ImportError::cell(&self.file, line, &self.header[column], problem, remedy));
            }
            _ => Comma::Wrong,
        };
        Ok(match self.comma {
            Comma::Wrong => None,
            Comma::Decimal => Some("a comma in a number is its decimal mark: there is no point in any"),
            Comma::Thousands => Some("a comma in a number separates its thousands: the decimal mark is a point"),
        })
    }
}

/// Of `13:07:59.250`, with or without a date in front of it; the fraction may have a comma.
pub(super) fn seconds_since_midnight(text: &str) -> Option<f64> {
    let is_of_date = |c: char| c.is_ascii_digit() || "-/.".contains(c);
    let time = match text.rsplit_once([' ', 'T']) {
        Some((date, time)) if date.chars().all(is_of_date) => time,
        Some(_) => return None,
        None => text,
    };
    // Its zone is that of all rows.
    let time = time.find(['Z', 'z', '+', '-']).map_or(time, |zone| &time[..zone]);
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
            ("2026-11-22T01:00:00.5Z", 3600.5),
            ("2026-11-22T01:00:00+00:00", 3600.0),
            ("2026-11-22 01:00:00.25-05:00", 3600.25),
            ("01:00:00+0200", 3600.0),
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
    #[test]
    fn commas_are_told_apart_where_a_number_says_it() {
        for (text, expected) in [
            ("1,234,567", Some(Grouping::Sure)),
            ("-1,234.5", Some(Grouping::Sure)),
            ("1,200", Some(Grouping::Possible)),
            ("1,5", Some(Grouping::Not)),
            ("0,250", Some(Grouping::Not)),
            ("1234,567", Some(Grouping::Not)),
            ("1.5", None),
            ("1200", None),
            ("1,2,3", None),
            ("1.234,5", None),
            ("a,b", None),
        ] {
            assert_eq!(Grouping::parse(text), expected, "{text}");
        }
        assert_eq!(Cell::parse(b"1,234,567", Comma::Thousands, ""), Cell::Number(1_234_567.0));
        assert_eq!(Cell::parse(b"1,5", Comma::Decimal, ""), Cell::Number(1.5));
        assert_eq!(Cell::parse(b"1,5", Comma::Thousands, ""), Cell::Text);
        assert_eq!(Cell::parse(b"1,5", Comma::Wrong, ""), Cell::Text);
    }

    #[test]
    fn a_unit_behind_a_number_is_that_of_its_column() {
        for (text, unit, expected) in [
            ("30%", "%", Cell::Number(30.0)),
            ("0.005 sec", "sec", Cell::Number(0.005)),
            ("1200RPM", "rpm", Cell::Number(1200.0)),
            ("-1.5e1 N", "n", Cell::Number(-15.0)),
            ("30", "%", Cell::Number(30.0)),
            ("500 ms", "s", Cell::Text),
            ("30%", "", Cell::Text),
            ("3 apples", "", Cell::Text),
        ] {
            assert_eq!(Cell::parse(text.as_bytes(), Comma::Wrong, unit), expected, "{text}");
        }
        assert_eq!(Cell::parse(b"1,5 V", Comma::Decimal, "v"), Cell::Number(1.5));
    }

    #[test]
    fn words_for_no_number_are_blanks() {
        for text in ["", "NaN", "-nan", "inf", "-Infinity", "N/A", "#N/A", "null", "-1.#IND", "1e999"] {
            let expected = if text == "1e999" { Cell::Text } else { Cell::Blank };
            assert_eq!(Cell::parse(text.as_bytes(), Comma::Wrong, ""), expected, "{text}");
        }
    }
}
