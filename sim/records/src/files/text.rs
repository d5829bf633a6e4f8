//! A text file, kept so that errors can show the place in it.

use std::fs::File;
use std::io::{self, Read as _};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use miette::NamedSource;

use super::{Excerpt, FileError, Located, printable_line};

const BYTE_ORDER_MARK: char = '\u{feff}';

/// A text that is read whole is no longer: ten million rows.
const LONGEST_TEXT: u64 = 1_000_000_000;
/// How much of a message is shown, and of the text that it is about, characters: names and texts may be as long as a file.
const LONGEST_MESSAGE: usize = 600;
const LONGEST_SPAN: usize = 80;

/// Bytes of text that were read by now.
static READ: AtomicU64 = AtomicU64::new(0);

/// How many bytes of text files this process has read by now: what a bar shows while files are read.
#[must_use]
pub fn bytes_read() -> u64 {
    READ.load(Ordering::Relaxed)
}

/// The text of a file and the name under which it was asked for. Clones share the text.
#[derive(Clone, Debug)]
pub struct TextFile {
    path: PathBuf,
    text: Arc<String>,
    /// Lines of the file before this part of it.
    lines_before: usize,
}

impl TextFile {
    /// Reads a UTF-8 file; a byte-order mark at its start is dropped.
    ///
    /// # Errors
    /// When the file is missing, cannot be read, is not UTF-8 or holds nothing but white space.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        if path.is_dir() {
            return Err(FileError::NotAFile { path: path.to_owned() });
        }
        Self::from_bytes(path, read_up_to(path, LONGEST_TEXT)?)
    }

    /// [`Self::read`] of a file whose bytes are in memory.
    ///
    /// # Errors
    /// When it is not UTF-8 or holds nothing but white space.
    pub fn from_bytes(path: &Path, bytes: Vec<u8>) -> Result<Self, FileError> {
        let file = Self::part(path, bytes, 0, 0)?;
        if file.text.trim().is_empty() {
            return Err(FileError::Empty { path: path.to_owned() });
        }
        Ok(file)
    }

    /// A text that is in no file, under a name by which errors call it.
    #[must_use]
    pub fn in_memory(name: &str, text: String) -> Self {
        Self { path: name.into(), text: Arc::new(text), lines_before: 0 }
    }

    /// The part of a file that follows so many bytes and lines.
    pub(super) fn part(path: &Path, bytes: Vec<u8>, bytes_before: u64, lines_before: usize) -> Result<Self, FileError> {
        READ.fetch_add(bytes.len() as u64, Ordering::Relaxed);
        let mut text = String::from_utf8(bytes).map_err(|error| not_utf8(path, &error, bytes_before, lines_before))?;
        if bytes_before == 0 && text.starts_with(BYTE_ORDER_MARK) {
            text.drain(..BYTE_ORDER_MARK.len_utf8());
        }
        Ok(Self { path: path.to_owned(), text: Arc::new(text), lines_before })
    }

    /// The path as it was given to [`TextFile::read`].
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The text, without byte-order mark.
    #[must_use]
    pub fn text(&self) -> &str {
        &self.text
    }

    /// The line of the file, counted from one, in which byte `offset` of the text stands.
    #[must_use]
    pub fn line(&self, offset: usize) -> usize {
        let before = &self.text.as_bytes()[..offset.min(self.text.len())];
        1 + self.lines_before + before.iter().filter(|byte| **byte == b'\n').count()
    }

    /// An error that shows the bytes `span` of the text.
    #[must_use]
    pub fn complaint(
        &self,
        span: Range<usize>,
        message: impl Into<String>,
        label: impl Into<String>,
        help: impl Into<String>,
    ) -> FileError {
        located(
            &self.path,
            Excerpt::new(Arc::clone(&self.text), self.lines_before),
            span,
            message.into(),
            label.into(),
            help.into(),
        )
    }
}

/// A whole file of `most` bytes or fewer; what has no end, such as a device, is read no further either.
fn read_up_to(path: &Path, most: u64) -> Result<Vec<u8>, FileError> {
    let mut bytes = Vec::new();
    let read = File::open(path).and_then(|file| file.take(most + 1).read_to_end(&mut bytes));
    match read {
        Err(source) => Err(cannot_read(path, source)),
        Ok(length) if length as u64 > most => Err(FileError::TooLong { path: path.to_owned(), most }),
        Ok(_) => Ok(bytes),
    }
}

