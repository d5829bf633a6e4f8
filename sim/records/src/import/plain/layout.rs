//! Where the numbers of a plain table begin, what separates them, and what stands above them.

use std::borrow::Cow;
use std::path::Path;

use csv::StringRecord;

use crate::import::ImportError;
use crate::import::format::Dialect;
use crate::import::quantity::{Quantity, Unit};
use crate::import::table::{Table, without_unit};

/// Separators, the likeliest first: a comma may be a decimal mark, a semicolon may stand in a remark.
const SEPARATORS: [u8; 3] = [b'\t', b';', b','];
/// What a line of remarks begins with.
const REMARK: [&str; 3] = ["#", "%", "//"];
/// Numbers in a line from which on it is one of the table: a time and something that was measured then.
const LEAST_NUMBERS: usize = 2;

/// A plain table, with what its header says.
pub(in crate::import) struct PlainTable<'a> {
    pub(in crate::import) table: Table<'a>,
    /// Units from a line of their own below the names, column by column.
    pub(in crate::import) units: Vec<String>,
    /// What says what a column is where that is not its name, column by column; `None` where nothing does. Empty where the names do.
    pub(in crate::import) labels: Vec<Option<String>>,
    /// What the log has beside the columns.
    pub(in crate::import) beside: Vec<Beside>,
    /// What its format says of it.
    pub(in crate::import) dialect: &'static Dialect,
    /// The line of the names, from 1; `None` where there is none, and columns are called `#1`, `#2` and so on.
    pub(in crate::import) header_line: Option<usize>,
    /// What a reader of the record has to know.
    pub(in crate::import) notes: Vec<String>,
    /// How many poles the motor has, as stated.
    pub(in crate::import) motor_poles: Option<u32>,
}

/// What a log has that cannot be a column as it is.
pub(in crate::import) struct Beside {
    pub(in crate::import) name: String,
    /// What it is.
    pub(in crate::import) shown: String,
    /// What would make a column of it.
    pub(in crate::import) remedy: String,
    /// What it measures by its name.
    pub(in crate::import) quantity: Option<Quantity>,
}

impl<'a> PlainTable<'a> {
    /// The columns of that name; where there is none, those whose label it is, or the last part of whose name.
    pub(in crate::import) fn called(&self, name: &str) -> Vec<usize> {
        let columns = |is: &dyn Fn(usize, &str) -> bool| -> Vec<usize> {
            self.table.header.iter().enumerate().filter(|(at, header)| is(*at, header)).map(|(at, _)| at).collect()
        };
        let exact = columns(&|_, header| header == name);
        if !exact.is_empty() || self.labels.is_empty() {
            return exact;
        }
        columns(&|at, header| {
            self.label(at) == Some(name) || header.strip_suffix(name).is_some_and(|rest| rest.ends_with('.'))
        })
    }

    /// What says what a column is.
    pub(in crate::import) fn label(&self, column: usize) -> Option<&str> {
        self.labels.get(column).map_or_else(|| Some(self.table.header[column].as_str()), Option::as_deref)
    }

    /// Finds the table in `text`, which is `file`'s.
    pub(in crate::import) fn parse(file: &Path, text: &'a str) -> Result<Self, ImportError> {
        let separated = |text| Some((FirstRow::find(text, LEAST_NUMBERS)?, Cow::Borrowed(text)));
        let Some((first, text)) = separated(text).or_else(|| with_tabs_for_blanks(text)) else {
            let header = text.lines().find(|line| !line.trim().is_empty()).unwrap_or_default();
            let header: String = header.trim().chars().take(120).collect();
            let problem =
                format!(": no known log format, and no table: no line of it has two numbers. It begins with: {header}");
            return Err(ImportError::unknown(file, problem));
        };
        let is_by_blanks = matches!(text, Cow::Owned(_));
        let mut above: Vec<(usize, &str)> = text
            .lines()
            .take(first.line)
            .enumerate()
            .filter(|(_, line)| !line.trim().is_empty())
            .map(|(index, line)| (index + 1, line))
            .collect();
        let mut last_above = || {
            let (line, text) = *above.last()?;
            let cells = cells(without_remark(text), first.separator);
            // Where blanks separate, a name of two words would be two.
            let is_names = if is_by_blanks { cells.len() == first.cells } else { cells.len() >= first.cells };
            is_names.then(|| {
                above.pop();
                (line, cells)
            })
        };
        let mut named = last_above();
        let mut units = Vec::new();
        if let Some((_, below)) = &named
            && below.iter().filter(|cell| Unit::is_any(bare(cell))).count() >= LEAST_NUMBERS
            && let Some(above) = last_above()
        {
            units = below.iter().map(|cell| bare(cell).to_owned()).collect();
            named = Some(above);
        }
        let mut notes = Vec::new();
        if !above.is_empty() {
            let lines = if above.len() == 1 { "line" } else { "lines" };
            notes.push(format!("{} {lines} above the header left out", above.len()));
        }
        let (header_line, header) = match named {
            Some((line, names)) => (Some(line), names),
            None => {
                notes.push(String::from("there is no header: columns are called by their place, #1 and so on"));
                (None, (1..=first.cells).map(|place| format!("#{place}")).collect())
            }
        };
        let rows = match text {
            Cow::Borrowed(text) => Cow::Borrowed(&text[first.offset..]),
            Cow::Owned(mut text) => Cow::Owned(text.split_off(first.offset)),
        };
        let table = Table::new(file, header, rows, first.separator, first.line as u64);
        match table.remarks() {
            0 => {}
            1 => notes.push(String::from("1 line of remarks (`#`) among or behind the rows left out")),
            lines => notes.push(format!("{lines} lines of remarks (`#`) among or behind the rows left out")),
        }
        let (labels, beside) = (Vec::new(), Vec::new());
        Ok(Self { table, units, labels, beside, dialect: &Dialect::PLAIN, header_line, notes, motor_poles: None })
    }
}

