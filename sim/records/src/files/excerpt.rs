//! A part of a file, for errors that show the place with the line numbers of the whole.

use std::sync::Arc;

use miette::{MietteError, MietteSpanContents, SourceCode, SourceSpan, SpanContents};

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
        Self { text, lines_before }
    }
}

impl SourceCode for Excerpt {
    fn read_span<'a>(
        &'a self,
        span: &SourceSpan,
        context_lines_before: usize,
        context_lines_after: usize,
    ) -> Result<Box<dyn SpanContents<'a> + 'a>, MietteError> {
        let inner = self.text.as_str().read_span(span, context_lines_before, context_lines_after)?;
        let line = self.lines_before + inner.line();
        Ok(Box::new(MietteSpanContents::new(inner.data(), *inner.span(), line, inner.column(), inner.line_count())))
    }
}
