//! The commands of the README and of the pages under `docs` do what the pages say.
//!
//! A page's fenced blocks are taken in order, in a folder of the page's own. A block that follows a line of only a file's
//! name in backquotes and a colon becomes that file and nothing else. The lines of a `console` block that begin with `$ ` are run by a shell,
//! and what they print has to be what stands below them, blanks at the ends of lines aside. The lines of an `sh` block are
//! run, and have to succeed. Where its first line is one of [`NOT_HERE`], which a reader understands as well, they are not
//! run: of those the arguments are parsed. A figure that a page shows, `figures/A-B.svg`, is the one that its commands draw
//! as `A-figures/B.svg` or `A-out/B.svg`, its words up to their digits and its curves up to two pixels; or one that a page
//! before it in [`PAGES`] draws. What `rotorlead demo` writes is taken from the gallery.
//!
//! What stands between backquotes in the text and begins with `rotorlead ` names commands and options that exist, and its
//! arguments are parsed.
//!
//! With `ROTORLEAD_UPDATE_PAGES=1` in the environment outputs and figures are written into the pages instead.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command as Process;

use clap::error::ErrorKind;
use clap::{CommandFactory as _, Parser as _};
use rotorlead_answer::FigureKind;
use rotorlead_cli::Arguments;

use crate::gallery::put_demo;
use crate::stand::program;

/// First lines of blocks whose commands no test can run.
const NOT_HERE: [&str; 4] =
    ["# needs the controller", "# needs the emulator", "# needs the network, once", "# takes long"];

/// How far a point may move before a picture is another one, in units of a drawing, of which a pixel has eight: what another
/// machine's last digits do is less than that.
const APART: f64 = 16.0;

/// A page with commands.
struct Page {
    /// From the root of the sources.
    file: &'static str,
    /// How many commands it has at least.
    commands: usize,
    /// What its reader has already: files' names, and what they are here.
    brought: &'static [(&'static str, &'static str)],
}

const fn page(file: &'static str, commands: usize) -> Page {
    Page { file, commands, brought: &[] }
}

/// What autopilots logged.
const AUTOPILOT_LOGS: &[(&str, &str)] = &[("bench.bin", "sim/records/tests/data/bench.bin")];

/// Every page with commands.
const PAGES: [Page; 20] = [
    page("README.md", 8),
    page("CONTRIBUTING.md", 6),
    page("docs/own-motor.md", 15),
    Page { brought: AUTOPILOT_LOGS, ..page("docs/autopilot-logs.md", 4) },
    page("docs/inverse.md", 4),
    page("docs/tutorial.md", 30),
    page("docs/identification.md", 4),
    page("docs/when-identification-fails.md", 15),
    page("docs/diagnosis.md", 8),
    page("docs/figures.md", 10),
    page("docs/firmware.md", 5),
    page("docs/rpm.md", 1),
    page("docs/board-rp2040.md", 4),
    page("docs/c-interface.md", 2),
    page("docs/python.md", 2),
    page("docs/web.md", 3),
    page("docs/wiring.md", 2),
    page("docs/vehicle.md", 6),
    page("docs/export.md", 8),
    page("docs/fleet.md", 4),
];

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

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// What a command prints, on either stream, without blanks at the ends of lines, and whether it succeeds.
fn printed(command: &str, folder: &Path) -> (Vec<String>, bool) {
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
    (text.trim_end().lines().map(|line| line.trim_end().to_owned()).collect(), output.status.success())
}

/// The program as it is called from the sources is the program.
fn as_installed(command: &str) -> String {
    command.replace("cargo run --release -- ", "rotorlead ")
}

/// Commands of a block, each of which may go on in the next line behind a backslash.
fn commands(lines: &[String]) -> Vec<String> {
    let joined = lines.join("\n").replace("\\\n", " ");
    joined.lines().filter(|line| !line.is_empty() && !line.starts_with('#')).map(str::to_owned).collect()
}

