//! PX4 ULog: what is taken of it and what is refused.

use std::fs;
use std::path::PathBuf;

use miette::Diagnostic as _;
use proptest::prelude::*;
use rotorlead_records::Output;
use rotorlead_records::import::{Import, ImportError, ImportOptions, import};

use crate::importing::{self, message as refusal};

fn sample() -> PathBuf {
    importing::sample("esc_status.ulg")
}

fn imported(bytes: &[u8], motor: usize) -> Result<Import, ImportError> {
    importing::imported(bytes, &ImportOptions { motor: Some(motor), ..ImportOptions::default() })
}

/// Status messages of the sample; every fourth repeats the report before.
const STATUSES: u64 = 160;
/// Commands of the sample, from the stamp of status 5 on.
const COMMANDS: u64 = 90;

const REPORT: &str = "esc_report:uint64_t timestamp;uint32_t esc_errorcount;int32_t esc_rpm;float esc_voltage;\
                      float esc_current;uint8_t actuator_function;uint8_t[3] _padding0;";
const STATUS: &str = "esc_status:uint64_t timestamp;uint16_t counter;uint8_t[6] _padding0;esc_report[2] esc;";

fn message(log: &mut Vec<u8>, kind: u8, parts: &[&[u8]]) {
    let data = parts.concat();
    log.extend((data.len() as u16).to_le_bytes());
    log.push(kind);
    log.extend(data);
}

fn status_us(k: u64) -> u64 {
    1_000_000 + 2500 * k
}

/// The report of which status is in status `k`.
fn reported(k: u64) -> u64 {
    if k % 4 == 3 { k - 1 } else { k }
}

fn command_us(k: u64) -> u64 {
    status_us(5) + 4000 * k
}

fn rpm(k: u64) -> i32 {
    -(4000 + (k * k % 977) as i32)
}

fn command(k: u64) -> f32 {
    [0.25, 0.5, 0.375][(k / 30) as usize]
}

/// `motors`: command as `actuator_motors`, else as pulses in `actuator_outputs`.
fn sample_bytes(motors: bool) -> Vec<u8> {
    let mut log = b"ULog\x01\x12\x35\x01".to_vec();
    log.extend(900_000_u64.to_le_bytes());
    message(&mut log, b'B', &[&[0; 40]]);
    let topic = if motors { "actuator_motors" } else { "actuator_outputs" };
    let field = if motors { "control" } else { "output" };
    let format = format!("{topic}:uint64_t timestamp;uint32_t x;float[4] {field};");
    for format in [REPORT, STATUS, &format, "cpuload:uint64_t timestamp;float load;"] {
        message(&mut log, b'F', &[format.as_bytes()]);
    }
    for (number, name) in [(0_u16, "cpuload"), (1, "esc_status"), (2, topic)] {
        message(&mut log, b'A', &[&[0], &number.to_le_bytes(), name.as_bytes()]);
    }
    for k in 0..STATUSES {
        // The second ESC is that of motor 1.
        let report = |function: u8, rpm: i32| {
            let mut report = status_us(reported(k)).to_le_bytes().to_vec();
            report.extend(0_u32.to_le_bytes());
            report.extend(rpm.to_le_bytes());
            report.extend((16.0 - k as f32 / 256.0).to_le_bytes());
            report.extend(0_f32.to_le_bytes());
            report.extend([function, 0, 0, 0]);
            report
        };
        let head = [&status_us(k).to_le_bytes()[..], &[0; 8]].concat();
        let reports = [report(102, 1), report(101, rpm(reported(k)))].concat();
        message(&mut log, b'D', &[&1_u16.to_le_bytes(), &head, &reports]);
        if k < COMMANDS {
            let value = if motors { command(k) } else { 1000.0 + 1000.0 * command(k) };
            let values = [value, f32::NAN, f32::NAN, f32::NAN].map(f32::to_le_bytes).concat();
            message(&mut log, b'D', &[&2_u16.to_le_bytes(), &command_us(k).to_le_bytes(), &[0; 4], &values]);
        }
    }
    log
}

#[test]
#[ignore = "writes the sample"]
fn write_the_sample() {
    fs::write(sample(), sample_bytes(true)).unwrap();
}

