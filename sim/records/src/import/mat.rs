//! MATLAB files (`save -v6` and `save -v7`): vectors, columns of matrices, fields of structs and of objects, as the columns of a table,
//! of which `plain` takes what it takes of any.
//!
//! A column is called as MATLAB calls it: `t`, `Data(:,1)`, `run.Y(2).Data`. Names say what a vector is and in which unit, as in the header
//! of a table; a name without a unit is in that of [`SPELLINGS`]. Nothing is concluded from the size of the numbers. Where a
//! struct has a name beside its numbers, as dSPACE's `Y(k).Name` and `Y(k).Data` and Simulink's `signals(k).label` and
//! `signals(k).values`, that is what they are called too. One number called `Ts` is the interval of rows that have no times.

use std::borrow::Cow;
use std::fmt::Write as _;
use std::path::Path;

use super::binary_columns::zero_based_stamps;
use super::format::{Dialect, LogFormat, Names, Reader, UNCOMPRESSED, spelled};
use super::mat5::{self, Content, Variable};
use super::plain::{Beside, PlainTable, take_table};
use super::quantity::Quantity;
use super::redact::Copied;
use super::table::Table;
use super::{ImportError, ImportOptions, Taken};
use crate::experiment::Excitation;
use crate::files::csv_rows::quoted;

/// What a vector of such a name is, and in which unit.
const SPELLINGS: Names = &[
    (Quantity::Time, "s", &["time", "t", "times", "ts", "timesec", "tsec", "seconds", "tout", "dt", "sampletime"]),
    (Quantity::Time, "ms", &["timems", "tms"]),
    (Quantity::Time, "us", &["timeus", "tus"]),
    (Quantity::Command, "duty", &["command", "cmd", "u", "throttle", "motorcommand", "throttlecommand", "inputdata"]),
    (Quantity::Command, "percent", &["commandpercent", "cmdpercent", "throttlepercent", "throttlepct"]),
    (Quantity::Command, "us", &["commandus", "cmdus", "throttleus", "pwmus", "pulseus", "escus", "pwm"]),
    (Quantity::Thrust, "N", &["thrust", "thrustn", "force", "forcen"]),
    (Quantity::Thrust, "gf", &["thrustgf", "thrustg"]),
    (Quantity::Thrust, "kgf", &["thrustkgf", "thrustkg"]),
    (Quantity::Speed, "rpm", &["rpm", "speedrpm", "motorrpm", "rotorrpm"]),
    (Quantity::Speed, "rad/s", &["omega", "omegarads", "speedrads"]),
    (Quantity::Speed, "rev/s", &["rps", "speedhz"]),
    (Quantity::Voltage, "V", &["voltage", "voltagev", "volts", "vbat", "batteryvoltage", "supplyvoltage"]),
    (Quantity::Current, "A", &["current", "currenta", "amps", "ibat", "batterycurrent", "supplycurrent"]),
];

/// Numbers of these names, where there is one, are the interval of the rows, seconds.
const INTERVALS: [&str; 3] = ["ts", "dt", "sampletime"];
/// Fields that hold the numbers of a signal, beside those that name it and say its unit: dSPACE's, Simulink's, and old `iddata`'s.
const SIGNALS: [(&str, &str, &str); 2] = [("Data", "Name", "Unit"), ("values", "label", "unit")];
/// The field of dSPACE's that holds the times of its `Y`, where there is one, and where there are several.
const TIMES: &str = "X";
const TIMES_OF_SEVERAL: &str = "X(";
/// A matrix has a signal in each of its shorter lines, up to so many. Chosen: more than a stand has channels; what has more is a picture.
const MOST_SIGNALS: usize = 64;

const DIALECT: Dialect = Dialect { names: SPELLINGS, usual: Some(Excitation::Staircase), ..Dialect::PLAIN };

fn is_time(name: &str) -> bool {
    DIALECT.meaning(name).is_some_and(|said| said.quantity == Quantity::Time)
}

