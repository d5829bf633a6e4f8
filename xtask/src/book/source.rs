//! What mdbook builds the site from. Pages link to each other by where they stand in the repository, so that their links work there
//! as well; in the site's source `docs` is the root, and pages from above it stand beside those of `docs`.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use crate::run::{Result, files_below};

/// Folder of the pages, and in it the index.
const DOCS: &str = "docs";
const INDEX: &str = "docs/SUMMARY.md";
/// What mdbook reads beside the pages.
const SETTINGS: [(&str, &str); 2] = [
    ("book.toml", include_str!("../../book/book.toml")),
    ("theme/head.hbs", include_str!("../../book/theme/head.hbs")),
];

/// Writes mdbook's settings, the index, the pages that it names, and what these show into `folder`. An error where a page links to what is
/// not on the site, or where a file stands in `docs` that no page leads to.
pub fn gather(root: &Path, folder: &Path) -> Result {
    let read = |file: &str| fs::read_to_string(root.join(file)).map_err(|error| format!("{file}: {error}"));
    let index = read(INDEX)?;
    let mut pages = BTreeSet::new();
    with_links(&index, |link| {
        pages.insert(resolved(INDEX, link));
        Ok(link.to_owned())
    })?;
    let mut shown = BTreeSet::new();
    let mut errors = Vec::new();
    for page in pages.iter().map(String::as_str).chain([INDEX]) {
        let moved = with_links(&read(page)?, |link| {
            let (file, section) = link.split_once('#').map_or((link, None), |(file, section)| (file, Some(section)));
            if file.is_empty() || link.contains("://") {
                return Ok(link.to_owned());
            }
            let target = resolved(page, file);
            if !pages.contains(&target) {
                if target.ends_with(".md") || !target.starts_with("docs/") {
                    return Err(format!(
                        "{page} links to {link}, which {INDEX} does not name: name it there, or write `{target}` as code"
                    ));
                }
                shown.insert(target.clone());
            }
            let up = "../".repeat(place(page).matches('/').count());
            let section = section.map(|section| format!("#{section}")).unwrap_or_default();
            Ok(format!("{up}{}{section}", place(&target)))
        });
        match moved {
            Ok(text) => write(&folder.join("src").join(place(page)), text.as_bytes())?,
            Err(error) => errors.push(error),
        }
    }
    for path in files_below(&root.join(DOCS))? {
        let file = path.strip_prefix(root).unwrap_or(&path).to_string_lossy().replace('\\', "/");
        if shown.contains(&file) {
            let content = fs::read(root.join(&file)).map_err(|error| format!("{file}: {error}"))?;
            write(&folder.join("src").join(place(&file)), &content)?;
        } else if !pages.contains(&file) && file != INDEX {
            errors.push(format!(
                "{file} stands in {DOCS}, and no page leads to it: name it in {INDEX}, show it, or remove it"
            ));
        }
    }
    for (file, text) in SETTINGS {
        write(&folder.join(file), text.as_bytes())?;
    }
    if errors.is_empty() { Ok(()) } else { Err(errors.join("\n")) }
}

/// Where a file of the repository stands in the site's source.
fn place(file: &str) -> String {
    let place = file.strip_prefix("docs/").unwrap_or(file);
    match place.strip_suffix("README.md") {
        Some(folder) => format!("{folder}index.md"),
        None => place.to_owned(),
    }
}

/// The file that a page's link leads to, from the root of the repository.
pub fn resolved(page: &str, link: &str) -> String {
    let mut parts: Vec<&str> = page.split('/').collect();
    parts.pop();
    for part in link.split('/') {
        match part {
            "." => {}
            ".." => drop(parts.pop()),
            part => parts.push(part),
        }
    }
    parts.join("/")
}

