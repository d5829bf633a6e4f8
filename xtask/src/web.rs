//! The web page: the host side as WebAssembly, with what a page of it takes.

use std::fs;
use std::path::{Path, PathBuf};

use wasm_bindgen_cli_support::Bindgen;

use crate::run::{Result, root, run, target_folder};
use crate::setup;

/// What a browser runs.
pub const TARGET: &str = "wasm32-unknown-unknown";
/// Cargo's profile of it, its package, and that as a file.
const PROFILE: &str = "web";
const PACKAGE: &str = "rotorlead-web";
const BUILT: &str = "rotorlead_web.wasm";
/// The modules that a page loads, and their features: one is for every browser, the other waits for a box.
const MODULES: [(&str, &str); 2] = [("rotorlead_web", ""), ("rotorlead_device", "device")];

/// The page's own files, and the folder that has them.
const PAGE: &str = "sim/web/page";
/// What it shares with the one-file report, and its example, by the names that the page has for them.
const SHARED: [(&str, &str); 4] = [
    ("sim/report/templates/report.css", "report.css"),
    ("sim/report/templates/figures.js", "figures.js"),
    ("sim/report/vendor/plotly/plotly-cartesian.min.js", "plotly.js"),
    ("sim/report/vendor/plotly/LICENSE", "plotly-license.txt"),
];

/// Builds the page, and says where it is and how much a browser loads.
pub fn build() -> Result {
    let folder = build_page()?;
    println!("{}", folder.display());
    Ok(())
}

/// Builds the page, and gives its folder.
pub fn build_page() -> Result<PathBuf> {
    let toolchain = setup::toolchain(TARGET)?;
    let folder = target_folder().join("web");
    let failed = |error: std::io::Error| format!("{}: {error}", folder.display());
    if folder.exists() {
        fs::remove_dir_all(&folder).map_err(failed)?;
    }
    fs::create_dir_all(&folder).map_err(failed)?;
    let built = toolchain.folder().join(PROFILE).join(BUILT);
    for (module, features) in MODULES {
        let package =
            ["build", "--locked", "--package", PACKAGE, "--lib", "--profile", PROFILE, "--features", features];
        run(&mut toolchain.cargo(&package))?;
        let mut bindings = Bindgen::new();
        let bound = bindings.input_path(&built).out_name(module).typescript(false).web(true);
        let bound = bound.and_then(|bindings| bindings.generate(&folder));
        bound.map_err(|error| format!("{}: {error:#}", built.display()))?;
    }
    for entry in fs::read_dir(root().join(PAGE)).map_err(failed)? {
        let entry = entry.map_err(failed)?;
        copy(&entry.path(), &folder.join(entry.file_name()))?;
    }
    for (from, to) in SHARED {
        copy(&root().join(from), &folder.join(to))?;
    }
    Ok(folder)
}

fn copy(from: &Path, to: &Path) -> Result {
    fs::copy(from, to).map(drop).map_err(|error| format!("{}: {error}", from.display()))
}
