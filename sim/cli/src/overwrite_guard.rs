//! What a command reads is not what it writes over: a record of a stand is not made twice.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use clap::ArgMatches;

/// Options that name a file to be written; every other path is read.
const WRITTEN: [&str; 5] = ["out", "json", "report", "out_model", "out_plan"];
/// What describes an experiment's records, in its folder.
const DESCRIPTION: &str = "experiment.toml";

/// The first file that the command line asks to be written over what it asks to be read, in words.
pub(super) fn overwritten(matches: &ArgMatches) -> Option<String> {
    let mut command = matches;
    while let Some((_, inner)) = command.subcommand() {
        command = inner;
    }
    let paths = |written: bool| {
        let ids = command.ids().filter(move |id| WRITTEN.contains(&id.as_str()) == written);
        ids.flat_map(|id| command.try_get_many::<PathBuf>(id.as_str()).ok().flatten().into_iter().flatten())
    };
    paths(true).find_map(|output| paths(false).find_map(|input| said(input, output)))
}

fn said(input: &Path, output: &Path) -> Option<String> {
    // What is not there is overwritten by nobody.
    let (read, written) = (input.canonicalize().ok()?, output.canonicalize().ok()?);
    let is_of_records = || {
        let is_record = written.extension().is_some_and(|end| end.eq_ignore_ascii_case("csv"));
        is_record || written.file_name() == Some(OsStr::new(DESCRIPTION))
    };
    if written.is_file() && written == read {
        return Some(format!("`{}` would be read and then written over: name another file", output.display()));
    }
    let is_in_it = written.is_file() && written.parent() == Some(read.as_path());
    (is_in_it && is_of_records()).then(|| {
        format!(
            "`{}` belongs to the records in `{}` and would be written over: name another file",
            output.display(),
            input.display()
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_their_description_and_what_is_read_are_spared_and_nothing_else_is() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        for name in ["experiment.toml", "a.csv", "model.toml", "report.html"] {
            std::fs::write(at(name), "").unwrap();
        }
        let is_guarded = |input: &Path, output: &str| said(input, &at(output)).is_some();
        for output in ["experiment.toml", "a.csv", "./a.csv"] {
            assert!(is_guarded(folder.path(), output), "{output}");
        }
        for output in ["model.toml", "report.html", "new.csv"] {
            assert!(!is_guarded(folder.path(), output), "{output}");
        }
        assert!(is_guarded(&at("model.toml"), "model.toml") && !is_guarded(&at("model.toml"), "a.csv"));
    }
}
