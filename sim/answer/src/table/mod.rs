//! Tables: what is shown, and the numbers behind it. One description for the terminal, for a report and for CSV.

mod text;
mod typed;

pub use typed::{CellValue, ColumnSpec, Unit, build_table, with_std};

use serde::{Deserialize, Deserializer, Serialize};
use serde_json::json;

use crate::escape;

/// A table with a heading for each column.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Table {
    /// File name without its end; unique in a report.
    pub name: String,
    /// What it lists, and what its entries mean.
    pub caption: String,
    /// The columns.
    pub columns: Vec<Column>,
    /// The rows, each with as many cells as there are columns.
    pub rows: Vec<Vec<Cell>>,
    /// Sentences below it.
    pub notes: Vec<String>,
    /// Who sees it.
    pub weight: Audience,
    /// The key of its rows for programs; `None` where they are none's.
    #[serde(skip_deserializing)]
    pub key: Option<&'static str>,
}

/// Who sees a table, beside the report, which shows all but those for programs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Audience {
    /// Whoever asks.
    #[default]
    Shown,
    /// Whoever asks for the detail.
    Detail,
    /// The same on a terminal; a report has it in another section.
    Terminal,
    /// Programs alone.
    Programs,
}

/// A column's heading.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Column {
    /// Its name in a CSV file, with the unit in it.
    #[serde(skip_deserializing)]
    pub name: &'static str,
    /// Its heading.
    pub heading: String,
    /// The unit; may be empty.
    pub unit: String,
    /// Whether a terminal leaves it to the report.
    pub is_detail: bool,
}

/// One cell.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cell {
    /// What is shown.
    pub text: String,
    /// What is behind it.
    pub value: Value,
}

/// What is behind a cell.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Value {
    /// Nothing but its words.
    Words,
    /// A number.
    Number(#[serde(deserialize_with = "number")] f64),
    /// A number and its standard error, as far as that is known.
    Estimate(#[serde(deserialize_with = "number")] f64, Option<f64>),
    /// No number, where others of the column have one.
    Unknown,
}

/// A number. JSON has null for what is not finite.
fn number<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    Ok(Option::deserialize(deserializer)?.unwrap_or(f64::NAN))
}

impl Column {
    /// A column.
    #[must_use]
    pub fn new(name: &'static str, heading: &str, unit: &str) -> Self {
        Self { name, heading: heading.to_owned(), unit: unit.to_owned(), is_detail: false }
    }

    /// The same, which a terminal leaves to the report.
    #[must_use]
    pub fn in_detail(self) -> Self {
        Self { is_detail: true, ..self }
    }

    /// Heading and unit, for where they stand beside each cell.
    #[must_use]
    pub fn full(&self) -> String {
        if self.unit.is_empty() { self.heading.clone() } else { format!("{}, {}", self.heading, self.unit) }
    }
}

impl Cell {
    /// Words.
    #[must_use]
    pub fn text(text: impl Into<String>) -> Self {
        Self { text: text.into(), value: Value::Words }
    }

    /// A number that is not known, with what is shown in its place.
    #[must_use]
    pub fn unknown(text: impl Into<String>) -> Self {
        Self { text: text.into(), value: Value::Unknown }
    }

    /// A number that is shown as `text`.
    #[must_use]
    pub fn shown(value: f64, text: String) -> Self {
        Self { text, value: Value::Number(value) }
    }

    /// A number with so many decimals.
    #[must_use]
    pub fn number(value: f64, decimals: usize) -> Self {
        let text = format!("{value:.decimals$}");
        // What rounds to zero has no sign.
        let is_zero = text.bytes().all(|byte| b"-0.".contains(&byte));
        Self::shown(value, if is_zero { text.trim_start_matches('-').to_owned() } else { text })
    }

    /// A number with so many decimals where there is one.
    #[must_use]
    pub fn optional(value: Option<f64>, decimals: usize) -> Self {
        value.map_or_else(|| Self::unknown("-"), |value| Self::number(value, decimals))
    }
}

impl Table {
    /// Whether a column holds numbers.
    #[must_use]
    pub fn is_number(&self, column: &usize) -> bool {
        self.rows.iter().any(|row| row.get(*column).is_some_and(|cell| cell.value != Value::Words))
    }

