//! What comes from data, on its way into a table: one function for each, and nothing else writes it there.

use std::borrow::Cow;

// Pages and pictures need it too, and know no crate but this one.
pub use rotorlead_records::files::printable;

/// A text as a cell of a table that is a text there too: what spreadsheets take for a formula has an apostrophe in front of it.
#[must_use]
pub fn cell(text: &str) -> Cow<'_, str> {
    let is_number = text.parse::<f64>().is_ok() || text == "-";
    let text = printable(text);
    if text.starts_with(['=', '+', '-', '@', '\t', '\n']) && !is_number { Cow::Owned(format!("'{text}")) } else { text }
}

/// [`cell`] as one field of CSV.
#[must_use]
pub fn field(text: &str) -> String {
    let cell = cell(text);
    if cell.contains([',', '"', '\n']) { format!("\"{}\"", cell.replace('"', "\"\"")) } else { cell.into_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_cell_is_a_formula() {
        for (text, expected) in [
            ("=1+1", "'=1+1"),
            ("@SUM(A1)", "'@SUM(A1)"),
            ("+1+cmd", "'+1+cmd"),
            ("-1+cmd", "'-1+cmd"),
            ("\t=1", "'\t=1"),
            ("-1.5", "-1.5"),
            ("-", "-"),
            ("a=1", "a=1"),
            ("=a,\"b\"", "\"'=a,\"\"b\"\"\""),
            ("a\u{1b}", "a␛"),
        ] {
            assert_eq!(field(text), expected);
        }
    }
}
