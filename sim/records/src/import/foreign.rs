//! Files that are no log but are given for one: recognized by their first bytes, and text in another encoding.

use std::borrow::Cow;
use std::path::Path;

use super::ImportError;

/// What a spreadsheet has to become.
const SPREADSHEET: &str = "open it in the spreadsheet program, choose the sheet with the rows and export it as CSV";
/// What is in an archive has to come out.
const PACKED: &str = "unpack it, and give the log that is in it";
/// A picture of a log.
const PICTURE: &str = "numbers cannot be read off it: give the log itself, exported as CSV";
/// What another program has to write as text.
const DATA: &str = "export the rows as CSV with the program that wrote it";

/// How files begin that are no log, what they are, and what to do.
const KINDS: &[(&[u8], &str, &str)] = &[
    (b"PK\x03\x04", "a ZIP archive", PACKED),
    (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", "an Excel workbook (XLS)", SPREADSHEET),
    (b"\x1f\x8b", "a gzip archive", PACKED),
    (b"BZh", "a bzip2 archive", PACKED),
    (b"\xfd7zXZ\0", "an XZ archive", PACKED),
    (b"\x28\xb5\x2f\xfd", "a Zstandard archive", PACKED),
    (b"7z\xbc\xaf\x27\x1c", "a 7z archive", PACKED),
    (b"\x89PNG", "a picture (PNG)", PICTURE),
    (b"\xff\xd8\xff", "a picture (JPEG)", PICTURE),
    (b"GIF8", "a picture (GIF)", PICTURE),
    (b"%PDF", "a PDF document", PICTURE),
    (
        b"SQLite format 3\0",
        "an SQLite database",
        "export the table with the rows as CSV, as `sqlite3 -header -csv` does",
    ),
    (b"FMT, 128,", "a DataFlash log as text", "give the log that it was made of, whose name ends in .bin"),
    (b"PAR1", "a Parquet file", DATA),
    (b"TDSm", "a LabVIEW log (TDMS)", DATA),
    (
        b"<!DOCTYPE",
        "a web page",
        "download the log itself: on a page that shows a file, the link is often called `raw`",
    ),
    (
        b"<!doctype",
        "a web page",
        "download the log itself: on a page that shows a file, the link is often called `raw`",
    ),
    (b"<html", "a web page", "download the log itself: on a page that shows a file, the link is often called `raw`"),
];

/// Bytes in which the names of a ZIP archive's first files are looked for.
const ZIP_HEAD: usize = 1 << 16;

/// Refuses what begins as no log does.
pub(super) fn refuse(file: &Path, bytes: &[u8]) -> Result<(), ImportError> {
    let Some(&(_, mut kind, mut remedy)) = KINDS.iter().find(|(start, ..)| bytes.starts_with(start)) else {
        return Ok(());
    };
    let head = &bytes[..bytes.len().min(ZIP_HEAD)];
    let names = |name: &[u8]| head.windows(name.len()).any(|part| part == name);
    if bytes.starts_with(b"PK") && names(b"[Content_Types].xml") && names(b"xl/") {
        (kind, remedy) = ("an Excel workbook (XLSX)", SPREADSHEET);
    } else if bytes.starts_with(b"PK") && names(b"opendocument.spreadsheet") {
        (kind, remedy) = ("a LibreOffice spreadsheet (ODS)", SPREADSHEET);
    }
    Err(ImportError::NoLog { file: file.into(), kind, remedy })
}

/// The text that `bytes` are, without its byte-order mark, and whether they are UTF-16.
pub(super) fn text<'a>(file: &Path, bytes: &'a [u8]) -> Result<(Cow<'a, str>, bool), ImportError> {
    let of_units = |bytes: &[u8], unit: fn([u8; 2]) -> u16| {
        // A byte more is half a character.
        let (pairs, rest) = bytes.as_chunks::<2>();
        let text = String::from_utf16(&pairs.iter().copied().map(unit).collect::<Vec<_>>());
        let damaged =
            ImportError::Damaged { file: file.into(), offset: 2, problem: "UTF-16 text with characters that are none" };
        text.ok().filter(|_| rest.is_empty()).map(|text| (Cow::Owned(text), true)).ok_or(damaged)
    };
    if let Some(bytes) = bytes.strip_prefix(b"\xff\xfe") {
        return of_units(bytes, u16::from_le_bytes);
    }
    if let Some(bytes) = bytes.strip_prefix(b"\xfe\xff") {
        return of_units(bytes, u16::from_be_bytes);
    }
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let line = |end: usize| memchr::memchr_iter(b'\n', &bytes[..end]).count() + 1;
    let text = std::str::from_utf8(bytes)
        .map_err(|error| ImportError::NotUtf8 { file: file.into(), line: line(error.valid_up_to()) })?;
    match memchr::memchr(0, bytes) {
        Some(at) => Err(ImportError::NotText { file: file.into(), line: line(at) }),
        None => Ok((Cow::Borrowed(text), false)),
    }
}
