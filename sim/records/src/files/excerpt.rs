//! A part of a file, for errors that show the place with the line numbers of the whole.

use std::borrow::Cow;
use std::ops::Range;
use std::sync::Arc;

use miette::{MietteError, MietteSpanContents, SourceCode, SourceSpan, SpanContents};

use super::printable::printable_in_place;

/// A line of more bytes is shown in part.
const LONGEST_LINE: usize = 160;
/// Bytes on either side of the place that are shown of it.
const AROUND: usize = 40;

/// Text of a file from some line on. Spans count its own bytes, reports show the lines of the file.
#[derive(Clone, Debug)]
pub struct Excerpt {
    text: Arc<String>,
    lines_before: usize,
}

impl Excerpt {
    /// `text`, which follows so many lines of its file.
    #[must_use]
    pub fn new(text: Arc<String>, lines_before: usize) -> Self {
        // Shown, and nothing else.
        let text = match printable_in_place(&text) {
            Cow::Borrowed(_) => text,
            Cow::Owned(printable) => Arc::new(printable),
        };
        Self { text, lines_before }
    }

    /// As much of `span` as so many characters.
    pub(super) fn shortened(&self, span: Range<usize>, most: usize) -> Range<usize> {
        let length = self.text.get(span.clone()).and_then(|text| text.char_indices().nth(most)).map(|(end, _)| end);
        span.start..length.map_or(span.end, |length| span.start + length)
    }

    /// What is shown around `span` where its line is long: so many bytes on either side, whole characters.
    fn window(&self, span: Range<usize>) -> Option<Range<usize>> {
        let text = self.text.as_str();
        let line_start = text.get(..span.start)?.rfind('\n').map_or(0, |newline| newline + 1);
        let line_end = text.get(span.end..)?.find('\n').map_or(text.len(), |newline| span.end + newline);
        if line_end - line_start <= LONGEST_LINE {
            return None;
        }
        let mut start = span.start.saturating_sub(AROUND).max(line_start);
        while !text.is_char_boundary(start) {
            start -= 1;
        }
        let mut end = (span.end + AROUND).min(line_end);
        while !text.is_char_boundary(end) {
            end += 1;
        }
        Some(start..end)
    }
}

impl SourceCode for Excerpt {
    fn read_span<'a>(
        &'a self,
        span: &SourceSpan,
        context_lines_before: usize,
        context_lines_after: usize,
    ) -> Result<Box<dyn SpanContents<'a> + 'a>, MietteError> {
        let bytes = span.offset()..span.offset() + span.len();
        let window = (context_lines_before + context_lines_after > 0).then(|| self.window(bytes)).flatten();
        let (span, before, after) = match window {
            Some(window) => (SourceSpan::from(window), 0, 0),
            None => (*span, context_lines_before, context_lines_after),
        };
        let inner = self.text.as_str().read_span(&span, before, after)?;
        let line = self.lines_before + inner.line();
        let data = inner.data();
        // The lines beside may be long where this one is not.
        let is_long = window_is_needed(data);
        if is_long && before + after > 0 {
            return self.read_span(&span, 0, 0);
        }
        Ok(Box::new(MietteSpanContents::new(data, *inner.span(), line, inner.column(), inner.line_count())))
    }
}

/// Whether a line is too long to be shown.
fn window_is_needed(data: &[u8]) -> bool {
    data.split(|byte| *byte == b'\n').any(|line| line.len() > LONGEST_LINE)
}
