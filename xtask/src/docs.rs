//! Pages that are written by the code that they are about, and by the commands that they show.

use crate::run::{Result, cargo, run};

/// Where the pages are.
const FOLDER: &str = "docs";

/// Writes the catalog of effects and the pages of the commands, then what the commands in all pages print, and their figures.
pub fn write() -> Result {
    run(&mut cargo(&["run", "--quiet", "--package", "rotorlead-sim", "--example", "pages", "--locked", "--", FOLDER]))?;
    let pages = ["test", "--quiet", "--package", "host-tests", "--test", "cli", "--locked", "--", "docs::"];
    run(cargo(&pages).env("ROTORLEAD_UPDATE_PAGES", "1"))
}
