//! DataFlash logs of ArduPilot: a chirp of its applet, or a motor's output and the speed that its ESC reports.
//!
//! - *A chirp* of the actuator chirp applet: the messages `ECRP`, whose rows have the pulse width that was put out and the speed at that
//!   moment. A row's command holds until the next row. Each sweep is a chirp of its own.
//! - *Otherwise* `RCOU`, the pulse widths of the outputs, and `ESC`, whose instances count outputs from zero. A report has its own
//!   stamp; the command is held to it, and kept on its own stamps too. Which output a motor is on is said by the parameters
//!   `SERVOn_FUNCTION`.
//! - Pulse widths become 0..1 by the parameters that state the ESC's range, `MOT_PWM_MIN` and `MOT_PWM_MAX` (`Q_M_` of a quadplane), of a
//!   plane's throttle by those of its output, `SERVOn_MIN` and `SERVOn_MAX`, unless a range is stated.

use std::collections::HashMap;
use std::path::Path;

use rotorlead_numerics::sample::median;

use super::binary_columns::{normalized, zero_based_stamps};
use super::dataflash_messages::{DataFlashLog, Messages, is_dataflash};
use super::format::{LogFormat, Reader, UNCOMPRESSED};
use super::held::{HeldCommand, hold};
use super::summary::{ColumnUse, DroppedRows};
use super::{ImportError, ImportOptions, ImportSummary, MIN_ROWS, Taken, flight, redact};
use crate::experiment::{Excitation, Output, Setpoints};

const CHIRP: &str = "ECRP";
const OUTPUTS: &str = "RCOU";
const REPORTS: &str = "ESC";
/// The messages that are read, beside those of parameters.
pub(super) const MESSAGES: [&str; 3] = [CHIRP, OUTPUTS, REPORTS];
/// How the parameters begin that state the pulse widths of all motors.
const PULSE_RANGES: [&str; 2] = ["MOT_PWM", "Q_M_PWM"];
/// Outputs in `RCOU`.
const CHANNELS: usize = 14;
/// Rows of a chirp come every 5 ms; after as long, seconds, another has begun.
const CHIRP_PAUSE_S: f64 = 1.0;
/// The frequency of a chirp never falls; where it is below this share of that before, another has begun.
const CHIRP_RESTART: f64 = 0.9;
const STAMP: &str = "microseconds, from the first row taken";

fn take(file: &Path, bytes: &[u8], options: &ImportOptions) -> Result<Taken, ImportError> {
    let log = DataFlashLog::read(bytes, &MESSAGES);
    if log.bytes_lost > bytes.len() / 2 {
        let problem = "from here on, more bytes belong to no message than to one";
        return Err(ImportError::Damaged { file: file.into(), offset: log.first_damage, problem });
    }
    let mut taken = match (log.messages(CHIRP), options.motor) {
        (Some(rows), None) => chirp(file, &log, rows, options)?,
        _ => outputs(file, &log, options)?,
    };
    let notes = &mut taken.summary.notes;
    if log.damaged > 0 {
        notes.push(format!(
            "the log is damaged in {} place(s), the first at byte {}: {} bytes there belong to no message, and the record may \
             have gaps",
            log.damaged, log.first_damage, log.bytes_lost
        ));
    }
    if log.cut {
        notes.push("the log ends within a message, as when power is cut; all whole messages were read".into());
    }
    let known = |name: &str| taken.summary.columns.iter().any(|column| column.name.split('.').next() == Some(name));
    let others: Vec<&str> = log.logged().map(|messages| messages.name).filter(|name| !known(name)).collect();
    let other = |name: &str| column(name.into(), None, "no part of an experiment");
    taken.summary.columns.extend(others.into_iter().map(other));
    Ok(taken)
}