/// Asserts that a command that is not run here could be.
fn parse(page: &str, command: &str) {
    let command = command.split(" #").next().unwrap();
    let words = shlex::split(command).unwrap_or_else(|| panic!("{page}: `{command}` has an open quote"));
    let names: Vec<&str> = words.iter().map(String::as_str).collect();
    match names.as_slice() {
        ["rotorlead", ..] => {
            if let Err(error) = Arguments::try_parse_from(&words) {
                assert!(!error.use_stderr(), "{page}: `{command}`:\n{error}");
            }
        }
        ["cargo", "install", "--path", path, ..] => {
            assert!(root().join(path).join("Cargo.toml").is_file(), "{page}: `{command}`");
        }
        ["cargo", "install", _, "--locked"] => {}
        // That these exist is asserted beside them, in `xtask`.
        ["cargo", "xtask", _, ..] => {}
        _ => panic!("{page}: nobody knows whether `{command}` is right"),
    }
}

/// Runs a page; gives the number of its commands.
fn run(page: &str, brought: &[(&str, &str)]) -> usize {
    let path = root().join(page);
    let text = std::fs::read_to_string(&path).unwrap();
    let is_update = std::env::var_os("ROTORLEAD_UPDATE_PAGES").is_some();
    let mut updated = text.clone();
    let folder = tempfile::tempdir().unwrap();
    for (name, source) in brought {
        std::fs::copy(root().join(source), folder.path().join(name)).unwrap();
    }
    let mut count = 0;
    for block in blocks(&text) {
        if let Some(file) = &block.file {
            let file = folder.path().join(file);
            std::fs::create_dir_all(file.parent().unwrap()).unwrap();
            std::fs::write(file, block.lines.join("\n") + "\n").unwrap();
            continue;
        }
        match block.language.as_str() {
            "console" => count += compare(page, &block, folder.path(), is_update, &mut updated),
            "sh" => {
                let is_here = !block.lines.first().is_some_and(|first| NOT_HERE.contains(&first.as_str()));
                let commands = commands(&block.lines);
                count += commands.len();
                if is_here {
                    let task = commands.iter().find(|command| command.starts_with("cargo xtask "));
                    assert!(task.is_none(), "{page}: `{}` is not marked", task.unwrap());
                    let lines = block.lines.iter().map(|line| as_installed(line));
                    let lines: Vec<String> = lines.filter(|line| !put_demo(line, folder.path())).collect();
                    let script = format!("set -e\n{}", lines.join("\n"));
                    let (printed, is_success) = printed(&script, folder.path());
                    assert!(is_success, "{page}: these fail: {script}\n{}\n", printed.join("\n"));
                } else {
                    commands.iter().for_each(|command| parse(page, command));
                }
            }
            "" | "text" | "toml" | "csv" => {}
            // Compiled by the tests of the C interface.
            "c" => {}
            // Run by the tests of the Python package.
            "python" => {}
            other => panic!("{page}: a block of `{other}` would be neither run nor compared"),
        }
    }
    for (image, name) in figures(&text) {
        let (case, figure) = name.split_once('-').unwrap_or_else(|| panic!("{page}: {name}"));
        let folders = ["figures", "out"].map(|kind| folder.path().join(format!("{case}-{kind}")));
        let Some(drawn) = folders.iter().find(|folder| folder.is_dir()) else {
            let first = PAGES
                .iter()
                .map(|page| page.file)
                .find(|page| figures(&read(page)).iter().any(|(_, one)| *one == name));
            assert!(first != Some(page), "{page} has no command that draws {name}");
            continue;
        };
        let drawn = drawn.join(figure);
        let drawn = std::fs::read_to_string(&drawn).unwrap_or_else(|error| panic!("{}: {error}", drawn.display()));
        let shown = path.parent().unwrap().join(image);
        if is_update {
            std::fs::create_dir_all(shown.parent().unwrap()).unwrap();
            std::fs::write(&shown, &drawn).unwrap();
        }
        let shown = std::fs::read_to_string(&shown).unwrap_or_else(|error| panic!("{}: {error}", shown.display()));
        assert_eq!(words(&shown), words(&drawn), "{page}: {name} is another figure now: `cargo xtask docs`");
        assert!(are_alike(&shown, &drawn), "{page}: {name} has other curves now: `cargo xtask docs`");
    }
    if is_update {
        std::fs::write(&path, updated).unwrap();
    }
    count
}

