//! A table for a terminal: aligned columns, numbers to the right and words to the left.

use rotorlead_records::files::printable_line;
use textwrap::core::display_width;
use textwrap::{Options, WordSeparator, WordSplitter};

use super::Table;
use crate::words::width;

/// What each line begins with.
const INDENT: usize = 2;
/// Between two columns; one where there is no room for more.
const GAPS: [usize; 2] = [2, 1];
/// A blank at which no line is broken.
const NO_BREAK: &str = "\u{a0}";
/// Words are not broken into lines narrower than this for the sake of another column.
const NARROWEST: usize = 16;

/// Text in lines of at most `width`; a longer word is broken.
fn lines(text: &str, width: usize) -> Vec<String> {
    let options =
        Options::new(width.max(1)).word_splitter(WordSplitter::NoHyphenation).word_separator(WordSeparator::AsciiSpace);
    textwrap::wrap(text, options).into_iter().map(|line| line.replace(NO_BREAK, " ")).collect()
}

/// The least width of a heading in at most so many lines.
fn narrowest(heading: &str, most: usize) -> usize {
    let longest_word = heading.split(' ').map(display_width).max().unwrap_or(0);
    (longest_word..display_width(heading))
        .find(|width| lines(heading, *width).len() <= most)
        .unwrap_or_else(|| display_width(heading))
}

impl Table {
    /// The caption, the table without the columns that are detail, and the notes, no wider than
    /// [`width`]. Headings are broken where the columns would be too wide for a line, then
    /// the widest words are; a table that is too wide even so goes on below, with its first column again.
    #[must_use]
    pub fn text(&self) -> String {
        let mut text: String = lines(&self.caption, width()).iter().map(|line| format!("{line}\n")).collect();
        let mut rest: Vec<usize> = (0..self.columns.len())
            .filter(|column| !self.columns[*column].is_detail && self.is_known(column))
            .collect();
        while !rest.is_empty() {
            let least = rest.len().min(2);
            let fitting = (least..=rest.len()).rev().find_map(|taken| Some((taken, self.layout(&rest[..taken])?)));
            let (taken, (gap, widths)) =
                fitting.unwrap_or_else(|| (least, (GAPS[0], vec![width() / least - GAPS[0]; least])));
            self.write(&rest[..taken], gap, &widths, &mut text);
            rest.drain(..taken);
            if !rest.is_empty() {
                rest.insert(0, 0);
                text.push('\n');
            }
        }
        for note in &self.notes {
            text.extend(lines(note, width() - INDENT).iter().map(|line| format!("{:INDENT$}{line}\n", "")));
        }
        text
    }

    /// Heading and unit, which stays in one piece.
    fn heading(&self, column: usize) -> String {
        let column = &self.columns[column];
        let unit = if column.unit.is_empty() { String::new() } else { format!("({})", column.unit) };
        format!("{} {}", column.heading, unit.replace(' ', NO_BREAK)).trim().to_owned()
    }

    /// What a cell shows, in the characters of a plain terminal.
    fn shown(&self, row: usize, column: usize) -> String {
        printable_line(&self.rows[row][column].text).replace('±', "+-")
    }

    /// Width of the widest cell.
    fn widest(&self, column: usize) -> usize {
        (0..self.rows.len()).map(|row| display_width(&self.shown(row, column))).max().unwrap_or(0)
    }

    /// Gap and widths of columns that stand side by side, with headings of as few lines as will do; `None` where there is no room
    /// for them.
    fn layout(&self, columns: &[usize]) -> Option<(usize, Vec<usize>)> {
        let room = |gap: usize| (width() - INDENT).saturating_sub(gap * (columns.len() - 1));
        let headings: Vec<String> = columns.iter().map(|column| self.heading(*column)).collect();
        let most = headings.iter().map(|heading| heading.split(' ').count()).max()?;
        let with_headings_in = |most: usize| -> Vec<usize> {
            let each = columns.iter().zip(&headings);
            each.map(|(column, heading)| self.widest(*column).max(narrowest(heading, most))).collect()
        };
        for gap in GAPS {
            let fits = |widths: &Vec<usize>| widths.iter().sum::<usize>() <= room(gap);
            if let Some(widths) = (1..=most).map(with_headings_in).find(fits) {
                return Some((gap, widths));
            }
        }
        let mut widths = with_headings_in(most);
        let least: Vec<usize> = headings.iter().map(|heading| narrowest(heading, most).max(NARROWEST)).collect();
        loop {
            let excess = widths.iter().sum::<usize>().saturating_sub(room(GAPS[0]));
            if excess == 0 {
                return Some((GAPS[0], widths));
            }
            let words = (0..columns.len()).filter(|index| !self.is_number(&columns[*index]));
            let widest = words.filter(|index| widths[*index] > least[*index]).max_by_key(|index| widths[*index])?;
            widths[widest] = widths[widest].saturating_sub(excess).max(least[widest]);
        }
    }