/// The statuses that have a new report and a command: held for 4 ms after the last.
fn expected() -> Vec<u64> {
    (0..STATUSES)
        .filter(|&k| k % 4 != 3)
        .filter(|&k| (command_us(0)..=command_us(COMMANDS - 1) + 4000).contains(&status_us(k)))
        .collect()
}

fn check_numbers(log: &Import) {
    let record = &log.experiment.records[0];
    let taken = expected();
    assert_eq!(log.experiment.output, Output::Rpm);
    let origin = status_us(taken[0]) as f64 * 1e-6;
    assert_eq!(record.time_s, taken.iter().map(|&k| status_us(k) as f64 * 1e-6 - origin).collect::<Vec<_>>());
    assert_eq!(
        record.rpm.as_deref().unwrap(),
        taken.iter().map(|&k| f64::from(rpm(k).unsigned_abs())).collect::<Vec<_>>()
    );
    let held = |k: &u64| f64::from(command(((status_us(*k) - command_us(0)) / 4000).min(COMMANDS - 1)));
    assert_eq!(record.command, taken.iter().map(held).collect::<Vec<_>>());
    let volts = taken.iter().map(|&k| f64::from(16.0 - k as f32 / 256.0)).collect::<Vec<_>>();
    assert_eq!(record.voltage_v.as_deref().unwrap(), volts);
    assert_eq!(record.current_a, None);
}

#[test]
fn the_sample_is_taken_number_by_number() {
    let log = import(&sample(), &ImportOptions::default()).unwrap();
    check_numbers(&log);
    let summary = &log.summary;
    assert_eq!((summary.format.name, summary.rows_read), ("ulog", STATUSES as usize));
    assert_eq!(summary.rows_taken, expected().len());
    assert_eq!(summary.rows_taken + summary.dropped.iter().map(|d| d.rows).sum::<usize>(), summary.rows_read);
    let reasons: Vec<_> = summary.dropped.iter().map(|d| (d.rows, d.reason.as_str())).collect();
    assert_eq!(reasons[0], (40, "the same report as in the row before"));
    assert_eq!(reasons[1], (4, "no command yet"));
    assert_eq!(reasons[2].1, "no command any more");
    let uses: Vec<_> = summary.columns.iter().map(|c| (c.name.as_str(), c.taken_as.as_deref())).collect();
    let expected = [
        ("esc_status.esc[1].timestamp", Some("time_s")),
        ("actuator_motors.control[0]", Some("command")),
        ("esc_status.esc[1].esc_rpm", Some("rpm")),
        ("esc_status.esc[1].esc_voltage", Some("voltage_v")),
        ("esc_status.esc[1].esc_current", None),
        ("cpuload[0]", None),
    ];
    assert_eq!(uses, expected);
    assert_eq!(summary.notes.len(), 1, "{:?}", summary.notes);
    assert!(summary.notes[0].contains("does not have THR_MDL_FAC"));
}

#[test]
fn pulses_of_an_output_channel_stand_in_for_the_command() {
    let log = importing::imported(&sample_bytes(false), &pulses()).unwrap();
    check_numbers(&log);
    assert!(log.summary.pulse_widths && log.summary.notes[0].contains("output channel 1"));
    // Its range is never guessed: with DShot it is another one.
    let text = refusal(imported(&sample_bytes(false), 1));
    assert!(text.contains("no parameter says") && text.contains("--pulse-us"), "{text}");
}

fn pulses() -> ImportOptions {
    ImportOptions { motor: Some(1), esc_signal_us: Some((1000.0, 2000.0)), ..ImportOptions::default() }
}

/// A log with this behind its first message.
fn with(bytes: &[u8], inserted: &[u8]) -> Vec<u8> {
    let at = 16 + 3 + 40;
    [&bytes[..at], inserted, &bytes[at..]].concat()
}

fn with_parameter(bytes: &[u8], key: &str, value: f32) -> Vec<u8> {
    let mut parameter = Vec::new();
    message(&mut parameter, b'P', &[&[key.len() as u8], key.as_bytes(), &value.to_le_bytes()]);
    with(bytes, &parameter)
}