pub(super) fn cannot_read(path: &Path, source: io::Error) -> FileError {
    match source.kind() {
        io::ErrorKind::NotFound => FileError::Missing {
            path: path.to_owned(),
            remedy: "check the path; relative paths start at the current folder",
        },
        _ => FileError::Io { action: "read", path: path.to_owned(), source },
    }
}

fn located(path: &Path, text: Excerpt, span: Range<usize>, message: String, label: String, help: String) -> FileError {
    let span = text.shortened(span, LONGEST_SPAN);
    FileError::Located(Box::new(Located {
        message: shortened(message),
        label,
        help: shortened(help),
        source_code: NamedSource::new(printable_line(&path.display().to_string()), text),
        span: span.into(),
    }))
}

/// The begin of a text, where it is long.
fn shortened(mut text: String) -> String {
    if let Some((end, _)) = text.char_indices().nth(LONGEST_MESSAGE) {
        text.truncate(end);
        text.push('…');
    }
    text
}

/// Shows the first byte that is not UTF-8. Before it the lossy text equals the file.
fn not_utf8(path: &Path, error: &std::string::FromUtf8Error, bytes_before: u64, lines_before: usize) -> FileError {
    let utf16 = bytes_before == 0 && matches!(error.as_bytes(), [0xff, 0xfe, ..] | [0xfe, 0xff, ..]);
    let at = error.utf8_error().valid_up_to();
    located(
        path,
        Excerpt::new(Arc::new(String::from_utf8_lossy(error.as_bytes()).into_owned()), lines_before),
        at..at + char::REPLACEMENT_CHARACTER.len_utf8(),
        format!("byte {} is not UTF-8", bytes_before + at as u64),
        "here".to_owned(),
        if utf16 {
            "the file looks like UTF-16: save it as UTF-8".to_owned()
        } else {
            "save the file as UTF-8, and check that it is text".to_owned()
        },
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::testing::{Scratch, assert_report};

    #[test]
    fn a_missing_file_is_named() {
        let error = TextFile::read(Path::new("/nowhere/model.toml")).unwrap_err();
        assert_report(error, &["/nowhere/model.toml", "does not exist", "check the path"]);
    }

    #[test]
    fn a_folder_is_not_text() {
        let scratch = Scratch::new();
        let error = TextFile::read(scratch.path()).unwrap_err();
        assert_report(error, &["is a folder, not a file", "the name of a file in it"]);
    }

    #[test]
    fn an_empty_file_is_named() {
        let scratch = Scratch::new();
        for text in ["", "\u{feff}", " \r\n\n"] {
            let path = scratch.file("a.csv", text);
            let error = TextFile::read(&path).unwrap_err();
            assert_report(error, &["a.csv", "is empty", "right file"]);
        }
    }

    #[test]
    fn bytes_that_are_not_utf8_are_shown_in_their_line() {
        let scratch = Scratch::new();
        let path = scratch.file("latin.csv", b"time_s\n0.1\n20 \xb5s\n");
        let error = TextFile::read(&path).unwrap_err();
        assert_report(error, &["latin.csv:3:4", "byte 14", "save the file as UTF-8"]);
    }

    #[test]
    fn utf16_is_recognized() {
        let scratch = Scratch::new();
        let path = scratch.file("wide.csv", b"\xff\xfet\0i\0");
        let error = TextFile::read(&path).unwrap_err();
        assert_report(error, &["wide.csv:1:1", "UTF-16"]);
    }

    #[test]
    fn a_byte_order_mark_is_dropped_and_moves_no_place() {
        let scratch = Scratch::new();
        let path = scratch.file("mark.txt", "\u{feff}ab\ncd");
        let file = TextFile::read(&path).unwrap();
        assert_eq!(file.text(), "ab\ncd");
        assert_eq!((file.line(0), file.line(2), file.line(3)), (1, 1, 2));
        assert_report(file.complaint(4..5, "m", "l", "h"), &["mark.txt:2:2"]);
    }
}
