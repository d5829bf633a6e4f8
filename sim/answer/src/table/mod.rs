//! Tables: what is shown, and the numbers behind it. One description for the terminal, for a report and for CSV.

mod text;

use crate::escape;

/// A table with a heading for each column.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    /// File name without its end; unique in a report.
    pub name: String,
    /// What it lists, and what its entries mean.
    pub caption: String,
    /// The columns.
    pub columns: Vec<Column>,
    /// The rows, each with as many cells as there are columns.
    pub rows: Vec<Vec<Cell>>,
}

/// A column's heading.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Column {
    /// Its name in a CSV file, with the unit in it.
    pub name: &'static str,
    /// Its heading.
    pub heading: String,
    /// The unit; may be empty.
    pub unit: String,
}

/// One cell.
#[derive(Clone, Debug, PartialEq)]
pub struct Cell {
    /// What is shown.
    pub text: String,
    /// What is behind it.
    pub value: Value,
}

/// What is behind a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Value {
    /// Nothing but its words.
    Words,
    /// A number.
    Number(f64),
    /// No number, where others of the column have one.
    Unknown,
}

impl Column {
    /// A column.
    #[must_use]
    pub fn new(name: &'static str, heading: &str, unit: &str) -> Self {
        Self { name, heading: heading.to_owned(), unit: unit.to_owned() }
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
    /// The same with these columns alone, by their names and in this order.
    #[must_use]
    pub fn select(&self, names: &[&str]) -> Self {
        let kept: Vec<usize> =
            names.iter().filter_map(|name| self.columns.iter().position(|column| column.name == *name)).collect();
        Self {
            name: self.name.clone(),
            caption: self.caption.clone(),
            columns: kept.iter().map(|column| self.columns[*column].clone()).collect(),
            rows: self.rows.iter().map(|row| kept.iter().map(|column| row[*column].clone()).collect()).collect(),
        }
    }

    /// Whether a column holds numbers.
    #[must_use]
    pub fn is_number(&self, column: &usize) -> bool {
        self.rows.iter().any(|row| row.get(*column).is_some_and(|cell| cell.value != Value::Words))
    }

    /// The table as CSV: numbers in full, nothing where there is none.
    #[must_use]
    pub fn csv(&self) -> String {
        let mut writer = csv::Writer::from_writer(Vec::new());
        let numeric: Vec<bool> = (0..self.columns.len()).map(|column| self.is_number(&column)).collect();
        let header = self.columns.iter().map(|column| column.name.to_owned()).collect();
        let cell = |(cell, is_number): (&Cell, &bool)| match cell.value {
            Value::Number(value) if value.is_finite() => value.to_string(),
            Value::Words if !is_number => escape::cell(&cell.text).into_owned(),
            _ => String::new(),
        };
        let rows = self.rows.iter().map(|row| row.iter().zip(&numeric).map(cell).collect());
        for row in std::iter::once(header).chain(rows) {
            let row: Vec<String> = row;
            writer.write_record(&row).expect("memory takes all, and rows are as long as the header");
        }
        let bytes = writer.into_inner().expect("memory takes all");
        String::from_utf8(bytes).expect("it was written from text")
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
        };
        assert_eq!(table.csv(), "file,fit_percent\n\"a, b.csv\",98.7654321\nc.csv,\n");
        assert_eq!(table.rows[0][1].text, "98.77");
        assert!(table.is_number(&1) && !table.is_number(&0));
        // Also where none of a column is known.
        let unknown = Table { rows: vec![vec![Cell::text("c.csv"), Cell::unknown("> 300")]], ..table };
        assert_eq!(unknown.csv(), "file,fit_percent\nc.csv,\n");
    }
}