#[test]
fn the_command_is_what_the_esc_gets_of_the_thrust() {
    let plain = imported(&sample_bytes(true), 1).unwrap();
    assert!(plain.summary.notes.iter().any(|note| note.contains("does not have THR_MDL_FAC")), "{:?}", plain.summary);
    let bent = |factor| imported(&with_parameter(&sample_bytes(true), "float THR_MDL_FAC", factor), 1).unwrap();
    let zero = bent(0.0);
    assert_eq!(zero.experiment.records[0].command, plain.experiment.records[0].command);
    assert!(zero.summary.notes.is_empty(), "{:?}", zero.summary.notes);
    let factor = 0.25;
    let bent = bent(factor as f32);
    for (signal, thrust) in bent.experiment.records[0].command.iter().zip(&plain.experiment.records[0].command) {
        assert!(((1.0 - factor) * signal + factor * signal * signal - thrust).abs() < 1e-12, "{signal} for {thrust}");
    }
    let column = &bent.summary.columns[1];
    assert!(column.note.contains("THR_MDL_FAC = 0.25"), "{column:?}");
}

#[test]
fn a_motor_test_which_drives_the_outputs_behind_the_motors_is_read_from_these() {
    for standing in [f32::NAN, 0.0] {
        let mut motors = Vec::new();
        message(&mut motors, b'F', &[b"actuator_motors:uint64_t timestamp;uint32_t x;float[4] control;"]);
        message(&mut motors, b'A', &[&[0], &3_u16.to_le_bytes(), b"actuator_motors"]);
        for k in 0..COMMANDS {
            let values = [standing; 4].map(f32::to_le_bytes).concat();
            message(&mut motors, b'D', &[&3_u16.to_le_bytes(), &command_us(k).to_le_bytes(), &[0; 4], &values]);
        }
        let log = importing::imported(&with(&sample_bytes(false), &motors), &pulses()).unwrap();
        check_numbers(&log);
        assert!(log.summary.notes[0].contains("as in a motor test"), "{:?}", log.summary.notes);
    }
}

#[test]
fn a_motor_that_is_off_or_not_there_is_told() {
    let text = refusal(imported(&sample_bytes(true), 2));
    assert!(text.contains("0 usable row(s)"), "{text}");
    for motor in [0, 5, usize::MAX] {
        let text = refusal(imported(&sample_bytes(true), motor));
        assert!(text.contains(&format!("`command` of motor {motor}")), "{text}");
    }
}

#[test]
fn a_log_cut_anywhere_gives_its_whole_messages_or_an_error() {
    let bytes = fs::read(sample()).unwrap();
    assert!(bytes.len() < 20_000);
    let whole = import(&sample(), &ImportOptions::default()).unwrap().experiment.records.remove(0);
    let mut taken = 0;
    for length in 0..bytes.len() {
        match imported(&bytes[..length], 1) {
            Ok(log) => {
                let record = &log.experiment.records[0];
                let rows = record.time_s.len();
                assert_eq!(record.rpm.as_ref().unwrap()[..], whole.rpm.as_ref().unwrap()[..rows]);
                assert_eq!(record.command[..], whole.command[..rows]);
                taken += usize::from(log.summary.notes.iter().any(|n| n.contains("ends within a message")));
            }
            Err(error) => assert!(error.help().is_some()),
        }
    }
    assert!(taken > 100, "{taken}");
}

#[test]
fn missing_topics_and_damaged_definitions_are_named() {
    let bytes = sample_bytes(true);
    // Cut within the header, behind it, within the definitions and behind them.
    for length in [8, 15, 16, 30, 59, 100, 400] {
        let text = refusal(imported(&bytes[..length], 1));
        assert!(text.contains(&format!("byte {length}: the log ends before anything was logged")), "{text}");
        assert!(text.contains("it is cut short or damaged"), "{text}");
    }
    let mut newer = bytes.clone();
    newer[16 + 3 + 8] = 2;
    assert!(refusal(imported(&newer, 1)).contains("byte 16: flags of a newer ULog"));
    let mut damaged = bytes;
    damaged[59 + 3] = 0xff;
    assert!(refusal(imported(&damaged, 1)).contains("byte 59: a message format"));
}

