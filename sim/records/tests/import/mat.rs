//! MATLAB files of named vectors: what is taken of them and what is refused.

use std::fs;
use std::io::Write as _;
use std::path::PathBuf;

use flate2::{Compression, write::ZlibEncoder};
use miette::Diagnostic as _;
use proptest::prelude::*;
use rotorlead_records::import::{Import, ImportError, ImportOptions, import};
use rotorlead_records::{Excitation, Output};

use crate::importing::{self, message};

fn sample() -> PathBuf {
    importing::sample("vectors.mat")
}

fn imported(bytes: &[u8]) -> Result<Import, ImportError> {
    importing::imported(bytes, &ImportOptions::default())
}

/// Rows of the sample.
const ROWS: usize = 400;

/// Numbers as they are stored.
enum Stored {
    F64(Vec<f64>),
    F32(Vec<f32>),
    U8(Vec<u8>),
    I16(Vec<i16>),
}

/// Writes MAT-files of level 5, in either byte order.
struct Writer {
    bytes: Vec<u8>,
    big: bool,
}

impl Writer {
    fn new(big: bool) -> Self {
        let mut bytes = b"MATLAB 5.0 MAT-file, made up".to_vec();
        bytes.resize(124, b' ');
        bytes.extend(if big { [1, 0, b'M', b'I'] } else { [0, 1, b'I', b'M'] });
        Self { bytes, big }
    }

    fn word(&self, value: u32) -> [u8; 4] {
        if self.big { value.to_be_bytes() } else { value.to_le_bytes() }
    }

    fn element(&self, kind: u32, data: &[u8]) -> Vec<u8> {
        let length = data.len() as u32;
        let mut element = Vec::new();
        if (1..=4).contains(&length) {
            element.extend(self.word(length << 16 | kind));
        } else {
            element.extend(self.word(kind));
            element.extend(self.word(length));
        }
        element.extend(data);
        element.resize(element.len().next_multiple_of(8), 0);
        element
    }

    /// A variable of this class, its flags in the bits above.
    fn matrix(&self, class: u32, name: &str, dimensions: &[u32], numbers: &Stored) -> Vec<u8> {
        macro_rules! stored {
            ($values:expr) => {
                $values.iter().flat_map(|v| if self.big { v.to_be_bytes() } else { v.to_le_bytes() }).collect()
            };
        }
        let (kind, data): (u32, Vec<u8>) = match numbers {
            Stored::F64(values) => (9, stored!(values)),
            Stored::F32(values) => (7, stored!(values)),
            Stored::U8(values) => (2, values.clone()),
            Stored::I16(values) => (3, stored!(values)),
        };
        let mut parts = self.element(6, &[self.word(class), self.word(0)].concat());
        parts.extend(self.element(5, &dimensions.iter().flat_map(|d| self.word(*d)).collect::<Vec<u8>>()));
        parts.extend(self.element(1, name.as_bytes()));
        parts.extend(self.element(kind, &data));
        self.element(14, &parts)
    }

    /// A column vector of doubles, whatever the type in which it is stored.
    fn vector(&mut self, name: &str, numbers: &Stored, compressed: bool) -> &mut Self {
        let length = match numbers {
            Stored::F64(v) => v.len(),
            Stored::F32(v) => v.len(),
            Stored::U8(v) => v.len(),
            Stored::I16(v) => v.len(),
        };
        let class = if matches!(numbers, Stored::F32(_)) { 7 } else { 6 };
        let matrix = self.matrix(class, name, &[length as u32, 1], numbers);
        self.push(matrix, compressed)
    }

    fn push(&mut self, element: Vec<u8>, compressed: bool) -> &mut Self {
        if !compressed {
            self.bytes.extend(element);
            return self;
        }
        let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
        encoder.write_all(&element).unwrap();
        let packed = encoder.finish().unwrap();
        self.bytes.extend([self.word(15), self.word(packed.len() as u32)].concat());
        self.bytes.extend(packed);
        self
    }