/// A page with the target of each link, outside of fenced blocks, replaced by what `change` makes of it.
fn with_links(page: &str, mut change: impl FnMut(&str) -> Result<String>) -> Result<String> {
    let mut changed = String::with_capacity(page.len());
    let mut is_block = false;
    for line in page.split_inclusive('\n') {
        is_block ^= line.trim_start().starts_with("```");
        let mut rest = line;
        while let Some((before, after)) = rest.split_once("](").filter(|_| !is_block) {
            let (link, behind) = after.split_once(')').ok_or_else(|| format!("a link without its end: {line}"))?;
            changed += &format!("{before}]({})", change(link)?);
            rest = behind;
        }
        changed += rest;
    }
    Ok(changed)
}

fn write(path: &Path, content: &[u8]) -> Result {
    let folder = path.parent().unwrap_or(path);
    fs::create_dir_all(folder)
        .and_then(|()| fs::write(path, content))
        .map_err(|error| format!("{}: {error}", path.display()))
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::{gather, place, resolved, with_links};

    #[test]
    fn links_are_resolved_from_where_their_page_stands() {
        assert_eq!(resolved("docs/commands/README.md", "../wiring.md"), "docs/wiring.md");
        assert_eq!(resolved("docs/SUMMARY.md", "../SECURITY.md"), "SECURITY.md");
        assert_eq!(resolved("SECURITY.md", "docs/wiring.md"), "docs/wiring.md");
        assert_eq!(place("docs/commands/README.md"), "commands/index.md");
        assert_eq!(place("SECURITY.md"), "SECURITY.md");
    }

    #[test]
    fn links_in_blocks_stay_as_they_are() {
        let page = "[a](b) and [c](d)\n```sh\n[e](f)\n```\n![g](h)\n";
        let found = with_links(page, |link| Ok(link.to_uppercase())).unwrap();
        assert_eq!(found, "[a](B) and [c](D)\n```sh\n[e](f)\n```\n![g](H)\n");
    }

    /// The site's source of a repository with these files, beside a page that the index names.
    fn gathered(page: &str, others: &[(&str, &str)]) -> Result<String, String> {
        let root = crate::run::target_folder().join(format!("book-test-{:?}", std::thread::current().id()));
        crate::run::remove(&root).unwrap();
        let index = "- [A](a.md)\n- [B](commands/README.md)\n- [C](../SECURITY.md)\n";
        let files = [
            ("docs/SUMMARY.md", index),
            ("docs/a.md", page),
            ("docs/commands/README.md", "[a](../a.md#x)\n"),
            ("SECURITY.md", "[a](docs/a.md)\n"),
        ];
        for (file, text) in files.into_iter().chain(others.iter().copied()) {
            super::write(&root.join(file), text.as_bytes()).unwrap();
        }
        let result = gather(&root, &root.join("built"));
        let source = |file: &str| fs::read_to_string(root.join("built/src").join(file)).unwrap();
        let found = result.map(|()| ["a.md", "commands/index.md", "SECURITY.md"].map(source).concat());
        crate::run::remove(&root).unwrap();
        found
    }

    #[test]
    fn links_lead_to_where_pages_stand_on_the_site() {
        let page = "[b](commands/README.md#y) [c](../SECURITY.md) [d](https://docs.rs/x)\n![e](figures/e.svg)\n";
        let found = gathered(page, &[("docs/figures/e.svg", "<svg/>")]).unwrap();
        let expected = "[b](commands/index.md#y) [c](SECURITY.md) [d](https://docs.rs/x)\n![e](figures/e.svg)\n[a](../a.md#x)\n[a](a.md)\n";
        assert_eq!(found, expected);
    }

    #[test]
    fn what_is_not_on_the_site_is_refused_by_name() {
        let error = gathered("[s](../src/lib.rs)\n", &[]).unwrap_err();
        assert!(
            error.contains("docs/a.md links to ../src/lib.rs") && error.contains("`src/lib.rs` as code"),
            "{error}"
        );
        for file in ["docs/b.md", "docs/figures/old.svg"] {
            let error = gathered("", &[(file, "")]).unwrap_err();
            assert!(error.contains(&format!("{file} stands in docs, and no page leads to it")), "{error}");
        }
    }
}
