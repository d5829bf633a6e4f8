//! The pages of the commands are what the commands say of themselves.

use std::collections::BTreeMap;
use std::path::Path;

use rotorlead_sim::command::help_pages;

#[test]
fn the_page_of_a_command_is_its_help() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/commands");
    let files = std::fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path());
    let found: BTreeMap<String, String> = files
        .map(|path| (path.file_name().unwrap().to_str().unwrap().to_owned(), std::fs::read_to_string(&path).unwrap()))
        .collect();
    let expected: BTreeMap<String, String> = help_pages().into_iter().map(|page| (page.file, page.text)).collect();
    assert!(
        found.keys().eq(expected.keys()),
        "`cargo xtask docs` brings the pages up to date: {:?} are there, {:?} are the commands",
        found.keys(),
        expected.keys()
    );
    for (file, text) in expected {
        assert_eq!(found[&file], text, "`cargo xtask docs` brings {file} up to date");
    }
}
