//! Reading an experiment's folder.

use std::path::Path;

use super::manifest::{CommandKind, Entry, MANIFEST, Manifest, place};
use super::table::Table;
use super::{Experiment, Record};
use crate::files::{FileError, Place, TextFile, TomlFile};

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
        Self::read_kind(folder, CommandKind::Duty)
    }

    /// Reads the folder of an experiment on a stand without a motor: `command = "force_n"`, and the column `command` is the
    /// force put in, in newtons. Everything else is as for [`Self::read`]; `nominal` has no meaning and is zero.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn read_force(folder: &Path) -> Result<Self, FileError> {
        Self::read_kind(folder, CommandKind::ForceN)
    }

    fn read_kind(folder: &Path, kind: CommandKind) -> Result<Self, FileError> {
        let path = manifest_path(folder)?;
        let (manifest, file): (Manifest, _) = TomlFile::read(&path)?;
        manifest.check().map_err(|fault| file.show(&fault))?;
        if manifest.command != kind {
            let (message, help) = match kind {
                CommandKind::Duty => (
                    "the command is a force, and a motor's is a duty",
                    "this is an experiment on a stand: use `rotorlead identify --stand`",
                ),
                CommandKind::ForceN => (
                    "the command is a duty, and a stand's input is a force",
                    "set it to \"force_n\" when the column `command` is the force put into the stand, in newtons",
                ),
            };
            return Err(file.show(&Place::root().key("command").fault(message, help)));
        }
        for (index, entry) in manifest.records.iter().enumerate() {
            check_files(folder, index, entry, &file)?;
        }
        let mut experiment = Self {
            name: manifest.name,
            output: manifest.output,
            sample_rate_hz: manifest.sample_rate_hz,
            esc_frame_hz: manifest.esc_frame_hz,
            command_rate_hz: manifest.command_rate_hz,
            records: Vec::new(),
        };
        for entry in manifest.records {
            let record = experiment.read_record(folder, entry, kind)?;
            experiment.records.push(record);
        }
        Ok(experiment)
    }

    fn read_record(&self, folder: &Path, entry: Entry, kind: CommandKind) -> Result<Record, FileError> {
        let text = TextFile::read(&folder.join(&entry.file))?;
        let mut table = Table::read(text, self.output, kind)?;
        let mut record = entry.into_record();
        table.fill(&mut record);
        if let Some(stated_hz) = self.sample_rate_hz {
            table.check_rate(&record, stated_hz)?;
        }
        Ok(record)
    }
}

fn manifest_path(folder: &Path) -> Result<std::path::PathBuf, FileError> {
    if folder.is_file() {
        return Err(FileError::NotAFolder {
            path: folder.to_owned(),
            remedy: "give the folder that holds experiment.toml",
        });
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
fn check_files(folder: &Path, index: usize, entry: &Entry, file: &TomlFile) -> Result<(), FileError> {
    let named = [("file", Some(&entry.file)), ("compensator", entry.compensator.as_ref())];
    for (key, name) in named {
        if let Some(path) = name.map(|name| folder.join(name))
            && !path.exists()
        {
            let fault = place(index)
                .key(key)
                .fault(format!("`{}` does not exist", path.display()), "correct the name, or put the file there");
            return Err(file.show(&fault));
        }
    }
    Ok(())
}
