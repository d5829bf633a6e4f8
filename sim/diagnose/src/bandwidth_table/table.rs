//! A table of measured bandwidths as a CSV file.

use std::ops::Range;
use std::path::Path;

use csv::StringRecord;
use rotorlead_plant::{Model, ModelError};
use rotorlead_records::files::csv_rows::{cell_span, next, quoted, reader, row_span};
use rotorlead_records::files::{FileError, TextFile, did_you_mean};

/// The columns, in the order of [`HEADER`].
const COLUMNS: [&str; 3] = ["u_nom", "uncompensated_rad_s", "compensated_rad_s"];
/// A header line with all of them.
const HEADER: &str = "u_nom,uncompensated_rad_s,compensated_rad_s";
/// Fewer rows show no course over the nominal command.
const LEAST_ROWS: usize = 2;

/// A column of measured bandwidths.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Column {
    /// Of the actuator alone.
    Uncompensated,
    /// With the compensator in front.
    Compensated,
}

impl Column {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Uncompensated, Self::Compensated];

    /// Its name in the header.
    #[must_use]
    pub fn name(self) -> &'static str {
        COLUMNS[1 + self as usize]
    }

    /// In a sentence.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Uncompensated => "uncompensated",
            Self::Compensated => "compensated",
        }
    }

    /// The other one.
    #[must_use]
    pub fn other(self) -> Self {
        match self {
            Self::Uncompensated => Self::Compensated,
            Self::Compensated => Self::Uncompensated,
        }
    }
}

/// The bandwidths at one nominal command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BandwidthRow {
    /// Command around which they were measured, 0..1.
    pub nominal: f64,
    /// Measured without and with the compensator, rad/s, above zero; in the order of [`Column::ALL`].
    pub measured_rad_s: [Option<f64>; 2],
}

impl BandwidthRow {
    /// One of the two.
    #[must_use]
    pub fn measured(&self, column: Column) -> Option<f64> {
        self.measured_rad_s[column as usize]
    }
}

/// Bandwidths at several nominal commands, by increasing command.
#[derive(Clone, Debug, PartialEq)]
pub struct BandwidthTable {
    /// The rows, two or more, at least two of them with a value in the column that is fitted.
    pub rows: Vec<BandwidthRow>,
}

impl BandwidthTable {
    /// Reads a CSV file with the columns `u_nom`, `uncompensated_rad_s` and `compensated_rad_s`, in any order. A bandwidth
    /// may be left empty.
    ///
    /// # Errors
    /// When the file cannot be read; when a column is missing, unknown or there twice; for a cell that is no number, a
    /// bandwidth that is not above zero, a row without any, a nominal command that is there twice or outside of `model`'s
    /// points; and for fewer than two values in the column `fitted`. The error shows the place.
    pub fn read(path: &Path, model: &Model, fitted: Column) -> Result<Self, FileError> {
        let text = TextFile::read(path)?;
        let mut reader = reader(&text);
        let mut cells = StringRecord::new();
        next(&mut reader, &mut cells);
        let places = header(&text, &cells)?;
        let mut rows: Vec<BandwidthRow> = Vec::new();
        while next(&mut reader, &mut cells) {
            let row = row(&text, &cells, &places)?;
            let nominal = || cell_span(&text, &cells, places[0]);
            if let Err(error @ ModelError::OutsideRange { .. }) = model.at(row.nominal) {
                let help = "remove the row, or identify the motor at this nominal command too";
                return Err(complain(&text, nominal(), error.to_string(), help));
            }
            if rows.iter().any(|other| other.nominal == row.nominal) {
                let message = format!("duplicate u_nom {}", row.nominal);
                return Err(complain(&text, nominal(), message, "keep one row per nominal command"));
            }
            rows.push(row);
        }
        let end = text.text().trim_end().len();
        let last = text.text()[..end].rfind('\n').map_or(0, |newline| newline + 1)..end;
        if rows.len() < LEAST_ROWS {
            let message = format!("too few rows of numbers: {}", rows.len());
            let help = "a diagnosis from bandwidths needs two nominal commands or more; \
                        with one, record a multisine there and give its folder instead";
            return Err(complain(&text, last, message, help));
        }
        let values = rows.iter().filter(|row| row.measured(fitted).is_some()).count();
        if values < LEAST_ROWS {
            let message = format!("column `{}` is to be fitted, and has too few values: {values}", fitted.name());
            let help = format!("fill it, or fit the other one: --fit {}", fitted.other().word());
            return Err(complain(&text, last, message, help));
        }
        rows.sort_by(|a, b| a.nominal.total_cmp(&b.nominal));
        Ok(Self { rows })
    }
}