/// The longest chirp, or the one that was asked for.
fn chirp(
    file: &Path,
    log: &DataFlashLog<'_>,
    rows: &Messages<'_>,
    options: &ImportOptions,
) -> Result<Taken, ImportError> {
    let [time_us, pulse_us, frequency_hz, rpm] =
        ["TimeUS", "PWM", "Freq", "RPM"].map(|label| read_column(file, rows, label));
    let (time_us, pulse_us, frequency_hz, rpm) = (time_us?, pulse_us?, frequency_hz?, rpm?);
    let begins = |row: &usize| {
        time_us[*row] - time_us[row - 1] > 1e6 * CHIRP_PAUSE_S
            || frequency_hz[*row] < CHIRP_RESTART * frequency_hz[row - 1]
    };
    let mut starts: Vec<usize> = (1..time_us.len()).filter(begins).collect();
    starts.insert(0, 0);
    starts.push(time_us.len());
    let chirps: Vec<_> = starts.windows(2).map(|pair| pair[0]..pair[1]).collect();
    let longest = chirps.iter().map(ExactSizeIterator::len).max();
    let mut notes = Vec::new();
    let number = match options.log {
        Some(log) => log
            .checked_sub(1)
            .filter(|&place| place < chirps.len())
            .ok_or_else(|| ImportError::no_such_log(file, log, chirps.len()))?,
        None => chirps.iter().position(|chirp| Some(chirp.len()) == longest).unwrap_or(0),
    };
    if chirps.len() > 1 && options.log.is_none() {
        notes.push(format!("{} chirps are in the log: taken is number {}, the longest", chirps.len(), number + 1));
    }
    let of_chirp = chirps[number].clone();
    let rows_read = of_chirp.len();
    // The applet writes -1 where it has no report. What is on the other side of such rows is left out: without them the command
    // would be taken as held.
    let of_chirp: Vec<usize> = of_chirp.collect();
    let is_reported = |row: &usize| rpm[*row].is_finite() && rpm[*row] >= 0.0;
    let unreported = of_chirp.iter().filter(|row| !is_reported(row)).count();
    let segments = of_chirp.split(|row| !is_reported(row));
    let rows = segments.max_by_key(|segment| segment.len()).unwrap_or_default().to_vec();
    check_count(file, rows.len())?;
    let range = pulse_range(file, log, &motors(log).pulse_range_parameters(0), time_us[rows[0]], options, &mut notes)?;
    let command = normalized(file, "ECRP.PWM", &rows, picked(&pulse_us, &rows), range)?;
    let stamps = rows.iter().map(|&row| time_us[row] * 1e-6).collect();
    let (time_s, sample_rate_hz, timing) = zero_based_stamps(file, "ECRP.TimeUS", &rows, stamps)?;
    let speed = picked(&rpm, &rows);
    notes.extend(age_of_reports(file, log, &time_s, &speed)?);
    let (low_hz, high_hz) = (frequency_hz[rows[0]], frequency_hz[rows[rows.len() - 1]]);
    if low_hz.is_finite() && high_hz.is_finite() {
        notes.push(format!("a chirp from {low_hz:.2} to {high_hz:.2} Hz, as its rows say"));
    }
    let columns = vec![
        column("ECRP.TimeUS".into(), Some("time_s"), STAMP),
        column("ECRP.PWM".into(), Some("command"), &format!("{}..{} become 0..1", range.0, range.1)),
        column("ECRP.Freq".into(), None, "the frequency of the chirp"),
        column("ECRP.RPM".into(), Some("rpm"), "as it stands"),
    ];
    let apart = rows_read - rows.len() - unreported;
    let dropped = [(unreported, "the ESC had not reported"), (apart, "apart from the longest segment with reports")];
    let dropped = dropped.into_iter().filter(|(rows, _)| *rows > 0);
    let summary = ImportSummary {
        file: file.into(),
        format: &FORMAT,
        rows_read,
        rows_taken: rows.len(),
        columns,
        dropped: dropped.map(|(rows, reason)| DroppedRows { rows, reason: reason.into() }).collect(),
        timing,
        pulse_widths: true,
        is_electrical: false,
        has_motors: true,
        notes,
    };
    let usual = Some(Excitation::Chirp);
    Ok(taken(summary, time_s, command, speed, sample_rate_hz, usual))
}

