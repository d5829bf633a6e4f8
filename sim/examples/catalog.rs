//! Writes the catalog of effects into a page: `cargo run -p rotorlead-sim --example catalog -- docs/diagnosis.md`, which is
//! what `cargo xtask docs` does.

use std::path::Path;

use miette::{IntoDiagnostic as _, miette};
use rotorlead_sim::plant::Catalog;
use rotorlead_sim::report::{catalog_markdown, with_catalog};

fn main() -> miette::Result<()> {
    let page = std::env::args().nth(1).ok_or_else(|| miette!("usage: catalog PAGE"))?;
    let path = Path::new(&page);
    let text = std::fs::read_to_string(path).into_diagnostic()?;
    let written = with_catalog(&text, &catalog_markdown(&Catalog::standard()))
        .ok_or_else(|| miette!("{page} has no marks for the catalog"))?;
    std::fs::write(path, written).into_diagnostic()
}