    /// A matrix of doubles, columns first.
    fn doubles_of(&self, name: &str, dimensions: &[u32], values: &[f64]) -> Vec<u8> {
        self.matrix(6, name, dimensions, &Stored::F64(values.to_vec()))
    }

    fn text(&self, name: &str, text: &str) -> Vec<u8> {
        self.matrix(4, name, &[1, text.len() as u32], &Stored::U8(text.as_bytes().to_vec()))
    }

    /// Structs of these fields, one struct after the other; objects of a class where there is one.
    fn structs(&self, name: &str, class: Option<&str>, fields: &[&str], structs: &[Vec<Vec<u8>>]) -> Vec<u8> {
        let mut parts = self.element(6, &[self.word(if class.is_some() { 3 } else { 2 }), self.word(0)].concat());
        parts.extend(self.element(5, &[self.word(1), self.word(structs.len() as u32)].concat()));
        parts.extend(self.element(1, name.as_bytes()));
        parts.extend(class.into_iter().flat_map(|class| self.element(1, class.as_bytes())));
        parts.extend(self.element(5, &self.word(32)));
        let padded = |field: &&str| {
            let mut padded = field.as_bytes().to_vec();
            padded.resize(32, 0);
            padded
        };
        parts.extend(self.element(1, &fields.iter().flat_map(padded).collect::<Vec<u8>>()));
        parts.extend(structs.iter().flatten().flatten());
        self.element(14, &parts)
    }

    fn cells(&self, name: &str, cells: &[Vec<u8>]) -> Vec<u8> {
        let mut parts = self.element(6, &[self.word(1), self.word(0)].concat());
        parts.extend(self.element(5, &[self.word(1), self.word(cells.len() as u32)].concat()));
        parts.extend(self.element(1, name.as_bytes()));
        parts.extend(cells.iter().flatten());
        self.element(14, &parts)
    }

    fn doubles(&mut self, name: &str, values: impl IntoIterator<Item = f64>) -> &mut Self {
        self.vector(name, &Stored::F64(values.into_iter().collect()), true)
    }

    fn import(&self) -> Result<Import, ImportError> {
        imported(&self.bytes)
    }

    fn import_with(&self, columns: &[&str]) -> Result<Import, ImportError> {
        let columns = columns.iter().map(|column| column.parse().unwrap()).collect();
        importing::imported(&self.bytes, &ImportOptions { columns, ..ImportOptions::default() })
    }
}

fn time(row: usize) -> f64 {
    row as f64 / 512.0
}

fn percent(row: usize) -> u8 {
    [20, 25, 30, 25][row / 100]
}

fn rpm(row: usize) -> i16 {
    (5000 + (row * row) % 1777) as i16
}

/// The sample: every way of storing that a wanted vector can have.
fn sample_bytes(big: bool) -> Vec<u8> {
    let mut log = Writer::new(big);
    let rows = || 0..ROWS;
    let text = log.matrix(4, "remark", &[1, 4], &Stored::U8(b"made".to_vec()));
    log.push(text, true)
        .vector("Time_s", &Stored::F64(rows().map(time).collect()), true)
        .vector("V_bat", &Stored::F32(rows().map(|k| 16.0 - k as f32 / 1024.0).collect()), true)
        .vector("current", &Stored::F64(vec![2.5; ROWS - 1]), false)
        .vector("T", &Stored::U8(vec![7; 3]), false)
        .vector("Throttle_percent", &Stored::U8(rows().map(percent).collect()), false)
        .vector("motor_rpm", &Stored::I16(rows().map(rpm).collect()), true);
    log.bytes
}

#[test]
#[ignore = "writes the sample"]
fn write_the_sample() {
    fs::write(sample(), sample_bytes(false)).unwrap();
}

