//! The experiment that a controller's records go to.

use std::fs;
use std::path::{Path, PathBuf};

use rotorlead::settings::Settings;
use rotorlead_plant::CompensatorDesign;
use rotorlead_records::files::{FileError, OutputFolder};
use rotorlead_records::{Experiment, Output, Record};

use super::design;

/// An experiment's folder, new or not, to which records are added one by one: what is there is whole at any time, so
/// whatever ends a series of records leaves those that were complete.
pub struct ExperimentFolder<'a> {
    path: &'a Path,
    /// The experiment without records.
    header: Experiment,
    design: CompensatorDesign,
}

impl<'a> ExperimentFolder<'a> {
    /// The folder at `path`, for records of a controller's motor with these settings, one row in `divisor` ticks, whose
    /// output frames come at `esc_frame_hz` and whose response is `output`.
    ///
    /// # Errors
    /// When records like these cannot go there, so that it is said before the work.
    pub fn new(
        path: &'a Path,
        settings: &Settings,
        motor: u8,
        divisor: u16,
        esc_frame_hz: f64,
        output: Output,
    ) -> miette::Result<Self> {
        let loop_rate_hz = f64::from(settings.loop_rate_hz);
        let header = Experiment {
            name: "recorded by the controller".into(),
            output,
            sample_rate_hz: Some(loop_rate_hz / f64::from(divisor)),
            esc_frame_hz: Some(esc_frame_hz),
            command_rate_hz: (divisor > 1).then_some(loop_rate_hz),
            records: Vec::new(),
        };
        if Experiment::is_at(path) {
            header.check_appendable(path)?;
        } else {
            OutputFolder::create(path)?;
        }
        Ok(Self { path, header, design: design(settings, motor)? })
    }

    /// Adds a record under the first free name that begins with `stem`, which is returned.
    ///
    /// # Errors
    /// When it cannot be written; then what was there is there still.
    pub fn add(&self, stem: &str, record: Record) -> miette::Result<String> {
        self.add_to(self.path, stem, record)
    }

    /// Puts the rows of a record that was not completed into a folder of their own beside this one, which is returned.
    ///
    /// # Errors
    /// As [`Self::add`].
    pub fn salvage(&self, stem: &str, record: Record) -> miette::Result<PathBuf> {
        let beside = (1..).map(|n| suffixed(self.path, &numbered(".partial", n, "")));
        let path = beside.into_iter().find(|path| !path.exists()).unwrap_or_else(|| self.path.to_owned());
        self.add_to(&path, stem, record)?;
        Ok(path)
    }

    fn add_to(&self, path: &Path, stem: &str, mut record: Record) -> miette::Result<String> {
        record.file = free_name(path, stem, ".csv");
        let file = record.file.clone();
        let is_new = !Experiment::is_at(path);
        let compensator = if record.compensated { Some(self.compensator(path)?) } else { None };
        record.compensator = compensator.as_ref().map(|(name, _)| PathBuf::from(name));
        let experiment = Experiment { records: vec![record], ..self.header.clone() };
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
                rotorlead_records::files::write_file(&path.join(name), &text)?;
            }
            experiment.append_to(path)?;
        }
        Ok(file)
    }

    /// Name and text of the compensator's file: the one that is there, or else a free name.
    fn compensator(&self, path: &Path) -> Result<(String, Vec<u8>), FileError> {
        let text = self.design.text(path)?.into_bytes();
        let names = (1..).map(|n| numbered("compensator", n, ".toml"));
        let fits = |name: &String| fs::read(path.join(name)).map_or(!path.join(name).exists(), |there| there == text);
        let name = names.into_iter().find(fits).unwrap_or_default();
        Ok((name, text))
    }
}

/// `stem.csv`, or `stem_2.csv` where there is one already, and so on.
fn free_name(folder: &Path, stem: &str, extension: &str) -> String {
    let names = (1..).map(|n| numbered(stem, n, extension));
    names.into_iter().find(|name| !folder.join(name).exists()).unwrap_or_default()
}

fn numbered(stem: &str, n: u32, extension: &str) -> String {
    if n == 1 { format!("{stem}{extension}") } else { format!("{stem}_{n}{extension}") }
}

/// `path` with `suffix` behind its name.
fn suffixed(path: &Path, suffix: &str) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(suffix);
    PathBuf::from(name)
}
