//! Logs of the PX4 autopilot: one motor's command and the speed that its ESC reports.
//!
//! - The command is `actuator_motors.control`, which is 0..1 and numbered by motor; where that is not
//!   logged, `actuator_outputs.output`, a pulse width numbered by output channel.
//! - The response is `esc_status.esc[].esc_rpm`. Each report has its own stamp, which is kept; a status
//!   that repeats an ESC's last report, because another ESC answered, is left out.
//! - The two topics have their own rates: the command is held to the response's stamps, and kept on its own too.

use std::collections::BTreeSet;
use std::path::Path;

use super::binary_columns::zero_based_stamps;
use super::format::{LogFormat, Reader, UNCOMPRESSED};
use super::held::{HeldCommand, hold};
use super::summary::ColumnUse;
use super::ulog_messages::{Topic, UlogLog, UlogNumber, is_ulog};
use super::{ImportError, ImportOptions, ImportSummary, MIN_ROWS, Taken, flight, redact};
use crate::experiment::{Excitation, Output, Setpoints};

/// Bends thrust to the ESC's signal.
pub(super) const THRUST_FACTOR: &str = "THR_MDL_FAC";
const MOTORS: &str = "actuator_motors";
const OUTPUTS: &str = "actuator_outputs";
const STATUS: &str = "esc_status";
/// The topics that are read.
pub(super) const TOPICS: [&str; 3] = [MOTORS, OUTPUTS, STATUS];
/// `esc_report.actuator_function` of motor 1 is one more.
const MOTOR_FUNCTION: f64 = 100.0;
/// Commands in one `actuator_motors`, or `actuator_outputs`.
const MOST_MOTORS: usize = 16;
/// ESCs in one `esc_status`.
const ESCS: usize = 8;