fn check_numbers(experiment: &rotorlead_records::Experiment) {
    let record = &experiment.records[0];
    let rows = || 0..ROWS;
    assert_eq!(experiment.output, Output::Rpm);
    assert_eq!(experiment.sample_rate_hz, Some(512.0));
    assert_eq!(record.time_s, rows().map(time).collect::<Vec<_>>());
    assert_eq!(record.command, rows().map(|k| f64::from(percent(k)) * 0.01).collect::<Vec<_>>());
    assert_eq!(record.rpm.as_deref().unwrap(), rows().map(|k| f64::from(rpm(k))).collect::<Vec<_>>());
    let volts = rows().map(|k| f64::from(16.0 - k as f32 / 1024.0)).collect::<Vec<_>>();
    assert_eq!(record.voltage_v.as_deref().unwrap(), volts);
    assert_eq!((record.current_a.as_ref(), record.thrust_n.as_ref()), (None, None));
}

#[test]
fn the_sample_is_taken_number_by_number() {
    let Import { experiment, summary } = import(&sample(), &ImportOptions::default()).unwrap();
    assert_eq!((summary.format.name, summary.rows_read, summary.rows_taken), ("mat", ROWS, ROWS));
    assert_eq!(experiment.name, "vectors");
    check_numbers(&experiment);
    let uses: Vec<_> = summary.columns.iter().map(|c| (c.name.as_str(), c.taken_as.as_deref())).collect();
    let expected = [
        ("Time_s", Some("time_s")),
        ("V_bat", Some("voltage_v")),
        ("Throttle_percent", Some("command")),
        ("motor_rpm", Some("rpm")),
        // Shorter ones come behind.
        ("current", None),
        ("T", None),
        ("remark", None),
    ];
    assert_eq!(uses, expected);
    assert!(summary.columns[4].note.contains("filled in 399 of 400 rows"), "{:?}", summary.columns[4]);
}

#[test]
fn either_byte_order_gives_the_same_numbers() {
    check_numbers(&imported(&sample_bytes(true)).unwrap().experiment);
}

#[test]
fn thrust_goes_before_speed_and_units_come_from_the_names() {
    let rows = || 0..120;
    let mut log = Writer::new(false);
    log.doubles("t_ms", rows().map(|k| 100.0 + 2.0 * f64::from(k)))
        .doubles("pwm", rows().map(|k| if k < 60 { 1250.0 } else { 1500.0 }))
        .doubles("thrust_gf", rows().map(|k| 100.0 + f64::from(k)))
        .doubles("omega", rows().map(|_| std::f64::consts::PI));
    let Import { experiment, summary } = log.import().unwrap();
    let record = &experiment.records[0];
    assert_eq!(experiment.output, Output::ThrustN);
    assert!((record.time_s[119] - 0.238).abs() < 1e-15);
    assert_eq!((record.command[0], record.command[119]), (0.25, 0.5));
    assert_eq!(record.thrust_n.as_ref().unwrap()[0], 100.0 * 9.80665e-3);
    assert!((record.rpm.as_ref().unwrap()[0] - 30.0).abs() < 1e-13);
    assert!(summary.pulse_widths && summary.notes[0].contains("response is the thrust"), "{:?}", summary.notes);
}

/// A log of 120 rows with one number changed.
fn with(name: &str, row: usize, value: f64) -> Result<Import, ImportError> {
    let mut log = Writer::new(false);
    for (vector, scale) in [("time", 0.01), ("command", 0.005), ("rpm", 50.0)] {
        let number = |k: usize| if (vector, k) == (name, row) { value } else { scale * k as f64 };
        log.doubles(vector, (0..120).map(number));
    }
    log.import()
}

#[test]
fn rows_of_nan_are_left_out_and_told() {
    for name in ["time", "command", "rpm"] {
        let Import { experiment, summary } = with(name, 50, f64::NAN).unwrap();
        assert_eq!((summary.rows_read, summary.rows_taken, summary.dropped[0].rows), (120, 119, 1));
        assert_eq!(experiment.records[0].rpm.as_ref().unwrap()[50], 2550.0);
        assert_eq!(experiment.sample_rate_hz, None, "a gap is no even grid");
    }
}

