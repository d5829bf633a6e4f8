//! Pages that are written by the code that they are about, and by the commands that they show.

use crate::run::{Result, cargo, run};

/// Writes the catalog of effects, the pages of the commands, what the commands in all pages print, and their figures: the
/// tests that compare them write them instead.
pub fn write() -> Result {
    let written = |package: &str, test: &str, filter: &str| {
        let arguments = ["test", "--quiet", "--package", package, "--test", test, "--locked", "--", filter];
        run(cargo(&arguments).env("ROTORLEAD_UPDATE_PAGES", "1"))
    };
    written("rotorlead-sim", "pages", "")?;
    // The program whose output is shown.
    run(&mut cargo(&["build", "--package", "rotorlead-sim", "--bin", "rotorlead", "--locked"]))?;
    written("host-tests", "cli", "docs::")
}