/// The text with a tab for each run of blanks, where that makes a table of it: a line of nothing but numbers.
fn with_tabs_for_blanks(text: &str) -> Option<(FirstRow, Cow<'_, str>)> {
    let is_table = |line: &str| {
        let mut words = line.split_whitespace();
        line.split_whitespace().nth(LEAST_NUMBERS - 1).is_some() && words.all(|word| is_number(word, b'\t'))
    };
    if !text.lines().any(is_table) {
        return None;
    }
    let tabbed = |line: &str| {
        let names = without_remark(line);
        let mark = &line[..line.len() - names.len()];
        format!("{}{}\n", mark.trim_start(), names.split_whitespace().collect::<Vec<_>>().join("\t"))
    };
    let text: String = text.lines().map(tabbed).collect();
    // Words of a remark are columns too; a row is all numbers.
    FirstRow::find(&text, usize::MAX).map(|first| (first, Cow::Owned(text)))
}

/// The first line that is numbers.
struct FirstRow {
    separator: u8,
    /// Lines before it.
    line: usize,
    /// Bytes before it.
    offset: usize,
    /// Its cells, empty ones at the end apart.
    cells: usize,
}

impl FirstRow {
    /// A line with so many numbers, or with nothing else where these are fewer; two at least. Numbers with units count where a line has
    /// nothing else: above a table stands what the supply had.
    fn find(text: &str, least: usize) -> Option<Self> {
        let mut offset = 0;
        for (line, content) in text.split_inclusive('\n').enumerate() {
            for separator in SEPARATORS.into_iter().filter(|separator| content.as_bytes().contains(separator)) {
                let cells = cells(content, separator);
                let numbers = cells.iter().filter(|cell| is_number(cell, separator)).count();
                let are_all = || cells.iter().all(|cell| is_number(without_unit(cell).0, separator));
                let is_row = numbers >= LEAST_NUMBERS && numbers >= least.min(cells.len());
                if is_row || (cells.len() >= LEAST_NUMBERS && are_all()) {
                    return Some(Self { separator, line, offset, cells: cells.len() });
                }
            }
            offset += content.len();
        }
        None
    }
}

/// The cells of one line, empty ones at the end apart.
fn cells(line: &str, separator: u8) -> Vec<String> {
    let mut reader = csv::ReaderBuilder::new()
        .delimiter(separator)
        .has_headers(false)
        .flexible(true)
        .trim(csv::Trim::All)
        .from_reader(line.as_bytes());
    let mut record = StringRecord::new();
    // Of a line of text nothing can fail but its end.
    let is_read = reader.read_record(&mut record).unwrap_or(false);
    let mut cells: Vec<String> = if is_read { record.iter().map(str::to_owned).collect() } else { Vec::new() };
    let filled = cells.iter().rposition(|cell| !cell.is_empty()).map_or(0, |last| last + 1);
    cells.truncate(filled);
    cells
}

fn is_number(cell: &str, separator: u8) -> bool {
    let parsed = if separator == b',' { cell.parse() } else { cell.replacen(',', ".", 1).parse() };
    parsed.is_ok_and(f64::is_finite)
}

/// A line of names without the mark of a remark in front of it.
fn without_remark(line: &str) -> &str {
    // A separator in front stands behind a column without a name.
    let line = line.trim_start_matches(' ');
    REMARK.iter().find_map(|mark| line.strip_prefix(mark)).unwrap_or(line)
}

/// A unit without its brackets.
fn bare(cell: &str) -> &str {
    cell.trim().trim_start_matches(['(', '[']).trim_end_matches([')', ']']).trim()
}
