//! No command writes over what it reads, and none writes twice to one place: a record of a stand is not made twice.

use std::fs;
use std::path::{Path, PathBuf};

use clap::parser::ValueSource::DefaultValue;
use clap::{Arg, ArgMatches, Command};
use rotorlead_records::FleetList;
use rotorlead_records::files::TextFile;

use super::UsageError;
use super::fleet::{DIAGNOSIS, MODEL};
use super::replacement::{self, ReplacementRefused, Typed};
use rotorlead_records::FLEET_LIST;

/// Options that name what is written; every other path is read. A test holds every path of the command line to be known.
const WRITTEN: [&str; 9] =
    ["out", "json", "report", "figures", "folder", "out_model", "out_plan", "out_compensator", "merged"];
/// What describes an experiment's records, in its folder.
const DESCRIPTION: &str = "experiment.toml";
/// What figures are written as.
const OF_FIGURES: [&str; 3] = ["csv", "svg", "png"];
/// What the files of any other folder are written as, those of manual pages among them.
const OF_FOLDERS: [&str; 5] = ["csv", "svg", "toml", "md", "1"];

/// A path of the command line.
struct Named<'a> {
    /// As it is called there.
    option: String,
    id: &'a str,
    /// The command that has the option.
    command: &'a str,
    path: &'a Path,
    typed: Typed,
    /// Where that is, links followed as far as there is something.
    at: PathBuf,
}

/// Refuses a command line that asks for two outputs in one place, or for one in the place of what it reads; and a path with a line
/// break, whose parts would stand in what is said like lines of the program.
pub(super) fn check(command: &Command, matches: &ArgMatches) -> Result<(), UsageError> {
    let paths = paths(command, matches);
    if let Some(Named { option, path, .. }) = paths.iter().find(|named| named.path.to_string_lossy().contains('\n')) {
        let message = format!("`{}` of {option} has a line break in its name", path.display());
        return Err(UsageError::new(message, "rename it, or name another"));
    }
    let (outputs, inputs): (Vec<Named>, Vec<Named>) = paths.into_iter().partition(|named| WRITTEN.contains(&named.id));
    if let Some(Named { option, .. }) = outputs.iter().find(|output| output.path == Path::new("-")) {
        let message = format!("{option} is `-`, and only --json goes to standard output");
        return Err(UsageError::new(message, "name a file; of a file that is called so, ./-"));
    }
    for (index, output) in outputs.iter().enumerate() {
        inputs.iter().try_for_each(|input| check_input(input, output))?;
        outputs[..index].iter().try_for_each(|earlier| check_apart(earlier, output))?;
        check_folder(output)?;
    }
    Ok(())
}

/// Refuses to replace a file of another kind than the output that would.
pub(super) fn check_replaced(command: &Command, matches: &ArgMatches) -> Result<(), ReplacementRefused> {
    let outputs = paths(command, matches).into_iter().filter(|named| WRITTEN.contains(&named.id));
    outputs.into_iter().try_for_each(|output| {
        replacement::check(output.path, &output.option, output.typed, (output.command, output.id))
    })
}

/// Every path that is given to the command and those that it is part of.
fn paths<'a>(command: &'a Command, matches: &'a ArgMatches) -> Vec<Named<'a>> {
    let mut paths = Vec::new();
    let mut level = Some((command, matches));
    while let Some((command, matches)) = level {
        for argument in command.get_arguments() {
            let id = argument.get_id().as_str();
            let given = matches.try_get_many::<PathBuf>(id).ok().flatten().into_iter().flatten();
            let typed = match matches.try_contains_id(id).is_ok() && matches.value_source(id) == Some(DefaultValue) {
                true => Typed::Nothing,
                false => Typed::Path,
            };
            let is_standard_output = |path: &PathBuf| id == "json" && path == Path::new("-");
            paths.extend(given.filter(|path| !is_standard_output(path)).map(|path| Named {
                option: name(argument),
                id,
                command: command.get_name(),
                path,
                typed,
                at: place(path),
            }));
        }
        level = matches.subcommand().and_then(|(name, inner)| Some((command.find_subcommand(name)?, inner)));
    }
    paths
}

fn name(argument: &Arg) -> String {
    let value = || argument.get_value_names().and_then(|names| names.first()).map(|name| name.to_string());
    argument.get_long().map_or_else(|| value().unwrap_or_default(), |long| format!("--{long}"))
}

/// The path without links and dots, also of what is still to be made.
fn place(path: &Path) -> PathBuf {
    let path = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    let real = |there: &Path| {
        let (there, rest) = (there.canonicalize().ok()?, path.strip_prefix(there).ok()?);
        // Nothing that is joined makes a folder of a file.
        Some(if rest.as_os_str().is_empty() { there } else { there.join(rest) })
    };
    path.ancestors().find_map(real).unwrap_or_else(|| path.clone())
}

