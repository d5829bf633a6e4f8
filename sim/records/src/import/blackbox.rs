//! Blackbox logs of Betaflight: one motor's command and the speed that its ESC reports over bidirectional DSHOT.
//!
//! - The command is `motor[]`. With DSHOT its numbers 48 to 2047 are the ESC's whole range (0 stops the motor, 1 to 47 are
//!   orders); otherwise it is a pulse width. `motorOutput` is no range of the ESC: it is where Betaflight idles.
//! - The response is `eRPM[]` (Betaflight 4.5 and later) in hundreds of electrical revolutions per minute:
//!   `rpm = 100 eRPM / (motor_poles / 2)`. Logs of Betaflight 4.1 to 4.4 have the same in `debug[]` where `debug_mode` was
//!   `DSHOT_RPM_TELEMETRY`, for the first four motors. The headers have the mode as its place in `debugType_e` of Betaflight's
//!   `src/main/build/debug.h`: 45 in all of these versions, and in 2025.12.
//! - A file holds a log per flight. The longest is taken unless another is asked for.

use std::path::Path;

use super::binary_columns::{normalized, zero_based_stamps};
use super::blackbox_frames::{self, BlackboxLog, Rows};
use super::format::{LogFormat, Reader, UNCOMPRESSED};
use super::missing::MissingOption;
use super::quantity::DSHOT;
use super::summary::{ColumnUse, DroppedRows};
use super::{ImportError, ImportOptions, ImportSummary, MIN_ROWS, Taken, flight, redact};
use crate::experiment::{Excitation, Output, Setpoints};

/// Bit of `features` that says that motors turn both ways.
const FEATURE_3D: i64 = 1 << 12;
/// Motors of a log.
const MOST_MOTORS: usize = 8;
/// `DSHOT_RPM_TELEMETRY` among the debug modes, from version 4.1 on. Standard: `debugType_e`.
const DEBUG_RPM_TELEMETRY: &str = "45";
/// The first version whose debug modes are so numbered.
const DEBUG_SINCE: (u32, u32) = (4, 1);
/// Volts in a unit of `vbatLatest`.
const VOLTS: f64 = 0.01;
/// Throttle in a unit of `setpoint[3]`. Standard: the mixer's throttle times 1000 (Betaflight, `blackbox.c`).
const THROTTLE: f64 = 0.001;
/// Place of the first setpoint among the columns that are read.
const SETPOINTS_FROM: usize = 3;
/// Columns that are read: command, speed, voltage and four setpoints.
const COLUMNS: usize = SETPOINTS_FROM + SETPOINT_COLUMNS.len();
/// What the setpoints become.
const SETPOINT_COLUMNS: [&str; 4] =
    ["setpoint_roll_rad_s", "setpoint_pitch_rad_s", "setpoint_yaw_rad_s", "setpoint_throttle"];