/// Runs the commands of a `console` block, and compares or replaces what they print; gives their number.
fn compare(page: &str, block: &Block, folder: &Path, is_update: bool, updated: &mut String) -> usize {
    let mut count = 0;
    let mut lines = block.lines.iter().peekable();
    while let Some(line) = lines.next() {
        let command = line.strip_prefix("$ ").unwrap_or_else(|| panic!("{page}: `{line}` is no command"));
        let mut expected = Vec::new();
        while let Some(line) = lines.next_if(|line| !line.starts_with("$ ")) {
            expected.push(line.clone());
        }
        let (found, _) = printed(command, folder);
        if is_update {
            let said = |lines: &[String]| [std::slice::from_ref(line), lines].concat().join("\n") + "\n";
            *updated = updated.replacen(&said(&expected), &said(&found), 1);
        } else {
            assert_eq!(found, expected, "{page}: `{command}` now prints\n{}\n", found.join("\n"));
        }
        count += 1;
    }
    count
}

/// The pictures of a page: the link, and the file's name.
fn figures(page: &str) -> Vec<(String, String)> {
    let links = page.split("](").skip(1).map(|rest| rest.split(')').next().unwrap());
    let pictures = links.filter(|link| link.ends_with(".svg"));
    pictures.map(|link| (link.to_owned(), link.rsplit('/').next().unwrap().to_owned())).collect()
}

/// What a picture says in words; numbers are left out.
fn words(svg: &str) -> Vec<String> {
    let texts = svg.split("<text").skip(1).filter_map(|rest| rest.split('>').nth(1)?.split('<').next());
    let said = texts.map(|text| text.trim().to_owned());
    said.filter(|text| text.parse::<f64>().is_err())
        .map(|text| text.replace(|c: char| c.is_ascii_digit(), "0"))
        .collect()
}

/// Whether two pictures are drawn alike: as many numbers, and none farther from its like than [`APART`].
fn are_alike(shown: &str, drawn: &str) -> bool {
    let numbers = |svg: &str| -> Vec<f64> {
        let parts = svg.split(|c: char| !(c.is_ascii_digit() || c == '.' || c == '-'));
        parts.filter_map(|part| part.parse().ok()).collect()
    };
    let (shown, drawn) = (numbers(shown), numbers(drawn));
    shown.len() == drawn.len() && shown.iter().zip(&drawn).all(|(a, b)| (a - b).abs() <= APART)
}

#[test]
fn a_curve_that_moves_by_more_than_two_pixels_is_another_picture() {
    let curve = |y: f64| format!("<polyline fill=\"none\" points=\"240,376.5 416,{y} \"/>");
    assert!(are_alike(&curve(376.0), &curve(390.0)));
    assert!(!are_alike(&curve(376.0), &curve(400.0)));
    assert!(!are_alike(&curve(376.0), &[curve(376.0), curve(376.0)].concat()));
}

/// Every page under `docs`, the README and the rules of the house, from the root of the sources.
fn all_pages() -> BTreeSet<String> {
    let markdown = |folder: &str| -> Vec<String> {
        let entries = std::fs::read_dir(root().join(folder)).unwrap();
        let names = entries.map(|entry| format!("{folder}/{}", entry.unwrap().file_name().to_str().unwrap()));
        names.filter(|name| name.ends_with(".md")).collect()
    };
    let front = ["README.md", "CONTRIBUTING.md", "SECURITY.md", "CODE_OF_CONDUCT.md"].map(str::to_owned).to_vec();
    [markdown("docs"), markdown("docs/commands"), front, templates()].concat().into_iter().collect()
}

/// What an issue or a change is written into.
fn templates() -> Vec<String> {
    let folders = [".github", ".github/ISSUE_TEMPLATE"];
    let in_folder = |folder: &str| -> Vec<String> {
        let entries = std::fs::read_dir(root().join(folder)).unwrap().map(|entry| entry.unwrap().file_name());
        entries
            .map(|name| format!("{folder}/{}", name.to_str().unwrap()))
            .filter(|name| root().join(name).is_file())
            .collect()
    };
    folders.into_iter().flat_map(in_folder).collect()
}

