//! Sentences for a terminal.

use std::ops::RangeInclusive;
use std::sync::OnceLock;

use rotorlead_records::files::printable_line;
use rotorlead_records::{Finding, Severity};
use textwrap::{Options, WordSeparator, WordSplitter};

/// Columns of text that goes to no terminal.
const COLUMNS: usize = 80;
/// Narrower a table cannot be, and wider no sentence is read well.
const READABLE: RangeInclusive<usize> = 40..=110;

static WIDTH: OnceLock<usize> = OnceLock::new();

/// Makes text as wide as a terminal of so many columns, within what can be read. The first one holds; without any text has 80 columns.
pub fn fit_terminal(columns: usize) {
    WIDTH.get_or_init(|| columns.clamp(*READABLE.start(), *READABLE.end()));
}

/// Columns of what is written for people.
#[must_use]
pub fn width() -> usize {
    WIDTH.get().copied().unwrap_or(COLUMNS)
}

/// Text no wider than a terminal, words and paths whole; all lines but the first begin with `indent`. Ends with a line break.
#[must_use]
pub fn paragraph(text: &str, indent: &str) -> String {
    wrapped(text, width(), indent) + "\n"
}

/// A sentence in lines of at most `width` characters; all but the first begin with `indent`, which counts. Names in it that have
/// line breaks make no lines of their own.
#[must_use]
pub fn wrapped(sentence: &str, width: usize, indent: &str) -> String {
    let options = Options::new(width)
        .subsequent_indent(indent)
        .break_words(false)
        .word_splitter(WordSplitter::NoHyphenation)
        .word_separator(WordSeparator::AsciiSpace);
    textwrap::fill(&printable_line(sentence), options)
}

/// A warning as a terminal shows it.
#[must_use]
pub fn warning(sentence: &str) -> String {
    paragraph(&format!("warning: {sentence}"), "  ")
}

/// Words as a sentence of their own: a capital letter, unless they begin with the name of a file, and a full stop where there is none.
#[must_use]
pub fn sentence(words: &str) -> String {
    let mut letters = words.chars();
    let is_name =
        words.split(' ').next().is_some_and(|word| word.trim_end_matches(['.', ':', ',']).contains(['.', '_', '/']));
    let upper = |first: char| if is_name { first.to_string() } else { first.to_uppercase().to_string() };
    let first = letters.next().map(upper).unwrap_or_default();
    let stop = if words.ends_with(['.', '?', ':']) { "" } else { "." };
    format!("{first}{}{stop}", letters.as_str())
}

/// A finding for a terminal: how grave it is, what is wrong, and on lines of its own what to do.
#[must_use]
pub fn remark(finding: &Finding) -> String {
    let severity = if finding.severity == Severity::Error { "error" } else { "warning" };
    let message = paragraph(&format!("{severity}: {}", finding.message), "  ");
    let remedy = finding.remedy.as_ref().map(|remedy| paragraph(&format!("  help: {remedy}"), "    "));
    message + &remedy.unwrap_or_default()
}

/// `1 error`, `2 errors`.
#[must_use]
pub fn counted(count: usize, what: &str) -> String {
    if count == 1 { format!("1 {what}") } else { format!("{count} {what}s") }
}
