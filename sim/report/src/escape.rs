//! What comes from data, on its way into a page or a table: one function for each, and nothing else writes it there.

use std::borrow::Cow;
use std::fmt::{self, Write};

use askama::filters::{Escaper, Html};
use rotorlead_records::files::printable;

/// Text of HTML or SVG that is no markup, and holds none of the characters that XML does not allow.
pub(crate) fn markup(text: &str) -> String {
    printable(text).replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

/// What a template does to all that it does not call `safe`: `askama.toml` names it.
#[derive(Clone, Copy)]
pub(crate) struct Markup;

impl Escaper for Markup {
    fn write_escaped_str<W: Write>(&self, to: W, text: &str) -> fmt::Result {
        Html.write_escaped_str(to, &printable(text))
    }
}

/// A text as a cell of a table that is a text there too: what spreadsheets take for a formula has an apostrophe in front of it.
pub(crate) fn cell(text: &str) -> Cow<'_, str> {
    let is_number = text.parse::<f64>().is_ok() || text == "-";
    let text = printable(text);
    if text.starts_with(['=', '+', '-', '@', '\t', '\n']) && !is_number { Cow::Owned(format!("'{text}")) } else { text }
}

/// [`cell`] as one field of CSV.
pub(crate) fn field(text: &str) -> String {
    let cell = cell(text);
    if cell.contains([',', '"', '\n']) { format!("\"{}\"", cell.replace('"', "\"\"")) } else { cell.into_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_in_a_page_is_markup_or_an_order() {
        assert_eq!(markup("<b>&\u{1b}\0"), "&lt;b&gt;&amp;␛␀");
        let mut html = String::new();
        Markup.write_escaped_str(&mut html, "\"<\u{1b}").unwrap();
        assert_eq!(html, "&#34;&#60;␛");
    }

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
