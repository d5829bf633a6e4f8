//! Writes what the code says of itself into the pages: `cargo run -p rotorlead-sim --example pages -- docs`, which is a part
//! of what `cargo xtask docs` does. The catalog of effects goes into `diagnosis.md`, the help of the commands into `commands/`.

use std::fs;
use std::path::Path;

use miette::{IntoDiagnostic as _, WrapErr as _, miette};
use rotorlead_sim::command::help_pages;
use rotorlead_sim::plant::Catalog;
use rotorlead_sim::report::{catalog_markdown, with_catalog};

fn main() -> miette::Result<()> {
    let docs = std::env::args().nth(1).ok_or_else(|| miette!("usage: pages FOLDER"))?;
    let docs = Path::new(&docs);

    let page = docs.join("diagnosis.md");
    let text = fs::read_to_string(&page).into_diagnostic().wrap_err_with(|| page.display().to_string())?;
    let written = with_catalog(&text, &catalog_markdown(&Catalog::standard()))
        .ok_or_else(|| miette!("{} has no marks for the catalog", page.display()))?;
    fs::write(&page, written).into_diagnostic()?;

    let folder = docs.join("commands");
    if folder.is_dir() {
        // A command that is gone takes its page with it.
        fs::remove_dir_all(&folder).into_diagnostic()?;
    }
    fs::create_dir_all(&folder).into_diagnostic()?;
    for page in help_pages() {
        fs::write(folder.join(page.file), page.text).into_diagnostic()?;
    }
    Ok(())
}
