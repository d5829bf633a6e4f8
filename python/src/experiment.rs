//! Records: a folder, or columns in memory that have the same keys.

use std::path::PathBuf;

use numpy::{AllowTypeChange, IntoPyArray as _, PyArrayLike1};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList, PyMapping};
use rotorlead_diagnose::fill_in_esc_commands;
use rotorlead_records::files::{FileError, KeyPath, TextFile};
use rotorlead_records::{Experiment, LONG_FILE, LongRecord, Output, Record};
use serde_json::json;
use toml::{Table, Value};

use crate::argument::{Given, read};
use crate::error::refused;
use crate::value::{check_whole, to_dict, to_table};

/// Columns of a record, as the header of its CSV file names them.
const COLUMNS: [&str; 7] = ["time_s", "command", "thrust_n", "rpm", "esc_command", "voltage_v", "current_a"];
/// What `simulate` says beside the keys of an experiment and of a record.
const SAID: [&str; 2] = ["seed", "rows"];

/// Records that are yet to be read, or are here.
pub enum Records {
    /// A folder of an experiment.
    Folder(PathBuf),
    /// Columns in memory.
    Columns(Experiment),
}

impl Records {
    /// What was given: a folder, an experiment with a list `records`, or one record. `output` is the response of columns that
    /// do not say which it is.
    pub fn of(given: &Given, output: Option<Output>) -> PyResult<Self> {
        match given {
            Given::Path(folder) => Ok(Self::Folder(folder.clone())),
            Given::Mapping(mapping) => Ok(Self::Columns(in_memory(mapping, output)?)),
        }
    }

    /// What errors call it.
    pub fn name(&self) -> String {
        match self {
            Self::Folder(folder) => folder.display().to_string(),
            Self::Columns(experiment) => experiment.name.clone(),
        }
    }

    /// [`Experiment::checksum`] of the folder.
    pub fn checksum(&self) -> Option<String> {
        match self {
            Self::Folder(folder) => Experiment::checksum(folder),
            Self::Columns(_) => None,
        }
    }

    /// All records, but for those whose rows stay on disk.
    pub fn read_leaving_long(self) -> Result<(Experiment, Vec<LongRecord>), FileError> {
        match self {
            Self::Folder(folder) => Experiment::read_except_long(&folder, LONG_FILE),
            Self::Columns(experiment) => Ok((experiment, Vec::new())),
        }
    }

    /// All records, those behind a compensator with what the ESC got.
    pub fn read_with_esc_commands(self) -> Result<Experiment, FileError> {
        let (mut experiment, folder) = match self {
            Self::Folder(folder) => (Experiment::read(&folder)?, folder),
            Self::Columns(experiment) => (experiment, PathBuf::new()),
        };
        fill_in_esc_commands(&mut experiment, &folder)?;
        Ok(experiment)
    }
}

/// The experiment of a mapping. Its keys are written as `experiment.toml` has them, and are read and refused as those are; its
/// columns are held to what those of a CSV file are.
fn in_memory(mapping: &Bound<PyMapping>, output: Option<Output>) -> PyResult<Experiment> {
    let is_one = !mapping.contains("records")?;
    let records: Vec<Bound<PyMapping>> =
        if is_one { vec![mapping.clone()] } else { mapping.get_item("records")?.extract()? };
    let mut manifest = if is_one { Table::new() } else { without(mapping, &["records"])? };
    let mut entries = Vec::new();
    let mut columns = Vec::new();
    for (index, record) in records.iter().enumerate() {
        let mut entry = without(record, &COLUMNS)?;
        if is_one {
            // One record says of itself what an experiment says of all.
            for key in ["name", "output", "sample_rate_hz", "esc_frame_hz", "command_rate_hz"] {
                manifest.extend(entry.remove(key).map(|value| (key.to_owned(), value)));
            }
        }
        entry.entry("file").or_insert_with(|| format!("record_{}", index + 1).into());
        entries.push(Value::Table(entry));
        columns.push(columns_of(record)?);
    }
    let of_all = |name| columns.iter().all(|columns: &Columns| columns.iter().any(|(column, _)| *column == name));
    // Where records have one response there is one answer; where they have both it has to be given.
    let output = output.or(match (of_all("thrust_n"), of_all("rpm")) {
        (true, true) => None,
        (false, true) => Some(Output::Rpm),
        _ => Some(Output::ThrustN),
    });
    for (key, value) in [("format", 1.into()), ("command", "duty".into()), ("name", "records".into())] {
        manifest.entry(key).or_insert(value);
    }
    if let Some(output) = output {
        manifest.entry("output").or_insert(output.column().into());
    }
    manifest.insert("record".to_owned(), Value::Array(entries));
    let mut experiment = read(Experiment::from_manifest(TextFile::in_memory("records", manifest.to_string())))?;
    for (record, columns) in experiment.records.iter_mut().zip(columns) {
        columns.into_iter().for_each(|(name, values)| fill(record, name, values));
    }
    read(experiment.check())?;
    Ok(experiment)
}

