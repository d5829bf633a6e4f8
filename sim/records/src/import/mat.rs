//! MATLAB files (`save -v6` and `save -v7`): named vectors, one per signal.
//!
//! Names say what a vector is and in which unit: `time_ms`, `command_percent`, `thrust_gf`. The table
//! of names is [`SPELLINGS`]; capitals and underscores do not matter, except in names of one letter
//! (`t` is the time, `T` may be a torque). Nothing is concluded from the size of the numbers.

use std::f64::consts::PI;
use std::path::Path;

use super::binary_columns::{normalized, zero_based_stamps};
use super::format::{LogFormat, Reader};
use super::mat5::{self, Kind, Variable};
use super::plain_columns::MOST_LISTED;
use super::quantity::{N_PER_GF, Quantity};
use super::summary::{ColumnUse, DroppedRows};
use super::{ImportError, ImportOptions, ImportSummary, MIN_ROWS, Taken};
use crate::experiment::{Excitation, Output};
use crate::files::csv_rows::quoted;

/// How a vector's numbers become those of the column.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Scale {
    Factor(f64),
    /// The stated range of pulse widths becomes 0..1.
    Pulse,
}

/// Names, in small letters without underscores; the first of a signal's that is there is taken.
const SPELLINGS: &[(Quantity, Scale, &[&str])] = &[
    (Quantity::Time, Scale::Factor(1.0), &["time", "t", "times", "ts", "timesec", "tsec", "seconds"]),
    (Quantity::Time, Scale::Factor(1e-3), &["timems", "tms"]),
    (Quantity::Time, Scale::Factor(1e-6), &["timeus", "tus"]),
    (Quantity::Command, Scale::Factor(1.0), &["command", "cmd", "u", "throttle", "motorcommand", "throttlecommand"]),
    (Quantity::Command, Scale::Factor(0.01), &["commandpercent", "cmdpercent", "throttlepercent", "throttlepct"]),
    (Quantity::Command, Scale::Pulse, &["commandus", "cmdus", "throttleus", "pwmus", "pulseus", "escus", "pwm"]),
    (Quantity::Thrust, Scale::Factor(1.0), &["thrust", "thrustn", "force", "forcen"]),
    (Quantity::Thrust, Scale::Factor(N_PER_GF), &["thrustgf", "thrustg"]),
    (Quantity::Thrust, Scale::Factor(1e3 * N_PER_GF), &["thrustkgf", "thrustkg"]),
    (Quantity::Speed, Scale::Factor(1.0), &["rpm", "speedrpm", "motorrpm", "rotorrpm"]),
    (Quantity::Speed, Scale::Factor(30.0 / PI), &["omega", "omegarads", "speedrads"]),
    (Quantity::Speed, Scale::Factor(60.0), &["rps", "speedhz"]),
    (
        Quantity::Voltage,
        Scale::Factor(1.0),
        &["voltage", "voltagev", "volts", "vbat", "batteryvoltage", "supplyvoltage"],
    ),
    (
        Quantity::Current,
        Scale::Factor(1.0),
        &["current", "currenta", "amps", "ibat", "batterycurrent", "supplycurrent"],
    ),
];

/// The place of `name` in [`SPELLINGS`] (smaller is taken first), and what it stands for.
fn meaning(name: &str) -> Option<(usize, Quantity, Scale)> {
    let plain =
        if name.len() == 1 { name.to_string() } else { name.to_lowercase().chars().filter(|&c| c != '_').collect() };
    let all = SPELLINGS.iter().flat_map(|(signal, scale, names)| names.iter().map(move |n| (*signal, *scale, *n)));
    all.enumerate().find(|(_, (_, _, n))| *n == plain).map(|(place, (signal, scale, _))| (place, signal, scale))
}

impl Variable {
    /// What it is: `1000x3 numbers`, `a timeseries object`.
    fn shown(&self) -> String {
        let sizes: Vec<String> = self.dimensions.iter().map(ToString::to_string).collect();
        match &self.kind {
            Kind::Real => format!("{} numbers", sizes.join("x")),
            Kind::Complex => String::from("complex numbers"),
            Kind::Sparse => String::from("a sparse matrix"),
            Kind::Cell => String::from("a cell array"),
            Kind::Struct => String::from("a struct"),
            Kind::Text => String::from("text"),
            Kind::FunctionHandle => String::from("a function handle"),
            Kind::Object(class) => format!("a {class} object"),
            Kind::Unknown => String::from("data of an unknown class"),
        }
    }

