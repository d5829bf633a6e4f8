//! More records for an experiment that is on disk already.

use std::fs::File;
use std::path::Path;

use serde::Serialize;

use super::Experiment;
use super::manifest::{Entry, MANIFEST, Manifest, place};
use super::write::record_files;
use crate::files::{FileError, KeyPath, TextFile, TomlFile, all_or_nothing, to_toml, write_file, write_file_parts};

/// What is added to the text of `experiment.toml`.
#[derive(Serialize)]
struct Addition {
    #[serde(rename = "record")]
    records: Vec<Entry>,
}

impl Experiment {
    /// Whether there is an experiment in `folder`.
    #[must_use]
    pub fn is_at(folder: &Path) -> bool {
        folder.join(MANIFEST).exists()
    }

    /// Whether records of this experiment may be added to the one in `folder`: both have the same output and rates.
    ///
    /// # Errors
    /// When `folder` holds no experiment that can be read, or another kind: the error shows the key.
    pub fn check_appendable(&self, folder: &Path) -> Result<(), FileError> {
        let (there, file): (Manifest, _) = TomlFile::read(&folder.join(MANIFEST))?;
        there.check().map_err(|fault| file.show(&fault))?;
        let here = Manifest::from_experiment(self);
        let refuse = |key: &str, there: String, here: String| {
            let fault = KeyPath::root().key(key).fault(
                format!("the experiment has {there}, and the record to be added {here}"),
                "record as the others were recorded, or into another folder",
            );
            Err(file.show(&fault))
        };
        if there.output != here.output {
            return refuse("output", format!("`{}`", there.output.column()), format!("`{}`", here.output.column()));
        }
        let rates = [
            ("sample_rate_hz", there.sample_rate_hz, here.sample_rate_hz),
            ("esc_frame_hz", there.esc_frame_hz, here.esc_frame_hz),
            ("command_rate_hz", there.command_rate_hz, here.command_rate_hz),
        ];
        let show = |rate: Option<f64>| rate.map_or_else(|| String::from("none"), |rate| format!("{rate} Hz"));
        match rates.into_iter().find(|(_, there, here)| there != here) {
            Some((key, there, here)) => refuse(key, show(there), show(here)),
            None => Ok(()),
        }
    }

    /// This experiment with the rates of the one in `folder`: its records are to be added there, and say of themselves when
    /// their rows are. That they do not contradict a rate is checked when they are added.
    ///
    /// # Errors
    /// When `folder` holds no experiment that can be read.
    pub fn with_rates_from(self, folder: &Path) -> Result<Self, FileError> {
        let (there, _): (Manifest, _) = TomlFile::read(&folder.join(MANIFEST))?;
        let Manifest { sample_rate_hz, esc_frame_hz, command_rate_hz, .. } = there;
        Ok(Self { sample_rate_hz, esc_frame_hz, command_rate_hz, ..self })
    }