/// A vector that may be a column.
struct Column {
    name: String,
    /// What says what it is: the last part of its name, or what the file calls it; nothing of a matrix's.
    label: Option<String>,
    unit: String,
    values: Vec<f64>,
}

/// The columns of a file, and what else is in it.
#[derive(Default)]
struct Columns {
    columns: Vec<Column>,
    beside: Vec<Beside>,
}

impl Columns {
    /// Adds these variables of one workspace or struct, whose name is in front of theirs.
    fn add_all(&mut self, front: &str, variables: Vec<Variable>) {
        let first = self.columns.len();
        let interval = |variable: &Variable| {
            let name = variable.name.trim_start_matches('.');
            let seconds = single(&variable.content).filter(|_| INTERVALS.contains(&spelled(name).as_str()));
            seconds.map(|seconds| (format!("{front}{}", variable.name), name.to_owned(), seconds))
        };
        let interval = variables.iter().find_map(interval);
        let texts: Vec<(String, String)> = variables.iter().filter_map(text).collect();
        for variable in variables {
            self.add(front, variable, &texts);
        }
        let added = &self.columns[first..];
        let has_times = added.iter().any(|column| column.label.as_deref().is_some_and(is_time));
        let rows = added.iter().map(|column| column.values.len()).max().unwrap_or(0);
        if let Some((name, label, seconds)) = interval.filter(|_| !has_times && rows > 0) {
            self.beside.retain(|beside| beside.name != name);
            let values = (0..rows).map(|row| row as f64 * seconds).collect();
            self.columns.push(Column { name, label: Some(label), unit: String::from("s"), values });
        }
    }

    /// Adds a variable, beside which its struct has `texts`.
    fn add(&mut self, front: &str, variable: Variable, texts: &[(String, String)]) {
        let name = format!("{front}{}", variable.name);
        let remedy = variable.remedy(&name);
        let shown = variable.shown();
        let mut lengths = variable.dimensions.iter().copied().filter(|&size| size != 1);
        match (variable.content, (lengths.next(), lengths.next(), lengths.next())) {
            (Content::Real(values), (Some(rows), None, _)) if rows > 0 => {
                let (owner, field) = name.rsplit_once('.').unwrap_or(("", &name));
                let owner = owner.rsplit('.').next().unwrap_or(owner);
                let beside = |field: &str| {
                    let is_it = |(name, text): &&(String, String)| name[1..] == *field && !text.is_empty();
                    texts.iter().find(is_it).map(|(_, text)| text.clone())
                };
                let signal = SIGNALS.iter().find(|(values, ..)| *values == field);
                let label = match signal {
                    // They may be called as the task that took them.
                    Some(_) if owner == TIMES || owner.starts_with(TIMES_OF_SEVERAL) => String::from("time"),
                    Some((_, name, _)) => beside(name).unwrap_or_else(|| owner.to_owned()),
                    None => field.to_owned(),
                };
                let unit = signal.and_then(|(.., unit)| beside(unit)).unwrap_or_default();
                self.columns.push(Column { name, label: Some(label), unit, values });
            }
            (Content::Real(values), (Some(rows), Some(columns), None))
                if (1..=MOST_SIGNALS).contains(&rows.min(columns)) =>
            {
                let mut push = |at: String, values: Vec<f64>| {
                    self.columns.push(Column { name: format!("{name}{at}"), label: None, unit: String::new(), values });
                };
                if rows >= columns {
                    let lines = values.chunks_exact(rows).enumerate();
                    lines.for_each(|(column, values)| push(format!("(:,{})", column + 1), values.to_vec()));
                } else {
                    let line = |row: usize| values.iter().skip(row).step_by(rows).copied().collect();
                    (0..rows).for_each(|row| push(format!("({},:)", row + 1), line(row)));
                }
            }
            (Content::Struct(_, parts) | Content::Cell(parts), _) if !parts.is_empty() => self.add_parts(&name, parts),
            _ => {
                let quantity = DIALECT.meaning(name.rsplit('.').next().unwrap_or(&name)).map(|said| said.quantity);
                self.beside.push(Beside { name, shown, remedy, quantity });
            }
        }
    }

