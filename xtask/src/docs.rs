//! Pages that are written by the code that they are about, and by the commands that they show.

use crate::board;
use crate::run::{Result, cargo, run};

/// Writes what follows from the descriptions of the boards; and the simulated samples, the catalog of effects, the pages of the
/// commands, the header of the C interface, what the commands in all pages print, and their figures: the tests that compare them write
/// them instead.
pub fn write() -> Result {
    board::write()?;
    // Of the whole workspace, as the tests are: of one package alone the crates have other features, and all would be compiled anew.
    let written = |test: &str, filter: &str| {
        let arguments = ["test", "--quiet", "--workspace", "--test", test, "--locked", "--", filter];
        run(cargo(&arguments).env("ROTORLEAD_UPDATE_PAGES", "1"))
    };
    // These are tests of the program's own package, which builds it: the next show what it prints.
    written("samples", "")?;
    written("pages", "")?;
    written("header", "")?;
    written("cli", "docs::")
}