fn read(page: &str) -> String {
    std::fs::read_to_string(root().join(page)).unwrap_or_else(|error| panic!("{page}: {error}"))
}

#[track_caller]
fn holds(file: &str) {
    let page = PAGES.iter().find(|page| page.file == file).unwrap();
    let count = run(file, page.brought);
    assert!(count >= page.commands, "{file} has {count} commands only");
}

#[cfg(unix)]
#[test]
fn the_page_on_your_own_motor_shows_what_its_commands_do() {
    holds("docs/own-motor.md");
}

#[test]
fn the_rules_of_the_house_name_commands_that_there_are() {
    holds("CONTRIBUTING.md");
}

#[test]
fn the_readme_shows_what_its_commands_do() {
    holds("README.md");
}

#[cfg(unix)]
#[test]
fn the_tutorial_shows_what_its_commands_print() {
    holds("docs/tutorial.md");
}

#[cfg(unix)]
#[test]
fn the_page_on_figures_shows_what_its_commands_draw() {
    holds("docs/figures.md");
}

#[cfg(unix)]
#[test]
fn the_page_on_identification_shows_what_its_commands_print() {
    holds("docs/identification.md");
}

#[cfg(unix)]
#[test]
fn the_page_on_failures_shows_what_its_commands_print() {
    holds("docs/when-identification-fails.md");
}

#[cfg(unix)]
#[test]
fn the_page_on_export_shows_what_its_commands_print() {
    holds("docs/export.md");
}

#[test]
fn the_page_on_diagnosis_shows_what_its_commands_print() {
    holds("docs/diagnosis.md");
}

#[cfg(unix)]
#[test]
fn the_page_on_autopilot_logs_shows_what_its_commands_print() {
    holds("docs/autopilot-logs.md");
}

#[cfg(unix)]
#[test]
fn the_page_on_the_inverse_shows_what_its_commands_print() {
    holds("docs/inverse.md");
}

#[cfg(unix)]
#[test]
fn the_page_on_fleets_shows_what_its_commands_print() {
    holds("docs/fleet.md");
}

#[cfg(unix)]
#[test]
fn the_page_on_the_vehicle_shows_what_its_commands_print() {
    holds("docs/vehicle.md");
}

#[cfg(unix)]
#[test]
fn the_pages_on_the_controller_name_commands_that_there_are() {
    holds("docs/firmware.md");
    holds("docs/rpm.md");
    holds("docs/board-rp2040.md");
    holds("docs/c-interface.md");
    holds("docs/wiring.md");
}

#[test]
fn a_page_with_commands_is_among_those_that_are_run() {
    let has_commands = |page: &String| {
        let found = blocks(&read(page));
        found.iter().any(|block| block.file.is_none() && ["sh", "console"].contains(&block.language.as_str()))
    };
    let found: BTreeSet<String> = all_pages().into_iter().filter(has_commands).collect();
    let run: BTreeSet<String> = PAGES.iter().map(|page| page.file.to_owned()).collect();
    assert_eq!(found, run);
}