/// One output, and what its ESC reports.
fn outputs(file: &Path, log: &DataFlashLog<'_>, options: &ImportOptions) -> Result<Taken, ImportError> {
    let number = options.motor.unwrap_or(1);
    let missing = |signal: &'static str, known: &str| {
        let known = format!("{known}; or `ECRP`, which the actuator chirp applet writes");
        let has: Vec<&str> = log.logged().map(|messages| messages.name).collect();
        ImportError::missing_signal(file, signal, number, &known, &has)
    };
    if let Some(log) = options.log {
        return Err(ImportError::no_such_log(file, log, 0));
    }
    let mut notes = Vec::new();
    let outputs = log.messages(OUTPUTS).ok_or_else(|| missing("command", "`RCOU`"))?;
    let reports = log.messages(REPORTS).ok_or_else(|| missing("rpm", "`ESC`, which needs ESCs with telemetry"))?;
    let time_us = read_column(file, outputs, "TimeUS")?;
    let motors = motors(log);
    let output = match motors.outputs.iter().find(|(motor, _)| *motor == number) {
        Some((_, output)) => *output,
        None if motors.outputs.is_empty() && (1..=CHANNELS).contains(&number) => {
            notes.push(format!("no parameter says which output motor {number} is on: taken is output {number}"));
            number
        }
        None => {
            return Err(missing(
                "command",
                "a parameter `SERVOn_FUNCTION` that puts that motor on an output of `RCOU`",
            ));
        }
    };
    let channel = |output: usize| read_column(file, outputs, &format!("C{output}"));
    let pulses = channel(output)?;
    let off = |pulse: &f64| if *pulse == 0.0 { f64::NAN } else { *pulse };
    let command: Vec<(f64, f64)> = time_us.iter().copied().zip(pulses.iter().map(off)).collect();

    let (report_us, instance) = (read_column(file, reports, "TimeUS")?, read_column(file, reports, "Instance")?);
    // Without the autopilot's slew, which draws a line on from the last two reports.
    let speed_label = if reports.place("RawRPM").is_some() { "RawRPM" } else { "RPM" };
    let speeds = read_column(file, reports, speed_label)?;
    let of_esc: Vec<usize> = (0..instance.len()).filter(|&row| instance[row] == (output - 1) as f64).collect();
    if of_esc.is_empty() {
        let mut reporting: Vec<usize> = instance.iter().map(|instance| *instance as usize + 1).collect();
        reporting.sort_unstable();
        reporting.dedup();
        let reporting: Vec<String> = reporting.iter().map(ToString::to_string).collect();
        let found = format!("reports of the ESC at output {output}, where output {} reports", reporting.join(", "));
        return Err(missing("rpm", &found));
    }
    let response: Vec<(f64, f64)> = of_esc.iter().map(|&row| (report_us[row], speeds[row])).collect();

    let held = hold(&command, &response);
    check_count(file, held.rows.len())?;
    notes.extend(held.note(&command, &response));
    let rows = &held.rows;
    let of_range = motors.pulse_range_parameters(output);
    let range = pulse_range(file, log, &of_range, response[rows[0]].0, options, &mut notes)?;
    let name = format!("{OUTPUTS}.C{output}");
    let HeldCommand { at_rows: command, own: own_command } =
        held.command(file, &name, &command, &response, range, |command| command)?;
    let stamps = rows.iter().map(|&row| response[row].0 * 1e-6).collect();
    let (time_s, sample_rate_hz, timing) = zero_based_stamps(file, "ESC.TimeUS", rows, stamps)?;
    let scaled = |pulse: &f64| (pulse - range.0) / (range.1 - range.0);
    let output_s: Vec<f64> = time_us.iter().map(|time| (time - response[rows[0]].0) * 1e-6).collect();
    let put_out: Vec<f64> = pulses.iter().map(scaled).collect();
    let others = motors.others((number, output), channel, scaled);
    flight::refuse(file, options, number, &output_s, &put_out, motors.kind_of_others(), &others)?;
    let rpm: Vec<f64> = rows.iter().map(|&row| response[row].1.abs()).collect();

    let esc = output - 1;
    let mut columns = vec![
        column(format!("ESC.TimeUS[{esc}]"), Some("time_s"), STAMP),
        column(name, Some("command"), &format!("{}..{} become 0..1; on its own stamps", range.0, range.1)),
        column(format!("ESC.{speed_label}[{esc}]"), Some("rpm"), "magnitude, as the ESC reports it"),
    ];
    let mut optional = |label: &str, taken_as: &str| {
        let values = reports.place(label).and_then(|_| read_column(file, reports, label).ok())?;
        let values: Vec<f64> = rows.iter().map(|&row| values[of_esc[row]]).collect();
        let is_there = values.iter().all(|value| value.is_finite()) && values.iter().any(|&value| value != 0.0);
        let (taken_as, note) =
            if is_there { (Some(taken_as), "as it stands") } else { (None, "the ESC does not report it") };
        columns.push(column(format!("ESC.{label}[{esc}]"), taken_as, note));
        is_there.then_some(values)
    };
    let (voltage_v, current_a) = (optional("Volt", "voltage_v"), optional("Curr", "current_a"));
    let summary = ImportSummary {
        file: file.into(),
        format: &FORMAT,
        rows_read: response.len(),
        rows_taken: rows.len(),
        columns,
        dropped: held.dropped,
        timing,
        pulse_widths: true,
        is_electrical: false,
        has_motors: true,
        notes,
    };
    Ok(Taken {
        own_command,
        voltage_v,
        current_a,
        ..taken(summary, time_s, command, rpm, sample_rate_hz, Some(Excitation::Staircase))
    })
}

