//! The commands of the pages under `docs` do what the pages say.
//!
//! A page's fenced blocks are taken in order. One that follows a line of only a file's name in backquotes and a colon becomes
//! that file; the lines of a `console` block that begin with `$ ` are run by a shell, and what they print has to be what
//! stands below them, blanks at the ends of lines aside. A figure that a page shows, `figures/A-B.svg`, is the one that its
//! commands draw as `A-figures/B.svg`, up to the digits.
//!
//! With `ROTORLEAD_UPDATE_PAGES=1` in the environment outputs and figures are written into the pages instead.

use std::path::Path;
use std::process::Command as Process;

use crate::stand::program;

/// One fenced block, and the file's name on the line before it.
struct Block {
    language: String,
    file: Option<String>,
    lines: Vec<String>,
}

fn blocks(page: &str) -> Vec<Block> {
    let mut blocks = Vec::new();
    let mut file = None;
    let mut lines = page.lines();
    while let Some(line) = lines.next() {
        if let Some(language) = line.strip_prefix("```") {
            let body = lines.by_ref().take_while(|line| *line != "```").map(str::to_owned).collect();
            blocks.push(Block { language: language.to_owned(), file: file.take(), lines: body });
        } else if !line.is_empty() {
            file = line.strip_prefix('`').and_then(|line| line.strip_suffix("`:")).map(str::to_owned);
        }
    }
    blocks
}

/// What a command prints, on either stream, without blanks at the ends of lines.
fn printed(command: &str, folder: &Path) -> Vec<String> {
    let program = program();
    let program = Path::new(program.get_program());
    let path = std::env::var("PATH").unwrap_or_default();
    let output = Process::new("sh")
        .args(["-c", command])
        .current_dir(folder)
        .env("PATH", format!("{}:{path}", program.parent().unwrap().display()))
        .env_remove("FORCE_COLOR")
        .output()
        .unwrap();
    let text = String::from_utf8(output.stdout).unwrap() + &String::from_utf8(output.stderr).unwrap();
    text.trim_end().lines().map(|line| line.trim_end().to_owned()).collect()
}

/// Runs a page; gives the number of its commands.
fn run(page: &str) -> usize {
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs");
    let path = docs.join(page);
    let text = std::fs::read_to_string(&path).unwrap();
    let is_update = std::env::var_os("ROTORLEAD_UPDATE_PAGES").is_some();
    let mut updated = text.clone();
    let folder = tempfile::tempdir().unwrap();
    let mut commands = 0;
    for block in blocks(&text) {
        if let Some(file) = block.file {
            std::fs::write(folder.path().join(file), block.lines.join("\n") + "\n").unwrap();
        }
        if block.language != "console" {
            continue;
        }
        let mut lines = block.lines.iter().peekable();
        while let Some(line) = lines.next() {
            let command = line.strip_prefix("$ ").unwrap_or_else(|| panic!("{page}: `{line}` is no command"));
            let mut expected = Vec::new();
            while let Some(line) = lines.next_if(|line| !line.starts_with("$ ")) {
                expected.push(line.clone());
            }
            let found = printed(command, folder.path());
            if is_update {
                let said = |lines: &[String]| [std::slice::from_ref(line), lines].concat().join("\n") + "\n";
                updated = updated.replacen(&said(&expected), &said(&found), 1);
            } else {
                assert_eq!(found, expected, "{page}: `{command}` now prints\n{}\n", found.join("\n"));
            }
            commands += 1;
        }
    }
    for link in text.split("](figures/").skip(1) {
        let name = link.split(')').next().unwrap();
        let (case, figure) = name.split_once('-').unwrap_or_else(|| panic!("{page}: {name}"));
        let drawn = std::fs::read_to_string(folder.path().join(format!("{case}-figures")).join(figure)).unwrap();
        let shown = docs.join("figures").join(name);
        if is_update {
            std::fs::create_dir_all(docs.join("figures")).unwrap();
            std::fs::write(&shown, &drawn).unwrap();
        }
        let shown = std::fs::read_to_string(&shown).unwrap_or_else(|error| panic!("{}: {error}", shown.display()));
        let texts = |svg: &str| svg.matches("<text").count();
        assert_eq!(texts(&shown), texts(&drawn), "{page}: {name} is another figure now");
    }
    if is_update {
        std::fs::write(&path, updated).unwrap();
    }
    commands
}

#[cfg(unix)]
#[test]
fn the_page_on_identification_shows_what_its_commands_print() {
    assert!(run("identification.md") >= 4);
}

#[cfg(unix)]
#[test]
fn the_page_on_failures_shows_what_its_commands_print() {
    assert!(run("when-identification-fails.md") >= 15);
}

#[cfg(unix)]
#[test]
fn the_page_on_diagnosis_from_bandwidths_shows_what_its_commands_print() {
    assert!(run("diagnosis-from-bandwidths.md") >= 3);
}

#[cfg(unix)]
#[test]
fn the_page_on_diagnosis_shows_what_its_commands_print() {
    assert!(run("diagnosis.md") >= 8);
}