    /// Adds the parts of a variable, those of each struct of an array together.
    fn add_parts(&mut self, name: &str, parts: Vec<Variable>) {
        let owner = |part: &Variable| part.name.rfind('.').map_or(0, |dot| dot);
        let mut parts = parts.into_iter().peekable();
        while let Some(first) = parts.next() {
            let front = first.name[..owner(&first)].to_owned();
            let mut group = vec![first];
            while let Some(part) = parts.next_if(|part| part.name[..owner(part)] == front) {
                group.push(part);
            }
            for part in &mut group {
                part.name.drain(..front.len());
            }
            self.add_all(&format!("{name}{front}"), group);
        }
    }
}

/// The number of a variable that is one, also in a cell.
fn single(content: &Content) -> Option<f64> {
    match content {
        Content::Real(values) if values.len() == 1 => values.first().copied().filter(|value| *value > 0.0),
        Content::Cell(cells) => cells.first().filter(|_| cells.len() == 1).and_then(|cell| single(&cell.content)),
        _ => None,
    }
}

/// The name and the text of a field that is one.
fn text(variable: &Variable) -> Option<(String, String)> {
    match &variable.content {
        Content::Text(text) if variable.name.starts_with('.') => Some((variable.name.clone(), text.trim().to_owned())),
        _ => None,
    }
}

impl Variable {
    /// What it is: `1000x3 numbers`, `an object of class timeseries`.
    fn shown(&self) -> String {
        let sizes: Vec<String> = self.dimensions.iter().map(ToString::to_string).collect();
        match &self.content {
            Content::Real(_) => format!("{} numbers", sizes.join("x")),
            Content::Packed => format!("{} numbers, packed tighter than any recording", sizes.join("x")),
            Content::Complex => String::from("complex numbers"),
            Content::Sparse => String::from("a sparse matrix"),
            Content::Cell(_) => String::from("a cell array"),
            Content::Struct(None, _) => String::from("a struct"),
            Content::Text(_) => String::from("text"),
            Content::FunctionHandle => String::from("a function handle"),
            Content::Struct(Some(class), _) | Content::Object(class) => format!("an object of class {class}"),
            Content::Unknown => String::from("data of an unknown class"),
        }
    }

    /// What to do in MATLAB before the numbers of what is called `name` can be taken.
    fn remedy(&self, name: &str) -> String {
        let x = quoted(name);
        match &self.content {
            Content::Real(_) if self.dimensions.contains(&0) => {
                format!("`{x}` is empty: save the variable that holds the rows")
            }
            Content::Real(_) | Content::Packed => {
                format!("save each column of `{x}` as a vector of its own, as in `thrust = {x}(:, 2)`")
            }
            Content::Complex => format!("save `real({x})` if its imaginary parts are zero, or else what was measured"),
            Content::Sparse => format!("save `full({x})`"),
            Content::Cell(_) => format!("save `cell2mat({x})`, or each signal in it as a vector of its own"),
            Content::Struct(None, _) => {
                format!("save the fields of `{x}` as vectors: `save(file, '-struct', '{x}', '-v7')`")
            }
            Content::Text(_) => format!("save numbers in place of `{x}`, such as `str2double({x})`"),
            Content::FunctionHandle => format!("save the numbers that `{x}` gives, as in `command = {x}(time)`"),
            Content::Struct(Some(_), _) | Content::Object(_) => format!(
                "only MATLAB reads `{x}`: save its numbers as vectors, those of a timeseries as `time = {x}.Time` and \
                 `rpm = {x}.Data`, those of an iddata as `u = {x}.u`, `y = {x}.y` and `Ts = {x}.Ts`, those of a table as `rpm = {x}.rpm`, \
                 those of a duration as `time = seconds({x})`"
            ),
            Content::Unknown => format!("save the numbers of `{x}` as vectors"),
        }
    }
}

