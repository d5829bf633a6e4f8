//! Columns that are declared once: heading, unit, decimals, the name in CSV and JSON, and where the value comes from.

use std::borrow::Cow;

use super::{Cell, Column, Table, Value};

/// A column of a table whose rows are made of `R`.
pub struct ColumnSpec<'a, R> {
    key: &'static str,
    heading: String,
    unit: Unit,
    decimals: usize,
    is_detail: bool,
    get: Box<dyn Fn(&R) -> CellValue + 'a>,
}

/// Display unit: symbol and factor from the stored value, which is SI unless the key names another unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unit {
    symbol: &'static str,
    scale: f64,
}

/// What a column has in one row.
#[derive(Clone, Debug, PartialEq)]
pub enum CellValue {
    /// Words.
    Words(String),
    /// A number.
    Number(f64),
    /// A number in the unit of its column, and what is shown for it.
    Shown(f64, String),
    /// A number and its standard error, as far as that is known.
    Estimate(f64, Option<f64>),
    /// No number, and what is shown for it.
    Unknown(Cow<'static, str>),
}

impl Unit {
    /// None.
    pub const NONE: Self = Self::plain("");
    /// Percent.
    pub const PERCENT: Self = Self::plain("%");
    /// A command, from 0 to 1.
    pub const DUTY: Self = Self::plain("duty");
    /// A pole or a bandwidth.
    pub const RAD_S: Self = Self::plain("rad/s");
    /// Milliseconds of seconds.
    pub const MILLISECONDS: Self = Self { symbol: "ms", scale: 1e3 };
    /// Percent of a share.
    pub const PERCENT_OF_SHARE: Self = Self { symbol: "%", scale: 1e2 };

    /// A unit that is shown as it is.
    #[must_use]
    pub const fn plain(symbol: &'static str) -> Self {
        Self { symbol, scale: 1.0 }
    }
}

impl From<f64> for CellValue {
    fn from(number: f64) -> Self {
        Self::Number(number)
    }
}

impl From<Option<f64>> for CellValue {
    fn from(number: Option<f64>) -> Self {
        number.map_or(Self::Unknown(Cow::Borrowed("-")), Self::Number)
    }
}

impl From<String> for CellValue {
    fn from(words: String) -> Self {
        Self::Words(words)
    }
}

impl From<&'static str> for CellValue {
    fn from(words: &'static str) -> Self {
        Self::Words(words.to_owned())
    }
}

impl<'a, R> ColumnSpec<'a, R> {
    /// A column.
    pub fn new<D: Into<CellValue>>(
        key: &'static str,
        heading: impl Into<String>,
        unit: Unit,
        decimals: usize,
        get: impl Fn(&R) -> D + 'a,
    ) -> Self {
        let get = Box::new(move |row: &R| get(row).into());
        Self { key, heading: heading.into(), unit, decimals, is_detail: false, get }
    }

    /// A column of words.
    pub fn words<D: Into<CellValue>>(key: &'static str, heading: &str, get: impl Fn(&R) -> D + 'a) -> Self {
        Self::new(key, heading, Unit::NONE, 0, get)
    }

    /// The same, which a terminal leaves to the report.
    #[must_use]
    pub fn in_detail(self) -> Self {
        Self { is_detail: true, ..self }
    }

    fn cell(&self, row: &R) -> Cell {
        let Unit { scale, .. } = self.unit;
        match (self.get)(row) {
            CellValue::Words(words) => Cell::text(words),
            CellValue::Number(value) => {
                Cell { value: Value::Number(value), ..Cell::number(scale * value, self.decimals) }
            }
            CellValue::Shown(value, text) => Cell::shown(value, text),
            CellValue::Estimate(value, std) => Cell {
                text: with_std(value, std, scale, self.decimals).replace("+-", "±"),
                value: Value::Estimate(value, std),
            },
            CellValue::Unknown(shown) => Cell::unknown(shown),
        }
    }
}