    /// Writes columns side by side below their headings, which end on one line.
    fn write(&self, columns: &[usize], gap: usize, widths: &[usize], text: &mut String) {
        let header: Vec<String> = columns.iter().map(|column| self.heading(*column)).collect();
        let rows = (0..self.rows.len()).map(|row| columns.iter().map(|column| self.shown(row, *column)).collect());
        for (index, row) in std::iter::once(header).chain(rows).enumerate() {
            let broken: Vec<Vec<String>> = row.iter().zip(widths).map(|(cell, width)| lines(cell, *width)).collect();
            let height = broken.iter().map(Vec::len).max().unwrap_or(0);
            for line in 0..height {
                let mut written = String::new();
                for ((column, width), cell) in columns.iter().zip(widths).zip(&broken) {
                    let above = if index == 0 { height - cell.len() } else { 0 };
                    let part = line.checked_sub(above).and_then(|line| cell.get(line)).map_or("", String::as_str);
                    let space = " ".repeat(width.saturating_sub(display_width(part)));
                    let gap = " ".repeat(if written.is_empty() { INDENT } else { gap });
                    written += &if self.is_number(column) { gap + &space + part } else { gap + part + &space };
                }
                text.push_str(written.trim_end());
                text.push('\n');
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::table::{Cell, Column, Table};

    fn table(columns: Vec<Column>, rows: Vec<Vec<Cell>>) -> String {
        Table { name: "t".to_owned(), caption: "Fit".to_owned(), columns, rows, ..Table::default() }.text()
    }

    #[test]
    fn numbers_stand_to_the_right_and_words_to_the_left() {
        let columns = vec![
            Column::new("u_nom", "u_nom", "duty"),
            Column::new("file", "record", ""),
            Column::new("gain", "gain", "N"),
        ];
        let rows = vec![
            vec![Cell::number(0.4, 3), Cell::text("a.csv"), Cell::shown(7.0, "7.00 ± 0.02".to_owned())],
            vec![Cell::number(0.45, 3), Cell::text("long.csv"), Cell::text("-")],
        ];
        let shown = "\
Fit
  u_nom (duty)  record        gain (N)
         0.400  a.csv     7.00 +- 0.02
         0.450  long.csv             -
";
        assert_eq!(table(columns, rows), shown);
    }

    #[test]
    fn a_name_with_a_line_break_is_one_line() {
        let shown = table(vec![Column::new("file", "record", "")], vec![vec![Cell::text("a\nerror: b\tc")]]);
        assert_eq!(shown, "Fit\n  record\n  a␊error: b␉c\n");
    }

    #[test]
    fn headings_are_broken_before_anything_else() {
        let columns: Vec<Column> = (0..8).map(|_| Column::new("k", "with compensator", "rad/s")).collect();
        let shown = table(columns, vec![vec![Cell::number(1.0, 4); 8]; 2]);
        let lines: Vec<&str> = shown.lines().collect();
        assert!(lines[1].trim_start().starts_with("with  "), "{shown}");
        assert!(lines.iter().all(|line| line.len() <= 80), "{shown}");
    }

    #[test]
    fn nothing_is_dropped_of_a_table_that_is_too_wide() {
        let columns: Vec<Column> = (0..12).map(|_| Column::new("k", "time_constant", "ms")).collect();
        let cells: Vec<Cell> = (0..12).map(|k| Cell::number(1e6 + f64::from(k), 2)).collect();
        let shown = table(columns, vec![cells]);
        assert!(shown.lines().all(|line| line.len() <= 80), "{shown}");
        assert!((0..12).all(|k| shown.contains(&format!("{:.2}", 1e6 + f64::from(k)))), "{shown}");
        let long = vec![Cell::text("why not ".repeat(30).trim()), Cell::text("x".repeat(100)), Cell::number(1.0, 1)];
        let columns = vec![Column::new("a", "reason", ""), Column::new("b", "file", ""), Column::new("c", "c", "")];
        let shown = table(columns, vec![long]);
        assert_eq!((shown.matches("why").count(), shown.matches('x').count()), (30, 100), "{shown}");
        assert!(shown.lines().all(|line| line.len() <= 80), "{shown}");
    }
}