/// The variables as a table.
fn table<'a>(file: &Path, variables: Vec<Variable>) -> PlainTable<'a> {
    let mut found = Columns::default();
    found.add_all("", variables);
    let Columns { mut columns, beside } = found;
    // The longest first, so that what is behind the end of a shorter one takes no place.
    columns.sort_by_key(|column| std::cmp::Reverse(column.values.len()));
    let mut text = String::new();
    for row in 0..columns.first().map_or(0, |column| column.values.len()) {
        let cells = columns.iter().map_while(|column| column.values.get(row));
        for (place, value) in cells.enumerate() {
            let separator = if place == 0 { "" } else { "," };
            // Text takes anything.
            let _ = match value.abs() {
                0.0 | 1e-5..1e15 => write!(text, "{separator}{value}"),
                _ => write!(text, "{separator}{value:e}"),
            };
        }
        text.push('\n');
    }
    let counts = columns.iter().map(|column| column.values.len()).collect();
    let header = columns.iter().map(|column| column.name.clone()).collect();
    PlainTable {
        table: Table::from_samples(file, header, Cow::Owned(text), counts),
        units: columns.iter().map(|column| column.unit.clone()).collect(),
        labels: columns.into_iter().map(|column| column.label).collect(),
        beside,
        dialect: &DIALECT,
        header_line: None,
        notes: Vec::new(),
        motor_poles: None,
    }
}

fn take(file: &Path, bytes: &[u8], options: &ImportOptions) -> Result<Taken, ImportError> {
    let variables = mat5::read(bytes).map_err(|damage| ImportError::Damaged {
        file: file.into(),
        offset: damage.offset,
        problem: damage.problem,
    })?;
    let mut plain = table(file, variables);
    plain.motor_poles = options.motor_poles;
    let mut taken = take_table(plain, options, &FORMAT)?;
    let is_time = |column: &&super::ColumnUse| column.taken_as.as_deref() == Some(Quantity::Time.column());
    let name = taken.summary.columns.iter().find(is_time).map_or("time", |column| &column.name);
    let rows: Vec<usize> = (0..taken.time_s.len()).collect();
    let (time_s, sample_rate_hz, _) = zero_based_stamps(file, name, &rows, std::mem::take(&mut taken.time_s))?;
    Ok(Taken { time_s, sample_rate_hz, ..taken })
}

/// Bytes as a log, where they are a MATLAB file.
fn read(file: &Path, bytes: &[u8], options: &ImportOptions) -> Result<Option<Taken>, ImportError> {
    match mat5::header(bytes) {
        Some(mat5::Header::Level5) => take(file, bytes, options).map(Some),
        Some(mat5::Header::Hdf5) => {
            let problem = ": a MATLAB file of version 7.3 (HDF5)";
            Err(ImportError::not_a_log(file, problem, "save it again in MATLAB with `save(file, '-v7')`"))
        }
        None => Ok(None),
    }
}

/// A MATLAB file may have a name in any variable, at any depth.
fn refuse_copy(file: &Path, bytes: &[u8]) -> Result<Option<Copied>, ImportError> {
    let problem = ": a MATLAB file, of which no copy without names and places is made";
    mat5::header(bytes).map_or(Ok(None), |_| Err(ImportError::not_redacted(file, problem)))
}

/// Bytes of memory per byte. Derived: one of compressed data may inflate to 64 one-byte numbers, each of which takes 32 bytes as a
/// number and as text, and is a cell of a table.
const COMPRESSED: usize = 64 * (32 + UNCOMPRESSED);

/// The format.
pub(super) const FORMAT: LogFormat = LogFormat {
    name: "mat",
    title: "MATLAB files of vectors, matrices or structs with the time, the command, and thrust or rpm (`save -v7`)",
    has_motors: false,
    has_several_logs: false,
    has_stated_columns: true,
    memory_per_byte: COMPRESSED,
    reader: Reader::Bytes { read, redact: refuse_copy },
};