    /// The same, which a terminal shows to who asks for the detail.
    #[must_use]
    pub fn in_detail(self) -> Self {
        Self { weight: Audience::Detail, ..self }
    }

    /// Whether anything is known in a column of a table with rows.
    #[must_use]
    pub fn is_known(&self, column: &usize) -> bool {
        let is_unknown = |row: &Vec<Cell>| row.get(*column).is_some_and(|cell| cell.value == Value::Unknown);
        self.rows.is_empty() || !self.rows.iter().all(is_unknown)
    }

    /// Whether a column has standard errors.
    fn has_std(&self, column: usize) -> bool {
        self.rows.iter().any(|row| row.get(column).is_some_and(|cell| matches!(cell.value, Value::Estimate(..))))
    }

    /// The table as CSV: numbers in full, nothing where there is none; standard errors in columns of their own.
    #[must_use]
    pub fn csv(&self) -> String {
        let mut writer = csv::Writer::from_writer(Vec::new());
        let full = |number: Option<f64>| number.filter(|number| number.is_finite()).map(|number| number.to_string());
        let columns: Vec<(bool, bool)> =
            (0..self.columns.len()).map(|column| (self.is_number(&column), self.has_std(column))).collect();
        let header = self.columns.iter().zip(&columns).flat_map(|(column, (_, has_std))| {
            std::iter::once(column.name.to_owned()).chain(has_std.then(|| format!("{}_std", column.name)))
        });
        let cells = |(cell, (is_number, has_std)): (&Cell, &(bool, bool))| {
            let (value, std) = match cell.value {
                Value::Number(value) => (full(Some(value)), None),
                Value::Estimate(value, std) => (full(Some(value)), full(std)),
                Value::Words if !is_number => (Some(escape::cell(&cell.text).into_owned()), None),
                Value::Words | Value::Unknown => (None, None),
            };
            std::iter::once(value.unwrap_or_default()).chain(has_std.then(|| std.unwrap_or_default()))
        };
        let rows = self.rows.iter().map(|row| row.iter().zip(&columns).flat_map(cells).collect());
        for row in std::iter::once(header.collect()).chain(rows) {
            let row: Vec<String> = row;
            writer.write_record(&row).expect("memory takes all, and rows are as long as the header");
        }
        let bytes = writer.into_inner().expect("memory takes all");
        String::from_utf8(bytes).expect("it was written from text")
    }

    /// The rows for programs: an object each, by the names of the columns. What is not known is null.
    #[must_use]
    pub fn json(&self) -> serde_json::Value {
        let columns: Vec<(&Column, bool)> =
            self.columns.iter().enumerate().map(|(index, column)| (column, self.has_std(index))).collect();
        let row = |row: &Vec<Cell>| {
            let mut object = serde_json::Map::new();
            for ((column, has_std), cell) in columns.iter().zip(row) {
                let (value, std) = match &cell.value {
                    Value::Words => (json!(cell.text), None),
                    Value::Number(value) => (json!(value), None),
                    Value::Estimate(value, std) => (json!(value), *std),
                    Value::Unknown => (serde_json::Value::Null, None),
                };
                object.insert(column.name.to_owned(), value);
                if *has_std {
                    object.insert(format!("{}_std", column.name), json!(std));
                }
            }
            serde_json::Value::Object(object)
        };
        self.rows.iter().map(row).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_shown_short_and_written_in_full() {
        let table = Table {
            name: "t".to_owned(),
            caption: String::new(),
            columns: vec![Column::new("file", "record", ""), Column::new("fit_percent", "% fit", "")],
            rows: vec![
                vec![Cell::text("a, b.csv"), Cell::number(98.765_432_1, 2)],
                vec![Cell::text("c.csv"), Cell::optional(None, 2)],
            ],
            ..Table::default()
        };
        assert_eq!(table.csv(), "file,fit_percent\n\"a, b.csv\",98.7654321\nc.csv,\n");
        assert_eq!(table.rows[0][1].text, "98.77");
        assert!(table.is_number(&1) && !table.is_number(&0));
        // Also where none of a column is known.
        let unknown = Table { rows: vec![vec![Cell::text("c.csv"), Cell::unknown("> 300")]], ..table };
        assert_eq!(unknown.csv(), "file,fit_percent\nc.csv,\n");
    }
}
