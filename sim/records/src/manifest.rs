//! `experiment.toml`: the keys of an experiment, strictly.

use std::collections::BTreeSet;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use super::{Excitation, Experiment, NOMINAL_TOLERANCE, Output, Record, Role, Setpoints};
use crate::files::{Fault, FileError, KeyPath, TextFile, TomlFile, is_plain_name};

/// The file's name in the experiment's folder.
pub(super) const MANIFEST: &str = "experiment.toml";

/// A period is the same within this share.
const SAME_PERIOD: f64 = 1e-9;

/// The file as it is written.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Manifest {
    pub(super) format: u32,
    pub(super) name: String,
    pub(super) command: CommandKind,
    pub(super) output: Output,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) sample_rate_hz: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) esc_frame_hz: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) command_rate_hz: Option<f64>,
    #[serde(rename = "record", default)]
    pub(super) records: Vec<Entry>,
}

/// What the column `command` holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum CommandKind {
    /// A duty from 0 to 1.
    Duty,
    /// A force in newtons, put into a stand instead of a motor's thrust.
    ForceN,
}

/// One `[[record]]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Entry {
    pub(super) file: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) command_file: Option<String>,
    pub(super) nominal: f64,
    pub(super) excitation: Excitation,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) period_s: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) amplitude: Option<f64>,
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub(super) compensated: bool,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) compensator: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) role: Option<Role>,
}

/// `[[record]]` number `index` (from zero).
pub(super) fn place(index: usize) -> KeyPath {
    KeyPath::root().key("record").item(index)
}

impl Manifest {
    /// What `experiment.toml` says of `experiment`.
    pub(super) fn from_experiment(experiment: &Experiment) -> Self {
        Self {
            format: 1,
            name: experiment.name.clone(),
            command: CommandKind::Duty,
            output: experiment.output,
            sample_rate_hz: experiment.sample_rate_hz,
            esc_frame_hz: experiment.esc_frame_hz,
            command_rate_hz: experiment.command_rate_hz,
            records: experiment.records.iter().map(Entry::from_record).collect(),
        }
    }

    /// Reads and checks the file's text.
    pub(super) fn parse(text: TextFile) -> Result<(Self, TomlFile), FileError> {
        let (manifest, file): (Self, _) = TomlFile::parse(text)?;
        manifest.check().map_err(|fault| file.show(&fault))?;
        Ok((manifest, file))
    }

    /// The experiment, with the records still to be added.
    pub(super) fn to_experiment(&self) -> Experiment {
        Experiment {
            name: self.name.clone(),
            output: self.output,
            sample_rate_hz: self.sample_rate_hz,
            esc_frame_hz: self.esc_frame_hz,
            command_rate_hz: self.command_rate_hz,
            records: Vec::new(),
        }
    }

    /// The rules that the types do not express: the first that is broken.
    pub(super) fn check(&self) -> Result<(), Fault> {
        self.faults().into_iter().next().map_or(Ok(()), |(_, fault)| Err(fault))
    }

    /// Refuses a column `command` that holds something else.
    pub(super) fn check_command(&self, kind: CommandKind) -> Result<(), Fault> {
        if self.command == kind {
            return Ok(());
        }
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
        Err(KeyPath::root().key("command").fault(message, help))
    }

    /// Everything that [`Self::check`] would refuse, with the index of its record where it is one record's.
    pub(super) fn faults(&self) -> Vec<(Option<usize>, Fault)> {
        let root = KeyPath::root();
        let mut faults = Vec::new();
        for (key, rate) in [
            ("sample_rate_hz", self.sample_rate_hz),
            ("esc_frame_hz", self.esc_frame_hz),
            ("command_rate_hz", self.command_rate_hz),
        ] {
            if let Some(Err(fault)) = rate.map(|rate| root.key(key).accept(rate)) {
                faults.push((None, fault));
            }
        }
        if let (Some(command), Some(sample)) = (self.command_rate_hz, self.sample_rate_hz)
            && command < sample
        {
            let fault = root.key("command_rate_hz").fault(
                format!("{command} Hz is slower than the rows, {sample} Hz"),
                "remove it: the rows show every change of the command by themselves",
            );
            faults.push((None, fault));
        }
        if self.records.is_empty() {
            let fault = root.key("record").fault(
                "the experiment has no record",
                "add a [[record]] with file, nominal and excitation for each CSV file",
            );
            faults.push((None, fault));
        }
        let mut files = BTreeSet::new();
        for (index, entry) in self.records.iter().enumerate() {
            if let Err(fault) = entry.check(&place(index)) {
                faults.push((Some(index), fault));
            }
            let named = [("file", Some(&entry.file)), ("command_file", entry.command_file.as_ref())];
            for (key, name) in named.into_iter().filter_map(|(key, name)| Some((key, name?))) {
                if !files.insert(name) {
                    let fault = place(index).key(key).fault(
                        format!("`{name}` is named twice"),
                        "remove one of the two: the same data would count double",
                    );
                    faults.push((Some(index), fault));
                }
            }
        }
        faults
    }
}