/// The entries of a mapping that are none of `columns` and nothing that `simulate` adds.
fn without(mapping: &Bound<PyMapping>, columns: &[&str]) -> PyResult<Table> {
    let rest = PyDict::new(mapping.py());
    for item in mapping.items()? {
        let (key, value): (String, Bound<PyAny>) = item.extract()?;
        if !columns.contains(&key.as_str()) && !SAID.contains(&key.as_str()) {
            rest.set_item(key, value)?;
        }
    }
    to_table(rest.as_mapping())
}

type Columns = Vec<(&'static str, Vec<f64>)>;

/// The columns that a record has.
fn columns_of(record: &Bound<PyMapping>) -> PyResult<Columns> {
    let mut columns = Vec::new();
    for name in COLUMNS {
        let Some(values) = record.get_item(name).ok().filter(|values| !values.is_none()) else { continue };
        check_whole(name, &values)?;
        let values = column(&values).ok_or_else(|| {
            let place = KeyPath::root().key(name);
            refused(
                &place.fault("this is no column of numbers", "give a one-dimensional array, one number for each row"),
            )
        })?;
        columns.push((name, values));
    }
    Ok(columns)
}

/// Kinds of NumPy's types that are numbers as they are: texts, dates and flags would be made such, and lose what they mean.
const NUMBERS: &str = "iufO";

/// The numbers of an array, or of what makes one.
fn column(values: &Bound<PyAny>) -> Option<Vec<f64>> {
    let array = values.py().import("numpy").ok()?.call_method1("asarray", (values,)).ok()?;
    let kind: String = array.getattr("dtype").ok()?.getattr("kind").ok()?.extract().ok()?;
    if !NUMBERS.contains(&kind) {
        return None;
    }
    let array: PyArrayLike1<f64, AllowTypeChange> = array.extract().ok()?;
    Some(array.as_array().to_vec())
}

fn fill(record: &mut Record, name: &str, values: Vec<f64>) {
    match name {
        "time_s" => record.time_s = values,
        "command" => record.command = values,
        "thrust_n" => record.thrust_n = Some(values),
        "rpm" => record.rpm = Some(values),
        "esc_command" => record.esc_command = Some(values),
        "voltage_v" => record.voltage_v = Some(values),
        _ => record.current_a = Some(values),
    }
}

/// The keys of an experiment, of its records and their columns, in a dict that already names the records.
pub fn describe<'py>(dict: &Bound<'py, PyDict>, experiment: Experiment) -> PyResult<()> {
    let py = dict.py();
    let of_all = json!({
        "output": experiment.output,
        "sample_rate_hz": experiment.sample_rate_hz,
        "esc_frame_hz": experiment.esc_frame_hz,
        "command_rate_hz": experiment.command_rate_hz,
    });
    dict.update(to_dict(py, &of_all)?.as_mapping())?;
    let records: Bound<PyList> = dict.as_any().get_item("records")?.cast_into()?;
    for (dict, record) in records.iter().zip(experiment.records) {
        let dict: Bound<PyDict> = dict.cast_into()?;
        let of_one = json!({
            "excitation": record.excitation,
            "period_s": record.period_s,
            "amplitude": record.amplitude,
            "compensated": record.compensated,
            "compensator": record.compensator,
            "role": record.role,
        });
        dict.update(to_dict(py, &of_one)?.as_mapping())?;
        let columns = [
            Some(record.time_s),
            Some(record.command),
            record.thrust_n,
            record.rpm,
            record.esc_command,
            record.voltage_v,
            record.current_a,
        ];
        for (name, values) in COLUMNS.into_iter().zip(columns) {
            dict.set_item(name, values.map(|values| values.into_pyarray(py)))?;
        }
    }
    Ok(())
}