fn take(file: &Path, bytes: &[u8], logs: &[&[u8]], options: &ImportOptions) -> Result<Taken, ImportError> {
    let mut notes = Vec::new();
    let number = chosen(file, logs, options, &mut notes)?;
    // Where the log begins in the file; garbage may lie in front of the first.
    let offset = bytes.len() - logs[number..].iter().map(|log| log.len()).sum::<usize>();
    let damaged = |at: usize, problem| ImportError::Damaged { file: file.into(), offset: offset + at, problem };
    let log = BlackboxLog::read(logs[number]).map_err(|damage| damaged(damage.offset, damage.problem))?;
    let number_of_motor = options.motor.unwrap_or(1);
    let missing =
        |signal: &str, known: &str| ImportError::missing_signal(file, signal, number_of_motor, known, &log.names);
    check_firmware(file, &log)?;
    let motor = number_of_motor.checked_sub(1).ok_or_else(|| missing("command", "motors are numbered from 1"))?;
    let command_name = format!("motor[{motor}]");
    let names = [format!("eRPM[{motor}]"), format!("debug[{motor}]")];
    let place = usize::from(log.field(&names[0]).is_none() && has_speed_in_debug(&log));
    let speed_name = &names[place];
    let command = log.field(&command_name).ok_or_else(|| missing("command", "the field `motor[]`"))?;
    let speed = log.field(speed_name).ok_or_else(|| {
        let known = format!(
            "the field `eRPM[]`, which Betaflight logs from version 4.5 on with bidirectional DSHOT, or `debug[]` of version 4.1 on with \
             debug_mode DSHOT_RPM_TELEMETRY ({DEBUG_RPM_TELEMETRY}); this one has debug_mode {}",
            log.header("debug_mode").unwrap_or("none")
        );
        missing("rpm", &known)
    })?;
    let poles = poles(file, &log, options, &mut notes)?;
    if place == 1 {
        notes.push(format!("the speed is `{speed_name}`: debug_mode {DEBUG_RPM_TELEMETRY} is DSHOT_RPM_TELEMETRY"));
    }
    let (range, pulse_widths) = match dshot(file, &log)? {
        true => (DSHOT, false),
        false => (options.pulse_range(), true),
    };

    let setpoint = |axis: usize| log.field(&format!("setpoint[{axis}]"));
    let setpoint_fields = [setpoint(0), setpoint(1), setpoint(2), setpoint(3)];
    let [roll, pitch, yaw, throttle] = setpoint_fields;
    let frames = log.rows([Some(command), Some(speed), log.field("vbatLatest"), roll, pitch, yaw, throttle]);
    let taken = usable(&frames, pulse_widths);
    let rows = taken.rows;
    if frames.lost > frames.rows.len() {
        return Err(damaged(frames.first_damage, "from here on, more frames are damaged than whole"));
    }
    if rows.len() < MIN_ROWS {
        return Err(ImportError::TooFewRows { file: file.into(), rows: rows.len(), needed: MIN_ROWS });
    }
    let is_flight = options.excitation == Some(Excitation::Flight);
    let column = |k: usize| rows.iter().map(|&row| f64::from(frames.rows[row].1[k])).collect::<Vec<_>>();
    let drive = normalized(file, &command_name, &rows, column(0), range)?;
    refuse_flight(file, options, &log, (motor, command, range), frames.rows[rows[0]].0)?;
    let rpm: Vec<f64> = column(1).into_iter().map(|erpm| erpm * 200.0 / poles).collect();
    if rpm.iter().all(|&rpm| rpm == 0.0) {
        notes.push(format!("`{speed_name}` is zero throughout: the motor never turned, or its ESC does not report"));
    }
    // Counted from the first row, as doubles would lose microseconds of none.
    let stamps = rows.iter().map(|&row| (frames.rows[row].0 - frames.rows[rows[0]].0) as f64 * 1e-6).collect();
    let (time_s, sample_rate_hz, timing) = zero_based_stamps(file, "time", &rows, stamps)?;
    let voltage = column(2);
    let voltage_v = (log.field("vbatLatest").is_some() && voltage.iter().any(|&v| v != 0.0))
        .then(|| voltage.into_iter().map(|v| v * VOLTS).collect());
    let asked = |place: usize, unit: f64| {
        let is_there = is_flight && setpoint_fields[place].is_some();
        is_there.then(|| column(SETPOINTS_FROM + place).into_iter().map(|value| value * unit).collect())
    };
    let rate = 1.0_f64.to_radians() / rate_scale(&log);
    let setpoints = Setpoints {
        roll_rad_s: asked(0, rate),
        pitch_rad_s: asked(1, rate),
        yaw_rad_s: asked(2, rate),
        throttle: asked(3, THROTTLE),
    };
    notes.extend(what_is_lost(&frames));

    let use_of = |name: &&str| {
        let (taken_as, note) = match *name {
            "time" => (Some("time_s"), String::from("microseconds, from the first row taken")),
            name if name == command_name => (Some("command"), format!("{}..{} become 0..1", range.0, range.1)),
            name if name == speed_name.as_str() => {
                (Some("rpm"), format!("times 100, by {} pairs of poles", poles / 2.0))
            }
            "vbatLatest" if voltage_v.is_some() => (Some("voltage_v"), format!("times {VOLTS}")),
            "vbatLatest" => (None, String::from("zero throughout")),
            "amperageLatest" => (None, String::from("the current of all motors")),
            "setpoint[0]" | "setpoint[1]" | "setpoint[2]" if is_flight => (
                Some(SETPOINT_COLUMNS[usize::from(name.as_bytes()[9] - b'0')]),
                String::from("degrees to radians a second"),
            ),
            "setpoint[3]" if is_flight => (Some(SETPOINT_COLUMNS[3]), format!("times {THROTTLE}")),
            name if name.starts_with("motor[") || name.starts_with("eRPM[") => (None, String::from("another motor")),
            _ => (None, String::from("no part of an experiment")),
        };
        ColumnUse { name: (*name).into(), taken_as: taken_as.map(String::from), note }
    };
    Ok(Taken {
        output: Output::Rpm,
        usual: Some(Excitation::Staircase),
        summary: ImportSummary {
            file: file.into(),
            format: &FORMAT,
            rows_read: frames.rows.len(),
            rows_taken: rows.len(),
            columns: log.names.iter().map(use_of).collect(),
            dropped: taken.dropped,
            timing,
            pulse_widths,
            is_electrical: true,
            has_motors: true,
            notes,
        },
        time_s,
        command: drive,
        own_command: Vec::new(),
        thrust_n: None,
        rpm: Some(rpm),
        voltage_v,
        current_a: None,
        setpoints,
        sample_rate_hz,
        loop_rate_hz: loop_rate_hz(&log),
    })
}

