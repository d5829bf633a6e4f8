//! Records: those of a folder, of logs, or columns in memory.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use miette::miette;
use numpy::{AllowTypeChange, IntoPyArray as _, PyArrayLike1};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyMapping};
use rotorlead_answer::Fact;
use rotorlead_diagnose::fill_in_esc_commands;
use rotorlead_records::files::{FileError, FilesInMemory, KeyPath, TextFile};
use rotorlead_records::import::{ColumnChoice, ImportOptions, import, import_bytes, motor_poles};
use rotorlead_records::{Excitation, Experiment, LONG_FILE, LongRecord, Output, Record};
use rotorlead_results::{Logs, experiment_facts, records_facts};
use serde_json::json;
use toml::{Table, Value};

use crate::argument::{one_of, read};
use crate::error::{raised, refused, refused_dict};
use crate::interrupt;
use crate::value::{check_whole, to_dict, to_python, to_table};

/// Columns of a record, as the header of its CSV file names them.
const COLUMNS: [&str; 7] = ["time_s", "command", "thrust_n", "rpm", "esc_command", "voltage_v", "current_a"];

/// Records in memory.
#[pyclass(frozen, module = "rotorlead._native", name = "Experiment")]
pub struct InMemory {
    experiment: Arc<Experiment>,
    /// The folder or the log that they are from.
    source: Option<PathBuf>,
    checksum: Option<String>,
    /// What was found in logs, and what of it was taken.
    logs: Option<serde_json::Value>,
}

impl InMemory {
    /// Records that are from no file.
    pub fn new(experiment: Experiment) -> Self {
        Self { experiment: Arc::new(experiment), source: None, checksum: None, logs: None }
    }

    fn from_logs(logs: Logs, source: Option<PathBuf>) -> Result<Self, FileError> {
        // What a folder with these records would be refused for.
        logs.experiment.check()?;
        Ok(Self { source, logs: Some(json!(logs.summaries)), ..Self::new(logs.experiment) })
    }
}

#[pymethods]
impl InMemory {
    /// Those of a folder.
    #[staticmethod]
    fn read(py: Python, folder: PathBuf) -> PyResult<Self> {
        interrupt::run(py, move || {
            let experiment = Arc::new(Experiment::read(&folder)?);
            Ok(Self { experiment, checksum: Experiment::checksum(&folder), source: Some(folder), logs: None })
        })
    }

    /// Those of logs, a record of each; `options` are those of [`import_options`].
    #[staticmethod]
    fn from_logs_of(py: Python, files: Vec<PathBuf>, options: &Bound<PyDict>) -> PyResult<Self> {
        let options = import_options(options)?;
        interrupt::run(py, move || {
            let logs = Logs::read(&files, true, |file| {
                let log = import(file, &options)?;
                options.unused_in(&log.summary).map_or(Ok(()), |(option, reason)| {
                    let help = format!("leave {option} out");
                    Err(miette!(help = help, "{option} does not go with `{}`: {reason}", file.display()))
                })?;
                Ok(log)
            })?;
            Ok(Self::from_logs(logs, files.into_iter().next())?)
        })
    }

    /// Those of a table that is the text of a CSV file and has this name.
    #[staticmethod]
    fn from_table(py: Python, name: PathBuf, table: &Bound<PyBytes>, options: &Bound<PyDict>) -> PyResult<Self> {
        let (options, table) = (import_options(options)?, table.as_bytes().to_vec());
        interrupt::run(py, move || {
            let logs = Logs::read(std::slice::from_ref(&name), true, |name| Ok(import_bytes(name, &table, &options)?))?;
            Ok(Self::from_logs(logs, None)?)
        })
    }

    /// Those of a dict with the keys of `experiment.toml`, and of its list `records` with the columns beside their keys.
    #[staticmethod]
    fn from_dict(mapping: &Bound<PyMapping>) -> PyResult<Self> {
        from_mapping(mapping).map(Self::new)
    }

    /// Those of the files of a folder, by their names.
    #[staticmethod]
    fn from_files(files: FilesInMemory) -> PyResult<Self> {
        read(Experiment::from_files(&files)).map(Self::new)
    }

    /// The files of its folder, by their names.
    fn files(&self) -> PyResult<FilesInMemory> {
        read(self.experiment.files())
    }

    /// Writes the folder, which is made.
    fn write(&self, py: Python, folder: PathBuf) -> PyResult<()> {
        let experiment = Arc::clone(&self.experiment);
        interrupt::run(py, move || Ok(experiment.write(&folder)?))
    }

    /// Where they are from.
    #[getter]
    fn source(&self) -> Option<PathBuf> {
        self.source.clone()
    }