/// Whether a parameter is one of those that are read.
pub(super) fn is_read(parameter: &str) -> bool {
    let is_of_output = |rest: &str| {
        let digits = rest.trim_start_matches(|c: char| c.is_ascii_digit());
        digits.len() < rest.len() && ["_FUNCTION", "_MIN", "_MAX"].contains(&digits)
    };
    let is_range = |prefix: &str| parameter.strip_prefix(prefix).is_some_and(|end| ["_MIN", "_MAX"].contains(&end));
    parameter.strip_prefix("SERVO").is_some_and(is_of_output) || PULSE_RANGES.into_iter().any(is_range)
}

/// Which outputs drive motors, as the parameters say.
struct Motors {
    /// Motors and their outputs, both from 1.
    outputs: Vec<(usize, usize)>,
    /// They are a plane's throttle, and its surfaces are on the others.
    are_throttle: bool,
}

impl Motors {
    /// Whose commands are looked at beside that of a motor: of a multicopter its other motors', else those of all other outputs.
    fn kind_of_others(&self) -> &'static str {
        if self.outputs.is_empty() || self.are_throttle { "output" } else { "motor" }
    }

    /// Those, beside the motor of this number at this output: their numbers and commands, scaled.
    fn others(
        &self,
        (number, output): (usize, usize),
        channel: impl Fn(usize) -> Result<Vec<f64>, ImportError>,
        scaled: impl Fn(&f64) -> f64,
    ) -> Vec<(usize, Vec<f64>)> {
        let outputs: Vec<(usize, usize)> = match self.kind_of_others() {
            "output" => (1..=CHANNELS).filter(|other| *other != output).map(|other| (other, other)).collect(),
            _ => self.outputs.iter().copied().filter(|(motor, _)| *motor != number).collect(),
        };
        let command = |output: usize| Some(channel(output).ok()?.iter().map(&scaled).collect());
        outputs.into_iter().filter_map(|(number, output)| Some((number, command(output)?))).collect()
    }

    /// The pairs of parameters that may state the pulse widths of this output.
    fn pulse_range_parameters(&self, output: usize) -> Vec<(String, String)> {
        let pair = |prefix: String| (format!("{prefix}_MIN"), format!("{prefix}_MAX"));
        if self.are_throttle {
            return vec![pair(format!("SERVO{output}"))];
        }
        PULSE_RANGES.map(|prefix| pair(prefix.into())).into()
    }
}

/// Where no output has a motor of a multicopter, it may have the throttle of a plane, or the left and the right one.
fn motors(log: &DataFlashLog<'_>) -> Motors {
    let lifting = |function: u32| match function {
        33..=40 => Some(function as usize - 32),
        82..=85 => Some(function as usize - 73),
        160..=179 => Some(function as usize - 147),
        _ => None,
    };
    let throttle = |function: u32| match function {
        70 | 73 => Some(1),
        74 => Some(2),
        _ => None,
    };
    let with = |motor: &dyn Fn(u32) -> Option<usize>| -> Vec<(usize, usize)> {
        let of_output = |output: usize| {
            let function = log.parameter(&format!("SERVO{output}_FUNCTION"), f64::INFINITY)?;
            Some((motor(function as u32)?, output))
        };
        (1..=CHANNELS).filter_map(of_output).collect()
    };
    let outputs = with(&lifting);
    if outputs.is_empty() {
        let outputs = with(&throttle);
        return Motors { are_throttle: !outputs.is_empty(), outputs };
    }
    Motors { outputs, are_throttle: false }
}

/// The pulse widths that mean 0 and 1: those that are stated, or the parameters'.
fn pulse_range(
    file: &Path,
    log: &DataFlashLog<'_>,
    parameters: &[(String, String)],
    at_us: f64,
    options: &ImportOptions,
    notes: &mut Vec<String>,
) -> Result<(f64, f64), ImportError> {
    if let Some(range) = options.esc_signal_us {
        return Ok(range);
    }
    for (min, max) in parameters {
        if let (Some(low), Some(high)) = (log.parameter(min, at_us), log.parameter(max, at_us))
            && low > 0.0
            && low < high
        {
            notes.push(format!("pulse widths {low}..{high} become 0..1, as the parameters {min} and {max} say"));
            return Ok((low, high));
        }
    }
    Err(ImportError::no_pulse_range(file))
}