/// Looks at the commands of all motors, whose frames are read again: seldom are there many, and often millions of rows. Seconds count
/// from `origin_us`.
fn refuse_flight(
    file: &Path,
    options: &ImportOptions,
    log: &BlackboxLog<'_>,
    (motor, command, range): (usize, usize, (f64, f64)),
    origin_us: i64,
) -> Result<(), ImportError> {
    let scaled = |value: i32| f64::max(f64::from(value) - range.0, 0.0) / (range.1 - range.0);
    for other in (0..MOST_MOTORS).filter(|&other| other != motor) {
        let Some(field) = log.field(&format!("motor[{other}]")) else { continue };
        let rows = log.rows([Some(command), Some(field)]).rows;
        let time_s: Vec<f64> = rows.iter().map(|(time_us, _)| (time_us - origin_us) as f64 * 1e-6).collect();
        let of_motor = |k: usize| rows.iter().map(|(_, row)| scaled(row[k])).collect::<Vec<f64>>();
        flight::refuse(file, options, motor + 1, &time_s, &of_motor(0), "motor", &[(other + 1, of_motor(1))])?;
    }
    Ok(())
}

/// The place of the log to take: the one that was asked for, or the longest.
fn chosen(file: &Path, logs: &[&[u8]], options: &ImportOptions, notes: &mut Vec<String>) -> Result<usize, ImportError> {
    if let Some(log) = options.log {
        let place = log.checked_sub(1).filter(|&place| place < logs.len());
        return place.ok_or_else(|| ImportError::no_such_log(file, log, logs.len()));
    }
    let longest = logs.iter().map(|log| log.len()).max();
    let place = logs.iter().position(|log| Some(log.len()) == longest).unwrap_or(0);
    if logs.len() > 1 {
        notes.push(format!("{} logs are in the file: taken is number {}, the longest", logs.len(), place + 1));
    }
    Ok(place)
}

/// By what rates are written larger: ten in a log of high resolution. The throttle is not (Betaflight, `blackbox.c`).
fn rate_scale(log: &BlackboxLog<'_>) -> f64 {
    if log.header("blackbox_high_resolution") == Some("1") { 10.0 } else { 1.0 }
}

/// Rate at which the controller sets the motors, hertz: that of its loop, `looptime` in microseconds by `pid_process_denom`.
fn loop_rate_hz(log: &BlackboxLog<'_>) -> Option<f64> {
    let number = |header: &str| log.header(header)?.parse::<f64>().ok().filter(|number| *number >= 1.0);
    Some(1e6 / (number("looptime")? * number("pid_process_denom")?))
}

/// A header that does not say what a number of the log means, or says what cannot be taken.
fn bad_header(file: &Path, header: &str, problem: String, remedy: &str) -> ImportError {
    ImportError::value(file, format!("header `{header}`"), problem, remedy)
}

/// Others write the same container with other units.
pub(super) fn check_firmware(file: &Path, log: &BlackboxLog<'_>) -> Result<(), ImportError> {
    let header = "Firmware revision";
    let firmware = log.header(header).unwrap_or("none");
    if firmware.starts_with("Betaflight ") {
        return Ok(());
    }
    let problem = format!("`{}` is not Betaflight", firmware.chars().take(40).collect::<String>());
    let remedy =
        "the units of other firmware are not known here: export the log as a table and write an experiment folder";
    Err(bad_header(file, header, problem, remedy))
}

/// Whether `debug[]` has the motors' speeds.
fn has_speed_in_debug(log: &BlackboxLog<'_>) -> bool {
    let firmware = log.header("Firmware revision").unwrap_or_default();
    let mut numbers = firmware.split(' ').nth(1).unwrap_or_default().split('.').map_while(|part| part.parse().ok());
    let version: Option<(u32, u32)> = numbers.next().zip(numbers.next());
    version.is_some_and(|version| version >= DEBUG_SINCE) && log.header("debug_mode") == Some(DEBUG_RPM_TELEMETRY)
}

