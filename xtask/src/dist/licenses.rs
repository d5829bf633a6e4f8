//! The licenses of all that is linked, with their texts.

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;

use super::read;
use crate::packages;
use crate::run::{Result, cargo, output, root, run, target_folder};
use crate::tools::ABOUT;

/// Which licenses may be there: what `cargo xtask deny` holds dependencies to.
const ALLOWED: &str = "deny.toml";
/// How a license and those that are under it are written.
const TEMPLATE: &str = "xtask/src/dist/third_party.hbs";
/// A crate that holds a font, and the text of the font's license in it: the crate's own is another.
const FONT: (&str, &str) = ("notosans", "fonts/LICENSE_OFL.txt");
/// What reports and the page show figures with, which is no crate.
const PLOTTER: &str = "sim/report/vendor/plotly/LICENSE";

/// Texts of the licenses of all that a package of the workspace links on a target.
pub fn texts(package: &str, target: &str) -> Result<Vec<u8>> {
    let manifest = packages::manifest(package)?;
    let manifest = manifest["manifest_path"].as_str().unwrap_or_default();
    let work = target_folder().join("third-party");
    fs::create_dir_all(&work).map_err(|error| format!("{}: {error}", work.display()))?;
    let (config, text) = (work.join("about.toml"), work.join(format!("{package}-{target}.txt")));
    fs::write(&config, accepted()?).map_err(|error| format!("{}: {error}", config.display()))?;
    let mut about = ABOUT.call(&["about", "generate", "--fail", "--locked", "--offline", "--target", target]);
    about.args(["--manifest-path", manifest, "--config"]).arg(config).arg("--output-file").arg(&text).arg(TEMPLATE);
    run(&mut about)?;
    read(&text)
}

/// Texts of the licenses of what is in the program and is no code of a crate: the font, and what shows figures.
pub fn asset_texts() -> Result<Vec<u8>> {
    let (name, path) = FONT;
    let font = read(&crate_folder(name)?.join(path))?;
    let plotter = read(&root().join(PLOTTER))?;
    let title = |name: &str| format!("\n{}\n{name}\n\n", "=".repeat(80)).into_bytes();
    Ok([title("Noto Sans, the font of figures"), font, title("Plotly, which shows figures in a browser"), plotter]
        .concat())
}

/// The tool's settings, which take the allowed licenses from those of dependencies.
fn accepted() -> Result<String> {
    let text = String::from_utf8_lossy(&read(&root().join(ALLOWED))?).into_owned();
    let allowed: toml::Table = toml::from_str(&text).map_err(|error| format!("{ALLOWED}: {error}"))?;
    let licenses = &allowed["licenses"];
    let exceptions = licenses["exceptions"].as_array().into_iter().flatten();
    let lists = std::iter::once(licenses).chain(exceptions).filter_map(|entry| entry["allow"].as_array());
    let names: Vec<toml::Value> = lists.flatten().cloned().collect();
    let mut config = toml::Table::new();
    config.insert("accepted".to_owned(), names.into());
    for ignored in ["ignore-build-dependencies", "ignore-dev-dependencies"] {
        config.insert(ignored.to_owned(), true.into());
    }
    Ok(config.to_string())
}

/// Where cargo keeps a dependency.
fn crate_folder(name: &str) -> Result<PathBuf> {
    let text =
        output(&mut cargo(&["metadata", "--format-version", "1", "--locked"])).ok_or("`cargo metadata` fails")?;
    let metadata: Value = serde_json::from_str(&text).map_err(|error| format!("cargo metadata: {error}"))?;
    let all = metadata["packages"].as_array().into_iter().flatten();
    let found = all.filter(|manifest| packages::name(manifest) == name).find_map(packages::folder);
    found.map(Path::to_owned).ok_or_else(|| format!("nothing depends on {name}: what this looks for has changed"))
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_licenses_of_dependencies_are_accepted_and_those_of_exceptions() {
        let config: toml::Table = toml::from_str(&super::accepted().unwrap()).unwrap();
        let names: Vec<&str> = config["accepted"].as_array().unwrap().iter().filter_map(toml::Value::as_str).collect();
        for name in ["MIT", "Apache-2.0", "MPL-2.0"] {
            assert!(names.contains(&name), "{names:?}");
        }
    }
}
