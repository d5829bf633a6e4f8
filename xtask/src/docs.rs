//! Pages that are written by the code that they are about.

use crate::run::{Result, cargo, run};

/// The page with the catalog of effects.
const PAGE: &str = "docs/diagnosis.md";

/// Writes the catalog of effects into its page.
pub fn write() -> Result {
    run(&mut cargo(&["run", "--quiet", "--package", "rotorlead-sim", "--example", "catalog", "--locked", "--", PAGE]))
}
