//! The page on the diagnosis has the catalog as it is.

use std::path::Path;

use rotorlead_sim::plant::Catalog;
use rotorlead_sim::report::{catalog_markdown, with_catalog};

#[test]
fn the_catalog_of_the_page_is_that_of_the_code() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/diagnosis.md");
    let page = std::fs::read_to_string(&path).unwrap();
    let section = catalog_markdown(&Catalog::standard());
    for kind in Catalog::standard().kinds() {
        for part in [kind.equation, kind.signature] {
            assert!(section.contains(part), "{} is incomplete", kind.id);
        }
    }
    assert_eq!(with_catalog(&page, &section).unwrap(), page, "`cargo xtask docs` brings the page up to date");
}