/// Where the columns stand.
fn header(text: &TextFile, cells: &StringRecord) -> Result<[usize; 3], FileError> {
    let mut places = [None; 3];
    for (index, cell) in cells.iter().enumerate() {
        let name = cell.trim();
        let span = || cell_span(text, cells, index);
        let Some(column) = COLUMNS.iter().position(|known| *known == name) else {
            let message = format!("column `{}` is not known", quoted(name));
            let help = if name.parse::<f64>().is_ok() {
                format!("begin the file with a header line: {HEADER}")
            } else {
                let meant = did_you_mean(name, COLUMNS.into_iter()).map(|question| question + " ");
                format!("{}rename or remove it; the columns are {}", meant.unwrap_or_default(), COLUMNS.join(", "))
            };
            return Err(complain(text, span(), message, help));
        };
        if places[column].replace(index).is_some() {
            return Err(complain(text, span(), format!("duplicate column `{name}`"), "remove one of the two"));
        }
    }
    let find = |column: usize| {
        places[column].ok_or_else(|| {
            let message = format!("column `{}` is missing", COLUMNS[column]);
            let help = format!("add it; what was not measured is left empty. The header is {HEADER}");
            complain(text, row_span(text, cells), message, help)
        })
    };
    Ok([find(0)?, find(1)?, find(2)?])
}

fn row(text: &TextFile, cells: &StringRecord, places: &[usize; 3]) -> Result<BandwidthRow, FileError> {
    if cells.len() != places.len() {
        let message = format!("{} cells, but the header has {}", cells.len(), places.len());
        return Err(complain(text, row_span(text, cells), message, "give every row one cell per column"));
    }
    let cell = |column: usize| {
        let index = places[column];
        let cell = cells[index].trim();
        let wrong = |rule: &str, help: &str| {
            let message = format!("column `{}`: `{}` {rule}", COLUMNS[column], quoted(cell));
            complain(text, cell_span(text, cells, index), message, help)
        };
        match cell.parse::<f64>() {
            _ if cell.is_empty() => Ok(None),
            Err(_) => Err(wrong("is not a number", "write a plain number with a decimal point, without its unit")),
            Ok(value) if column == 0 && !(0.0..=1.0).contains(&value) => {
                Err(wrong("is not a command from 0 to 1", "write the nominal command as a part of full duty"))
            }
            Ok(value) if column > 0 && !(value > 0.0 && value.is_finite()) => {
                Err(wrong("is no bandwidth", "write a frequency above 0 in rad/s, or leave the cell empty"))
            }
            Ok(value) => Ok(Some(value)),
        }
    };
    let Some(nominal) = cell(0)? else {
        let span = cell_span(text, cells, places[0]);
        return Err(complain(text, span, "column `u_nom`: the cell is empty", "fill the cell, or remove its row"));
    };
    let measured_rad_s = [cell(1)?, cell(2)?];
    if measured_rad_s == [None; 2] {
        let message = format!("no bandwidth at a u_nom of {nominal}");
        return Err(complain(text, row_span(text, cells), message, "fill one of the two, or remove the row"));
    }
    Ok(BandwidthRow { nominal, measured_rad_s })
}

/// An error with the line's number, as for records.
fn complain(text: &TextFile, span: Range<usize>, message: impl AsRef<str>, help: impl Into<String>) -> FileError {
    let line = text.line(span.start);
    text.complaint(span, format!("line {line}: {}", message.as_ref()), "here", help)
}