/// Refuses an output in the place of what is read.
fn check_input(input: &Named, output: &Named) -> Result<(), UsageError> {
    // What is not there is overwritten by nobody, and neither is a device.
    if !output.at.is_file() {
        return Ok(());
    }
    let (read, written) = (input.path.display(), output.path.display());
    if output.at == input.at {
        let message = format!("`{written}` of {} would be read and then written over", output.option);
        return Err(UsageError::new(message, "name another file"));
    }
    if files_read(input).iter().any(|file| place(file) == output.at) {
        let message = format!("`{written}` of {} belongs to `{read}` and would be written over", output.option);
        return Err(UsageError::new(message, "name another file"));
    }
    Ok(())
}

/// What a command reads where it is given this path: of a folder its records, of a list its logs, and what either names.
fn files_read(input: &Named) -> Vec<PathBuf> {
    if !input.at.is_dir() {
        return named_in(&input.at);
    }
    let description = input.at.join(DESCRIPTION);
    let entries = fs::read_dir(&input.at).into_iter().flatten().flatten().map(|entry| entry.path());
    let is_table = |path: &PathBuf| path.extension().is_some_and(|end| end.eq_ignore_ascii_case("csv"));
    let mut files: Vec<PathBuf> = entries.filter(is_table).collect();
    files.extend(named_in(&description));
    files.push(description);
    if input.command == "report" {
        // It takes the model that lies with the records.
        files.push(input.at.join(MODEL));
    }
    if input.command == "fleet" {
        let logs = FleetList::read(&input.at).map(|list| list.logs).unwrap_or_default();
        let of_log = |folder: PathBuf| [folder.join(MODEL), folder.join(DIAGNOSIS)];
        files.extend(logs.iter().flat_map(|log| of_log(log.path(&input.at))));
    }
    files
}

/// The files that a TOML file names, such as its records and compensators. One that cannot be read is the command's to refuse.
fn named_in(file: &Path) -> Vec<PathBuf> {
    fn texts(value: toml::Value) -> Vec<String> {
        match value {
            toml::Value::String(text) => vec![text],
            toml::Value::Array(items) => items.into_iter().flat_map(texts).collect(),
            toml::Value::Table(table) => table.into_iter().flat_map(|(_, value)| texts(value)).collect(),
            _ => Vec::new(),
        }
    }
    if file.extension().is_none_or(|end| end != "toml") {
        return Vec::new();
    }
    let read = || toml::from_str(TextFile::read(file).ok()?.text()).ok();
    let folder = file.parent().unwrap_or(Path::new(""));
    read().map(texts).unwrap_or_default().into_iter().map(|name| folder.join(name)).collect()
}

/// Refuses two outputs in one place, and one among the files with which another fills its folder.
fn check_apart(earlier: &Named, output: &Named) -> Result<(), UsageError> {
    let is_file = !output.at.exists() || output.at.is_file() || output.at.is_dir();
    if output.at == earlier.at && is_file {
        let message = format!("{} and {} are both `{}`", output.option, earlier.option, output.path.display());
        return Err(UsageError::new(message, "give them different files: one would overwrite the other"));
    }
    for (folder, file) in [(earlier, output), (output, earlier)] {
        let ends = if folder.id == "figures" { &OF_FIGURES[..] } else { &OF_FOLDERS };
        let is_alike = file.at.extension().is_some_and(|end| ends.iter().any(|known| end.eq_ignore_ascii_case(known)));
        if is_alike && file.at.starts_with(&folder.at) {
            let message = format!(
                "`{}` of {} is in the folder `{}`, into which {} writes files that may be called so",
                file.path.display(),
                file.option,
                folder.path.display(),
                folder.option
            );
            return Err(UsageError::new(message, "give it another folder: one would overwrite the other"));
        }
    }
    Ok(())
}

/// Refuses to fill a folder of measurements with files that may be called as they are.
fn check_folder(output: &Named) -> Result<(), UsageError> {
    let fills = output.id == "figures" || ["demo", "man"].contains(&output.command) && output.id == "out";
    match [DESCRIPTION, FLEET_LIST].into_iter().find(|name| output.at.join(name).is_file()) {
        Some(name) if fills => Err(UsageError::new(
            format!("{} is `{}`, in which `{name}` lies", output.option, output.path.display()),
            "name another folder: what is written might be called as a record that is there",
        )),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use std::any::TypeId;
    use std::collections::BTreeSet;

    use super::super::command_line;
    use super::*;

    /// Options that name what is read.
    const READ: [&str; 13] = [
        "a",
        "b",
        "experiment",
        "model",
        "model_option",
        "plan",
        "compensator",
        "files",
        "align",
        "stand_model",
        "records",
        "airframe",
        "fleet",
    ];

    fn path_options(command: &Command) -> BTreeSet<String> {
        let is_path = |argument: &&Arg| argument.get_value_parser().type_id() == TypeId::of::<PathBuf>();
        let own = command.get_arguments().filter(is_path).map(|argument| argument.get_id().to_string());
        own.chain(command.get_subcommands().flat_map(path_options)).collect()
    }

    #[test]
    fn every_path_of_the_command_line_is_known_to_be_read_or_written() {
        let known: BTreeSet<String> = WRITTEN.iter().chain(&READ).map(ToString::to_string).collect();
        assert_eq!(path_options(&command_line()), known);
        assert_eq!(known.len(), WRITTEN.len() + READ.len(), "an option is both");
    }
}
