//! What the help of a command looks like: an example at its top, and what few runs need under headings of its own.

use clap::{Args as _, Command};

use super::EXAMPLES;
use super::identify_align::AlignOptions;
use super::identify_stand::StandArguments;
use super::latency::LatencyArguments;
use super::log_arguments::LogArguments;
use super::outcome::JsonOption;
use super::parameters::DesignArguments;
use super::report_option::ReportOption;

/// Options that stand together under a heading.
struct Group {
    /// Adds what declares them to a command.
    declared: fn(Command) -> Command,
    heading: &'static str,
    /// Whether `-h` leaves them to `--help`.
    is_rare: bool,
}

const GROUPS: [Group; 7] = [
    Group::rare(StandArguments::augment_args, "A stand"),
    Group::rare(AlignOptions::augment_args, "A command that was logged apart"),
    Group::rare(LogArguments::augment_args, "Reading a log"),
    Group::rare(DesignArguments::augment_args, "Compensator"),
    Group::rare(LatencyArguments::augment_args, "Pulses and delays"),
    Group { is_rare: false, ..Group::rare(ReportOption::augment_args, "Further outputs") },
    Group { is_rare: false, ..Group::rare(JsonOption::augment_args, "Further outputs") },
];
/// Those of them that many runs need.
const USUAL: [&str; 3] = ["column", "excitation", "kind"];
/// Options of every command.
const EVERYWHERE: [&str; 3] = ["quiet", "verbose", "force"];

impl Group {
    const fn rare(declared: fn(Command) -> Command, heading: &'static str) -> Self {
        Self { declared, heading, is_rare: true }
    }
}

/// A command with what its help lacks.
pub fn with_layout(command: Command) -> Command {
    let has = |id: &str| command.get_arguments().any(|argument| argument.get_id() == id);
    let mut headings: Vec<(String, &str, bool)> = Vec::new();
    for Group { declared, heading, is_rare } in GROUPS {
        let declared = declared(Command::new("part"));
        let ids: Vec<&str> = declared.get_arguments().map(|argument| argument.get_id().as_str()).collect();
        // Another command may call something else so.
        if ids.iter().all(|id| has(id)) {
            headings.extend(ids.iter().map(|id| ((*id).to_owned(), heading, is_rare && !USUAL.contains(id))));
        }
    }
    let example = example(command.get_name()).map(|line| format!("Example: {line}\n\n")).unwrap_or_default();
    command
        .mut_args(|argument| {
            let of = headings.iter().find(|(id, ..)| argument.get_id() == id.as_str());
            match of {
                Some((_, heading, is_rare)) => argument.help_heading(*heading).hide_short_help(*is_rare),
                None => argument,
            }
        })
        .help_template(format!(
            "{{about-with-newline}}\n{{usage-heading}} {{usage}}\n\n{example}{{all-args}}{{after-help}}"
        ))
}

/// The program with its options of every command below all others.
pub fn with_common_options(program: Command) -> Command {
    program.mut_args(|argument| {
        let is_common = EVERYWHERE.contains(&argument.get_id().as_str());
        if is_common { argument.help_heading("Every command") } else { argument }
    })
}

/// What a command is shown by.
pub fn example(command: &str) -> Option<&'static str> {
    EXAMPLES.iter().find(|line| line.split(' ').nth(1) == Some(command)).copied()
}

#[cfg(test)]
mod tests {
    use super::super::command_line;
    use super::*;

    #[test]
    fn every_command_has_an_example_that_it_takes() {
        for command in command_line().get_subcommands().map(Command::get_name) {
            let line = example(command).unwrap_or_else(|| panic!("`{command}` has no example"));
            command_line().try_get_matches_from(line.split(' ')).unwrap_or_else(|error| panic!("{error}"));
        }
    }

    #[test]
    fn short_help_is_one_screen() {
        for command in command_line().get_subcommands_mut() {
            let name = command.get_name().to_owned();
            let lines = command.render_help().to_string().lines().count();
            assert!(lines <= 50, "{name}: {lines} lines");
        }
    }
}
