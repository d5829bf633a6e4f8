//! A text file in parts, for files that are too long to keep.

use std::fs::File;
use std::io::Read as _;
use std::path::{Path, PathBuf};

use memchr::{memchr_iter, memrchr};

use super::text::cannot_read;
use super::{FileError, TextFile};

/// Bytes that are read at a time.
const BLOCK: usize = 1 << 20;

/// Reads a file in blocks of whole lines, each a [`TextFile`] whose errors show the lines of the whole file. No more than
/// about a mebibyte is in memory, unless a line is longer.
#[derive(Debug)]
pub(crate) struct TextBlocks {
    path: PathBuf,
    file: File,
    /// The beginning of a line that the block before ended in.
    rest: Vec<u8>,
    bytes_before: u64,
    lines_before: usize,
}

impl TextBlocks {
    /// Begins to read.
    ///
    /// # Errors
    /// When the file cannot be opened.
    pub(crate) fn open(path: &Path) -> Result<Self, FileError> {
        let file = File::open(path).map_err(|source| cannot_read(path, source))?;
        Ok(Self { path: path.to_owned(), file, rest: Vec::new(), bytes_before: 0, lines_before: 0 })
    }

    /// The next block; `None` at the end.
    ///
    /// # Errors
    /// When the operating system refuses, or the block is not UTF-8.
    pub(crate) fn next(&mut self) -> Result<Option<TextFile>, FileError> {
        let mut bytes = Vec::with_capacity(self.rest.len() + BLOCK);
        bytes.append(&mut self.rest);
        loop {
            let from = bytes.len();
            let read = self.file.by_ref().take(BLOCK as u64).read_to_end(&mut bytes);
            let read = read.map_err(|source| cannot_read(&self.path, source))?;
            if read == 0 {
                break;
            }
            if let Some(newline) = memrchr(b'\n', &bytes[from..]) {
                self.rest = bytes.split_off(from + newline + 1);
                break;
            }
        }
        if bytes.is_empty() {
            return Ok(None);
        }
        let (before, lines) = (bytes.len() as u64, memchr_iter(b'\n', &bytes).count());
        let part = TextFile::part(&self.path, bytes, self.bytes_before, self.lines_before)?;
        self.bytes_before += before;
        self.lines_before += lines;
        Ok(Some(part))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::testing::{Scratch, assert_report};

    fn blocks(path: &Path) -> Vec<TextFile> {
        let mut blocks = TextBlocks::open(path).unwrap();
        std::iter::from_fn(|| blocks.next().unwrap()).collect()
    }

    #[test]
    fn blocks_are_whole_lines_and_together_the_file() {
        let scratch = Scratch::new();
        let long = "x".repeat(3 * BLOCK);
        let short = "0.125,0.5,-3.25\n".repeat(BLOCK / 4);
        for text in [short.clone(), format!("{short}{long}\n{short}end"), "a".into(), String::new()] {
            let path = scratch.file("a.csv", format!("\u{feff}{text}"));
            let blocks = blocks(&path);
            assert_eq!(blocks.iter().map(TextFile::text).collect::<String>(), text);
            let (_, whole) = blocks.split_last().unwrap();
            assert!(whole.iter().all(|block| block.text().ends_with('\n')));
            let mut line = 1;
            for block in &blocks {
                assert_eq!(block.line(0), line);
                line += block.text().matches('\n').count();
            }
        }
    }

    #[test]
    fn errors_show_lines_of_the_whole_file() {
        let scratch = Scratch::new();
        let line = "0.125,0.5,-3.25\n";
        let lines = BLOCK / 4;
        let path = scratch.file("a.csv", line.repeat(lines));
        let block = blocks(&path).pop().unwrap();
        let last = block.text().len() - line.len();
        let error = block.complaint(last + 6..last + 9, "m", "l", "h");
        assert_report(error, &[&format!("a.csv:{lines}:7"), &format!("{lines} │ 0.125,0.5")]);
        let mut bytes = line.repeat(lines).into_bytes();
        let bad = bytes.len() - 2;
        bytes[bad] = 0xb5;
        let path = scratch.file("b.csv", bytes);
        let mut blocks = TextBlocks::open(&path).unwrap();
        let error = loop {
            match blocks.next() {
                Ok(Some(_)) => {}
                Ok(None) => panic!("the byte was accepted"),
                Err(error) => break error,
            }
        };
        assert_report(error, &[&format!("b.csv:{lines}:15"), &format!("byte {bad} is not UTF-8")]);
    }
}
