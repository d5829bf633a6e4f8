//! Files that are no log but are given for one: recognized by their first bytes, and text in another encoding.

use std::borrow::Cow;
use std::path::Path;

use encoding_rs::{Encoding, UTF_8, WINDOWS_1252};

use super::ImportError;
use super::format::LogFormat;

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

/// What a ground station has of a flight.
const TELEMETRY: (&str, &str) = (
    "a MAVLink telemetry log (.tlog), which has what came over the radio link a few times a second",
    "give the log that the autopilot wrote itself: .bin of ArduPilot, .ulg of PX4",
);
/// Stamps of such a log, microseconds since 1970: from 2000 to 2100.
const TELEMETRY_US: std::ops::Range<u64> = 946_684_800_000_000..4_102_444_800_000_000;

/// Bytes in which the names of a ZIP archive's first files are looked for.
const ZIP_HEAD: usize = 1 << 16;

/// Refuses what begins as no log does.
pub(super) fn refuse(file: &Path, bytes: &[u8]) -> Result<(), ImportError> {
    let telemetry = is_telemetry(bytes).then_some((&b""[..], TELEMETRY.0, TELEMETRY.1));
    let known = KINDS.iter().find(|(start, ..)| bytes.starts_with(start)).copied().or(telemetry);
    let Some((_, mut kind, mut remedy)) = known else { return Ok(()) };
    let head = &bytes[..bytes.len().min(ZIP_HEAD)];
    let names = |name: &[u8]| head.windows(name.len()).any(|part| part == name);
    if bytes.starts_with(b"PK") && names(b"[Content_Types].xml") && names(b"xl/") {
        (kind, remedy) = ("an Excel workbook (XLSX)", SPREADSHEET);
    } else if bytes.starts_with(b"PK") && names(b"opendocument.spreadsheet") {
        (kind, remedy) = ("a LibreOffice spreadsheet (ODS)", SPREADSHEET);
    }
    Err(ImportError::not_a_log(file, format!(": {kind}, and no log"), remedy))
}

/// Whether bytes are MAVLink packets, each behind its stamp of eight bytes (mavlink/qgroundcontrol, MAVLink's *Telemetry Logs*).
fn is_telemetry(bytes: &[u8]) -> bool {
    // Where the next packet of version 1 or 2 begins: a head, as many bytes as it says, a checksum, and a signature where a flag says so.
    let packet = |bytes: &[u8]| {
        let stamp = u64::from_be_bytes(bytes.get(..8)?.try_into().ok()?);
        let (mark, length, flags) = (*bytes.get(8)?, usize::from(*bytes.get(9)?), *bytes.get(10)?);
        let length = match mark {
            0xfe => 8 + 6 + length + 2,
            0xfd => 8 + 10 + length + 2 + 13 * usize::from(flags & 1),
            _ => return None,
        };
        TELEMETRY_US.contains(&stamp).then_some(length)
    };
    let next = packet(bytes).and_then(|length| bytes.get(length..));
    next.is_some_and(|next| next.is_empty() || packet(next).is_some())
}

/// The text that `bytes` are, without its byte-order mark, and the name of its encoding where that is not UTF-8. What has no mark and is
/// no UTF-8 is taken as Windows-1252, in which spreadsheets and loggers on Windows write, unless it has characters that no text has.
pub(super) fn text<'a>(file: &Path, bytes: &'a [u8]) -> Result<(Cow<'a, str>, Option<&'static str>), ImportError> {
    let (marked, mark) = Encoding::for_bom(bytes).unwrap_or((UTF_8, 0));
    let bytes = &bytes[mark..];
    let line = |end: usize| memchr::memchr_iter(b'\n', &bytes[..end]).count() + 1;
    let not_text = |at: usize| {
        let problem = format!(
            ", line {}: the byte {:#04x} belongs in no text: the file is damaged, or a binary log that is not known",
            line(at),
            bytes[at]
        );
        let remedy = format!("copy the file again, or export it as one of these: {}", LogFormat::titles());
        ImportError::not_a_log(file, problem, remedy)
    };
    if marked != UTF_8 {
        let text = marked.decode_without_bom_handling_and_without_replacement(bytes);
        let problem = "UTF-16 text with characters that are none";
        let damaged = ImportError::Damaged { file: file.into(), offset: mark, problem };
        return text.map(|text| (text, Some(marked.name()))).ok_or(damaged);
    }
    let is_of_no_text = |byte: &u8| byte.is_ascii_control() && !byte.is_ascii_whitespace();
    match (std::str::from_utf8(bytes), memchr::memchr(0, bytes)) {
        (_, Some(at)) => Err(not_text(at)),
        (Ok(text), None) => Ok((Cow::Borrowed(text), None)),
        (Err(_), None) => match bytes.iter().position(is_of_no_text) {
            Some(at) => Err(not_text(at)),
            None => Ok((WINDOWS_1252.decode_without_bom_handling(bytes).0, Some(WINDOWS_1252.name()))),
        },
    }
}
