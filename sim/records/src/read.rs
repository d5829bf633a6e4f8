//! Reading an experiment's folder.

use std::path::Path;

use rayon::iter::{IntoParallelIterator as _, ParallelIterator as _};

use super::column::Column;
use super::manifest::{CommandKind, Entry, MANIFEST, Manifest, place};
use super::table::Table;
use super::{CommandLog, Excitation, Experiment, LongRecord, Output, Record};
use crate::files::{FileError, FilesInMemory, InputFolder, TextFile, TomlFile, checksum_of_files};

impl Experiment {
    /// Reads `experiment.toml` in `folder` and the CSV file of each of its records.
    ///
    /// A record of constant command is accepted: some tools have a use for it, and
    /// [`Record::is_constant`] tells.
    ///
    /// # Errors
    /// When anything is missing, unknown, out of its range, or contradicts something else. The
    /// error shows the file and the place in it, and says what to do.
    pub fn read(folder: &Path) -> Result<Self, FileError> {
        Self::read_kind(folder, CommandKind::Duty, true)
    }

    /// As [`Self::read`], of the files of a folder.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn from_files(files: &FilesInMemory) -> Result<Self, FileError> {
        Self::read_all(files.into(), CommandKind::Duty, true, u64::MAX).map(|(experiment, _)| experiment)
    }

    /// The experiment that the text of an `experiment.toml` describes, its records without their columns. With those,
    /// [`Self::check`] refuses what [`Self::read`] would.
    ///
    /// # Errors
    /// As [`Self::read`], of the text.
    pub fn from_manifest(text: TextFile) -> Result<Self, FileError> {
        let (manifest, file) = Manifest::parse(text)?;
        manifest.check_command(CommandKind::Duty).map_err(|fault| file.show(&fault))?;
        let mut experiment = manifest.to_experiment();
        experiment.records = manifest.records.into_iter().map(Entry::into_record).collect();
        Ok(experiment)
    }

    /// By which two results can be seen to rest on the same files: [`checksum_of_files`] of a log, or of the `experiment.toml` in a
    /// folder and then of each record. `None` where they are not all there, as of records that were never written.
    #[must_use]
    pub fn checksum(source: &Path) -> Option<String> {
        if source.is_file() {
            return checksum_of_files([source.to_owned()]);
        }
        Self::checksum_in(source.into())
    }

    /// [`Self::checksum`] of a folder.
    #[must_use]
    pub fn checksum_in(folder: InputFolder) -> Option<String> {
        let (described, _) = Manifest::parse(folder.text(MANIFEST).ok()?).ok()?;
        let named = described.records.iter().flat_map(|entry| [Some(&entry.file), entry.command_file.as_ref()]);
        folder.checksum(std::iter::once(MANIFEST).chain(named.flatten().map(String::as_str)))
    }

    /// As [`Self::read`], but leaves multisine records whose file is longer than `longest` bytes ([`LONG_FILE`]) on disk:
    /// their rows are not read, and the records are not in the experiment but beside it, in the order of the manifest.
    /// An estimator of spectra takes them block by block ([`LongRecord::for_each_block`](super::LongRecord::for_each_block)).
    ///
    /// [`LONG_FILE`]: super::LONG_FILE
    ///
    /// # Errors
    /// As [`Self::read`]; what is wrong with the rows that were not read shows when they are.
    pub fn read_except_long(folder: &Path, longest: u64) -> Result<(Self, Vec<LongRecord>), FileError> {
        Self::read_all(folder.into(), CommandKind::Duty, true, longest)
    }

    /// Reads the folder of an experiment on a stand without a motor: `command = "force_n"`, and the column `command` is the
    /// force put in, in newtons. Everything else is as for [`Self::read`]; `nominal` has no meaning and is zero.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn read_force_input(folder: &Path) -> Result<Self, FileError> {
        Self::read_kind(folder, CommandKind::ForceN, true)
    }

    /// Reads response logs that were recorded apart from their commands: as [`Experiment::read`], but the column `command`
    /// may be absent, and is all zeros whether it is or not. A command log ([`read_command_log`]) belongs to each.
    ///
    /// # Errors
    /// As for [`Experiment::read`].
    pub fn read_responses(folder: &Path) -> Result<Self, FileError> {
        let mut experiment = Self::read_kind(folder, CommandKind::Duty, false)?;
        for record in &mut experiment.records {
            record.command = vec![0.0; record.time_s.len()];
        }
        Ok(experiment)
    }

    fn read_kind(folder: &Path, kind: CommandKind, with_command: bool) -> Result<Self, FileError> {
        Self::read_all(folder.into(), kind, with_command, u64::MAX).map(|(experiment, _)| experiment)
    }

    fn read_all(
        folder: InputFolder,
        kind: CommandKind,
        with_command: bool,
        longest: u64,
    ) -> Result<(Self, Vec<LongRecord>), FileError> {
        let (manifest, file) = Manifest::parse(manifest_text(folder)?)?;
        manifest.check_command(kind).map_err(|fault| file.show(&fault))?;
        for (index, entry) in manifest.records.iter().enumerate() {
            check_files(folder, index, entry, &file)?;
        }
        let mut experiment = manifest.to_experiment();
        let is_long = |entry: &Entry| {
            entry.excitation == Excitation::Multisine
                && folder.length(&entry.file) > longest
                && entry.command_file.is_none()
        };
        let (long, short): (Vec<_>, Vec<_>) = manifest.records.into_iter().partition(is_long);
        let long = long
            .into_iter()
            .map(|entry| LongRecord {
                path: folder.path(&entry.file),
                header: entry.into_record(),
                output: experiment.output,
                stated_hz: experiment.sample_rate_hz,
            })
            .collect();
        // Side by side; the error is that of the first faulty record, whichever is found first.
        let records: Vec<_> = short
            .into_par_iter()
            .map(|entry| experiment.read_record(folder, entry, kind, with_command, &file))
            .collect();
        experiment.records = records.into_iter().collect::<Result<_, _>>()?;
        Ok((experiment, long))
    }

    pub(super) fn read_record(
        &self,
        folder: InputFolder,
        entry: Entry,
        kind: CommandKind,
        with_command: bool,
        manifest: &TomlFile,
    ) -> Result<Record, FileError> {
        let (table, record) = self.read_rows(folder, entry, kind, with_command)?;
        if let Some(stated_hz) = self.sample_rate_hz {
            table.check_rate(&record, stated_hz, manifest)?;
        }
        table.check_clock(&record)?;
        Ok(record)
    }

    /// The rows of a record, whatever their times are, and the table that they were taken from.
    pub(super) fn read_rows(
        &self,
        folder: InputFolder,
        entry: Entry,
        kind: CommandKind,
        with_command: bool,
    ) -> Result<(Table, Record), FileError> {
        let text = folder.text(&entry.file)?;
        let response = Column::for_output(self.output);
        let is_in_rows = with_command && entry.command_file.is_none();
        let needed: &[Column] =
            if is_in_rows { &[Column::TimeS, Column::Command, response] } else { &[Column::TimeS, response] };
        let mut table = Table::read(text, needed, kind)?;
        let command_file = entry.command_file.clone().filter(|_| with_command);
        let mut record = entry.into_record();
        table.fill(&mut record);
        if let Some(name) = command_file {
            let log = read_own_stamps(folder, name, kind, record.time_s[0])?;
            let command = log.at_rows(&record.time_s, record.excitation);
            table.check_command(&record, &command, &log)?;
            record.command = command;
            record.command_log = Some(log);
        }
        Ok((table, record))
    }
}

