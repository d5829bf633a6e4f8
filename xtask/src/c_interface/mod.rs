//! The C interface for the cores of flight controllers: its size, its stack, its cost, and that it gives the library's bits
//! there. What the page says of these is held to what is measured.

mod archive;
mod emulated;

use crate::run::{Result, root};
use archive::{Bytes, CORES};

const PAGE: &str = "docs/c-interface.md";

/// Builds the archives and prints what a firmware takes of them.
pub fn build() -> Result {
    let tables = archive::measure()?;
    let rows = tables.iter().flatten().map(Bytes::row).collect();
    hold(rows)
}

/// Runs the archives in the emulator: compares their outputs with the library's, and counts their instructions.
pub fn bench() -> Result {
    let mut rows = Vec::new();
    for core in &CORES {
        rows.extend(emulated::measure(core)?);
    }
    hold(rows)
}

impl Bytes {
    fn row(&self) -> String {
        let bytes: Vec<String> = self.on_cores.iter().map(ToString::to_string).collect();
        format!("| {} | {} |", self.of, bytes.join(" | "))
    }
}

/// Prints the rows of the page's tables, and fails where the page has others.
fn hold(rows: Vec<String>) -> Result {
    let page = std::fs::read_to_string(root().join(PAGE)).map_err(|error| format!("{PAGE}: {error}"))?;
    for row in &rows {
        println!("{row}");
    }
    let missed: Vec<&str> = rows.iter().filter(|row| !is_stated(&page, row)).map(String::as_str).collect();
    if missed.is_empty() { Ok(()) } else { Err(format!("{PAGE} does not state:\n{}", missed.join("\n"))) }
}

/// Whether a row stands in the page with numbers that are no smaller, and by a tenth and 64 at most larger: another compiler
/// makes other code.
fn is_stated(page: &str, row: &str) -> bool {
    let parts =
        |row: &str| -> Vec<String> { row.trim_matches('|').split('|').map(|part| part.trim().to_owned()).collect() };
    let wanted = parts(row);
    page.lines().filter(|line| line.starts_with('|')).map(parts).any(|stated| {
        let alike = |(stated, wanted): (&String, &String)| match (stated.parse::<u64>(), wanted.parse::<u64>()) {
            (Ok(stated), Ok(wanted)) => (wanted..=wanted + wanted / 10 + 64).contains(&stated),
            _ => stated == wanted,
        };
        stated.len() == wanted.len() && stated.iter().zip(&wanted).all(alike)
    })
}

#[cfg(test)]
mod tests {
    use super::is_stated;

    #[test]
    fn a_page_may_state_a_little_more_and_nothing_less() {
        let page = "| use | M4F | M7 |\n|---|---|---|\n| a step | 2000 | 2100 |\n";
        assert!(is_stated(page, "| a step | 2000 | 2100 |") && is_stated(page, "| a step | 1800 | 2050 |"));
        for other in
            ["| a step | 2001 | 2100 |", "| a step | 2000 | 1800 |", "| a reset | 2000 | 2100 |", "| a step | 2000 |"]
        {
            assert!(!is_stated(page, other), "{other}");
        }
    }
}
