//! What a board's page says of its image's size, held against what a build measures.

use std::fs;

use crate::board::Board;
use crate::run::{Result, root};

/// How the line begins that has the figures.
const BEGIN: &str = "The image takes at most ";

/// What the image takes, bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sizes {
    pub flash: u64,
    pub ram: u64,
    /// Deepest stack.
    pub stack: u64,
}

/// An error where the page states less than the image takes.
pub fn check(board: &Board, sizes: Sizes) -> Result {
    let page = &board.pages.sizes;
    let line_of = |text: &str| text.lines().find(|line| line.starts_with(BEGIN)).and_then(stated);
    let stated = line_of(&read(page)?).ok_or_else(|| format!("{page} has no line with {BEGIN:?}"))?;
    let parts = [("flash", sizes.flash), ("RAM", sizes.ram), ("stack", sizes.stack)];
    for ((name, bytes), stated_kib) in parts.into_iter().zip(stated) {
        if bytes.div_ceil(1024) > stated_kib {
            return Err(format!(
                "the image takes {bytes} bytes of {name}, and {page} says {stated_kib} KiB: \
                 `cargo xtask build --update-readme` corrects it"
            ));
        }
    }
    Ok(())
}

/// Writes what was measured into the page.
pub fn update(board: &Board, sizes: Sizes) -> Result {
    let lines: Vec<_> = read(&board.pages.sizes)?
        .lines()
        .map(|line| if line.starts_with(BEGIN) { sentence(sizes) } else { line.to_owned() })
        .collect();
    let path = root().join(&board.pages.sizes);
    fs::write(&path, lines.join("\n") + "\n").map_err(|error| format!("{}: {error}", path.display()))?;
    check(board, sizes)
}

fn read(page: &str) -> Result<String> {
    let path = root().join(page);
    fs::read_to_string(&path).map_err(|error| format!("{}: {error}", path.display()))
}

fn sentence(sizes: Sizes) -> String {
    let [flash, ram, stack] = [sizes.flash, sizes.ram, sizes.stack].map(|bytes| bytes.div_ceil(1024));
    format!("{BEGIN}{flash} KiB of flash, {ram} KiB of RAM and {stack} KiB of stack.")
}

/// The three numbers of the sentence.
fn stated(line: &str) -> Option<[u64; 3]> {
    let numbers: Vec<u64> = line.split(' ').filter_map(|word| word.parse().ok()).collect();
    numbers.try_into().ok()
}

#[cfg(test)]
mod tests {
    use super::{Sizes, sentence, stated};

    #[test]
    fn what_is_written_is_what_is_read() {
        let sizes = Sizes { flash: 91_812, ram: 31_880, stack: 8192 };
        assert_eq!(sentence(sizes), "The image takes at most 90 KiB of flash, 32 KiB of RAM and 8 KiB of stack.");
        assert_eq!(stated(&sentence(sizes)), Some([90, 32, 8]));
        assert_eq!(stated("The image takes at most 90 KiB of flash."), None);
    }
}
