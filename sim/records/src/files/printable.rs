//! What a terminal or a page would obey instead of showing it.

use std::borrow::Cow;
use std::error::Error;
use std::fmt::{self, Debug, Display};

use miette::{Diagnostic, LabeledSpan, ReportHandler, Severity, SourceCode};

/// `text` with a picture in place of each character that is an order and no sign: the controls, among them the one that begins the
/// sequences of a terminal, and those that turn the direction of what follows. Line breaks and tabs stay.
#[must_use]
pub fn printable(text: &str) -> Cow<'_, str> {
    pictured(text, is_order)
}

/// [`printable`] with pictures of line breaks and tabs too: what is said in one line, where a name that is quoted begins no other.
#[must_use]
pub fn printable_line(text: &str) -> Cow<'_, str> {
    pictured(text, |character| is_order(character) || character.is_control())
}

/// `text` with a picture in place of each of these characters.
fn pictured(text: &str, is_shown_so: fn(char) -> bool) -> Cow<'_, str> {
    if !text.contains(is_shown_so) {
        return Cow::Borrowed(text);
    }
    let picture = |character: char| match character {
        sign if !is_shown_so(sign) => sign,
        '\0'..'\x20' => char::from_u32(0x2400 + u32::from(character)).unwrap_or('\u{fffd}'),
        '\x7f' => '\u{2421}',
        _ => '\u{fffd}',
    };
    Cow::Owned(text.chars().map(picture).collect())
}

/// [`printable`] with as many bytes, so that places in the text stay where they are.
pub(super) fn printable_in_place(text: &str) -> Cow<'_, str> {
    if !text.contains(is_order) {
        return Cow::Borrowed(text);
    }
    let mut shown = String::with_capacity(text.len());
    for (index, character) in text.char_indices() {
        match character.len_utf8() {
            // A part of a line break.
            1 if text[index..].starts_with("\r\n") => shown.push(character),
            1 if is_order(character) => shown.push('?'),
            2 if is_order(character) => shown.push('¿'),
            3 if is_order(character) => shown.push('\u{fffd}'),
            _ => shown.push(character),
        }
    }
    Cow::Owned(shown)
}

/// Whether a terminal or a page obeys the character instead of showing it; line breaks and tabs are none of these.
#[must_use]
pub fn is_order(character: char) -> bool {
    let is_direction =
        matches!(character, '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    is_direction || character.is_control() && !matches!(character, '\n' | '\t')
}

/// Shows reports as another handler does, with all that they quote [`printable`].
pub struct PrintableReports<H>(pub H);

impl<H: ReportHandler> ReportHandler for PrintableReports<H> {
    fn debug(&self, diagnostic: &dyn Diagnostic, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.debug(&PrintableReport::from_report(diagnostic), formatter)
    }
}

/// A report with printable words. Its excerpts are so already.
pub struct PrintableReport<'a> {
    report: &'a dyn Diagnostic,
    message: String,
    cause: Option<Cause<'a>>,
}

/// What a report is caused by.
enum Cause<'a> {
    Report(Box<PrintableReport<'a>>),
    Error(Message),
}

/// An error that is words alone.
#[derive(Debug)]
struct Message {
    message: String,
    cause: Option<Box<Message>>,
}

impl<'a> PrintableReport<'a> {
    /// The same as `report`, but for what it quotes.
    #[must_use]
    pub fn from_report(report: &'a dyn Diagnostic) -> Self {
        let of_error = || report.source().map(|cause| Cause::Error(Message::from_error(cause)));
        let of_report = report.diagnostic_source().map(|cause| Cause::Report(Box::new(Self::from_report(cause))));
        Self { report, message: printable_line(&report.to_string()).into_owned(), cause: of_report.or_else(of_error) }
    }
}

impl Message {
    fn from_error(error: &dyn Error) -> Self {
        let cause = error.source().map(|cause| Box::new(Self::from_error(cause)));
        Self { message: printable_line(&error.to_string()).into_owned(), cause }
    }
}

impl Display for Message {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(&self.message)
    }
}

impl Error for Message {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        self.cause.as_deref().map(|cause| cause as &dyn Error)
    }
}

impl Debug for PrintableReport<'_> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(&self.message)
    }
}

impl Display for PrintableReport<'_> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(&self.message)
    }
}

impl Error for PrintableReport<'_> {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        match &self.cause {
            Some(Cause::Error(message)) => Some(message),
            _ => None,
        }
    }
}

impl Diagnostic for PrintableReport<'_> {
    fn code<'a>(&'a self) -> Option<Box<dyn Display + 'a>> {
        self.report.code()
    }

    fn severity(&self) -> Option<Severity> {
        self.report.severity()
    }

    fn help<'a>(&'a self) -> Option<Box<dyn Display + 'a>> {
        Some(Box::new(printable(&self.report.help()?.to_string()).into_owned()))
    }

    fn source_code(&self) -> Option<&dyn SourceCode> {
        self.report.source_code()
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        let shown = |label: LabeledSpan| {
            LabeledSpan::new_with_span(label.label().map(|text| printable_line(text).into_owned()), *label.inner())
        };
        Some(Box::new(self.report.labels()?.map(shown)))
    }

    fn diagnostic_source(&self) -> Option<&dyn Diagnostic> {
        match &self.cause {
            Some(Cause::Report(report)) => Some(&**report),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn orders_become_pictures_and_all_else_stays() {
        let text = "Größe\t\u{1b}[31m\u{7}\r\0\u{7f}\u{9b}2J\u{202e}x\n";
        assert_eq!(printable(text), "Größe\t␛[31m␇␍␀␡\u{fffd}2J\u{fffd}x\n");
        assert_eq!(printable_line("a\tb\r\nc\u{202e}"), "a␉b␍␊c\u{fffd}");
        assert_eq!(printable_in_place(text).len(), text.len());
        assert!(!printable_in_place(text).contains(is_order));
        assert_eq!(printable_in_place("a\u{7}\r\nb"), "a?\r\nb");
    }
}
