//! The library as another firmware takes it: it brings no board, builds with features alone and for the smallest core, and makes a
//! complete package.

use std::collections::BTreeSet;

use serde_json::Value;

use crate::run::{Result, cargo, output, root, run};
use crate::{board, book, packages, setup};

/// The package.
const PACKAGE: &str = "rotorlead";
/// Features with which it is linted here, one at a time, beside those of its boards.
const LINTED: [&str; 2] = ["settings", "link"];
/// Those with which other checks build it: the workspace is linted with the first, the images of both cores are built with the first
/// two, and an image of each with the third.
const ELSEWHERE: [&str; 3] = ["controller", "systick", "planted-panic"];
/// Every package that the default features may bring.
const DEFAULT_PACKAGES: [&str; 5] = ["autocfg", "embedded-hal", "libm", "num-complex", "num-traits"];
/// Packages whose presence would ask something of a firmware: an implementation of locks or of atomics.
const LOCKS: [&str; 2] = ["critical-section", "portable-atomic"];
/// The feature for a kind of core, whose package names the first of these.
const OF_A_CORE: &str = "systick";
/// All of it.
pub fn check() -> Result {
    let manifest = packages::manifest(PACKAGE)?;
    links()?;
    let features = features(&manifest);
    let own = board::all()?.iter().filter(|board| board.package == PACKAGE);
    let boards: Vec<&str> = own.filter_map(|board| board.feature.as_deref()).collect();
    dependencies(&manifest, &features, &boards)?;
    let linted = LINTED.iter().chain(&boards);
    if let Some(new) = features.iter().find(|name| !linted.clone().chain(&ELSEWHERE).any(|known| known == name)) {
        return Err(format!("the feature {new} is checked nowhere: add it to `LINTED` in xtask/src/library.rs"));
    }
    for feature in [None].into_iter().chain(linted.copied().map(Some)) {
        let mut clippy = package("clippy", feature);
        run(clippy.args(["--all-targets", "--", "-D", "warnings"]))?;
    }
    // The filter alone, on the core that lacks most.
    run(&mut setup::toolchain(setup::SMALLEST_CORE)?.cargo(&["build", "--package", PACKAGE, "--lib", "--locked"]))?;
    // Builds what is in the archive, too. What that needs is here after the builds above.
    run(&mut cargo(&["package", "--package", PACKAGE, "--locked", "--offline", "--allow-dirty"]))
}

/// A command of cargo for the package on the host, with one feature or none.
fn package(command: &str, feature: Option<&str>) -> std::process::Command {
    let mut cargo = cargo(&[command, "--package", PACKAGE, "--locked", "--no-default-features"]);
    cargo.args(feature.map(|feature| format!("--features={feature}")));
    cargo
}

/// An error where a page in the package links to a file that is not. README.md stands on its own page of the registry, where
/// links lead to the repository.
fn links() -> Result {
    let mut list = cargo(&["package", "--package", PACKAGE, "--list", "--allow-dirty", "--locked", "--offline"]);
    let text = output(&mut list).ok_or("`cargo package --list` fails")?;
    let files: BTreeSet<&str> = text.lines().collect();
    for page in files.iter().filter(|file| file.ends_with(".md") && **file != "README.md") {
        let text = std::fs::read_to_string(root().join(page)).map_err(|error| format!("{page}: {error}"))?;
        if let Some(link) = relative_links(page, &text).into_iter().find(|link| !files.contains(link.as_str())) {
            return Err(format!(
                "{page} links to {link}, which is not in the package: add it to `include` in Cargo.toml"
            ));
        }
    }
    Ok(())
}

/// Files that a page links to, from the package's root.
fn relative_links(page: &str, text: &str) -> Vec<String> {
    let targets = text.split("](").skip(1).filter_map(|rest| rest.split([')', '#', ' ']).next());
    let relative = targets.filter(|target| !target.is_empty() && !target.contains("://"));
    relative.map(|target| book::resolved(page, target)).collect()
}

/// Every feature but the default.
fn features(manifest: &Value) -> Vec<String> {
    let all = manifest["features"].as_object().into_iter().flatten();
    all.map(|(name, _)| name.clone()).filter(|name| name != "default").collect()
}