impl Entry {
    pub(super) fn from_record(record: &Record) -> Self {
        Self {
            file: record.file.clone(),
            command_file: record.command_log.as_ref().map(|log| log.file.clone()),
            nominal: record.nominal,
            excitation: record.excitation,
            period_s: record.period_s,
            amplitude: record.amplitude,
            compensated: record.compensated,
            compensator: record.compensator.as_ref().map(|path| path.to_string_lossy().into_owned()),
            role: record.role,
        }
    }

    fn check(&self, place: &KeyPath) -> Result<(), Fault> {
        plain(&self.file, place.key("file"))?;
        if let Some(name) = &self.command_file {
            plain(name, place.key("command_file"))?;
        }
        place.key("nominal").accept(self.nominal)?;
        if let Some(period_s) = self.period_s {
            place.key("period_s").accept(period_s)?;
        } else if self.excitation.is_periodic() {
            return Err(place
                .key("period_s")
                .fault("a multisine or square wave has a period, and it is not given", "add `period_s`, in seconds"));
        }
        if let Some(amplitude) = self.amplitude {
            place.key("amplitude").accept(amplitude)?;
        }
        match (&self.compensator, self.compensated) {
            (Some(name), true) => plain(name, place.key("compensator")),
            (None, false) => Ok(()),
            (None, true) => Err(place.key("compensated").fault(
                "a compensated record names its compensator, and none is given",
                "add `compensator`, the name of its file in the same folder",
            )),
            (Some(_), false) => Err(place.key("compensator").fault(
                "the record names a compensator, but `compensated` is not true",
                "set `compensated = true`, or remove `compensator`",
            )),
        }
    }

    /// Whether it describes `record`, whose file it names: this is where it stands.
    pub(super) fn check_describes(&self, record: &Record, place: &KeyPath) -> Result<(), Fault> {
        let period = |period_s: Option<f64>| period_s.map_or_else(|| String::from("none"), |s| format!("{s} s"));
        let is_same_period = match (self.period_s, record.period_s) {
            (Some(here), Some(there)) => (here / there - 1.0).abs() < SAME_PERIOD,
            (here, there) => here == there,
        };
        let differs = if self.excitation != record.excitation {
            Some(("excitation", self.excitation.name().to_owned(), record.excitation.name().to_owned()))
        } else if !is_same_period {
            Some(("period_s", period(self.period_s), period(record.period_s)))
        } else if (self.nominal - record.nominal).abs() > NOMINAL_TOLERANCE {
            Some(("nominal", self.nominal.to_string(), format!("{:.4}", record.nominal)))
        } else if self.compensated != record.compensated {
            Some(("compensated", self.compensated.to_string(), record.compensated.to_string()))
        } else {
            None
        };
        differs.map_or(Ok(()), |(key, here, there)| {
            Err(place.key(key).fault(
                format!("`{}` is described with {here} here, and the record to be added has {there}", self.file),
                "correct the description, or rename the log: a record is named after it",
            ))
        })
    }

    /// The record, with the columns still to be filled.
    pub(super) fn into_record(self) -> Record {
        Record {
            file: self.file,
            nominal: self.nominal,
            excitation: self.excitation,
            period_s: self.period_s,
            amplitude: self.amplitude,
            compensated: self.compensated,
            compensator: self.compensator.map(PathBuf::from),
            role: self.role,
            time_s: Vec::new(),
            command: Vec::new(),
            command_log: None,
            thrust_n: None,
            rpm: None,
            esc_command: None,
            voltage_v: None,
            current_a: None,
            setpoints: Setpoints::default(),
        }
    }
}

fn plain(name: &str, place: KeyPath) -> Result<(), Fault> {
    if is_plain_name(name) {
        Ok(())
    } else {
        Err(place.fault(
            format!("`{name}` is not the name of a file inside the experiment's folder"),
            "put the file in the folder and give its name relative to it, without `..`",
        ))
    }
}