/// The command log of a record whose first row is at `first_s`.
fn read_own_stamps(
    folder: InputFolder,
    name: String,
    kind: CommandKind,
    first_s: f64,
) -> Result<CommandLog, FileError> {
    let text = folder.text(&name)?;
    let mut table = Table::read(text, &[Column::TimeS, Column::Command], kind)?;
    let (time_s, command) = (table.take(Column::TimeS), table.take(Column::Command));
    table.check_start(first_s, time_s[0])?;
    Ok(CommandLog { file: name, time_s, command })
}

/// A command log as it is on disk.
#[derive(Clone, Debug, PartialEq)]
pub struct CommandFile {
    /// Times in seconds on the commanding computer's clock, strictly increasing.
    pub time_s: Vec<f64>,
    /// Commands, 0..1; each holds until the next row.
    pub command: Vec<f64>,
    /// Thrust in newtons, where it was logged beside the command.
    pub thrust_n: Option<Vec<f64>>,
    /// Rotor speed in revolutions per minute, where it was logged beside the command.
    pub rpm: Option<Vec<f64>>,
}

impl CommandFile {
    /// The response of that name, where it was logged beside the command.
    #[must_use]
    pub fn response(&self, output: Output) -> Option<&[f64]> {
        match output {
            Output::ThrustN => self.thrust_n.as_deref(),
            Output::Rpm => self.rpm.as_deref(),
        }
    }
}