    /// Adds this experiment's records to the one in `folder`: their CSV files first, then one new `experiment.toml` in
    /// place of the old one, whose text stays as it is and is only added to. A record that is described there already, and
    /// whose file has not been there, keeps its description. Whatever fails, the experiment is the old one or the new one.
    /// Several that add at once do so one after the other.
    ///
    /// # Errors
    /// Those of [`Experiment::check_appendable`] and of [`Experiment::write`]; a file of the same name; a description of
    /// something else; a file of a compensator that is not there.
    pub fn append_to(&self, folder: &Path) -> Result<(), FileError> {
        // Until the end: what others add meanwhile would not be in the new description.
        let _lock = lock(folder);
        self.check_appendable(folder)?;
        let path = folder.join(MANIFEST);
        let refused = |path: &Path, fault| FileError::refused(path, fault);
        let mut names = self.records.iter().flat_map(|record| record_files(record).into_iter().map(|(name, _)| name));
        if let Some(name) = names.find(|name| folder.join(name).exists()) {
            let fault = KeyPath::root()
                .key("record")
                .fault("there is such a file in the experiment already", "rename the log: a record is named after it");
            return Err(refused(&folder.join(name), fault));
        }
        let (there, file): (Manifest, _) = TomlFile::read(&path)?;
        let mut records = Vec::new();
        for record in &self.records {
            match there.records.iter().position(|entry| entry.file == record.file) {
                Some(index) => {
                    there.records[index].check_describes(record, &place(index)).map_err(|fault| file.show(&fault))?;
                }
                None => records.push(Entry::from_record(record)),
            }
        }
        let text =
            if records.is_empty() { None } else { Some(added(TextFile::read(&path)?.text(), &Addition { records })) };
        if let Some(text) = &text {
            // A list of records in one line, `record = [...]`, cannot be added to.
            let manifest: Manifest = toml::from_str(text).map_err(|error| {
                let help = "write each record of experiment.toml as a [[record]] of its own";
                refused(&path, KeyPath::root().key("record").fault(error.message().to_owned(), help))
            })?;
            manifest.check().map_err(|fault| refused(&path, fault))?;
        }
        for record in &self.records {
            self.check_columns(record, &self.needed()).map_err(|fault| refused(&folder.join(&record.file), fault))?;
            if let Some(name) = record.compensator.as_deref().filter(|name| !folder.join(name).exists()) {
                let fault = KeyPath::root()
                    .key("record")
                    .fault("there is no such file", "give the record the name of another file");
                return Err(refused(&folder.join(name), fault));
            }
        }
        // The description last: what it names is there.
        all_or_nothing(|| {
            for record in &self.records {
                for (name, parts) in record_files(record) {
                    write_file_parts(&folder.join(name), parts)?;
                }
            }
            text.as_ref().map_or(Ok(()), |text| write_file(&path, text.as_bytes()))
        })
    }
}

/// Waits until nobody else adds to the experiment in `folder`, and keeps others waiting until it is dropped. Not where the system
/// has no locks of folders, as Windows and some network drives.
fn lock(folder: &Path) -> Option<File> {
    // Not of the description, which is another file each time.
    let folder = File::open(folder).ok()?;
    folder.lock().ok()?;
    Some(folder)
}

/// The text of `experiment.toml` with records at its end.
fn added(text: &str, addition: &Addition) -> String {
    format!("{}\n\n{}", text.trim_end_matches('\n'), to_toml(addition))
}

#[cfg(test)]
mod tests {
    use std::{fs, thread};

    use super::*;
    use crate::experiment::{Excitation, Output, Record};
    use crate::files::testing::{Scratch, assert_report};

    fn experiment(file: &str, nominal: f64) -> Experiment {
        let record = Record {
            file: file.into(),
            nominal,
            excitation: Excitation::Step,
            period_s: None,
            amplitude: Some(0.1),
            compensated: false,
            compensator: None,
            role: None,
            time_s: vec![0.0, 0.01, 0.02],
            command: vec![nominal, nominal, nominal + 0.1],
            thrust_n: Some(vec![1.0, 1.0, 1.5]),
            rpm: None,
            command_log: None,
            esc_command: None,
            voltage_v: None,
            current_a: None,
            setpoints: crate::Setpoints::default(),
        };
        Experiment {
            name: "stand".into(),
            output: Output::ThrustN,
            sample_rate_hz: Some(100.0),
            esc_frame_hz: Some(400.0),
            command_rate_hz: None,
            records: vec![record],
        }
    }

    #[test]
    fn an_added_record_leaves_all_that_was_there() {
        let scratch = Scratch::new();
        let folder = scratch.path().join("stand");
        let (first, second) = (experiment("a.csv", 0.4), experiment("b.csv", 0.5));
        first.write(&folder).unwrap();
        let path = folder.join(MANIFEST);
        let noted = fs::read_to_string(&path).unwrap() + "# the blue motor";
        fs::write(&path, &noted).unwrap();
        second.append_to(&folder).unwrap();
        assert!(fs::read_to_string(&path).unwrap().starts_with(&noted));
        let read = Experiment::read(&folder).unwrap();
        assert_eq!(read.records, [first.records, second.records].concat());
    }