/// Two formats of 64000 bytes: 16000 fields that are 9000 fields each.
#[test]
fn formats_within_formats_are_measured_in_no_time() {
    let mut log = b"ULog\x01\x12\x35\x01".to_vec();
    log.extend([0; 8]);
    message(&mut log, b'F', &[b"x:", "bool a;".repeat(9000).as_bytes()]);
    message(&mut log, b'F', &[b"esc_status:", "x a;".repeat(16_000).as_bytes()]);
    message(&mut log, b'F', &[b"actuator_motors:uint64_t timestamp;float[4] control;"]);
    message(&mut log, b'A', &[&[0, 0, 0], b"actuator_motors"]);
    message(&mut log, b'A', &[&[0, 1, 0], b"esc_status"]);
    message(&mut log, b'D', &[&[0; 26]]);
    message(&mut log, b'D', &[&[1, 0], &[0; 30]]);
    let start = std::time::Instant::now();
    assert!(refusal(imported(&log, 1)).contains("`rpm` of motor 1"));
    assert!(start.elapsed().as_secs() < 10, "{:?}", start.elapsed());
}

#[test]
fn formats_of_absurd_size_or_that_hold_themselves_end_at_once() {
    for field in ["esc_report[18446744073709551615] esc", "esc_status[9] esc", "x[99999999999999999999] esc"] {
        let mut log = b"ULog\x01\x12\x35\x01".to_vec();
        log.extend([0; 8]);
        message(&mut log, b'F', &[REPORT.as_bytes()]);
        message(&mut log, b'F', &[format!("esc_status:{field};uint64_t timestamp;").as_bytes()]);
        message(&mut log, b'F', &[b"actuator_motors:uint64_t timestamp;float[4] control;"]);
        message(&mut log, b'A', &[&[0, 0, 0], b"actuator_motors"]);
        message(&mut log, b'A', &[&[0, 1, 0], b"esc_status"]);
        message(&mut log, b'D', &[&[0; 26]]);
        message(&mut log, b'D', &[&[1, 0], &[0; 30]]);
        refusal(imported(&log, 1));
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    /// Changed bytes give an experiment of equal columns or an error with a remedy, and never a panic.
    #[test]
    fn damaged_files_are_taken_or_refused(
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
        early in prop::collection::vec((0_usize..700, any::<u8>()), 0..3),
        motors in any::<bool>(),
    ) {
        let mut bytes = sample_bytes(motors);
        for (at, byte) in changes {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
        // Definitions are a small part of the file.
        for (at, byte) in early {
            bytes[at] = byte;
        }
        match imported(&bytes, 1) {
            Ok(Import { experiment, .. }) => {
                let record = &experiment.records[0];
                prop_assert!(record.time_s.is_sorted_by(|a, b| a < b));
                prop_assert_eq!(record.time_s.len(), record.command.len());
                prop_assert_eq!(record.time_s.len(), record.rpm.as_ref().unwrap().len());
                prop_assert!(record.command.iter().all(|c| (0.0..=1.0).contains(c)));
            }
            Err(error) => prop_assert!(error.help().is_some()),
        }
    }
}

#[test]
fn a_flight_is_refused() {
    let bytes = sample_bytes(true);
    let moved = |own: bool| {
        // All four commands of each message, whose first is motor 1.
        let mut bytes = bytes.clone();
        let mut k = 0_u32;
        for at in 0..bytes.len() - 40 {
            if bytes[at..at + 5] == [2 + 8 + 4 + 16, 0, b'D', 2, 0] {
                for motor in 0..4 {
                    let own = if own { 0.01 * f64::from(k * 7 % 13) * f64::from(motor + 1) } else { 0.0 };
                    let value = 0.4 + 0.01 * f64::from(k * 3 % 11) + own;
                    let place = at + 5 + 12 + 4 * motor as usize;
                    bytes[place..place + 4].copy_from_slice(&(value as f32).to_le_bytes());
                }
                k += 1;
            }
        }
        assert_eq!(u64::from(k), COMMANDS);
        bytes
    };
    let text = refusal(imported(&moved(true), 1));
    assert!(text.contains("a flight, and no bench run") && text.contains("that of motor 2, 3, 4"), "{text}");
    assert!(imported(&moved(false), 1).is_ok());
}