#[test]
fn what_the_text_names_are_commands_and_options_that_exist() {
    let mut program = Arguments::command();
    program.build();
    let mut count = 0;
    for page in all_pages() {
        for span in in_backquotes(&read(&page)) {
            let Some(arguments) = span.strip_prefix("rotorlead ") else { continue };
            let mut command = &program;
            for word in arguments.split_whitespace() {
                if let Some(option) = word.strip_prefix("--") {
                    let option = option.split('=').next().unwrap();
                    let mut known = command.get_arguments().chain(program.get_arguments());
                    let device = program.find_subcommand("device").unwrap();
                    let is_known = known.any(|one| one.get_long() == Some(option))
                        || device.get_arguments().any(|one| one.get_long() == Some(option))
                        || ["help", "version"].contains(&option);
                    assert!(is_known, "{page}: `{span}` has an option `--{option}`, and there is none");
                } else if let Some(found) = command.find_subcommand(word) {
                    command = found;
                }
            }
            // What is said with its arguments has to be right as a whole; a mere name may lack what has to be given.
            let mut words = shlex::split(span.split(" | ").next().unwrap()).unwrap();
            if words.last().is_some_and(|last| last.starts_with("--")) {
                words.pop();
            }
            if let Err(error) = Arguments::try_parse_from(&words) {
                let is_name = matches!(
                    error.kind(),
                    ErrorKind::MissingRequiredArgument
                        | ErrorKind::MissingSubcommand
                        | ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand
                );
                assert!(is_name || !error.use_stderr(), "{page}: `{span}`:\n{error}");
            }
            let first = arguments.split_whitespace().next().unwrap();
            let is_command = first.starts_with('-') || program.find_subcommand(first).is_some();
            assert!(is_command, "{page}: `{span}` is no command");
            count += 1;
        }
    }
    assert!(count >= 40, "only {count} are named");
}

/// What stands between backquotes outside of blocks, on one line or more.
fn in_backquotes(page: &str) -> Vec<String> {
    let mut text = String::new();
    let mut is_block = false;
    for line in page.lines() {
        if line.starts_with("```") {
            is_block = !is_block;
        } else if !is_block {
            text.push_str(line);
            text.push('\n');
        }
    }
    let spans = text.split('`').skip(1).step_by(2);
    spans.map(|span| span.split_whitespace().collect::<Vec<_>>().join(" ")).collect()
}

#[test]
fn every_link_of_a_page_leads_somewhere() {
    for page in all_pages() {
        let folder = root().join(&page).parent().unwrap().to_owned();
        for link in read(&page).split("](").skip(1) {
            let link = link.split(')').next().unwrap();
            if link.contains("://") {
                continue;
            }
            let (file, section) = link.split_once('#').unwrap_or((link, ""));
            let file = if file.is_empty() { root().join(&page) } else { folder.join(file) };
            assert!(file.exists(), "{page} links to `{link}`");
            if !section.is_empty() {
                let text = std::fs::read_to_string(file).unwrap();
                assert!(anchors(&text).contains(section), "{page} links to `{link}`: {:?}", anchors(&text));
            }
        }
    }
}

/// The names under which sections are linked to.
fn anchors(page: &str) -> BTreeSet<String> {
    let mut is_block = false;
    let mut found = BTreeSet::new();
    for line in page.lines() {
        if line.starts_with("```") {
            is_block = !is_block;
        }
        if !is_block && line.starts_with('#') {
            let words = line.trim_start_matches('#').trim().to_lowercase();
            let kept = words.chars().filter(|c| c.is_alphanumeric() || " -_".contains(*c));
            found.insert(kept.collect::<String>().replace(' ', "-"));
        }
    }
    found
}

#[test]
fn every_figure_that_can_be_drawn_is_explained_with_a_picture() {
    let page = read("docs/figures.md");
    let sections: Vec<&str> = page.split("\n## ").skip(1).collect();
    for kind in FigureKind::ALL {
        let heading = format!("`{}`", kind.id());
        let section = sections.iter().find(|section| section.lines().next().unwrap().contains(&heading));
        let section = section.unwrap_or_else(|| panic!("docs/figures.md has no section with {heading} in its heading"));
        let picture = format!("-{}", kind.id());
        assert!(figures(section).iter().any(|(_, name)| name.contains(&picture)), "{heading} has no picture");
        for part in ["**Axes.**", "**Good.**", "**Bad.**", "**Then.**"] {
            assert!(section.contains(part), "{heading} does not say: {part}");
        }
    }
}

#[test]
fn the_index_leads_to_every_page() {
    let index = read("docs/SUMMARY.md");
    for page in all_pages().iter().filter_map(|page| page.strip_prefix("docs/")).filter(|page| *page != "SUMMARY.md") {
        assert!(index.contains(&format!("]({page})")), "docs/SUMMARY.md has no link to {page}");
    }
}
