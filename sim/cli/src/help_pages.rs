//! The help of every command as Markdown, for people who read before they run.

use std::fmt::Write as _;

use clap::{Arg, Command};
use textwrap::{Options, WordSeparator, WordSplitter};

use super::command_line;
use super::help::example;

/// One page of help.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct HelpPage {
    /// The file's name.
    pub file: String,
    /// Its Markdown.
    pub text: String,
}

/// Columns of a page.
const WIDTH: usize = 120;
/// Heading of the options that have none of their own.
const OPTIONS: &str = "Options";
/// The first line of every page.
const MARK: &str = "<!-- `cargo xtask docs` writes this page from the help of the command -->\n\n";

/// A page for every command, and first `README.md`, which lists them. What the parser knows is what they say: a command
/// or an option that is added is on its page.
#[must_use]
pub fn help_pages() -> Vec<HelpPage> {
    let mut program = command_line();
    // Fills in what clap adds by itself: usage, and options that hold for every command.
    program.build();
    let mut index = format!("{MARK}# Commands\n\n");
    paragraphs(&mut index, &program);
    let mut pages = Vec::new();
    for command in shown(&program) {
        let name = command.get_name();
        let about = command.get_about().map(ToString::to_string).unwrap_or_default();
        item(&mut index, "", &format!("[`{name}`]({name}.md): {about}"));
        let mut text = MARK.to_owned();
        page(&mut text, command, 1);
        pages.push(HelpPage { file: format!("{name}.md"), text });
    }
    index.push('\n');
    arguments(&mut index, &program, 2);
    after(&mut index, &program);
    pages.insert(0, HelpPage { file: "README.md".to_owned(), text: index.trim_end().to_owned() + "\n" });
    for page in &mut pages {
        page.text = page.text.trim_end().to_owned() + "\n";
    }
    pages
}

/// The commands below one, without `help`, which is in no page.
fn shown(command: &Command) -> impl Iterator<Item = &Command> {
    command.get_subcommands().filter(|command| !command.is_hide_set() && command.get_name() != "help")
}

fn page(text: &mut String, command: &Command, level: usize) {
    let mut named = command.clone();
    let usage = named.render_usage().to_string();
    let usage = usage.trim_start_matches("Usage:").trim();
    let name = command.get_bin_name().unwrap_or_else(|| command.get_name());
    let _ = writeln!(text, "{} {name}\n", "#".repeat(level));
    paragraphs(text, command);
    let example =
        example(command.get_name()).filter(|_| level == 1).map(|line| format!("\n\n$ {line}")).unwrap_or_default();
    let _ = writeln!(text, "```text\n{usage}{example}\n```\n");
    arguments(text, command, level + 1);
    after(text, command);
    for command in shown(command) {
        page(text, command, level + 1);
    }
}

/// What a command does, its first sentence first.
fn paragraphs(text: &mut String, command: &Command) {
    let about = command.get_long_about().or_else(|| command.get_about()).map(ToString::to_string).unwrap_or_default();
    for paragraph in about.split("\n\n").filter(|paragraph| !paragraph.trim().is_empty()) {
        let words = paragraph.split_whitespace().collect::<Vec<_>>().join(" ");
        let end = if words.ends_with(['.', ':']) { "" } else { "." };
        let _ = writeln!(text, "{}\n", filled(&format!("{words}{end}"), ""));
    }
}

/// What follows the help in a terminal, as it stands there.
fn after(text: &mut String, command: &Command) {
    if let Some(after) = command.get_after_long_help().or_else(|| command.get_after_help()) {
        let _ = writeln!(text, "```text\n{}\n```\n", after.to_string().trim());
    }
}