#[test]
fn bad_numbers_are_named() {
    let Import { summary, .. } = with("rpm", 50, f64::INFINITY).unwrap();
    assert_eq!((summary.rows_taken, summary.dropped[0].rows), (119, 1), "an infinite number is none");
    let text = message(with("time", 50, 0.48));
    assert!(text.contains("sample 51, column `time`: time runs backwards by 0.01 s"), "{text}");
    let mut fast = Writer::new(false);
    for (vector, scale) in [("time", 5e-303), ("command", 0.005), ("rpm", 50.0)] {
        fast.doubles(vector, (0..120).map(|k| scale * f64::from(k)));
    }
    let text = message(fast.import());
    assert!(text.contains("variable `time`: rows come every 5e-303 s") && text.contains("in seconds"), "{text}");
    let text = message(with("command", 50, 1250.0));
    assert!(
        text.contains("sample 51, column `command`: 1250 is outside 0..1") && text.contains("--pulse-us"),
        "{text}"
    );
}

#[test]
fn missing_short_and_unequal_vectors_are_refused() {
    let rows = |n: u32| (0..n).map(|k| 1e-3 * f64::from(k));
    let mut log = Writer::new(false);
    assert!(message(log.import()).contains("no column is known to be the time"));
    log.doubles("t", rows(120));
    assert!(message(log.import()).contains("no column is known to be the command"));
    log.doubles("u", rows(120));
    let text = message(log.import());
    assert!(
        text.contains("known to be the thrust, and none the rpm") && text.contains("columns are `t`, `u`."),
        "{text}"
    );
    log.doubles("rpm", rows(119));
    assert!(message(log.import()).contains("vector `rpm`: 119 numbers, but `t` has 120"));
    let mut log = Writer::new(false);
    log.doubles("t", rows(99)).doubles("u", rows(99)).doubles("rpm", rows(99));
    assert!(message(log.import()).contains("99 usable row(s)"));
}

/// An object of a `classdef` as MATLAB saves it: no dimensions, but the name of a system of types and that of the class.
fn object(log: &Writer, name: &str, class: &str) -> Vec<u8> {
    let parts = [name, "MCOS", class].map(|text| log.element(1, text.as_bytes())).concat();
    log.element(14, &[log.element(6, &[log.word(17), log.word(0)].concat()), parts].concat())
}

/// A log of 120 rows whose command is this variable, packed or not.
fn with_command(command: impl Fn(&Writer) -> Vec<u8>, compressed: bool) -> Result<Import, ImportError> {
    let mut log = Writer::new(false);
    let ramp = || (0..120).map(|k| 0.005 * f64::from(k));
    log.doubles("time", ramp()).doubles("rpm", ramp());
    let command = command(&log);
    log.push(command, compressed).import()
}

#[test]
fn a_vector_may_lie_along_any_dimension() {
    let numbers = || Stored::F64((0..120).map(|k| 0.005 * f64::from(k)).collect());
    for dimensions in [&[120, 1][..], &[1, 120], &[1, 1, 120], &[1, 120, 1, 1]] {
        let Import { experiment, .. } = with_command(|log| log.matrix(6, "u", dimensions, &numbers()), true).unwrap();
        assert_eq!(experiment.records[0].command[100], 0.5, "{dimensions:?}");
    }
}