    /// What was found in logs, and what of it was taken.
    #[getter]
    fn logs<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        self.logs.as_ref().map(|logs| to_python(py, logs)).transpose()
    }

    /// The keys of an experiment and of its records, without their columns.
    fn keys<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let Experiment { name, output, sample_rate_hz, esc_frame_hz, command_rate_hz, records } = &*self.experiment;
        let keys = |record: &Record| {
            json!({
                "file": record.file,
                "nominal": record.nominal,
                "excitation": record.excitation,
                "period_s": record.period_s,
                "amplitude": record.amplitude,
                "compensated": record.compensated,
                "compensator": record.compensator,
                "role": record.role,
            })
        };
        let keys = json!({
            "name": name,
            "output": output,
            "sample_rate_hz": sample_rate_hz,
            "esc_frame_hz": esc_frame_hz,
            "command_rate_hz": command_rate_hz,
            "records": records.iter().map(keys).collect::<Vec<_>>(),
        });
        to_dict(py, &keys)
    }

    /// The columns of a record by their names; None where it has no such column.
    fn columns<'py>(&self, py: Python<'py>, record: usize) -> PyResult<Bound<'py, PyDict>> {
        let dict = PyDict::new(py);
        let Some(record) = self.experiment.records.get(record) else { return Ok(dict) };
        let columns = [
            Some(&record.time_s),
            Some(&record.command),
            record.thrust_n.as_ref(),
            record.rpm.as_ref(),
            record.esc_command.as_ref(),
            record.voltage_v.as_ref(),
            record.current_a.as_ref(),
        ];
        for (name, values) in COLUMNS.into_iter().zip(columns) {
            dict.set_item(name, values.map(|values| values.clone().into_pyarray(py)))?;
        }
        Ok(dict)
    }
}

/// Records that are yet to be read, or are here.
pub enum Records {
    /// A folder of an experiment.
    Folder(PathBuf),
    /// In memory.
    InMemory {
        /// They.
        experiment: Arc<Experiment>,
        /// Where they are from.
        source: Option<PathBuf>,
        /// The checksum of their files.
        checksum: Option<String>,
    },
}

impl<'a, 'py> FromPyObject<'a, 'py> for Records {
    type Error = PyErr;

    fn extract(value: Borrowed<'a, 'py, PyAny>) -> PyResult<Self> {
        if let Ok(records) = value.cast::<InMemory>() {
            let InMemory { experiment, source, checksum, .. } = records.get();
            return Ok(Self::InMemory {
                experiment: Arc::clone(experiment),
                source: source.clone(),
                checksum: checksum.clone(),
            });
        }
        value
            .extract()
            .map(Self::Folder)
            .map_err(|_| PyTypeError::new_err("records or the path of a folder are needed"))
    }
}

impl Records {
    /// What errors call it.
    pub fn name(&self) -> String {
        match self {
            Self::Folder(folder) => folder.display().to_string(),
            Self::InMemory { experiment, source, .. } => {
                source.as_ref().map_or_else(|| experiment.name.clone(), |source| source.display().to_string())
            }
        }
    }

    /// The folder or the log that they are from.
    pub fn source(&self) -> Option<&Path> {
        match self {
            Self::Folder(folder) => Some(folder),
            Self::InMemory { source, .. } => source.as_deref(),
        }
    }

    /// [`Experiment::checksum`] of the folder.
    pub fn checksum(&self) -> Option<String> {
        match self {
            Self::Folder(folder) => Experiment::checksum(folder),
            Self::InMemory { checksum, .. } => checksum.clone(),
        }
    }

    /// Facts for the page of an answer.
    pub fn facts(&self, experiment: &Experiment) -> Vec<Fact> {
        match self.source() {
            Some(source) => records_facts(experiment, source),
            None => experiment_facts(experiment, "in memory"),
        }
    }

    /// All records, but for those whose rows stay on disk.
    pub fn read_leaving_long(&self) -> Result<(Experiment, Vec<LongRecord>), FileError> {
        match self {
            Self::Folder(folder) => Experiment::read_except_long(folder, LONG_FILE),
            Self::InMemory { experiment, .. } => Ok((Experiment::clone(experiment), Vec::new())),
        }
    }

    /// All records.
    pub fn read(&self) -> Result<Experiment, FileError> {
        match self {
            Self::Folder(folder) => Experiment::read(folder),
            Self::InMemory { experiment, .. } => Ok(Experiment::clone(experiment)),
        }
    }

    /// All records, those behind a compensator with what the ESC got.
    pub fn read_with_esc_commands(&self) -> Result<Experiment, FileError> {
        let mut experiment = self.read()?;
        fill_in_esc_commands(&mut experiment, self.source().unwrap_or(Path::new("")).into())?;
        Ok(experiment)
    }
}

/// One of the two responses by its name.
pub fn response(name: Option<&str>) -> PyResult<Option<Output>> {
    name.map(|name| one_of("response", name, &[Output::ThrustN, Output::Rpm].map(|output| (output.option(), output))))
        .transpose()
}