    /// What to do in MATLAB before its numbers can be taken; `None` of a vector, whichever of its dimensions it lies along.
    fn remedy(&self) -> Option<String> {
        let x = quoted(&self.name);
        Some(match &self.kind {
            Kind::Real if self.dimensions.contains(&0) => {
                format!("`{x}` is empty: save the variable that holds the rows")
            }
            Kind::Real if self.dimensions.iter().filter(|&&size| size != 1).count() <= 1 => return None,
            Kind::Real => format!("save each column of `{x}` as a vector of its own, as in `thrust = {x}(:, 2)`"),
            Kind::Complex => format!("save `real({x})` if its imaginary parts are zero, or else what was measured"),
            Kind::Sparse => format!("save `full({x})`"),
            Kind::Cell => format!("save `cell2mat({x})`, or each signal in it as a vector of its own"),
            Kind::Struct => format!("save the fields of `{x}` as vectors: `save(file, '-struct', '{x}', '-v7')`"),
            Kind::Text => format!("save numbers in place of `{x}`, such as `str2double({x})`"),
            Kind::FunctionHandle => format!("save the numbers that `{x}` gives, as in `command = {x}(time)`"),
            Kind::Object(_) => format!(
                "only MATLAB reads `{x}`: save its numbers as vectors, those of a timeseries as `time = {x}.Time` and \
                 `rpm = {x}.Data`, those of a table as `rpm = {x}.rpm`, those of a duration as `time = seconds({x})`"
            ),
            Kind::Unknown => format!("save the numbers of `{x}` as vectors"),
        })
    }
}

/// A vector that is taken.
struct Source {
    place: usize,
    /// Its place in the list of columns.
    column: usize,
    signal: Quantity,
    scale: Scale,
    name: String,
    values: Vec<f64>,
}

fn take(file: &Path, bytes: &[u8], options: &ImportOptions) -> Result<Taken, ImportError> {
    let mut variables = mat5::read(bytes, |name| meaning(name).is_some()).map_err(|damage| ImportError::Damaged {
        file: file.into(),
        offset: damage.offset,
        problem: damage.problem,
    })?;
    let mut columns: Vec<ColumnUse> = Vec::new();
    let mut sources: Vec<Source> = Vec::new();
    for (column, variable) in variables.iter_mut().enumerate() {
        let mut note = String::from("no known name");
        if let Some((place, signal, scale)) = meaning(&variable.name) {
            note = match (variable.remedy(), variable.values.take()) {
                (None, Some(values)) => {
                    sources.push(Source { place, column, signal, scale, name: variable.name.clone(), values });
                    format!("another vector was taken as {}", signal.column())
                }
                _ => format!("{}, and no vector of numbers", variable.shown()),
            };
        }
        columns.push(ColumnUse { name: variable.name.clone(), taken_as: None, note });
    }
    sources.sort_by_key(|s| s.place);
    let mut pick = |signal: Quantity| {
        let at = sources.iter().position(|s| s.signal == signal)?;
        Some(sources.remove(at))
    };
    let missing = |signals: &[Quantity]| missing(file, &variables, signals);
    let time = pick(Quantity::Time).ok_or_else(|| missing(&[Quantity::Time]))?;
    let command = pick(Quantity::Command).ok_or_else(|| missing(&[Quantity::Command]))?;
    let (thrust, speed) = (pick(Quantity::Thrust), pick(Quantity::Speed));
    if thrust.is_none() && speed.is_none() {
        return Err(missing(&[Quantity::Thrust, Quantity::Speed]));
    }
    let supply = [pick(Quantity::Voltage), pick(Quantity::Current)];
    let rows_read = time.values.len();
    for source in [Some(&command), thrust.as_ref(), speed.as_ref()].into_iter().flatten() {
        if source.values.len() != rows_read {
            let problem = format!("{} numbers, but `{}` has {rows_read}", source.values.len(), time.name);
            return Err(ImportError::Vector { file: file.into(), name: source.name.clone(), problem });
        }
    }
    let needed = [Some(&time), Some(&command), thrust.as_ref(), speed.as_ref()];
    let whole = |&row: &usize| needed.iter().flatten().all(|source| !source.values[row].is_nan());
    let rows: Vec<usize> = (0..rows_read).filter(whole).collect();
    let mut dropped = Vec::new();
    if rows.len() < rows_read {
        let reason = String::from("NaN in the time, the command or the response");
        dropped.push(DroppedRows { rows: rows_read - rows.len(), reason });
    }
    if rows.len() < MIN_ROWS {
        return Err(ImportError::TooFewRows { file: file.into(), rows: rows.len(), needed: MIN_ROWS });
    }

    let mut column_of = |source: &Source| -> Result<Vec<f64>, ImportError> {
        let entry = &mut columns[source.column];
        entry.taken_as = Some(source.signal.column().into());
        let mut values = Vec::with_capacity(rows.len());
        for &row in &rows {
            let value = source.values[row];
            if !value.is_finite() {
                return Err(sample(file, &source.name, row, value, "not finite"));
            }
            values.push(value);
        }
        entry.note = match source.scale {
            Scale::Pulse => {
                let (low, high) = options.pulse_range();
                format!("{low}..{high} µs become 0..1, stated and not measured")
            }
            Scale::Factor(1.0) => String::from("as it stands"),
            Scale::Factor(factor) => format!("times {factor}"),
        };
        if let Scale::Factor(factor) = source.scale {
            values.iter_mut().for_each(|v| *v *= factor);
        }
        Ok(values)
    };
    let time_s = column_of(&time)?;
    let drive = column_of(&command)?;
    let thrust_n = thrust.as_ref().map(&mut column_of).transpose()?;
    let rpm = speed.as_ref().map(&mut column_of).transpose()?;
    let range = if command.scale == Scale::Pulse { options.pulse_range() } else { (0.0, 1.0) };
    let drive = normalized(file, &command.name, &rows, drive, range)?;
    let (time_s, sample_rate_hz, timing) = zero_based_stamps(file, &time.name, &rows, time_s)?;
    columns[time.column].note.push_str(", from the first row taken");

    let [voltage_v, current_a] = supply.map(|source| {
        let source = source?;
        let filled = source.values.len() == rows_read && rows.iter().all(|&row| source.values[row].is_finite());
        let entry = &mut columns[source.column];
        if !filled {
            entry.note = format!("not a finite number in each of {} rows", rows.len());
            return None;
        }
        entry.taken_as = Some(source.signal.column().into());
        entry.note = String::from("as it stands");
        Some(rows.iter().map(|&row| source.values[row]).collect())
    });
    let mut notes = Vec::new();
    if thrust_n.is_some() && rpm.is_some() && options.output.is_none() {
        notes.push(String::from(
            "thrust and speed are both there: the experiment's response is the thrust; `--response rpm` takes the speed",
        ));
    }
    Ok(Taken {
        output: if thrust_n.is_some() { Output::ThrustN } else { Output::Rpm },
        usual: Some(Excitation::Staircase),
        summary: ImportSummary {
            file: file.into(),
            format: &FORMAT,
            rows_read,
            rows_taken: rows.len(),
            columns,
            dropped,
            timing,
            pulse_widths: command.scale == Scale::Pulse,
            notes,
        },
        time_s,
        command: drive,
        own_command: Vec::new(),
        thrust_n,
        rpm,
        voltage_v,
        current_a,
        sample_rate_hz,
    })
}