#[test]
fn what_is_no_vector_of_real_numbers_is_refused_by_its_name() {
    let shaped = |class: u32, dimensions: &'static [u32]| {
        let count = dimensions.iter().product::<u32>() as usize;
        move |log: &Writer| log.matrix(class, "u", dimensions, &Stored::U8(vec![0; count]))
    };
    let of_class = |class| shaped(class, &[120, 1]);
    type Made = Box<dyn Fn(&Writer) -> Vec<u8>>;
    let cases: [(Made, &str, &str); 12] = [
        (Box::new(shaped(6, &[4, 5, 6])), "4x5x6 numbers", "`thrust = u(:, 2)`"),
        (Box::new(shaped(6, &[0, 0])), "0x0 numbers", "`u` is empty"),
        (Box::new(shaped(6, &[0, 1])), "0x1 numbers", "`u` is empty"),
        (Box::new(of_class(6 | 0x0800)), "complex numbers", "`real(u)`"),
        (Box::new(of_class(5)), "a sparse matrix", "`full(u)`"),
        (Box::new(shaped(1, &[300, 1])), "a cell array", "`cell2mat(u)`"),
        (Box::new(|log| log.structs("u", None, &[], &[vec![]])), "a struct", "`save(file, '-struct', 'u', '-v7')`"),
        (Box::new(of_class(4)), "text", "`str2double(u)`"),
        (Box::new(of_class(16)), "a function handle", "`command = u(time)`"),
        (Box::new(of_class(18)), "data of an unknown class", "save the numbers"),
        (Box::new(|log| object(log, "u", "timeseries")), "an object of class timeseries", "`time = u.Time`"),
        (
            Box::new(|log| log.structs("u", Some("idpoly"), &[], &[vec![]])),
            "an object of class idpoly",
            "`time = u.Time`",
        ),
    ];
    for (made, found, remedy) in cases {
        for compressed in [false, true] {
            let text = message(with_command(&made, compressed));
            let expected =
                format!("log.csv, variable `u`: {found}, where a vector of real numbers is needed | in MATLAB");
            assert!(text.contains(&expected) && text.contains(remedy), "{text}");
        }
    }
}

#[test]
fn an_unfit_variable_gives_way_to_one_that_can_be_taken() {
    let mut log = Writer::new(false);
    let timeseries = object(&log, "thrust", "timeseries");
    let ramp = || (0..120).map(|k| 0.005 * f64::from(k));
    log.push(timeseries, true).doubles("time", ramp()).doubles("command", ramp()).doubles("rpm", ramp());
    let Import { experiment, summary } = log.import().unwrap();
    assert_eq!(experiment.output, Output::Rpm);
    assert_eq!((summary.columns[3].name.as_str(), &summary.columns[3].taken_as), ("thrust", &None));
    assert!(summary.columns[3].note.contains("an object of class timeseries"), "{}", summary.columns[3].note);
}

#[test]
fn what_the_file_has_is_said_where_a_signal_is_missing() {
    let mut log = Writer::new(false);
    let run = log.structs("run", None, &[], &[vec![]]);
    log.doubles("t", (0..120).map(f64::from)).doubles("y", (0..120).map(f64::from)).push(run, true);
    let text = message(log.import());
    assert!(text.contains("the columns are `t`, `y`; no columns are `run` (a struct)"), "{text}");
    assert!(message(Writer::new(false).import()).contains("the columns are none"));
}

/// Rows of a staircase of 12 levels, at 100 Hz: time, command and a speed.
fn stairs() -> (Vec<f64>, Vec<f64>, Vec<f64>) {
    let rows = || 0..240;
    let level = |row: usize| [0.2, 0.5, 0.3, 0.6][row / 60];
    (
        rows().map(|row| row as f64 / 100.0).collect(),
        rows().map(level).collect(),
        rows().map(|row| 20_000.0 * level(row) + (row % 7) as f64).collect(),
    )
}

fn check_stairs(import: Result<Import, ImportError>) {
    let (time, command, speed) = stairs();
    let Import { experiment, .. } =
        import.unwrap_or_else(|error| panic!("{error} | {:?}", error.help().map(|h| h.to_string())));
    let record = &experiment.records[0];
    assert!(record.time_s.iter().zip(&time).all(|(found, expected)| (found - expected).abs() < 1e-12));
    assert_eq!((&record.command, record.rpm.as_ref().unwrap()), (&command, &speed));
    assert_eq!(record.excitation, Excitation::Staircase);
    assert!((experiment.sample_rate_hz.unwrap() - 100.0).abs() < 1e-9);
}

#[test]
fn columns_of_a_vectors_name_are_stated_as_of_any_table() {
    let (time, command, speed) = stairs();
    let mut log = Writer::new(false);
    log.doubles("t", time).doubles("u", command).doubles("y", speed);
    check_stairs(log.import_with(&["command=u:duty", "rpm=y:rpm", "time=t:s"]));
    check_stairs(log.import_with(&["rpm=y:rpm"]));
    let text = message(log.import_with(&["rpm=n:rpm"]));
    assert!(text.contains("no column `n`") && text.contains("the columns are `t`, `u`, `y`"), "{text}");
    assert!(message(log.import()).contains("none the rpm"));
}