fn take(file: &Path, bytes: &[u8], options: &ImportOptions) -> Result<Taken, ImportError> {
    let log = UlogLog::read(bytes, &TOPICS).map_err(|damage| ImportError::Damaged {
        file: file.into(),
        offset: damage.offset,
        problem: damage.problem,
    })?;
    if !log.logged {
        return Err(ImportError::Damaged {
            file: file.into(),
            offset: bytes.len(),
            problem: "the log ends before anything was logged",
        });
    }
    let number = options.motor.unwrap_or(1);
    let has: BTreeSet<&str> = log.topics.iter().map(|topic| topic.name).collect();
    let has: Vec<&str> = has.into_iter().collect();
    let missing = |signal: &'static str, known: &str| ImportError::missing_signal(file, signal, number, known, &has);
    let mut notes = Vec::new();
    let motor = number.checked_sub(1).ok_or_else(|| missing("command", "motors are numbered from 1"))?;

    let mut found = Vec::new();
    for (name, field) in [(MOTORS, "control"), (OUTPUTS, "output")] {
        let places = (log.topic(name), log.place(name, field, motor, None), log.place(name, "timestamp", 0, None));
        if let (Some(topic), Some(place), Some(stamp)) = places {
            let command_name = format!("{name}.{field}[{motor}]");
            found.push((topic, field, samples(file, &command_name, topic, place, stamp)?, command_name));
        }
    }
    let moving = found.iter().position(|(_, _, command, _)| moves(command)).unwrap_or(0);
    if moving > 0 {
        notes.push(
            "`actuator_motors` stands still, as in a motor test, which drives the outputs behind it: taken is \
             `actuator_outputs`"
                .into(),
        );
    }
    if found.is_empty() {
        return Err(missing("command", "`actuator_motors.control` or `actuator_outputs.output`"));
    }
    let (topic, field, command, command_name) = found.swap_remove(moving);
    let pulse_widths = topic.name == OUTPUTS;
    let range = match options.esc_signal_us {
        _ if !pulse_widths => (0.0, 1.0),
        Some(range) => range,
        None => return Err(ImportError::no_pulse_range(file)),
    };
    if pulse_widths {
        notes.push(format!(
            "the command is output channel {} of instance {}, which is motor {} only if the airframe is wired so",
            number, topic.instance, number
        ));
    }

    let status = log.topic(STATUS).ok_or_else(|| missing("rpm", "`esc_status.esc[].esc_rpm`"))?;
    let report = |esc: usize, name: &str| log.place(STATUS, "esc", esc, Some(name));
    let esc = find_esc(status, motor, report, &mut notes);
    let speed_place = report(esc, "esc_rpm").ok_or_else(|| missing("rpm", "`esc_status.esc[].esc_rpm`"))?;
    let own_stamp = report(esc, "timestamp").ok_or_else(|| missing("time_s", "`esc_status.esc[].timestamp`"))?;
    let speed_name = format!("{STATUS}.esc[{esc}].esc_rpm");
    let response = samples(file, &speed_name, status, speed_place, own_stamp)?;

    let rows_read = response.len();
    let held = hold(&command, &response);
    notes.extend(held.note(&command, &response));
    let rows = &held.rows;
    if rows.len() < MIN_ROWS {
        return Err(ImportError::TooFewRows { file: file.into(), rows: rows.len(), needed: MIN_ROWS });
    }
    let mut becomes = format!("{}..{} become 0..1; on its own stamps", range.0, range.1);
    let factor = log.parameter(THRUST_FACTOR).filter(|_| !pulse_widths);
    if factor.is_none() && !pulse_widths {
        notes.push(format!(
            "the log does not have {THRUST_FACTOR}, by which PX4 bends the command on its way to the ESC: it is taken as 0, which \
             bends nothing"
        ));
    }
    let factor = factor.filter(|factor| *factor > 0.0);
    if let Some(factor) = factor {
        becomes = format!("as the ESC's signal, by {THRUST_FACTOR} = {factor}; on its own stamps");
    }
    let bent = |command: f64| factor.map_or(command, |factor| signal(command, factor));
    let HeldCommand { at_rows, own } = held.command(file, &command_name, &command, &response, range, bent)?;
    refuse_flight(file, options, &log, (topic, field, range), (motor, &command), response[rows[0]].0)?;
    let stamps = rows.iter().map(|&row| response[row].0 * 1e-6).collect();
    let (time_s, sample_rate_hz, timing) =
        zero_based_stamps(file, &format!("{STATUS}.esc[{esc}].timestamp"), rows, stamps)?;
    let rpm = rows.iter().map(|&row| response[row].1.abs()).collect();

    let mut columns = vec![
        column(format!("{STATUS}.esc[{esc}].timestamp"), Some("time_s"), "microseconds, from the first row taken"),
        column(command_name, Some("command"), &becomes),
        column(speed_name, Some("rpm"), "magnitude, as the ESC reports it"),
    ];
    let mut optional = |name: &str, taken_as: &str| {
        let place = report(esc, name)?;
        let values: Option<Vec<f64>> = rows.iter().map(|&row| place.read(status.rows[row])).collect();
        let values = values.filter(|v| v.iter().all(|x| x.is_finite()) && v.iter().any(|&x| x != 0.0));
        let (taken_as, note) =
            if values.is_some() { (Some(taken_as), "as it stands") } else { (None, "the ESC does not report it") };
        columns.push(column(format!("{STATUS}.esc[{esc}].{name}"), taken_as, note));
        values
    };
    let voltage_v = optional("esc_voltage", "voltage_v");
    let current_a = optional("esc_current", "current_a");
    for other in &log.topics {
        let taken = other.name == STATUS && other.instance == status.instance
            || other.name == topic.name && other.instance == topic.instance;
        if !taken {
            columns.push(column(format!("{}[{}]", other.name, other.instance), None, "no part of an experiment"));
        }
    }
    if log.cut {
        notes.push("the log ends within a message, as when power is cut; all whole messages were read".into());
    }
    if log.dropouts > 0 {
        notes.push(format!("the logger lost data {} time(s): a command may be held too long there", log.dropouts));
    }
    Ok(Taken {
        output: Output::Rpm,
        usual: Some(Excitation::Staircase),
        summary: ImportSummary {
            file: file.into(),
            format: &FORMAT,
            rows_read,
            rows_taken: rows.len(),
            columns,
            dropped: held.dropped,
            timing,
            pulse_widths,
            is_electrical: false,
            has_motors: true,
            notes,
        },
        time_s,
        command: at_rows,
        own_command: own,
        thrust_n: None,
        rpm: Some(rpm),
        voltage_v,
        current_a,
        setpoints: Setpoints::default(),
        loop_rate_hz: None,
        sample_rate_hz,
    })
}

