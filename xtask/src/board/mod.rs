//! The boards that the application runs on, as the `board.toml` in the folder of each describes them. `docs/boards.md` says how one is
//! added.

mod written;

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use serde::Deserialize;

use crate::image::flash_files::FlashMap;
use crate::run::{Result, root};

pub use written::write;

/// The description in a board's folder.
const FILE: &str = "board.toml";
/// The folder of the board that is a feature of the library's own package, and the folder that has one for each other board.
const OWN_FOLDER: &str = "src/board";
const FOLDERS: &str = "boards";
/// The region of a memory map that holds data.
const RAM: &str = "RAM";

/// One board, as its `board.toml` describes it.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Board {
    /// The folder of its `board.toml`, from the root on.
    #[serde(skip)]
    folder: String,
    /// What `--board` calls it.
    pub name: String,
    /// What a person calls it.
    title: String,
    /// Whether the tasks build for it where no board is named.
    #[serde(default)]
    is_default: bool,
    /// Package that has the board's code, its HAL and its memory map.
    pub package: String,
    /// Feature of that package that brings them, where it takes one.
    pub feature: Option<String>,
    /// Binary of that package that runs on it.
    pub binary: String,
    /// Rust's target of its core.
    pub target: String,
    /// What runs its image on a host.
    pub emulator: Option<Emulator>,
    /// What probe-rs calls the chip, where a debug probe flashes it.
    pub probe_chip: Option<String>,
    /// How the code declares a pin: with `{constant}`, the pin's `{name}`, and the `{number}` at the end of that.
    pin_item: String,
    /// Heads of the first two columns of the table of pins: names and functions.
    pin_columns: [String; 2],
    /// Every pin that the firmware uses, in the order in which a wiring table lists them.
    pins: Vec<Pin>,
    /// Interrupts of the application, highest priority first.
    interrupts: Vec<Interrupt>,
    /// Exceptions above all of them, which add to the deepest stack.
    #[serde(default)]
    pub exceptions_above: Vec<String>,
    /// What the core stores at an interrupt, and a word to align it.
    pub interrupt_frame_bytes: u32,
    /// The pages that state its facts.
    pub pages: Pages,
    /// Its flash.
    pub flash: FlashMap,
    /// The other regions of its memory map.
    memory: BTreeMap<String, Region>,
}

/// A program that runs a board's image on a host.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "lowercase")]
pub enum Emulator {
    /// QEMU, with the machine that [`emulator::Board`] has of the board's name.
    Qemu,
    /// rp2040js.
    Rp2040js,
}

/// A pin that the firmware uses.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Pin {
    /// As the chip's manual has it.
    name: String,
    /// What it is inside the chip, or on the board.
    #[serde(default)]
    function: String,
    /// What to connect there.
    connect: String,
    /// Voltage.
    level: String,
    /// What the board's code calls it, where it names it.
    constant: Option<String>,
}

/// An interrupt of the application. Each has a priority of its own.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Interrupt {
    priority: u8,
    /// As the vector table has it.
    name: String,
    /// What it does.
    task: String,
    /// The longest wait that is allowed.
    wait: String,
}

/// The pages that state facts of a board.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pages {
    /// What to connect to which pin.
    pins: String,
    /// Which interrupt goes first.
    interrupts: String,
    /// What the image takes.
    pub sizes: String,
}

/// A part of the address space.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Region {
    start: u32,
    bytes: u32,
}

impl Board {
    /// Reads the description in a folder, given from the root on.
    fn read(folder: &str) -> Result<Self> {
        let path = root().join(folder).join(FILE);
        let text = std::fs::read_to_string(&path).map_err(|error| format!("{}: {error}", path.display()))?;
        let board: Self = toml::from_str(&text).map_err(|error| format!("{}: {error}", path.display()))?;
        if !board.memory.contains_key(RAM) {
            return Err(format!("{}: [memory] has no region {RAM}", path.display()));
        }
        if !board.interrupts.is_sorted_by(|first, next| first.priority > next.priority) {
            return Err(format!(
                "{}: each interrupt must have a lower priority than the one before it",
                path.display()
            ));
        }
        Ok(Self { folder: folder.to_owned(), ..board })
    }

    /// Addresses of the RAM that holds data.
    pub fn ram(&self) -> Range<u32> {
        let Region { start, bytes } = self.memory[RAM];
        start..start + bytes
    }

    /// Interrupts of the application by their names in the vector table, highest priority first: those that must never panic.
    pub fn interrupts(&self) -> impl Iterator<Item = &str> {
        self.interrupts.iter().map(|interrupt| interrupt.name.as_str())
    }

