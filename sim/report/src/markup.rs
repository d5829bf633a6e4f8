//! What comes from data, on its way into a page or a picture: one way for each, and nothing else writes it there.

use std::fmt::{self, Write};

use askama::filters::{Escaper, Html};
use rotorlead_answer::escape::printable;

/// Text of HTML or SVG that is no markup, and holds none of the characters that XML does not allow.
pub(crate) fn escape_markup(text: &str) -> String {
    printable(text).replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

/// What a template does to all that it does not call `safe`: `askama.toml` names it.
#[derive(Clone, Copy)]
pub(crate) struct HtmlEscaper;

impl Escaper for HtmlEscaper {
    fn write_escaped_str<W: Write>(&self, to: W, text: &str) -> fmt::Result {
        Html.write_escaped_str(to, &printable(text))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_in_a_page_is_markup_or_an_order() {
        assert_eq!(escape_markup("<b>&\u{1b}\0"), "&lt;b&gt;&amp;␛␀");
        let mut html = String::new();
        HtmlEscaper.write_escaped_str(&mut html, "\"<\u{1b}").unwrap();
        assert_eq!(html, "&#34;&#60;␛");
    }
}