/// How old the ESC's reports are: where rows repeat them by the rows, else, where the autopilot draws lines between them, by the log
/// of the reports themselves.
fn age_of_reports(
    file: &Path,
    log: &DataFlashLog<'_>,
    time_s: &[f64],
    rpm: &[f64],
) -> Result<Option<String>, ImportError> {
    let changes = rpm.windows(2).filter(|pair| pair[0] != pair[1]).count();
    if changes == 0 {
        return Ok(None);
    }
    if 2 * changes <= time_s.len() {
        let every_ms = 1e3 * (time_s[time_s.len() - 1] - time_s[0]) / changes as f64;
        return Ok(Some(format!(
            "the speed changes every {every_ms:.0} ms on average, as the ESC reports it: half of that, and what the telemetry takes, \
             is in the dead time that is found"
        )));
    }
    let Some(reports) = log.messages(REPORTS) else {
        return Ok(Some(
            "between two reports of the ESC the autopilot draws a line: the interval of the telemetry, and what it takes, is in the \
             dead time that is found"
                .into(),
        ));
    };
    let (time_us, instance) = (read_column(file, reports, "TimeUS")?, read_column(file, reports, "Instance")?);
    let mut last = HashMap::new();
    let intervals_ms = time_us.iter().zip(&instance).filter_map(|(time_us, instance)| {
        let before = last.insert(*instance as u32, *time_us)?;
        Some(1e-3 * (time_us - before))
    });
    Ok(median(intervals_ms).map(|every_ms| {
        format!(
            "the ESC reports every {every_ms:.0} ms, and the autopilot draws a line between two reports: that interval, and what the \
             telemetry takes, is in the dead time that is found"
        )
    }))
}

fn check_count(file: &Path, rows: usize) -> Result<(), ImportError> {
    if rows < MIN_ROWS {
        return Err(ImportError::TooFewRows { file: file.into(), rows, needed: MIN_ROWS });
    }
    Ok(())
}

/// A field of all messages.
fn read_column(file: &Path, messages: &Messages<'_>, label: &str) -> Result<Vec<f64>, ImportError> {
    let fault = |problem: &str| ImportError::vector(file, &format!("{}.{label}", messages.name), problem);
    let place = messages.place(label).ok_or_else(|| fault("the message has no such field"))?;
    let values: Option<Vec<f64>> = messages.rows.iter().map(|row| place.read(row)).collect();
    values.ok_or_else(|| fault("no number, or a message that is shorter than its format"))
}

fn picked(values: &[f64], rows: &[usize]) -> Vec<f64> {
    rows.iter().map(|&row| values[row]).collect()
}

fn column(name: String, taken_as: Option<&str>, note: &str) -> ColumnUse {
    ColumnUse { name, taken_as: taken_as.map(String::from), note: note.into() }
}

fn taken(
    summary: ImportSummary,
    time_s: Vec<f64>,
    command: Vec<f64>,
    rpm: Vec<f64>,
    sample_rate_hz: Option<f64>,
    usual: Option<Excitation>,
) -> Taken {
    Taken {
        time_s,
        command,
        own_command: Vec::new(),
        thrust_n: None,
        rpm: Some(rpm),
        voltage_v: None,
        current_a: None,
        setpoints: Setpoints::default(),
        loop_rate_hz: None,
        sample_rate_hz,
        output: Output::Rpm,
        usual,
        summary,
    }
}

/// Bytes as a log, where they are a DataFlash log.
fn read(file: &Path, bytes: &[u8], options: &ImportOptions) -> Result<Option<Taken>, ImportError> {
    is_dataflash(bytes).then(|| take(file, bytes, options)).transpose()
}

/// The format.
pub(super) const FORMAT: LogFormat = LogFormat {
    name: "dataflash",
    title: "ArduPilot DataFlash (.bin), with the chirps of its actuator chirp applet",
    has_motors: true,
    has_several_logs: true,
    has_stated_columns: false,
    memory_per_byte: UNCOMPRESSED,
    reader: Reader::Bytes { read, redact: redact::dataflash::copy },
};