#[test]
fn a_matrix_has_a_signal_in_each_of_its_lines() {
    let (time, command, speed) = stairs();
    let percent = command.iter().map(|command| 100.0 * command).collect::<Vec<_>>();
    // With the time in a column, beside a vector of it, and lying.
    let mut log = Writer::new(false);
    let matrix = log.doubles_of("Data", &[240, 3], &[time.clone(), percent.clone(), speed.clone()].concat());
    log.push(matrix, true);
    check_stairs(log.import_with(&["time=Data(:,1):s", "command=Data(:,2):percent", "rpm=Data(:,3):rpm"]));
    let text = message(log.import());
    assert!(text.contains("the columns are `Data(:,1)`, `Data(:,2)`, `Data(:,3)`"), "{text}");
    let mut log = Writer::new(true);
    let lying: Vec<f64> = percent.iter().zip(&speed).flat_map(|(percent, speed)| [*percent, *speed]).collect();
    let matrix = log.doubles_of("Data", &[2, 240], &lying);
    log.doubles("time", time).push(matrix, false);
    check_stairs(log.import_with(&["command=Data(1,:):percent", "rpm=Data(2,:):rpm"]));
}

#[test]
fn fields_of_structs_are_called_by_their_path_and_what_the_file_calls_them() {
    let (time, command, speed) = stairs();
    let field = |log: &Writer, values: &[f64]| log.doubles_of("", &[1, 240], values);
    // One's own struct, whose names say what they are.
    let mut log = Writer::new(false);
    let run = [&time, &command, &speed].map(|values| field(&log, values)).to_vec();
    let run = log.structs("run", None, &["time_s", "throttle", "rpm"], &[run]);
    log.push(run, true);
    check_stairs(log.import());
    check_stairs(log.import_with(&["command=run.throttle:duty", "rpm=rpm:rpm"]));
    // A record of dSPACE's ControlDesk.
    let mut log = Writer::new(false);
    let x = log.structs("", None, &["Name", "Data"], &[vec![log.text("", "HostService"), field(&log, &time)]]);
    let signal = |name: &str, values: &[f64]| vec![log.text("", name), field(&log, values)];
    let y = [signal("Model Root/throttle", &command), signal("Model Root/rotor speed", &speed)];
    let y = log.structs("", None, &["Name", "Data"], &y);
    let recording = log.structs("rec_001", None, &["X", "Y"], &[vec![x, y]]);
    log.push(recording, true);
    for (command, rpm) in [
        ("rec_001.Y(1).Data", "rec_001.Y(2).Data"),
        ("Model Root/throttle", "Model Root/rotor speed"),
        ("Y(1).Data", "Y(2).Data"),
    ] {
        check_stairs(log.import_with(&[&format!("command={command}:duty"), &format!("rpm={rpm}:rpm")]));
    }
    let text = message(log.import());
    assert!(text.contains("`rec_001.X.Data` (`time`), `rec_001.Y(1).Data` (`Model Root/throttle`)"), "{text}");
    // Simulink's structure with time, whose signals say their units.
    let mut log = Writer::new(false);
    let signal =
        |label: &str, unit: &str, values: &[f64]| vec![field(&log, values), log.text("", label), log.text("", unit)];
    let percent = command.iter().map(|command| 100.0 * command).collect::<Vec<_>>();
    let signals = [signal("throttle", "%", &percent), signal("rotor speed", "rpm", &speed)];
    let signals = log.structs("", None, &["values", "label", "unit"], &signals);
    let out = log.structs("out", None, &["time", "signals"], &[vec![field(&log, &time), signals]]);
    log.push(out, false);
    check_stairs(log.import());
}