/// Looks at the commands of all motors that are not switched off throughout; seconds count from `origin_us`.
fn refuse_flight(
    file: &Path,
    options: &ImportOptions,
    log: &UlogLog<'_>,
    (topic, field, range): (&Topic<'_>, &str, (f64, f64)),
    (motor, command): (usize, &[(f64, f64)]),
    origin_us: f64,
) -> Result<(), ImportError> {
    let scaled = |value: f64| (value - range.0) / (range.1 - range.0);
    let of_motor = |other: usize| {
        let place = log.place(topic.name, field, other, None)?;
        let values: Option<Vec<f64>> = topic.rows.iter().map(|row| place.read(row).map(scaled)).collect();
        Some((other + 1, values?))
    };
    let others: Vec<(usize, Vec<f64>)> =
        (0..MOST_MOTORS).filter(|&other| other != motor).filter_map(of_motor).collect();
    let time_s: Vec<f64> = command.iter().map(|sample| (sample.0 - origin_us) * 1e-6).collect();
    let command: Vec<f64> = command.iter().map(|sample| scaled(sample.1)).collect();
    flight::refuse(file, options, motor + 1, &time_s, &command, "motor", &others)
}

fn column(name: String, taken_as: Option<&str>, note: &str) -> ColumnUse {
    ColumnUse { name, taken_as: taken_as.map(String::from), note: note.into() }
}

/// Whether a command takes more than one value.
fn moves(command: &[(f64, f64)]) -> bool {
    let mut known = command.iter().map(|sample| sample.1).filter(|value| value.is_finite());
    known.next().is_some_and(|first| known.any(|value| value != first))
}

/// What the ESC gets of a thrust, both 0 to 1 of their ranges, where thrust is `(1 - factor) signal + factor signal^2` (PX4,
/// `FunctionMotors::updateValues`).
fn signal(thrust: f64, factor: f64) -> f64 {
    let half = (1.0 - factor) / (2.0 * factor);
    (half * half + thrust / factor).sqrt() - half
}

/// Which ESC drives `motor` (from 0): the one that says so, or that of the same place.
fn find_esc<'a>(
    status: &Topic<'_>,
    motor: usize,
    report: impl Fn(usize, &str) -> Option<UlogNumber<'a>>,
    notes: &mut Vec<String>,
) -> usize {
    let function = MOTOR_FUNCTION + (motor + 1) as f64;
    let says_so = |&esc: &usize| {
        let place = report(esc, "actuator_function");
        place.is_some_and(|p| status.rows.iter().any(|row| p.read(row) == Some(function)))
    };
    (0..ESCS).find(says_so).unwrap_or_else(|| {
        notes.push(format!("no ESC says that it drives motor {}: taken is the one of that place", motor + 1));
        motor
    })
}

/// Stamps in microseconds and numbers of a topic.
fn samples(
    file: &Path,
    name: &str,
    topic: &Topic<'_>,
    place: UlogNumber<'_>,
    stamp: UlogNumber<'_>,
) -> Result<Vec<(f64, f64)>, ImportError> {
    let sample = |row: &&[u8]| Some((stamp.read(row)?, place.read(row)?));
    let all: Option<Vec<_>> = topic.rows.iter().map(sample).collect();
    all.ok_or_else(|| ImportError::vector(file, name, "a message is shorter than its format"))
}

/// Bytes as a log, where they are a ULog.
fn read(file: &Path, bytes: &[u8], options: &ImportOptions) -> Result<Option<Taken>, ImportError> {
    is_ulog(bytes).then(|| take(file, bytes, options)).transpose()
}

/// The format.
pub(super) const FORMAT: LogFormat = LogFormat {
    name: "ulog",
    title: "PX4 ULog",
    has_motors: true,
    has_several_logs: false,
    has_stated_columns: false,
    memory_per_byte: UNCOMPRESSED,
    reader: Reader::Bytes { read, redact: redact::ulog::copy },
};