/// What a log does not say of itself, of a dict with the names of the options of `rotorlead import`.
fn import_options(options: &Bound<PyDict>) -> PyResult<ImportOptions> {
    fn get<'py, T>(options: &Bound<'py, PyDict>, name: &str) -> PyResult<Option<T>>
    where
        T: for<'a> FromPyObject<'a, 'py, Error = PyErr>,
    {
        options.get_item(name)?.filter(|value| !value.is_none()).map(|value| value.extract()).transpose()
    }
    let fault = |name: &str, message: String, help: &str| refused(&KeyPath::root().key(name).fault(message, help));
    let columns: Vec<(String, String)> = get(options, "columns")?.unwrap_or_default();
    let columns = columns.into_iter().map(|(quantity, column)| {
        format!("{quantity}={column}").parse::<ColumnChoice>().map_err(|message| {
            fault("columns", message, "give a quantity and its column, as in {\"thrust\": \"load:gf\"}")
        })
    });
    let excitations = Excitation::ALL.map(|excitation| (excitation.name(), excitation));
    let excitation: Option<String> = get(options, "excitation")?;
    let output: Option<String> = get(options, "response")?;
    let count = |name: &str| -> PyResult<Option<usize>> {
        let number: Option<i64> = get(options, name)?;
        let positive = |number: i64| usize::try_from(number).ok().filter(|number| *number > 0);
        let refused = |number| fault(name, format!("{number} is no number from 1"), "the first is number 1");
        number.map(|number| positive(number).ok_or_else(|| refused(number))).transpose()
    };
    let number = |name: &str| -> PyResult<Option<f64>> {
        let number: Option<f64> = get(options, name)?;
        number.map_or(Ok(()), |number| KeyPath::root().key(name).accept(number)).map_err(|fault| refused(&fault))?;
        Ok(number)
    };
    let poles = count("motor_poles")?.map(|poles| {
        motor_poles(&poles.to_string()).map_err(|message| fault("motor_poles", message, "give the motor's own"))
    });
    let options = ImportOptions {
        name: get(options, "name")?,
        esc_signal_us: get(options, "pulse_us")?,
        motor: count("motor")?,
        log: count("log")?,
        columns: columns.collect::<PyResult<_>>()?,
        seconds: get(options, "seconds")?,
        output: response(output.as_deref())?,
        tare: get(options, "tare")?.unwrap_or(false),
        motor_poles: poles.transpose()?,
        rate_hz: get(options, "rate_hz")?,
        excitation: excitation.map(|name| one_of("excitation", &name, &excitations)).transpose()?,
        period_s: number("period_s")?,
        nominal: number("nominal")?,
        amplitude: number("amplitude")?,
        ..ImportOptions::default()
    };
    options.check().map_err(|fault| raised(&miette!(help = fault.help, "{}", fault.message)))?;
    Ok(options)
}

/// The experiment of a mapping. Its keys are written as `experiment.toml` has them, and are read and refused as those are; its
/// columns are held to what those of a CSV file are.
fn from_mapping(mapping: &Bound<PyMapping>) -> PyResult<Experiment> {
    let records: Vec<Bound<PyMapping>> = mapping.get_item("records")?.extract()?;
    let mut manifest = without(mapping, &["records"])?;
    let mut entries = Vec::new();
    let mut columns = Vec::new();
    for (index, record) in records.iter().enumerate() {
        let mut entry = without(record, &COLUMNS)?;
        entry.entry("file").or_insert_with(|| format!("record_{}", index + 1).into());
        entries.push(Value::Table(entry));
        columns.push(columns_of(record)?);
    }
    let of_all = |name| columns.iter().all(|columns: &Columns| columns.iter().any(|(column, _)| *column == name));
    // Where records have one response there is one answer; where they have both it has to be given.
    let output = match (of_all("thrust_n"), of_all("rpm")) {
        (true, true) if !columns.is_empty() => None,
        (false, true) => Some(Output::Rpm),
        _ => Some(Output::ThrustN),
    };
    if output.is_none() && !manifest.contains_key("output") {
        let fault =
            KeyPath::root().key("response").fault("the records have thrust and speed", "give one of: thrust, rpm");
        return Err(refused(&fault));
    }
    for (key, value) in [("format", 1.into()), ("command", "duty".into()), ("name", "records".into())] {
        manifest.entry(key).or_insert(value);
    }
    if let Some(output) = output {
        manifest.entry("output").or_insert(output.column().into());
    }
    manifest.insert("record".to_owned(), Value::Array(entries));
    let text = TextFile::in_memory("records", manifest.to_string());
    let mut experiment = Experiment::from_manifest(text).map_err(|error| refused_dict("records", &error))?;
    for (record, columns) in experiment.records.iter_mut().zip(columns) {
        columns.into_iter().for_each(|(name, values)| fill(record, name, values));
    }
    read(experiment.check())?;
    Ok(experiment)
}

/// The entries of a mapping that are none of `columns`.
fn without(mapping: &Bound<PyMapping>, columns: &[&str]) -> PyResult<Table> {
    let rest = PyDict::new(mapping.py());
    for item in mapping.items()? {
        let (key, value): (String, Bound<PyAny>) = item.extract()?;
        if !columns.contains(&key.as_str()) {
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