fn arguments(text: &mut String, command: &Command, level: usize) {
    let all = || command.get_arguments().filter(|one| !one.is_hide_set() && !is_common(one));
    let positional = || all().filter(|one| one.is_positional());
    let options = || all().filter(|one| !one.is_positional());
    let heading = "#".repeat(level);
    if positional().next().is_some() {
        let _ = writeln!(text, "{heading} Arguments\n");
        positional().for_each(|one| argument(text, one));
        text.push('\n');
    }
    let mut headings: Vec<&str> = Vec::new();
    for name in options().map(under).filter(|name| *name != OPTIONS) {
        if !headings.contains(&name) {
            headings.push(name);
        }
    }
    for name in std::iter::once(OPTIONS).chain(headings) {
        if options().any(|one| under(one) == name) {
            let _ = writeln!(text, "{heading} {name}\n");
            options().filter(|one| under(one) == name).for_each(|one| argument(text, one));
            text.push('\n');
        }
    }
}

/// The heading under which an option stands.
fn under(option: &Arg) -> &str {
    option.get_help_heading().unwrap_or(OPTIONS)
}

/// `--help` and `--version`, which need no words.
fn is_common(argument: &Arg) -> bool {
    ["help", "version"].contains(&argument.get_id().as_str())
}

fn argument(text: &mut String, argument: &Arg) {
    let short = argument.get_short().filter(|_| argument.get_long().is_some());
    let short = short.map(|letter| format!("`-{letter}`, ")).unwrap_or_default();
    // Styled text is plain once its escapes are left out, which `to_string` of an argument does.
    let mut line = format!("{short}`{argument}`");
    let help = argument.get_long_help().or_else(|| argument.get_help()).map(ToString::to_string).unwrap_or_default();
    for paragraph in help.split("\n\n").filter(|paragraph| !paragraph.trim().is_empty()) {
        let words = paragraph.split_whitespace().collect::<Vec<_>>().join(" ");
        let (begin, end) = (if line.ends_with('.') { "" } else { ":" }, if words.ends_with('.') { "" } else { "." });
        let _ = write!(line, "{begin} {words}{end}");
    }
    let defaults = argument.get_default_values();
    if !defaults.is_empty() && argument.get_action().takes_values() {
        let values = defaults.iter().map(|value| value.to_string_lossy()).collect::<Vec<_>>().join(" ");
        let _ = write!(line, " Default: `{values}`.");
    }
    if argument.is_required_set() && !argument.is_positional() {
        line.push_str(" Required.");
    }
    item(text, "", &line);
    for value in argument.get_possible_values().iter().filter(|value| !value.is_hide_set()) {
        if argument.get_action().takes_values() {
            let help = value.get_help().map(|help| format!(": {help}.")).unwrap_or_default();
            item(text, "  ", &format!("`{}`{help}", value.get_name()));
        }
    }
}

/// One line of a list.
fn item(text: &mut String, indent: &str, words: &str) {
    let _ = writeln!(text, "{}", filled(&format!("{indent}- {words}"), &format!("{indent}  ")));
}

/// Lines of at most [`WIDTH`] characters, words whole; all but the first begin with `indent`.
fn filled(words: &str, indent: &str) -> String {
    let options = Options::new(WIDTH)
        .subsequent_indent(indent)
        .break_words(false)
        .word_splitter(WordSplitter::NoHyphenation)
        .word_separator(WordSeparator::AsciiSpace);
    textwrap::fill(words, options)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_command_has_a_page_with_every_option() {
        let pages = help_pages();
        let mut program = command_line();
        program.build();
        assert_eq!(pages.len(), 1 + shown(&program).count());
        for command in shown(&program) {
            let page = pages.iter().find(|page| page.file == format!("{}.md", command.get_name())).unwrap();
            for argument in command.get_arguments().filter(|one| !is_common(one) && !one.is_hide_set()) {
                assert!(page.text.contains(&format!("`{argument}`")), "{argument} in\n{}", page.text);
            }
            assert!(pages[0].text.contains(&format!("({}.md)", command.get_name())));
        }
    }

    #[test]
    fn a_command_below_a_command_is_on_its_page() {
        let pages = help_pages();
        let device = pages.iter().find(|page| page.file == "device.md").unwrap();
        assert!(device.text.contains("\n## rotorlead device excite\n"), "{}", device.text);
        assert!(device.text.contains("`--newtons-per-count <N>`"));
    }
}
