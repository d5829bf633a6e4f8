//! The rows of a CSV text and where each cell stands in it, for an error to show.

use std::ops::Range;

use csv::StringRecord;

use super::{TextFile, printable_line};

/// How much of a cell an error quotes, characters: an unclosed quote makes a cell of a whole file.
const QUOTED: usize = 40;

/// Rows of any length, the header among them.
pub fn reader(text: &TextFile) -> csv::Reader<&[u8]> {
    csv::ReaderBuilder::new()
        .has_headers(false)
        .flexible(true) // Rows of another length get an error of our own, with its place.
        .from_reader(text.text().as_bytes())
}

/// Reads the next row; false at the end.
pub fn next(reader: &mut csv::Reader<&[u8]>, row: &mut StringRecord) -> bool {
    reader.read_record(row).expect("rows of any length, of UTF-8 text in memory, cannot fail")
}

/// Where a whole row stands in the text.
pub fn row_span(text: &TextFile, row: &StringRecord) -> Range<usize> {
    cell_span(text, row, 0).start..cell_span(text, row, row.len().saturating_sub(1)).end
}

/// A cell as an error quotes it.
pub fn quoted(cell: &str) -> String {
    // In a remedy too, which may have lines of its own.
    match cell.char_indices().nth(QUOTED) {
        Some((end, _)) => format!("{}…", printable_line(&cell[..end])),
        None => printable_line(cell).into_owned(),
    }
}

/// Where cell `index` of `row` stands in the text. A row's position is where the reader began to
/// look for it, which may be the end of the line before.
pub fn cell_span(text: &TextFile, row: &StringRecord, index: usize) -> Range<usize> {
    let from = row.position().map_or(0, |position| position.byte() as usize);
    let text = text.text();
    let rest = &text[from.min(text.len())..];
    let first = text.len() - rest.trim_start_matches(['\r', '\n']).len();
    let (mut start, mut cell, mut in_quotes) = (first, 0, false);
    for (at, byte) in text.bytes().enumerate().skip(first) {
        match byte {
            b'"' => in_quotes = !in_quotes,
            b',' if !in_quotes && cell < index => {
                cell += 1;
                start = at + 1;
            }
            b',' if !in_quotes => return start..at,
            // Also inside quotes: a label over the rest of the file would show nothing.
            b'\n' | b'\r' => return start..at,
            _ => {}
        }
    }
    start..text.len()
}
