//! What a motor was given, and how it is taken: logs, each of which becomes a record, or the files of an experiment's folder.

use std::path::{Path, PathBuf};

use rotorlead_records::files::{FilesInMemory, InputFolder, checksum};
use rotorlead_records::import::{
    Import, ImportError, ImportOptions, ImportSummary, import_bytes, shell_word, table_columns,
};
use rotorlead_records::{Experiment, Finding, Role};
use rotorlead_results::Logs;
use serde_json::{Map, Value};

use crate::fault::Fault;
use crate::request::import_options;

/// What a folder of an experiment has beside its records.
const MANIFEST: &str = "experiment.toml";

/// Files, in the order in which they were given.
#[derive(Default)]
pub struct Given {
    names: Vec<String>,
    files: FilesInMemory,
}

/// An experiment, taken.
pub struct Taken {
    pub experiment: Experiment,
    /// What was found in each log; `None` of a folder.
    pub logs: Option<Vec<ImportSummary>>,
    pub findings: Vec<Finding>,
    pub checksum: Option<String>,
    /// The files that it is from.
    pub names: Vec<String>,
    /// What is asked of them on the command line; `None` where nothing takes them there as they are here.
    pub typed: Option<Typed>,
}

/// Logs as they are given on the command line.
pub struct Typed {
    /// What brings several of them into a folder.
    import: Option<String>,
    /// What a command is given: a folder, or a log with the options that read it.
    source: String,
}

impl Taken {
    /// Whether it was taken of logs, and not of a folder.
    pub fn has_logs(&self) -> bool {
        self.logs.is_some()
    }
}

impl Typed {
    /// The report with these options.
    pub fn report(&self, options: &str) -> Vec<String> {
        self.import.iter().cloned().chain([format!("rotorlead report {}{options}", self.source)]).collect()
    }

    /// The inverse of a natural frequency, behind the report.
    pub fn inverse(&self, natural_rad_s: f64) -> [String; 2] {
        [
            format!("rotorlead identify {} --out model.toml", self.source),
            format!("rotorlead design model.toml --kind inverse --natural {natural_rad_s} --out compensator.toml"),
        ]
    }
}

impl Given {
    /// Adds a file, which the page gives a name of its own. One of a name that is there already takes its place.
    pub fn add(&mut self, name: String, bytes: Vec<u8>) {
        if self.files.insert(name.clone(), bytes).is_none() {
            self.names.push(name);
        }
    }

    /// The files as a folder.
    pub fn folder(&self) -> InputFolder<'_> {
        (&self.files).into()
    }

    /// Takes them.
    pub fn read(&self, options: &Map<String, Value>, held_out: &[String]) -> Result<Taken, Fault> {
        if self.files.contains_key(MANIFEST) {
            self.read_folder(options, held_out)
        } else {
            self.read_logs(options, held_out)
        }
    }

    fn read_folder(&self, options: &Map<String, Value>, held_out: &[String]) -> Result<Taken, Fault> {
        if let Some(option) = options.keys().chain(held_out).next() {
            let message = format!("`{option}` says what is in a log, and these are the files of an experiment");
            return Err(Fault::new(message, format!("leave it out: {MANIFEST} says it")));
        }
        Ok(Taken {
            experiment: Experiment::from_files(&self.files)?,
            logs: None,
            findings: Vec::new(),
            checksum: Experiment::checksum_in(self.folder()),
            names: self.names.clone(),
            typed: Some(Typed { import: None, source: ".".to_owned() }),
        })
    }

    fn read_logs(&self, options: &Map<String, Value>, held_out: &[String]) -> Result<Taken, Fault> {
        let typed = typed(options);
        let options = import_options(options)?;
        let paths: Vec<PathBuf> = self.names.iter().map(PathBuf::from).collect();
        let mut fault = None;
        let logs = Logs::read(&paths, true, |file| {
            self.import(file, &options).map_err(|found| {
                fault = Some(found);
                miette::miette!("one of the logs is not taken")
            })
        });
        let mut logs = logs.map_err(|error| fault.unwrap_or_else(|| error.into()))?;
        if !held_out.is_empty() {
            hold_out(&mut logs.experiment, &self.names, held_out)?;
        }
        // What a folder with these records would be refused for.
        logs.experiment.check()?;
        let sum = match &self.names[..] {
            [only] => self.files.get(only).map(|bytes| checksum(bytes)),
            _ => None,
        };
        Ok(Taken {
            experiment: logs.experiment,
            logs: Some(logs.summaries),
            findings: logs.findings,
            checksum: sum,
            names: self.names.clone(),
            // Which runs are held out no command says.
            typed: held_out.is_empty().then(|| self.typed(&typed)),
        })
    }

    fn import(&self, file: &Path, options: &ImportOptions) -> Result<Import, Fault> {
        let bytes = self.files.get(&*file.to_string_lossy()).map_or(&[][..], |bytes| bytes);
        let asks = |error: ImportError| Fault::from_log(&error, table_columns(file, bytes));
        let log = import_bytes(file, bytes, options).map_err(asks)?;
        match options.unused_in(&log.summary) {
            None => Ok(log),
            Some((option, reason)) => {
                let message = format!("{option} does not go with `{}`: {reason}", file.display());
                Err(Fault::new(message, format!("leave {option} out")))
            }
        }
    }

    fn typed(&self, options: &str) -> Typed {
        let words: Vec<_> = self.names.iter().map(|name| shell_word(name)).collect();
        match &words[..] {
            [only] => Typed { import: None, source: format!("{only}{options}") },
            all => Typed {
                import: Some(format!("rotorlead import {}{options} --out stand", all.join(" "))),
                source: "stand".to_owned(),
            },
        }
    }
}

/// Has the records of these logs be held out.
fn hold_out(experiment: &mut Experiment, names: &[String], held_out: &[String]) -> Result<(), Fault> {
    if experiment.records.len() != names.len() {
        return Err(Fault::new("a log of several motors is not held out", "hold out a log with one record"));
    }
    let is_held_out = |name: &String| held_out.contains(name);
    if names.iter().all(is_held_out) {
        return Err(Fault::new("all runs are held out, and nothing can be fitted", "leave one to be fitted"));
    }
    for (record, _) in experiment.records.iter_mut().zip(names).filter(|(_, name)| is_held_out(name)) {
        record.role = Some(Role::Validate);
    }
    Ok(())
}

/// Options as they are typed.
fn typed(options: &Map<String, Value>) -> String {
    let mut words = String::new();
    for (name, value) in options {
        match value {
            Value::Null | Value::Bool(false) => {}
            Value::Bool(true) => words += &format!(" --{name}"),
            Value::Array(values) => {
                values.iter().for_each(|value| words += &format!(" --{name} {}", word(value)));
            }
            value => words += &format!(" --{name} {}", word(value)),
        }
    }
    words
}

fn word(value: &Value) -> String {
    shell_word(&value.as_str().map_or_else(|| value.to_string(), str::to_owned)).into_owned()
}
