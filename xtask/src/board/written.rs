//! What is written from the description of a board: its constants in code, its memory map, and the tables of its pages.

use std::fs;
use std::path::{Path, PathBuf};

use super::{Board, FILE, Interrupt, Pin, all};
use crate::firmware::PROBE_OPTIONS;
use crate::run::{Result, root};

/// What every board does below its interrupts, as their row of the table.
const IDLE: [&str; 4] = ["none", "idle", "messages, settings, design of the filter", "20 s"];

/// What is written into a file, whole or between two lines that mark a part.
struct Written {
    path: PathBuf,
    /// The description of the board, from the root on, and the name of the part, where it is one.
    part: Option<(String, &'static str)>,
    text: String,
}

impl Written {
    /// The whole content that the file is to have.
    fn content(&self) -> Result<String> {
        let Some((description, part)) = &self.part else { return Ok(self.text.clone()) };
        let (begin, end) = (format!("{description}: {part};"), format!("end of {description}: {part}"));
        let file = read(&self.path)?;
        replaced(&file, &begin, &end, &self.text).ok_or_else(|| {
            format!("{} has no line with `{begin}`, or none with `{end}` behind it", self.path.display())
        })
    }
}

/// Writes what is not up to date of all that follows from the descriptions of the boards.
pub fn write() -> Result {
    for written in all()?.iter().flat_map(files) {
        let (path, content) = (&written.path, written.content()?);
        if read(path).as_ref() != Ok(&content) {
            fs::write(path, content).map_err(|error| format!("{}: {error}", path.display()))?;
            println!("writes {}", path.display());
        }
    }
    Ok(())
}

fn read(path: &Path) -> Result<String> {
    fs::read_to_string(path).map_err(|error| format!("{}: {error}", path.display()))
}

/// A text with other lines between the line that has `begin` and the one that has `end`.
fn replaced(text: &str, begin: &str, end: &str, lines: &str) -> Option<String> {
    let begin = text.find(begin)?;
    let start = begin + text[begin..].find('\n')? + 1;
    let end = text[..start + text[start..].find(end)?].rfind('\n')? + 1;
    Some([&text[..start], lines, &text[end..]].concat())
}

/// Everything that follows from the description of a board.
fn files(board: &Board) -> Vec<Written> {
    let folder = root().join(&board.folder);
    let part = |path: PathBuf, name, text| {
        let description = format!("{}/{FILE}", board.folder);
        Written { path, part: Some((description, name)), text }
    };
    let mut files = vec![
        Written { path: board.sources().join("generated.rs"), part: None, text: code(board) },
        part(folder.join("board.x"), "memory", memory(board)),
        part(root().join(&board.pages.pins), "pins", pins(board)),
        part(root().join(&board.pages.interrupts), "interrupts", interrupts(board)),
    ];
    if let Some(chip) = board.probe_chip.as_ref().filter(|_| board.is_default) {
        files.push(part(root().join(".cargo/config.toml"), "runner", runner(board, chip)));
    }
    files
}

/// The module that has a board's constants.
fn code(board: &Board) -> String {
    let mut code = format!(
        "//! What `{FILE}` says, as constants. `cargo xtask boards` writes this file.\n\n\
         /// Name of the board.\n\
         pub const TITLE: &str = {:?};\n\n\
         /// First address of the flash.\n\
         pub const FLASH_START: u32 = {:#010x};\n\n\
         /// First address of the settings, behind the image.\n\
         pub const SETTINGS_START: u32 = {:#010x};\n\n\
         /// Bytes of the flash that belong to the settings.\n\
         pub const SETTINGS_BYTES: u32 = {:#x};\n\n\
         /// Pins: name, {}, what to connect, level.\n\
         pub const PINS: {}\n\
         /// Interrupts, highest priority first: priority, name, task, longest wait that is allowed.\n\
         pub const INTERRUPTS: {}",
        board.title,
        board.flash.start,
        board.flash.settings().start,
        board.flash.settings_bytes,
        board.pin_columns[1],
        array(&pin_rows(board)),
        array(&interrupt_rows(board)),
    );
    for pin in &board.pins {
        let Some(constant) = &pin.constant else { continue };
        let number = &pin.name[pin.name.trim_end_matches(|c: char| c.is_ascii_digit()).len()..];
        let item = board.pin_item.replace("{constant}", constant).replace("{name}", &pin.name);
        let item = item.replace("{number}", number);
        code += &format!("\n/// {}: {}.\n{item}\n", pin.name, pin.connect);
    }
    code
}

/// Type and value of a constant that has rows of strings.
fn array(rows: &[[String; 4]]) -> String {
    let lines: String = rows.iter().map(|row| format!("    {row:?},\n")).collect();
    format!("[[&str; 4]; {}] = [\n{lines}];\n", rows.len())
}

/// The regions of the memory map. The flash of the settings is none of them.
fn memory(board: &Board) -> String {
    let flash = &board.flash;
    let boot = (flash.boot_bytes > 0).then_some(("BOOT2", flash.start, flash.boot_bytes));
    let image = ("FLASH", flash.vectors(), flash.image_bytes - flash.boot_bytes);
    let others = board.memory.iter().map(|(name, region)| (name.as_str(), region.start, region.bytes));
    let lines = boot.into_iter().chain([image]).chain(others);
    let lines = lines.map(|(name, start, bytes)| format!("  {name} : ORIGIN = {start:#010x}, LENGTH = {bytes:#x}\n"));
    format!("MEMORY\n{{\n{}}}\n", lines.collect::<String>())
}

/// What cargo runs an image with: the debug probe, as `cargo xtask flash` does.
fn runner(board: &Board, chip: &str) -> String {
    let features = board.feature.as_ref().map_or_else(String::new, |feature| format!(" --features {feature}"));
    format!(
        "# `cargo run --profile firmware --package {}{features} --target {}` flashes and shows the\n\
         # log, as `cargo xtask flash` does.\n\
         [target.{}]\n\
         runner = \"probe-rs run --chip {chip} {}\"\n",
        board.package,
        board.target,
        board.target,
        PROBE_OPTIONS.join(" "),
    )
}

/// The table of pins in a page.
fn pins(board: &Board) -> String {
    let [names, functions] = &board.pin_columns;
    table([names, functions, "what to connect", "level"], &pin_rows(board))
}

/// The table of interrupts in a page.
fn interrupts(board: &Board) -> String {
    table(["priority", "interrupt", "task", "longest wait that is allowed"], &interrupt_rows(board))
}

fn pin_rows(board: &Board) -> Vec<[String; 4]> {
    let row = |pin: &Pin| [&pin.name, &pin.function, &pin.connect, &pin.level].map(String::clone);
    board.pins.iter().map(row).collect()
}

/// Those of the interrupts, and below them the idle task, which is the same on every board.
fn interrupt_rows(board: &Board) -> Vec<[String; 4]> {
    let row = |interrupt: &Interrupt| {
        let Interrupt { priority, name, task, wait } = interrupt;
        [priority.to_string(), name.clone(), task.clone(), wait.clone()]
    };
    board.interrupts.iter().map(row).chain([IDLE.map(str::to_owned)]).collect()
}

/// A table of Markdown, between empty lines.
fn table(heads: [&str; 4], rows: &[[String; 4]]) -> String {
    let lines: String = rows.iter().map(|row| format!("| {} |\n", row.join(" | "))).collect();
    format!("\n| {} |\n|---|---|---|---|\n{lines}\n", heads.join(" | "))
}

#[cfg(test)]
mod tests {
    use super::{all, files, read, replaced};

    #[test]
    fn what_follows_from_the_boards_is_up_to_date() {
        for written in all().unwrap().iter().flat_map(files) {
            let is_current = read(&written.path).unwrap() == written.content().unwrap();
            assert!(is_current, "`cargo xtask boards` brings {} up to date", written.path.display());
        }
    }

    #[test]
    fn lines_are_replaced_between_their_marks_alone() {
        let text = "a\n<!-- b: c; d -->\ne\n<!-- end of b: c -->\nf\n";
        let expected = text.replace("e\n<", "g\nh\n<");
        assert_eq!(replaced(text, "b: c;", "end of b: c", "g\nh\n").as_ref(), Some(&expected));
        assert_eq!(replaced(text, "b: d;", "end of b: c", "g\n"), None);
        assert_eq!(replaced(text, "b: c;", "end of b: d", "g\n"), None);
    }
}