/// An error where a package comes in that must not: with the default features any but [`DEFAULT_PACKAGES`], with another
/// feature one of a board's.
fn dependencies(manifest: &Value, features: &[String], boards: &[&str]) -> Result {
    let default = tree(None)?;
    let others: Vec<&str> =
        default.iter().map(String::as_str).filter(|name| !DEFAULT_PACKAGES.contains(name)).collect();
    if !others.is_empty() {
        return Err(format!("the default features bring {}", others.join(", ")));
    }
    println!("the default features bring {}", Vec::from_iter(default).join(", "));
    let is_board = |feature: &String| boards.contains(&feature.as_str());
    let of_boards: BTreeSet<String> =
        features.iter().filter(|feature| is_board(feature)).flat_map(|board| own_packages(manifest, board)).collect();
    if of_boards.is_empty() {
        return Err("no feature of a board brings a package: what this looks for has changed".to_owned());
    }
    for feature in features.iter().filter(|feature| !is_board(feature)) {
        let found = tree(Some(feature))?;
        let locks = LOCKS.into_iter().filter(|_| feature != OF_A_CORE);
        let wrong: Vec<&str> =
            of_boards.iter().map(String::as_str).chain(locks).filter(|name| found.contains(*name)).collect();
        if !wrong.is_empty() {
            return Err(format!("the feature {feature} brings {}", wrong.join(", ")));
        }
        println!("the feature {feature} brings {} packages, and none of a board", found.len());
    }
    Ok(())
}

/// Packages that a feature switches on by itself.
fn own_packages(manifest: &Value, feature: &str) -> Vec<String> {
    let entries = manifest["features"][feature].as_array().into_iter().flatten();
    entries.filter_map(|entry| Some(entry.as_str()?.strip_prefix("dep:")?.to_owned())).collect()
}

/// Every package that comes in on any target, with the default features and one more. Those that only run in builds count.
fn tree(feature: Option<&str>) -> Result<BTreeSet<String>> {
    let mut tree = cargo(&["tree", "--package", PACKAGE, "--locked", "--target", "all"]);
    tree.args(["--edges", "normal,build", "--prefix", "none", "--format", "{p}"]);
    tree.args(feature.map(|feature| format!("--features={feature}")));
    let text = output(&mut tree).ok_or_else(|| format!("`cargo tree --package {PACKAGE} --locked` fails"))?;
    Ok(names(&text))
}

/// The names in what `cargo tree` prints, without the package itself.
fn names(tree: &str) -> BTreeSet<String> {
    let names = tree.lines().filter_map(|line| line.split_whitespace().next());
    names.filter(|name| *name != PACKAGE && !name.starts_with('[')).map(str::to_owned).collect()
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::{features, names, own_packages, relative_links};

    #[test]
    fn names_are_read_from_what_cargo_tree_prints() {
        let tree =
            "rotorlead v0.1.0 (/work)\nlibm v0.2.16\nnum-traits v0.2.19\n[build-dependencies]\nlibm v0.2.16 (*)\n\n";
        assert_eq!(Vec::from_iter(names(tree)), ["libm", "num-traits"]);
    }

    #[test]
    fn links_are_read_from_where_their_page_stands() {
        let text = "[a](wiring.md#pins) [b](../src/main.rs) [c](#here) [d](https://docs.rs/x) [e](./boards.md)";
        assert_eq!(relative_links("docs/firmware.md", text), ["docs/wiring.md", "src/main.rs", "docs/boards.md"]);
        assert_eq!(relative_links("CHANGELOG.md", "[a](docs/wiring.md)"), ["docs/wiring.md"]);
    }

    #[test]
    fn the_packages_of_a_feature_are_its_own_and_not_those_of_features_that_it_needs() {
        let manifest =
            json!({"features": {"default": [], "link": ["dep:cobs"], "board": ["link", "dep:hal", "rtic/x"]}});
        assert_eq!(own_packages(&manifest, "board"), ["hal"]);
        assert_eq!(features(&manifest), ["board", "link"]);
    }
}