/// How many poles the motor has: as stated, or as the log says.
fn poles(
    file: &Path,
    log: &BlackboxLog<'_>,
    options: &ImportOptions,
    notes: &mut Vec<String>,
) -> Result<f64, ImportError> {
    let header = "motor_poles";
    let logged = log.header(header).and_then(|text| text.parse().ok()).filter(|poles: &u32| *poles >= 2);
    if let (Some(stated), Some(logged)) = (options.motor_poles, logged)
        && stated != logged
    {
        notes.push(format!("{stated} poles, as stated; the log says {logged}, and gains would be off by their ratio"));
    }
    options.motor_poles.or(logged).map(f64::from).ok_or_else(|| ImportError::Unstated {
        file: file.into(),
        problem: format!(", header `{header}`: no number of poles"),
        remedy: format!("state it with {}: without it electrical speed is no speed", MissingOption::motor_poles()),
        missing: vec![MissingOption::motor_poles()],
    })
}

/// Whether commands are DSHOT numbers.
fn dshot(file: &Path, log: &BlackboxLog<'_>) -> Result<bool, ImportError> {
    let features = log.header("features").and_then(|text| text.parse::<i64>().ok()).unwrap_or(0);
    if features & FEATURE_3D != 0 {
        let problem = String::from("the motors turn both ways (3D)");
        let remedy = "log with 3D switched off: half of the ESC's range is the other direction";
        return Err(bad_header(file, "features", problem, remedy));
    }
    let header = "motor_pwm_protocol";
    match log.header(header).and_then(|text| text.parse::<u8>().ok()) {
        Some(5..=8) => Ok(true),
        Some(0..=3) => Ok(false),
        _ => {
            let remedy = "known are 0 to 3 (PWM, OneShot, MultiShot) and 5 to 8 (DSHOT, ProShot)";
            Err(bad_header(file, header, String::from("neither DSHOT nor pulses"), remedy))
        }
    }
}

/// Rows to take, by their place.
struct Usable {
    rows: Vec<usize>,
    dropped: Vec<DroppedRows>,
}

/// Leaves out rows in which the motor has no command, and what can only be damage.
fn usable(frames: &Rows<COLUMNS>, pulse_widths: bool) -> Usable {
    let (mut stopped, mut wrong) = (0, 0);
    let mut rows = Vec::new();
    for (row, (_, [command, erpm, ..])) in frames.rows.iter().enumerate() {
        if *erpm < 0 || !pulse_widths && !(0..=2047).contains(command) {
            wrong += 1;
        } else if !pulse_widths && *command < 48 {
            stopped += 1;
        } else {
            rows.push(row);
        }
    }
    let reasons =
        [(stopped, "the motor is stopped (DSHOT below 48)"), (wrong, "no DSHOT number, or a negative speed: damage")];
    let reasons = reasons.into_iter().filter(|(rows, _)| *rows > 0);
    Usable { rows, dropped: reasons.map(|(rows, reason)| DroppedRows { rows, reason: reason.into() }).collect() }
}

/// What the record has gaps for, in words.
fn what_is_lost(frames: &Rows<COLUMNS>) -> Vec<String> {
    let mut notes = Vec::new();
    if frames.damaged + frames.lost > 0 {
        notes.push(format!(
            "the log is damaged in {} place(s), and {} frame(s) that hang on them are lost: the record has gaps there",
            frames.damaged, frames.lost
        ));
    }
    if frames.pauses > 0 {
        notes.push(format!("logging paused {} time(s): the record has gaps there", frames.pauses));
    }
    if !frames.closed {
        notes.push("the log was not closed, as when power is cut: all whole frames were read".into());
    }
    notes
}

/// Bytes as a log, where they hold a blackbox.
fn read(file: &Path, bytes: &[u8], options: &ImportOptions) -> Result<Option<Taken>, ImportError> {
    let logs = blackbox_frames::logs(bytes);
    (!logs.is_empty()).then(|| take(file, bytes, &logs, options)).transpose()
}

/// The format.
pub(super) const FORMAT: LogFormat = LogFormat {
    name: "blackbox",
    title: "Betaflight blackbox",
    has_motors: true,
    has_several_logs: true,
    has_stated_columns: false,
    memory_per_byte: UNCOMPRESSED,
    reader: Reader::Bytes { read, redact: redact::blackbox::copy },
};