#[test]
fn data_for_identification_have_their_interval_in_place_of_times() {
    let (_, command, speed) = stairs();
    let fields = ["u", "y", "Ts"];
    let numbers = |log: &Writer| {
        [&command[..], &speed, &[0.01]].map(|values| log.doubles_of("", &[values.len() as u32, 1], values)).to_vec()
    };
    // As a struct of its own, an object of the old class, whose signals are in cells, and vectors in the workspace.
    let mut log = Writer::new(false);
    let data = log.structs("z", None, &fields, &[numbers(&log)]);
    log.push(data, true);
    check_stairs(log.import_with(&["rpm=z.y:rpm"]));
    check_stairs(log.import_with(&["command=u:duty", "rpm=y:rpm", "time=Ts:s"]));
    let mut log = Writer::new(false);
    let cells = numbers(&log).into_iter().map(|cell| log.cells("", &[cell])).collect::<Vec<_>>();
    let data = log.structs("z", Some("iddata"), &["InputData", "OutputData", "Ts"], &[cells]);
    log.push(data, true);
    check_stairs(log.import_with(&["rpm=z.OutputData:rpm"]));
    let mut log = Writer::new(false);
    log.doubles("u", command.clone()).doubles("y", speed.clone()).doubles("Ts", [0.01]);
    check_stairs(log.import_with(&["rpm=y:rpm"]));
    // An object that only MATLAB reads.
    let mut log = Writer::new(false);
    let data = object(&log, "u", "iddata");
    log.push(data, true);
    let text = message(log.import());
    assert!(text.contains("`u`: an object of class iddata") && text.contains("`Ts = u.Ts`"), "{text}");
}

#[test]
fn structs_within_each_other_end_somewhere() {
    let log = Writer::new(false);
    let mut inner = log.doubles_of("", &[2, 1], &[0.0, 1.0]);
    for _ in 0..1000 {
        inner = log.cells("", &[inner]);
    }
    let mut log = Writer::new(false);
    let cells = log.cells("u", &[inner]);
    log.push(cells, false);
    assert!(message(log.import()).contains("a cell array"));
}

#[test]
fn version_7_3_is_told_to_be_saved_again() {
    let mut bytes = sample_bytes(false);
    bytes[125] = 2;
    assert!(message(imported(&bytes)).contains("-v7"));
}

#[test]
fn a_file_cut_anywhere_is_refused() {
    let bytes = fs::read(sample()).unwrap();
    assert!(bytes.len() < 20_000);
    for length in 0..bytes.len() {
        message(imported(&bytes[..length]));
    }
}

#[test]
fn lengths_beyond_the_file_cost_no_memory() {
    // Dimensions whose product does not fit, and an element said to be of 4 GB.
    let mut log = Writer::new(false);
    let huge = log.matrix(6, "time", &[u32::MAX, u32::MAX], &Stored::F64(vec![0.0; 4]));
    log.push(huge, true);
    assert!(message(log.import()).contains("do not have its size"));
    let mut log = Writer::new(false);
    log.bytes.extend([[14, 0, 0, 0], [0xff; 4]].concat());
    assert!(message(log.import()).contains("byte 128: the file ends within a variable"));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    /// Changed bytes give an experiment of equal columns or an error with a remedy, and never a panic.
    #[test]
    fn damaged_files_are_taken_or_refused(
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
        cut in prop::option::of(any::<prop::sample::Index>()),
        big in any::<bool>(),
    ) {
        let mut bytes = sample_bytes(big);
        for (at, byte) in changes {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
        if let Some(cut) = cut {
            bytes.truncate(cut.index(bytes.len()));
        }
        match imported(&bytes) {
            Ok(Import { experiment, .. }) => {
                let record = &experiment.records[0];
                prop_assert!(record.time_s.is_sorted_by(|a, b| a < b));
                prop_assert_eq!(record.time_s.len(), record.command.len());
                prop_assert!(record.command.iter().all(|c| (0.0..=1.0).contains(c)));
            }
            Err(error) => prop_assert!(error.help().is_some()),
        }
    }
}
