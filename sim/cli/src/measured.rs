//! What a motor was measured by: an experiment's folder, or a log of another tool.

use std::path::{Path, PathBuf};
use std::slice;

use clap::{Arg, Args, Command};
use indicatif::ProgressBar;
use rotorlead_records::files::TomlFile;
use rotorlead_records::import::{ImportOptions, ImportSummary};
use rotorlead_records::{Experiment, LongRecord, Output};

use super::UsageError;
use super::log_arguments::{LogArguments, logs_in_short, logs_text, responses};
use super::report_option::{arguments, typed};

/// What the folder of a log is called in commands that are proposed.
const FOLDER: &str = "stand";

/// An experiment, or a log with what it does not say of itself.
#[derive(Args, Debug)]
pub struct Measured {
    /// The experiment's folder, or a log that `rotorlead import` takes
    #[arg(value_name = "DIR|LOG")]
    experiment: PathBuf,
    #[command(flatten)]
    reader: Reader,
}

/// How an experiment or a log is read.
#[derive(Args, Debug)]
pub struct Reader {
    /// Which column is the response; what the experiment says, or the log shows, unless given
    #[arg(long, alias = "output", value_name = "RESPONSE", value_parser = responses())]
    response: Option<Output>,
    #[command(flatten)]
    log: LogArguments,
}

/// What was read.
pub struct Reading {
    pub experiment: Experiment,
    /// Records whose rows stay on disk; none of a log.
    pub long: Vec<LongRecord>,
    /// What of a log bears on the numbers, in words; empty for a folder.
    pub text: String,
    /// All that was found in it, taken and guessed.
    pub detail: String,
    /// The same for programs.
    pub logs: Option<Vec<ImportSummary>>,
}

impl Measured {
    /// The folder or the log.
    pub fn path(&self) -> &Path {
        &self.experiment
    }

    /// Where the experiment has to be in a folder, that.
    pub fn folder(&self) -> Result<&Path, UsageError> {
        self.reader.folder(&self.experiment)
    }

    /// Reads it. Multisine records whose file is longer than `longest` bytes stay on disk.
    pub fn read(&self, longest: u64) -> miette::Result<Reading> {
        self.reader.read(&self.experiment, longest)
    }

    /// Reads it where the commands were logged apart: they are zero.
    pub fn read_responses(&self) -> miette::Result<Reading> {
        if is_log(&self.experiment) {
            return self.reader.read_log(&self.experiment, false);
        }
        let experiment = Experiment::read_responses(self.folder()?)?;
        Ok(Reading { experiment, long: Vec::new(), text: String::new(), detail: String::new(), logs: None })
    }

    /// Makes the response the one that is asked for. One that was not taken is refused.
    pub fn choose_output(&self, experiment: &mut Experiment) -> Result<(), UsageError> {
        self.reader.choose_output(experiment)
    }

    /// What other commands take in its place: the folder, of a log the one that [`Self::import_command`] makes.
    pub fn as_folder(&self) -> &Path {
        if is_log(&self.experiment) { Path::new(FOLDER) } else { &self.experiment }
    }

    /// The command that makes a folder of a log.
    pub fn import_command(&self) -> Option<String> {
        let words = ["import".to_owned(), self.experiment.display().to_string()];
        let out = ["--out".to_owned(), FOLDER.to_owned()];
        is_log(&self.experiment).then(|| typed(words.into_iter().chain(Reader::as_typed()).chain(out)))
    }
}

impl Reader {
    /// The options about a log as they were typed for the command that is running.
    fn as_typed() -> Vec<String> {
        let known = Self::augment_args(Command::new("log"));
        let (mut given, mut words) = (arguments(), Vec::new());
        while let Some(word) = given.next() {
            let (name, value) = word.split_once('=').map_or((word.as_str(), None), |(name, value)| (name, Some(value)));
            let is_named = |option: &&Arg| {
                let names = option.get_long().into_iter().chain(option.get_all_aliases().into_iter().flatten());
                name.strip_prefix("--").is_some_and(|name| names.into_iter().any(|known| known == name))
            };
            let Some(option) = known.get_arguments().find(is_named) else { continue };
            let value = if value.is_none() && option.get_action().takes_values() { given.next() } else { None };
            words.extend([Some(word), value].into_iter().flatten());
        }
        words
    }

    fn folder<'a>(&self, path: &'a Path) -> Result<&'a Path, UsageError> {
        // Of what is not there, that is said.
        if path.exists() {
            self.log.refuse_with(path)?;
        }
        Ok(path)
    }

    /// Reads what is at `path`. Multisine records whose file is longer than `longest` bytes stay on disk.
    pub fn read(&self, path: &Path, longest: u64) -> miette::Result<Reading> {
        if is_log(path) {
            return self.read_log(path, true);
        }
        let (experiment, long) = Experiment::read_except_long(self.folder(path)?, longest)?;
        Ok(Reading { experiment, long, text: String::new(), detail: String::new(), logs: None })
    }

    /// Makes the response the one that is asked for. One that was not taken is refused.
    pub fn choose_output(&self, experiment: &mut Experiment) -> Result<(), UsageError> {
        let Some(output) = self.response else { return Ok(()) };
        experiment.output = output;
        experiment.records.iter().find(|record| record.response(output).is_none()).map_or(Ok(()), |record| {
            let message = format!("--response asks for `{}`, and `{}` has no such column", output.column(), record.file);
            let remedy = "leave --response out, or take the other response of the log with `rotorlead import --response`: where it is \
                          slower than the one that was taken, rows without it are left out";
            Err(UsageError::new(message, remedy))
        })
    }

    fn read_log(&self, path: &Path, with_command: bool) -> miette::Result<Reading> {
        let options = ImportOptions { output: self.response, without_command: !with_command, ..self.log.options() };
        // The command has a bar of its own.
        let logs = self.log.read(slice::from_ref(&path.to_owned()), &options, &ProgressBar::hidden())?;
        let (text, detail) = (logs_in_short(&logs), logs_text(&logs));
        let mut experiment = logs.experiment;
        for record in experiment.records.iter_mut().filter(|_| !with_command) {
            record.command = vec![0.0; record.time_s.len()];
        }
        // What a folder with these records would be refused for.
        experiment.check()?;
        Ok(Reading { experiment, long: Vec::new(), text, detail, logs: Some(logs.summaries) })
    }
}

/// Whether it is a file that is no part of an experiment. What is not there is missed as a folder.
pub(super) fn is_log(path: &Path) -> bool {
    path.exists() && !path.is_dir() && !TomlFile::is_called_so(path)
}