    #[cfg(unix)]
    #[test]
    fn records_that_are_added_at_once_are_all_kept() {
        let scratch = Scratch::new();
        let folder = scratch.path().join("stand");
        experiment("first.csv", 0.4).write(&folder).unwrap();
        thread::scope(|scope| {
            for number in 0..8 {
                let (added, folder) = (experiment(&format!("{number}.csv"), 0.5), &folder);
                scope.spawn(move || added.append_to(folder).unwrap());
            }
        });
        assert_eq!(Experiment::read(&folder).unwrap().records.len(), 9);
    }

    #[test]
    fn a_record_that_is_described_and_still_to_come_keeps_its_description() {
        let scratch = Scratch::new();
        let folder = scratch.path().join("stand");
        let (first, second) = (experiment("a.csv", 0.4), experiment("b.csv", 0.5));
        let both = Experiment { records: [first.records.clone(), second.records].concat(), ..first };
        both.write(&folder).unwrap();
        let path = folder.join(MANIFEST);
        let noted = fs::read_to_string(&path).unwrap() + "# the blue motor";
        fs::write(&path, &noted).unwrap();
        fs::remove_file(folder.join("b.csv")).unwrap();
        let other = |change: &dyn Fn(&mut Record)| {
            let mut other = experiment("b.csv", 0.5);
            change(&mut other.records[0]);
            other.append_to(&folder).unwrap_err()
        };
        assert_report(other(&|r| r.excitation = Excitation::Staircase), &["staircase", "step", "excitation"]);
        assert_report(other(&|r| r.nominal = 0.6), &["nominal", "0.5", "0.6"]);
        assert_report(other(&|r| r.period_s = Some(2.0)), &["period_s", "2 s", "none"]);
        assert!(!folder.join("b.csv").exists());
        // A level is not met to the last digit.
        experiment("b.csv", 0.502).append_to(&folder).unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), noted);
        let read = Experiment::read(&folder).unwrap();
        assert_eq!(read.records[1].nominal, 0.5);
        assert_eq!(read.records[1].command[1], 0.502);
        let third = Experiment { records: experiment("c.csv", 0.6).records, ..both };
        third.append_to(&folder).unwrap();
        assert_eq!(Experiment::read(&folder).unwrap().records.len(), 3);
    }

    #[test]
    fn what_does_not_belong_is_refused_and_nothing_changes() {
        let scratch = Scratch::new();
        let folder = scratch.path().join("stand");
        experiment("a.csv", 0.4).write(&folder).unwrap();
        let before = fs::read_to_string(folder.join(MANIFEST)).unwrap();
        let other = |change: &dyn Fn(&mut Experiment)| {
            let mut other = experiment("b.csv", 0.5);
            change(&mut other);
            other.append_to(&folder).unwrap_err()
        };
        assert_report(
            other(&|e| e.esc_frame_hz = Some(600.0)),
            &["esc_frame_hz", "400 Hz", "600 Hz", "another folder"],
        );
        assert_report(other(&|e| e.command_rate_hz = Some(5000.0)), &["command_rate_hz", "none", "5000 Hz"]);
        assert_report(other(&|e| e.records[0].file = "a.csv".into()), &["a.csv", "already", "rename the log"]);
        assert_report(other(&|e| e.records[0].command[1] = f64::NAN), &["b.csv", "command"]);
        fs::write(folder.join("b.csv"), "mine").unwrap();
        assert_report(other(&|_| {}), &["b.csv", "already"]);
        assert_eq!(fs::read_to_string(folder.join("b.csv")).unwrap(), "mine");
        assert_eq!(fs::read_to_string(folder.join(MANIFEST)).unwrap(), before);
    }
}
