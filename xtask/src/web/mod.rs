//! The web page: the host side as WebAssembly, with what a page of it takes.

mod packages;
mod test;

use std::fs;
use std::path::{Path, PathBuf};

use flate2::Crc;
use wasm_bindgen_cli_support::Bindgen;

use crate::run::{Result, beside, cargo, root, run, target_folder};
use crate::setup;

pub use packages::{NPM_PACKAGES, has_packages, install_packages};
pub use test::test;

/// What a browser runs.
pub const TARGET: &str = "wasm32-unknown-unknown";
/// Cargo's profile of it, which has a folder in cargo's beside the page's, and the name of its package as a file.
const PROFILE: &str = "wasm";
const MODULE: &str = "rotorlead_web";

/// The page's own files.
const PAGE: &str = "sim/web/page";
/// The list of all of them.
const FILES: &str = "files.js";
/// What it shares with the one-file report and the command line, by the names that the page has for them.
const SHARED: [(&str, &str); 5] = [
    ("sim/cli/samples/staircase.csv", "staircase.csv"),
    ("sim/report/templates/report.css", "report.css"),
    ("sim/report/templates/figures.js", "figures.js"),
    ("sim/report/vendor/plotly/plotly-cartesian.min.js", "plotly.js"),
    ("sim/report/vendor/plotly/LICENSE", "plotly-license.txt"),
];

/// Builds the page, and a program of cargo's release profile that serves it; says where both are.
pub fn build() -> Result {
    let folder = page()?;
    let program = program(&folder, &["--release"])?;
    println!("{}\n{}", folder.display(), program.display());
    Ok(())
}

/// Builds the page, and gives its folder.
pub fn page() -> Result<PathBuf> {
    let toolchain = setup::toolchain(TARGET)?;
    run(&mut toolchain.cargo(&["build", "--locked", "--package", "rotorlead-web", "--lib", "--profile", PROFILE]))?;
    let built = toolchain.folder().join(PROFILE).join(format!("{MODULE}.wasm"));
    let folder = target_folder().join("web");
    let failed = |error: std::io::Error| format!("{}: {error}", folder.display());
    if folder.exists() {
        fs::remove_dir_all(&folder).map_err(failed)?;
    }
    fs::create_dir_all(&folder).map_err(failed)?;
    let mut bindings = Bindgen::new();
    let bound = bindings
        .input_path(&built)
        .typescript(false)
        .web(true)
        .and_then(|bindings| bindings.remove_name_section(true).remove_producers_section(true).generate(&folder));
    bound.map_err(|error| format!("{}: {error:#}", built.display()))?;
    for entry in fs::read_dir(root().join(PAGE)).map_err(failed)? {
        let entry = entry.map_err(failed)?;
        copy(&entry.path(), &folder.join(entry.file_name()))?;
    }
    for (from, to) in SHARED {
        copy(&root().join(from), &folder.join(to))?;
    }
    fs::write(folder.join(FILES), kept_files(&folder).map_err(failed)?).map_err(failed)?;
    Ok(folder)
}

/// What `offline.js` keeps: the files of the page's folder, and a sum of them.
fn kept_files(folder: &Path) -> std::io::Result<String> {
    let mut names = Vec::new();
    for entry in fs::read_dir(folder)? {
        names.push(entry?.file_name().to_string_lossy().into_owned());
    }
    names.sort();
    let mut sum = Crc::new();
    for name in &names {
        sum.update(&fs::read(folder.join(name))?);
    }
    Ok(format!("const VERSION = \"{:08x}\";\nconst FILES = {names:?};\n", sum.sum()))
}

/// Builds a program that serves the page, beside the one without it.
fn program(page: &Path, profile: &[&str]) -> Result<PathBuf> {
    let mut build = cargo(&["build", "--locked", "--package", "rotorlead-cli", "--bin", "rotorlead"]);
    build.args(profile).env("ROTORLEAD_WEB", page);
    let folder = beside(&mut build, &target_folder());
    run(&mut build)?;
    Ok(folder.join(if profile.is_empty() { "debug" } else { "release" }).join("rotorlead"))
}

fn copy(from: &Path, to: &Path) -> Result {
    fs::copy(from, to).map(drop).map_err(|error| format!("{}: {error}", from.display()))
}
