//! Checksums, by which two results can be seen to rest on the same content.

use std::fs::File;
use std::io::{self, Read as _};
use std::path::{Path, PathBuf};

/// Bytes of a file that are held at a time: records may be longer than the memory.
const BLOCK: usize = 1 << 16;

/// CRC-32 of `bytes`, as eight hexadecimal digits.
#[must_use]
pub fn checksum(bytes: &[u8]) -> String {
    written(crc32fast::hash(bytes))
}

/// [`checksum`] of parts, one behind the other.
#[must_use]
pub fn checksum_of(parts: &[&[u8]]) -> String {
    let mut sum = crc32fast::Hasher::new();
    parts.iter().for_each(|part| sum.update(part));
    written(sum.finalize())
}

/// [`checksum`] of files, one behind the other; `None` where they are none, or one cannot be read.
#[must_use]
pub fn checksum_of_files(files: impl IntoIterator<Item = PathBuf>) -> Option<String> {
    let mut files = files.into_iter().peekable();
    files.peek()?;
    let mut sum = crc32fast::Hasher::new();
    files.try_for_each(|file| add(&mut sum, &file)).ok()?;
    Some(written(sum.finalize()))
}

fn add(sum: &mut crc32fast::Hasher, file: &Path) -> io::Result<()> {
    let mut file = File::open(file)?;
    let mut block = vec![0; BLOCK];
    loop {
        match file.read(&mut block)? {
            0 => return Ok(()),
            count => sum.update(&block[..count]),
        }
    }
}

fn written(sum: u32) -> String {
    format!("{sum:08x}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::testing::Scratch;

    #[test]
    fn files_have_the_checksum_of_their_bytes_one_behind_the_other() {
        // The check value of CRC-32.
        assert_eq!(checksum(b"123456789"), "cbf43926");
        assert_eq!(checksum_of(&[b"1234", b"56789"]), "cbf43926");
        let scratch = Scratch::new();
        let (first, second) = (scratch.file("a", "1234"), scratch.file("b", "56789"));
        assert_eq!(checksum_of_files([first.clone(), second]).unwrap(), "cbf43926");
        let long = "7".repeat(3 * BLOCK + 1);
        assert_eq!(checksum_of_files([scratch.file("c", &long)]).unwrap(), checksum(long.as_bytes()));
        assert_eq!(checksum_of_files([first, scratch.path().join("d")]), None);
        assert_eq!(checksum_of_files([]), None);
    }
}