    /// The folder of its sources.
    fn sources(&self) -> PathBuf {
        let folder = root().join(&self.folder);
        let sources = folder.join("src");
        if sources.is_dir() { sources } else { folder }
    }
}

/// Every board, the default one first.
///
/// # Errors
/// What is wrong with a description.
pub fn all() -> Result<&'static [Board]> {
    static BOARDS: LazyLock<Result<Vec<Board>>> = LazyLock::new(read_all);
    BOARDS.as_deref().map_err(Clone::clone)
}

/// The board of a name.
///
/// # Errors
/// The names that there are.
pub fn named(name: &str) -> Result<&'static Board> {
    all()?.iter().find(|board| board.name == name).ok_or_else(|| {
        let names: Vec<_> = all().into_iter().flatten().map(|board| board.name.as_str()).collect();
        format!("there is no board `{name}`: it may be {}", names.join(" or "))
    })
}

/// The board that the tasks build for where none is named.
///
/// # Errors
/// As [`all`].
pub fn default() -> Result<&'static Board> {
    all()?.first().ok_or_else(|| format!("no folder has a {FILE}"))
}

fn read_all() -> Result<Vec<Board>> {
    let mut folders = vec![OWN_FOLDER.to_owned()];
    let entries = std::fs::read_dir(root().join(FOLDERS)).map_err(|error| format!("{FOLDERS}: {error}"))?;
    for entry in entries {
        let path = entry.map_err(|error| format!("{FOLDERS}: {error}"))?.path();
        if path.join(FILE).is_file() {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            folders.push(Path::new(FOLDERS).join(&*name).to_string_lossy().into_owned());
        }
    }
    let mut boards = folders.iter().map(|folder| Board::read(folder)).collect::<Result<Vec<_>>>()?;
    boards.sort_by_key(|board| (!board.is_default, board.name.clone()));
    match boards.iter().filter(|board| board.is_default).count() {
        1 => Ok(boards),
        count => Err(format!("{count} boards are the default one: `is_default = true` must be in one {FILE}")),
    }
}

#[cfg(test)]
mod tests {
    /// `docs/boards.md`.
    const PAGE: &str = include_str!("../../../docs/boards.md");

    #[test]
    fn the_page_on_boards_names_every_method_that_a_board_must_give() {
        let traits = include_str!("../../../src/controller/hardware.rs");
        let methods = traits.lines().filter_map(|line| line.strip_prefix("    fn ")?.split('(').next());
        let methods: Vec<&str> = methods.collect();
        assert!(methods.len() > 15, "only {} methods were found", methods.len());
        for method in methods {
            assert!(PAGE.contains(&format!("`{method}`")), "docs/boards.md does not say what `{method}` does");
        }
    }

    #[test]
    fn the_page_on_boards_names_every_file_of_its_examples() {
        let is_example = |board: &&super::Board| PAGE.contains(&format!("`{}/`", board.folder));
        let examples: Vec<_> = super::all().unwrap().iter().filter(is_example).collect();
        assert!(!examples.is_empty(), "docs/boards.md names the folder of no board");
        for board in examples {
            for entry in std::fs::read_dir(board.sources()).unwrap() {
                let name = entry.unwrap().file_name().into_string().unwrap();
                assert!(PAGE.contains(&name), "docs/boards.md does not name {name} of {}", board.folder);
            }
        }
    }

    /// RTIC takes a priority as a literal alone, so that no constant of `generated.rs` can stand there.
    #[test]
    fn the_tasks_of_each_board_have_the_interrupts_and_priorities_of_its_description() {
        for board in super::all().unwrap() {
            let main =
                if board.sources().join("main.rs").is_file() { board.sources() } else { super::root().join("src") };
            let code = std::fs::read_to_string(main.join("main.rs")).unwrap();
            let bound: Vec<&str> =
                code.lines().filter_map(|line| line.trim().strip_prefix("#[task(binds = ")).collect();
            assert_eq!(bound.len(), board.interrupts.len(), "{}: {bound:?}", board.name);
            for interrupt in &board.interrupts {
                let described = format!("{}, priority = {}", interrupt.name, interrupt.priority);
                let is_it = |rest: &str| rest.starts_with([',', ')']);
                let is_bound = bound.iter().any(|task| task.strip_prefix(&*described).is_some_and(is_it));
                assert!(is_bound, "{}: no task binds {described}: {bound:?}", board.name);
            }
        }
    }

    #[test]
    fn a_board_that_is_not_there_is_refused_with_the_names_of_those_that_are() {
        let error = super::named("stm32f406").unwrap_err();
        assert!(super::all().unwrap().iter().all(|board| error.contains(&board.name)), "{error}");
    }
}