/// Reads a command log: a CSV file with the columns `time_s` and `command`. A response may be there too; other columns of a record
/// may be there and are left.
///
/// # Errors
/// When the file is missing, or anything in it is unknown, impossible or out of its range. The error shows the place.
pub fn read_command_log(path: &Path) -> Result<CommandFile, FileError> {
    let mut table = Table::read(TextFile::read(path)?, &[Column::TimeS, Column::Command], CommandKind::Duty)?;
    let mut take = |column| Some(table.take(column)).filter(|values| !values.is_empty());
    let (thrust_n, rpm) = (take(Column::ThrustN), take(Column::Rpm));
    Ok(CommandFile { time_s: table.take(Column::TimeS), command: table.take(Column::Command), thrust_n, rpm })
}

/// The text of a folder's `experiment.toml`.
fn manifest_text(folder: InputFolder) -> Result<TextFile, FileError> {
    match folder {
        InputFolder::OnDisk(folder) => TextFile::read(&manifest_path(folder)?),
        InputFolder::InMemory(_) => folder.text(MANIFEST),
    }
}

pub(super) fn manifest_path(folder: &Path) -> Result<std::path::PathBuf, FileError> {
    if folder.is_file() {
        let mut remedy = String::from("give the folder that holds experiment.toml");
        if !TomlFile::is_called_so(folder) {
            let log = folder.display();
            remedy += &format!(
                "; `rotorlead import {log} --out DIR` makes one from a log, and `rotorlead identify {log}` judges it as it is"
            );
        }
        return Err(FileError::NotAFolder { path: folder.to_owned(), remedy: remedy.into() });
    }
    let path = folder.join(MANIFEST);
    if path.exists() {
        return Ok(path);
    }
    let (path, remedy) = if folder.exists() {
        let remedy = "give a folder that holds an experiment.toml and one CSV file per record; \
                      `rotorlead import` makes one from a log";
        (path, remedy)
    } else {
        let remedy = "check the path; relative paths start at the current folder";
        (folder.to_owned(), remedy)
    };
    Err(FileError::Missing { path, remedy })
}

/// Shows a file that is named but not there where it is named.
pub(super) fn check_files(folder: InputFolder, index: usize, entry: &Entry, file: &TomlFile) -> Result<(), FileError> {
    let named = [
        ("file", Some(&entry.file)),
        ("command_file", entry.command_file.as_ref()),
        ("compensator", entry.compensator.as_ref()),
    ];
    for (key, name) in named {
        if let Some(name) = name.filter(|name| !folder.has(name)) {
            let fault = place(index).key(key).fault(
                format!("`{}` does not exist", folder.path(name).display()),
                "correct the name, or put the file there; a record that is not to be made is taken out",
            );
            return Err(file.show(&fault));
        }
    }
    Ok(())
}