fn sample(file: &Path, name: &str, row: usize, value: f64, problem: &'static str) -> ImportError {
    ImportError::Sample { file: file.into(), name: name.into(), number: row + 1, value, problem }
}

/// The error that no vector stands for one of `signals`: the variable of such a name that is none, or all that the file has.
fn missing(file: &Path, variables: &[Variable], signals: &[Quantity]) -> ImportError {
    let is_meant =
        |variable: &&Variable| meaning(&variable.name).is_some_and(|(_, signal, _)| signals.contains(&signal));
    let unfit = variables.iter().filter(is_meant).find_map(|variable| Some((variable, variable.remedy()?)));
    if let Some((variable, remedy)) = unfit {
        let problem = format!("{}, where a vector of real numbers is needed", variable.shown());
        let remedy = format!("in MATLAB, {remedy}");
        return ImportError::Variable { file: file.into(), name: variable.name.clone(), problem, remedy };
    }
    let names = SPELLINGS.iter().filter(|(signal, ..)| signals.contains(signal)).flat_map(|(_, _, names)| names.iter());
    let shown = |variable: &Variable| format!("`{}` ({})", quoted(&variable.name), variable.shown());
    let all: Vec<String> = variables.iter().take(MOST_LISTED).map(shown).collect();
    // What a variable of another name holds may be well named.
    let holds_more = |variable: &&Variable| !matches!(variable.kind, Kind::Text | Kind::FunctionHandle);
    let within = variables.iter().filter(holds_more).find_map(Variable::remedy);
    ImportError::MissingSignal {
        file: file.into(),
        signal: signals.iter().map(|signal| signal.column()).collect::<Vec<_>>().join(" or "),
        there: if all.is_empty() { String::from("no variables") } else { all.join(", ") },
        known: names.map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", "),
        within: within.map(|remedy| format!("; or {remedy}")).unwrap_or_default(),
    }
}

/// Bytes as a log, where they are a MATLAB file.
fn read(file: &Path, bytes: &[u8], options: &ImportOptions) -> Result<Option<Taken>, ImportError> {
    match mat5::header(bytes) {
        Some(mat5::Header::Level5) => take(file, bytes, options).map(Some),
        Some(mat5::Header::Hdf5) => Err(ImportError::Hdf5 { file: file.into() }),
        None => Ok(None),
    }
}

/// Bytes of memory per byte: one of compressed data may inflate to 64 one-byte numbers, each of which takes 32 bytes.
const COMPRESSED: usize = 64 * 32;

/// The format.
pub(super) const FORMAT: LogFormat = LogFormat {
    name: "mat",
    title: "MATLAB files of named vectors, time, command, thrust or rpm (`save -v7`)",
    has_motors: false,
    has_several_logs: false,
    has_stated_columns: false,
    memory_per_byte: COMPRESSED,
    reader: Reader::Bytes(read),
};