/// The table of these rows.
#[must_use]
pub fn build_table<R>(name: &str, caption: impl Into<String>, columns: &[ColumnSpec<'_, R>], rows: &[R]) -> Table {
    let head = |column: &ColumnSpec<'_, R>| Column {
        name: column.key,
        heading: column.heading.clone(),
        unit: column.unit.symbol.to_owned(),
        is_detail: column.is_detail,
    };
    Table {
        name: name.to_owned(),
        caption: caption.into(),
        columns: columns.iter().map(head).collect(),
        rows: rows.iter().map(|row| columns.iter().map(|column| column.cell(row)).collect()).collect(),
        ..Table::default()
    }
}

/// A value and its standard error, both times `scale`, to the second significant digit of the error; with `digits` decimals
/// where there is no error to go by.
#[must_use]
pub fn with_std(value: f64, std: Option<f64>, scale: f64, digits: usize) -> String {
    let value = scale * value;
    match std.map(|std| scale.abs() * std) {
        // An error of this size leaves no digit of the value in its place.
        Some(std) if std >= 1e6 => format!("{value:.1e} +- {std:.1e}"),
        Some(std) if std.is_finite() && std > 0.0 => {
            // From 1e-9 to 1e6 this is -9 to 5.
            let magnitude = std.max(1e-9).log10().floor() as i32;
            let digits = usize::try_from(1 - magnitude).unwrap_or(0);
            format!("{value:.digits$} +- {std:.digits$}")
        }
        Some(std) => format!("{value:.digits$} +- {std:.0}"),
        None => format!("{value:.digits$}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Lag {
        tau_s: f64,
        std_s: Option<f64>,
        file: &'static str,
    }

    #[test]
    fn one_declaration_gives_heading_cell_csv_and_json() {
        let columns = [
            ColumnSpec::words("file", "record", |lag: &Lag| lag.file),
            ColumnSpec::new("tau_s", "tau", Unit::MILLISECONDS, 1, |lag: &Lag| {
                CellValue::Estimate(lag.tau_s, lag.std_s)
            }),
        ];
        let rows =
            [Lag { tau_s: 0.0831, std_s: Some(0.0012), file: "a.csv" }, Lag { tau_s: 0.1, std_s: None, file: "b.csv" }];
        let table = build_table("lags", "Lags", &columns, &rows);
        assert_eq!(table.text(), "Lags\n  record     tau (ms)\n  a.csv   83.1 +- 1.2\n  b.csv         100.0\n");
        assert_eq!(table.csv(), "file,tau_s,tau_s_std\na.csv,0.0831,0.0012\nb.csv,0.1,\n");
        let expected = serde_json::json!([
            { "file": "a.csv", "tau_s": 0.0831, "tau_s_std": 0.0012 },
            { "file": "b.csv", "tau_s": 0.1, "tau_s_std": null },
        ]);
        assert_eq!(table.json(), expected);
    }

    #[test]
    fn the_error_has_two_digits_and_the_value_as_many_decimals() {
        assert_eq!(with_std(7.07204, Some(0.01092), 1.0, 4), "7.072 +- 0.011");
        assert_eq!(with_std(0.059_741, Some(0.000_126), 1e3, 2), "59.74 +- 0.13");
        assert_eq!(with_std(28_832.4, Some(153.7), 1.0, 4), "28832 +- 154");
        assert_eq!(with_std(60.005_554, Some(0.000_072_7), 1.0, 3), "60.005554 +- 0.000073");
        assert_eq!(with_std(3.28e10, Some(9.47e18), 1.0, 3), "3.3e10 +- 9.5e18");
        assert_eq!(with_std(1.5, Some(0.0), 1.0, 3), "1.500 +- 0");
        assert_eq!(with_std(1.5, Some(f64::NAN), 1.0, 3), "1.500 +- NaN");
        assert_eq!(with_std(1.5, None, 1.0, 3), "1.500");
    }
}
