//! Reading a folder for everything that is wrong with it, where [`Experiment::read`] stops at the first.

use std::collections::BTreeSet;
use std::path::Path;

use rayon::iter::{IntoParallelIterator as _, ParallelIterator as _};

use super::manifest::{CommandKind, Entry, Manifest};
use super::read::{check_files, manifest_path};
use super::{Experiment, Record};
use crate::files::{AcceptedRange, FileError, InputFolder, TomlFile};

/// What a folder holds, and what in it cannot be read.
#[derive(Debug)]
pub struct Inspection {
    /// What `experiment.toml` says, with the records that [`Experiment::read`] would accept; `None` where it cannot be read.
    pub experiment: Option<Experiment>,
    /// Whether the command is a force put into a stand ([`Experiment::read_force_input`]).
    pub is_force: bool,
    /// Everything that reading refuses, in the order of `experiment.toml`.
    pub unreadable: Vec<Unreadable>,
    /// CSV files in the folder that no record names.
    pub unnamed: Vec<String>,
}

/// Something that reading refuses.
#[derive(Debug)]
pub struct Unreadable {
    /// The record's file, as `experiment.toml` names it; `None` where it is no single record's fault.
    pub file: Option<String>,
    /// What is wrong, where, and what to do.
    pub error: FileError,
    /// The record as far as it can be read when its command may be any number and its rate any rate.
    pub rows: Option<Box<Record>>,
    /// Whether the file is there at all.
    pub is_there: bool,
}

impl Unreadable {
    fn new(file: Option<String>, error: FileError) -> Self {
        Self { file, error, rows: None, is_there: true }
    }
}

impl Inspection {
    /// The files of all records, where none of them is there and no other CSV file either: a folder in which nothing is recorded yet.
    #[must_use]
    pub fn not_recorded(&self) -> Option<Vec<&str>> {
        let is_empty = self.experiment.as_ref().is_some_and(|experiment| experiment.records.is_empty());
        let is_missing = |fault: &Unreadable| !fault.is_there;
        let files = self.unreadable.iter().filter_map(|fault| fault.file.as_deref());
        let is_all = is_empty && self.unnamed.is_empty() && self.unreadable.iter().all(is_missing);
        (is_all && !self.unreadable.is_empty()).then(|| files.collect())
    }
}

impl Experiment {
    /// Reads all that can be read in `folder`, and says of the rest why it cannot.
    #[must_use]
    pub fn inspect(folder: &Path) -> Inspection {
        let read = manifest_path(folder).and_then(|path| TomlFile::read::<Manifest>(&path));
        let (manifest, file) = match read {
            Ok(read) => read,
            Err(error) => {
                let unreadable = vec![Unreadable::new(None, error)];
                return Inspection { experiment: None, is_force: false, unreadable, unnamed: Vec::new() };
            }
        };
        let unnamed = unnamed(folder, &manifest);
        let mut unreadable = Vec::new();
        let mut faulty = BTreeSet::new();
        for (index, fault) in manifest.faults() {
            faulty.extend(index);
            let record = index.and_then(|index| manifest.records.get(index)).map(|entry| entry.file.clone());
            unreadable.push(Unreadable::new(record, file.show(&fault)));
        }
        let rate = |key: &str, rate: Option<f64>| rate.filter(|rate| AcceptedRange::for_key(key).accept(*rate).is_ok());
        let mut experiment = Self {
            name: manifest.name,
            output: manifest.output,
            sample_rate_hz: rate("sample_rate_hz", manifest.sample_rate_hz),
            esc_frame_hz: rate("esc_frame_hz", manifest.esc_frame_hz),
            command_rate_hz: rate("command_rate_hz", manifest.command_rate_hz),
            records: Vec::new(),
        };
        let kind = manifest.command;
        let entries: Vec<(usize, Entry)> =
            manifest.records.into_iter().enumerate().filter(|(index, _)| !faulty.contains(index)).collect();
        let read: Vec<Result<Record, Unreadable>> = entries
            .into_par_iter()
            .map(|(index, entry)| experiment.inspect_record(folder.into(), index, entry, kind, &file))
            .collect();
        for record in read {
            match record {
                Ok(record) => experiment.records.push(record),
                Err(fault) => unreadable.push(fault),
            }
        }
        Inspection { experiment: Some(experiment), is_force: kind == CommandKind::ForceN, unreadable, unnamed }
    }

    fn inspect_record(
        &self,
        folder: InputFolder,
        index: usize,
        entry: Entry,
        kind: CommandKind,
        manifest: &TomlFile,
    ) -> Result<Record, Unreadable> {
        let file = Some(entry.file.clone());
        if let Err(error) = check_files(folder, index, &entry, manifest) {
            let is_there = folder.has(&entry.file);
            return Err(Unreadable { is_there, ..Unreadable::new(file, error) });
        }
        self.read_record(folder, entry.clone(), kind, true, manifest).map_err(|error| {
            // A force may be any number.
            let rows = self.read_rows(folder, entry, CommandKind::ForceN, true).ok();
            let rows = rows.map(|(_, record)| Box::new(record));
            Unreadable { rows, ..Unreadable::new(file, error) }
        })
    }
}

/// The CSV files that lie beside `experiment.toml` and are in no record, sorted.
fn unnamed(folder: &Path, manifest: &Manifest) -> Vec<String> {
    let files = manifest.records.iter().flat_map(|entry| [Some(&entry.file), entry.command_file.as_ref()]);
    let named: BTreeSet<&str> = files.flatten().map(String::as_str).collect();
    let Ok(entries) = folder.read_dir() else { return Vec::new() };
    let names = entries.filter_map(|entry| entry.ok()?.file_name().into_string().ok());
    let mut names: Vec<String> =
        names.filter(|name| name.to_ascii_lowercase().ends_with(".csv") && !named.contains(name.as_str())).collect();
    names.sort();
    names
}
