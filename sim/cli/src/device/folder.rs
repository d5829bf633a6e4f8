//! The experiment that a controller's records go to.

use std::fs;
use std::path::{Path, PathBuf};

use rotorlead_device::{Header, Keeper, free_name};
use rotorlead_records::files::{FileError, OutputFolder, write_file};
use rotorlead_records::{Experiment, Record};

/// An experiment's folder, new or not, to which records are added one by one: what is there is whole at any time, so
/// whatever ends a series of records leaves those that were complete.
pub struct ExperimentFolder {
    path: PathBuf,
    header: Header,
}

impl ExperimentFolder {
    /// The folder at `path`.
    ///
    /// # Errors
    /// When records like these cannot go there, so that it is said before the work.
    pub fn new(path: &Path, header: Header) -> Result<Self, FileError> {
        if Experiment::is_at(path) {
            header.experiment.check_appendable(path)?;
        } else {
            OutputFolder::create(path)?;
        }
        Ok(Self { path: path.to_owned(), header })
    }

    /// Puts the rows of a record that was not completed into a folder of their own beside this one, which is returned.
    ///
    /// # Errors
    /// As [`Keeper::add`].
    pub fn salvage(&self, stem: &str, record: Record) -> miette::Result<PathBuf> {
        let suffix = free_name(".partial", "", |suffix| suffixed(&self.path, suffix).exists());
        let path = suffixed(&self.path, &suffix);
        self.add_to(&path, stem, record)?;
        Ok(path)
    }

    fn add_to(&self, path: &Path, stem: &str, mut record: Record) -> miette::Result<String> {
        record.file = free_name(stem, ".csv", |name| path.join(name).exists());
        let file = record.file.clone();
        let is_new = !Experiment::is_at(path);
        let compensator = if record.compensated { Some(self.compensator(path)?) } else { None };
        record.compensator = compensator.as_ref().map(|(name, _)| PathBuf::from(name));
        let experiment = Experiment { records: vec![record], ..self.header.experiment.clone() };
        if is_new {
            let folder = OutputFolder::create(path)?;
            experiment.write_into(&folder)?;
            if let Some((name, text)) = compensator {
                folder.write(&name, &text)?;
            }
            folder.commit()?;
        } else {
            if let Some((name, text)) = compensator
                && !path.join(&name).exists()
            {
                write_file(&path.join(name), &text)?;
            }
            experiment.append_to(path)?;
        }
        Ok(file)
    }

    /// Name and text of the compensator's file: the one that is there, or else a free name.
    fn compensator(&self, path: &Path) -> Result<(String, Vec<u8>), FileError> {
        let text = self.header.compensator.text(path)?.into_bytes();
        let fits = |name: &str| fs::read(path.join(name)).map_or(!path.join(name).exists(), |there| there == text);
        let name = free_name("compensator", ".toml", |name| !fits(name));
        Ok((name, text))
    }
}

impl Keeper for ExperimentFolder {
    fn place(&self) -> String {
        self.path.display().to_string()
    }

    fn add(&mut self, stem: &str, record: Record) -> miette::Result<String> {
        self.add_to(&self.path, stem, record)
    }

    fn experiment(&self) -> miette::Result<Experiment> {
        Ok(Experiment::read(&self.path)?)
    }

    fn checksum(&self) -> Option<String> {
        Experiment::checksum(&self.path)
    }

    fn write(&mut self, name: &str, text: &str) -> miette::Result<()> {
        Ok(write_file(&self.path.join(name), text.as_bytes())?)
    }
}

/// `path` with `suffix` behind its name.
fn suffixed(path: &Path, suffix: &str) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(suffix);
    PathBuf::from(name)
}
