//! The documentation as a site: the pages that `docs/SUMMARY.md` names, built by mdbook, and checked as they were built.

mod site;
mod source;

use std::fs;
use std::path::PathBuf;

pub use source::resolved;

use crate::run::{Result, remove, root, target_folder};
use crate::setup;

/// Builds the site into `book` in cargo's target folder, and gives that. Where a page or a link is wrong, the last site stays.
pub fn build() -> Result<PathBuf> {
    let folder = target_folder().join("book-build");
    remove(&folder)?;
    source::gather(root(), &folder)?;
    let mut mdbook = setup::python_tool("mdbook", &["build"])?;
    // Of its log the warnings alone: it succeeds in spite of them.
    let output = mdbook.arg(&folder).env("MDBOOK_LOG", "warn").output().map_err(|error| format!("mdbook: {error}"))?;
    let printed = String::from_utf8_lossy(&output.stderr);
    if !output.status.success() || !printed.trim().is_empty() {
        return Err(format!("mdbook ended with {}, and warns:\n{printed}", output.status));
    }
    let built = folder.join("book");
    let pages = site::check(&built)?;
    let site = target_folder().join("book");
    remove(&site)?;
    fs::rename(&built, &site).map_err(|error| format!("{}: {error}", site.display()))?;
    println!("{pages} pages: {}", site.join("index.html").display());
    Ok(site)
}
