//! The table in `docs/firmware.md` that says which scenario is proven where: written by the tests, and held by them.

use std::sync::{Mutex, PoisonError};

use super::{Miss, Proof};

/// A column of the table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Column {
    /// The library on a board in memory.
    Mocks,
    /// The STM32F405's image in QEMU.
    Stm32,
    /// The RP2040's image in rp2040js.
    Rp2040js,
    /// The RP2040's image in rp2040-emu.
    Rp2040Emu,
}

/// Rows of what belongs to a board and not to the library: tests of their own hold them.
pub const WATCHDOG: &str = "the control task stops: reset with the outputs low";
/// See [`WATCHDOG`].
pub const PANIC: &str = "a panic: outputs low, a restart, and `info` names it";
/// See [`WATCHDOG`].
pub const POWER_CUT: &str = "power is cut while settings are saved: the old or the new";
/// All of them.
pub const OF_BOARDS: [&str; 3] = [WATCHDOG, PANIC, POWER_CUT];

const PAGE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/firmware.md");
const BEGIN: &str = "<!-- scenarios: `cargo xtask test-image --update-page` writes the cells of what follows -->";
const END: &str = "<!-- end of the scenarios -->";
/// How far figures of the page may be off.
const TOLERANCE: f64 = 0.05;
/// Set, the tests write the page instead of holding it.
const UPDATE: &str = "ROTORLEAD_UPDATE_PAGES";

static PAGE_LOCK: Mutex<()> = Mutex::new(());

/// Holds a cell of the page to what a test has come to, or writes it.
///
/// # Panics
/// Where the scenario has failed, or the page says something else.
pub fn hold(row: &str, column: Column, proof: &Proof) {
    let found = match proof {
        Ok(figure) => figure.clone(),
        Err(Miss::Cannot(what)) => format!("cannot: {what}"),
        Err(Miss::Wrong(what)) => panic!("{row}, {column:?}: {what}"),
    };
    println!("{row}, {column:?}: {found}");
    let _guard = PAGE_LOCK.lock().unwrap_or_else(PoisonError::into_inner);
    let mut table = Table::read();
    let written = table.cell(row, column);
    if std::env::var_os(UPDATE).is_some() {
        *written = found;
        table.write();
        return;
    }
    assert!(
        is_near(written, &found),
        "docs/firmware.md says {written:?} of {row:?}, {column:?}, and not {found:?}; \
         `cargo xtask test-image --update-page` writes what the tests give"
    );
}

/// Holds the cells of the targets that lack something.
///
/// # Panics
/// As [`hold`].
pub fn hold_cannot(row: &str, cells: &[(Column, &'static str)]) {
    for &(column, what) in cells {
        hold(row, column, &Err(Miss::Cannot(what)));
    }
}

/// The names of the page's rows, in order.
///
/// # Panics
/// Where the page cannot be read.
#[must_use]
pub fn rows() -> Vec<String> {
    let _guard = PAGE_LOCK.lock().unwrap_or_else(PoisonError::into_inner);
    Table::read().rows.into_iter().map(|[name, ..]| name).collect()
}

/// The page, cut at its table.
struct Table {
    before: String,
    rows: Vec<[String; 5]>,
    after: String,
}

impl Table {
    fn read() -> Self {
        let page = std::fs::read_to_string(PAGE).unwrap_or_else(|error| panic!("{PAGE}: {error}"));
        Self::parse(&page).unwrap_or_else(|| panic!("docs/firmware.md has no table between {BEGIN} and {END}"))
    }

    fn parse(page: &str) -> Option<Self> {
        let (begin, end) = (page.find(BEGIN)? + BEGIN.len(), page.find(END)?);
        let mut lines = page.get(begin..end)?.lines().skip_while(|line| !line.starts_with("|"));
        let head: Vec<&str> = lines.by_ref().take(2).collect();
        let rows = lines.take_while(|line| line.starts_with("|")).map(|line| {
            let cells: Vec<String> = line.trim_matches('|').split('|').map(|cell| cell.trim().to_owned()).collect();
            cells.try_into().ok()
        });
        let rows = rows.collect::<Option<Vec<_>>>()?;
        let before = format!("{}\n\n{}\n", &page[..begin], head.join("\n"));
        Some(Self { before, rows, after: format!("\n{}", &page[end..]) })
    }

    fn cell(&mut self, row: &str, column: Column) -> &mut String {
        let cells = self.rows.iter_mut().find(|cells| cells[0] == row);
        &mut cells.unwrap_or_else(|| panic!("docs/firmware.md has no row for: {row}"))[1 + column as usize]
    }

    fn page(&self) -> String {
        let rows = self.rows.iter().map(|cells| format!("| {} |\n", cells.join(" | ")));
        [self.before.clone(), rows.collect(), self.after.clone()].concat()
    }

    fn write(&self) {
        std::fs::write(PAGE, self.page()).unwrap_or_else(|error| panic!("{PAGE}: {error}"));
    }
}

/// Whether two cells have the same words, and figures that are near.
fn is_near(written: &str, found: &str) -> bool {
    let (written, found): (Vec<&str>, Vec<&str>) = (words(written), words(found));
    written.len() == found.len()
        && written.iter().zip(found).all(|(written, found)| match (written.parse::<f64>(), found.parse::<f64>()) {
            (Ok(written), Ok(found)) => (written - found).abs() <= TOLERANCE * found.abs(),
            _ => *written == found,
        })
}

fn words(cell: &str) -> Vec<&str> {
    cell.split([' ', ',', ';']).filter(|word| !word.is_empty()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_is_written_as_it_was_read_but_for_one_cell() {
        let page =
            format!("a\n{BEGIN}\n\n| s | a | b | c | d |\n|---|---|---|---|---|\n| x | 1 | 2 | 3 | 4 |\n\n{END}\nb\n");
        let mut table = Table::parse(&page).unwrap();
        assert_eq!(table.page(), page);
        "yes".clone_into(table.cell("x", Column::Rp2040js));
        assert_eq!(table.page(), page.replace("| 3 |", "| yes |"));
    }

    #[test]
    fn figures_are_held_to_a_twentieth_and_words_to_the_letter() {
        for (written, is_held) in [
            ("100 us, 20 at most", true),
            ("104 us, 20 at most", true),
            ("106 us, 20 at most", false),
            ("100 us", false),
        ] {
            assert_eq!(is_near(written, "100 us, 20 at most"), is_held, "{written}");
        }
        assert!(!is_near("cannot: no pins", "cannot: no inputs"));
        assert!(!is_near("", "yes"));
    }
}
