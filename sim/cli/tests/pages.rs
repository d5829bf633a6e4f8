//! The pages that the code writes are what it says of itself. With `ROTORLEAD_UPDATE_PAGES=1` in the environment, as `cargo
//! xtask docs` sets it, they are written.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use rotorlead::protocol::PulseProtocol;
use rotorlead_cli::help_pages;
use rotorlead_plant::Catalog;
use rotorlead_results::{catalog_markdown, with_catalog};

fn docs() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs")
}

fn is_update() -> bool {
    std::env::var_os("ROTORLEAD_UPDATE_PAGES").is_some()
}

#[test]
fn the_catalog_of_the_page_is_that_of_the_code() {
    let path = docs().join("effects.md");
    let page = fs::read_to_string(&path).unwrap();
    let section = catalog_markdown(&Catalog::standard());
    for kind in Catalog::standard().kinds() {
        for part in [kind.equation, kind.signature] {
            assert!(section.contains(part), "{} is incomplete", kind.id);
        }
    }
    hold(&path, &page, &with_catalog(&page, &section).unwrap());
}

/// Writes a page, or asserts that it is as it would be written.
fn hold(path: &Path, page: &str, expected: &str) {
    if is_update() {
        fs::write(path, expected).unwrap();
    } else {
        assert_eq!(expected, page, "`cargo xtask docs` brings the page up to date");
    }
}

#[test]
fn the_protocols_of_the_page_are_those_of_the_code() {
    let path = docs().join("firmware.md");
    let page = fs::read_to_string(&path).unwrap();
    let (dshot, pulses): (Vec<_>, Vec<_>) = PulseProtocol::ALL.into_iter().partition(|one| one.dshot().is_some());
    let [pulses, dshot] =
        [pulses, dshot].map(|some| some.iter().map(|one| format!("`{}`", one.name())).collect::<Vec<_>>().join(", "));
    let (before, rest) = page.split_once("| `input.protocol` | ").unwrap();
    let (_, after) = rest.split_once(" on a [board that speaks it]").unwrap();
    let row = format!("| `input.protocol` | {pulses}; {dshot} on a [board that speaks it]");
    hold(&path, &page, &format!("{before}{row}{after}"));
}

#[test]
fn the_page_of_a_command_is_its_help() {
    let folder = docs().join("commands");
    let expected: BTreeMap<String, String> = help_pages().into_iter().map(|page| (page.file, page.text)).collect();
    if is_update() {
        // A command that is gone takes its page with it.
        let _ = fs::remove_dir_all(&folder);
        fs::create_dir_all(&folder).unwrap();
        for (file, text) in expected {
            fs::write(folder.join(file), text).unwrap();
        }
        return;
    }
    let files = fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path());
    let found: BTreeMap<String, String> = files
        .map(|path| (path.file_name().unwrap().to_str().unwrap().to_owned(), fs::read_to_string(&path).unwrap()))
        .collect();
    let [there, wanted] = [&found, &expected].map(|pages| pages.keys().collect::<Vec<_>>());
    assert_eq!(there, wanted, "`cargo xtask docs` brings the pages up to date");
    for (file, text) in expected {
        assert_eq!(found[&file], text, "`cargo xtask docs` brings {file} up to date");
    }
}
