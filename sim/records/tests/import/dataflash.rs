//! ArduPilot DataFlash: what is taken of it and what is refused. The samples are written by pymavlink, and its reader wrote down
//! what is in them: `tests/data/dataflash.py`.

use std::fs;

use proptest::prelude::*;
use rotorlead_identify::identification::{IdentifyOptions, Lags, identify};
use rotorlead_records::import::{Import, ImportError, ImportOptions, import};
use rotorlead_records::{Excitation, Record};

use crate::importing::{self, message as refusal, sample};

fn imported(bytes: &[u8], options: &ImportOptions) -> Result<Import, ImportError> {
    importing::imported(bytes, options)
}

fn bench() -> Vec<u8> {
    fs::read(sample("bench.bin")).unwrap()
}

fn chirp() -> Vec<u8> {
    fs::read(sample("chirp.bin")).unwrap()
}

fn taken(log: Import) -> Record {
    log.experiment.records.into_iter().next().unwrap()
}

/// What pymavlink's reader saw of `field`, by the number of its message, from 0.
fn seen(file: &str, message: &str, field: &str) -> Vec<(usize, f64)> {
    let text = fs::read_to_string(sample("dataflash.csv")).unwrap();
    let mut seen = Vec::new();
    for line in text.lines() {
        let parts: Vec<&str> = line.split(',').collect();
        if parts[..2] == [file, message] && parts[3] == field {
            seen.push((parts[2].parse::<usize>().unwrap() - 1, parts[4].parse().unwrap()));
        }
    }
    seen
}

#[test]
fn an_output_and_its_esc_are_what_the_other_reader_sees() {
    let log = import(&sample("bench.bin"), &ImportOptions::default()).unwrap();
    let summary = &log.summary;
    assert_eq!((summary.format.name, summary.rows_read), ("dataflash", 900));
    let uses: Vec<_> = summary.columns.iter().map(|c| (c.name.as_str(), c.taken_as.as_deref())).collect();
    let expected = [
        ("ESC.TimeUS[2]", Some("time_s")),
        ("RCOU.C3", Some("command")),
        ("ESC.RawRPM[2]", Some("rpm")),
        ("ESC.Volt[2]", Some("voltage_v")),
        ("ESC.Curr[2]", Some("current_a")),
        ("PARM", None),
        ("MSG", None),
    ];
    assert_eq!(uses, expected);
    assert_eq!(summary.notes.len(), 1, "{:?}", summary.notes);
    assert!(summary.notes[0].contains("1100..1900 become 0..1, as the parameters MOT_PWM_MIN"), "{:?}", summary.notes);
    let record = taken(log);
    assert_eq!(record.excitation, Excitation::Staircase);

    // By their stamps: the other ESCs' messages are between those of the third.
    let origin = seen("bench.bin", "ESC", "TimeUS")[0].1;
    let row_of = |time_us: f64| record.time_s.iter().position(|t| (t - (time_us - origin) * 1e-6).abs() < 1e-7);
    let columns = [("RawRPM", &record.rpm), ("Volt", &record.voltage_v), ("Curr", &record.current_a)];
    let instances = seen("bench.bin", "ESC", "Instance");
    let mut compared = 0;
    for ((&(number, time_us), &(_, instance)), place) in
        seen("bench.bin", "ESC", "TimeUS").iter().zip(&instances).zip(0..)
    {
        if instance != 2.0 {
            continue;
        }
        for (label, column) in columns {
            let (same, value) = seen("bench.bin", "ESC", label)[place];
            assert_eq!(same, number);
            assert_eq!(column.as_ref().unwrap()[row_of(time_us).unwrap()], value, "{label} of {number}");
            compared += 1;
        }
    }
    assert!(compared > 40, "{compared}");
    let mut compared = 0;
    for ((_, time_us), (_, pulse)) in
        seen("bench.bin", "RCOU", "TimeUS").into_iter().zip(seen("bench.bin", "RCOU", "C3"))
    {
        // The report of this moment comes 0.263 ms after the output.
        let row = row_of(time_us + 263.0).unwrap();
        assert_eq!(record.command[row], (pulse - 1100.0) / 800.0);
        compared += 1;
    }
    assert_eq!(compared, 9);
}

#[test]
fn each_sweep_of_the_applet_is_a_chirp_and_what_the_other_reader_sees() {
    let log = import(&sample("chirp.bin"), &ImportOptions::default()).unwrap();
    let notes = log.summary.notes.join("; ");
    assert!(notes.contains("2 chirps are in the log: taken is number 2, the longest"), "{notes}");
    assert!(notes.contains("a chirp from 0.50 to 15.0") || notes.contains("a chirp from 0.50 to 14.9"), "{notes}");
    let one = taken(import(&sample("chirp.bin"), &ImportOptions { log: Some(1), ..ImportOptions::default() }).unwrap());
    let two = taken(log);
    assert_eq!((one.excitation, two.excitation), (Excitation::Chirp, Excitation::Chirp));
    // The first rows of each have no report.
    let rows: Vec<(f64, f64)> = [&one, &two]
        .iter()
        .flat_map(|record| record.command.iter().copied().zip(record.rpm.as_ref().unwrap().iter().copied()))
        .collect();
    let sum_of = |field: &str| {
        let (last, sum) = seen("chirp.bin", "ECRP", &format!("sum of {field}"))[0];
        (last + 1, sum)
    };
    let (count, pulses) = sum_of("PWM");
    let dropped = count - rows.len();
    assert!((1..20).contains(&dropped), "{dropped}");
    // At the beginning the applet is in the middle of its range, faded to nothing.
    let sum: f64 = rows.iter().map(|(command, _)| 1000.0 + 1000.0 * command).sum::<f64>() + 1450.0 * dropped as f64;
    assert!((sum - pulses).abs() < 2.0 * dropped as f64, "{sum} {pulses}");
    let sum: f64 = rows.iter().map(|(_, rpm)| rpm).sum::<f64>() - dropped as f64;
    assert!((sum - sum_of("RPM").1).abs() < 1e-3);
    // The part of the second sweep, row by row.
    let first_us = {
        let row = seen("chirp.bin", "ECRP", "TimeUS").into_iter().zip(seen("chirp.bin", "ECRP", "RPM"));
        let found =
            row.filter(|((_, time), (_, rpm))| *time > 9e6 && *rpm >= 0.0).map(|((_, time), (_, rpm))| (time, rpm));
        found.collect::<Vec<_>>()
    };
    let rpm = two.rpm.as_ref().unwrap();
    let start = first_us
        .iter()
        .find_map(|(time, value)| {
            rpm.iter().position(|r| r == value && *r > 0.0).map(|row| time * 1e-6 - two.time_s[row])
        })
        .unwrap();
    assert!((9.0..9.1).contains(&start), "{start}");
    for (time, value) in first_us {
        let row = two.time_s.iter().position(|t| (t + start - time * 1e-6).abs() < 1e-6).unwrap();
        assert_eq!(rpm[row], value);
    }
}

/// The sample's motor: 14 rpm per microsecond, 80 ms, seen 30 ms late.
#[test]
fn a_row_without_a_report_ends_what_is_taken_of_a_chirp() {
    let whole = taken(imported(&chirp(), &ImportOptions::default()).unwrap());
    // The speed is the last field of `ECRP`.
    let speed = whole.rpm.as_ref().unwrap()[1000] as f32;
    let mut bytes = chirp();
    let times: Vec<usize> =
        bytes.windows(4).enumerate().filter(|(_, four)| *four == speed.to_le_bytes()).map(|(at, _)| at).collect();
    assert_eq!(times.len(), 1, "one row has this speed");
    bytes[times[0]..times[0] + 4].copy_from_slice(&(-1.0_f32).to_le_bytes());
    let log = imported(&bytes, &ImportOptions::default()).unwrap();
    let apart: Vec<usize> = log.summary.dropped.iter().map(|dropped| dropped.rows).collect();
    assert_eq!(apart.last(), Some(&1000), "{:?}", log.summary.dropped);
    assert_eq!(taken(log).rpm.unwrap(), whole.rpm.unwrap()[1001..]);
}

#[test]
fn the_chirp_of_the_applet_gives_its_lag_and_delay() {
    let log = import(&sample("chirp.bin"), &ImportOptions::default()).unwrap();
    let found = identify(&log.experiment, &IdentifyOptions::default()).unwrap();
    let Lags::Chirps(chirps) = &found.lags else { panic!("{:?}", found.lags) };
    let fit = &chirps.lags.nominals[0].fit;
    let delay_s = fit.delay_s.unwrap();
    println!("{:?} {:?} {delay_s:?}", fit.gain, fit.time_constant_s);
    for (estimate, truth) in [(fit.gain, 14_000.0), (fit.time_constant_s, 0.08), (delay_s, 0.03)] {
        assert!((estimate.value / truth - 1.0).abs() < 0.02, "{estimate:?} {truth}");
    }
    let coherence = &chirps.responses[0].coherence;
    assert!(coherence.len() > 12 && coherence.iter().all(|c| (0.98..=1.0).contains(c)), "{coherence:?}");
    let highest_hz = chirps.responses[0].response.lines.last().unwrap().omega_rad_s / std::f64::consts::TAU;
    assert!((9.0..15.0).contains(&highest_hz), "{highest_hz}");
}

/// 60 ms and 15 ms; the command was logged every 20 ms.
#[test]
fn the_staircase_of_a_motor_test_gives_a_lag() {
    let log = import(&sample("bench.bin"), &ImportOptions::default()).unwrap();
    let found = identify(&log.experiment, &IdentifyOptions::default()).unwrap();
    let fit = found.lags.in_time().unwrap();
    println!("{:?} {:?}", fit.delay_s, found.model.points);
    assert!(found.model.points.len() >= 3);
    for point in &found.model.points {
        assert!((point.time_constant_s - 0.06).abs() < 0.01, "{point:?}");
    }
}

#[test]
fn what_the_log_does_not_have_is_told() {
    let motor = |motor: usize| ImportOptions { motor: Some(motor), ..ImportOptions::default() };
    let text = refusal(imported(&bench(), &motor(5)));
    assert!(text.contains("`command` of motor 5") && text.contains("SERVOn_FUNCTION"), "{text}");
    let text = refusal(imported(&chirp(), &motor(1)));
    assert!(text.contains("`command` of motor 1") && text.contains("needed is `RCOU`"), "{text}");
    let log = |log: usize| ImportOptions { log: Some(log), ..ImportOptions::default() };
    for (bytes, number, there) in [(bench(), 1, "but 0"), (chirp(), 3, "but 2"), (chirp(), 0, "but 2")] {
        let text = refusal(imported(&bytes, &log(number)));
        assert!(text.contains(&format!("no log {number} in it, {there}")), "{text}");
    }
    // Motor 2 is on output 1, whose ESC reports too seldom.
    let text = refusal(imported(&bench(), &motor(2)));
    assert!(text.contains("usable row(s)"), "{text}");
}

/// A parameter renamed is one that is not there.
fn without(mut bytes: Vec<u8>, name: &str) -> Vec<u8> {
    let at = bytes.windows(name.len()).position(|part| part == name.as_bytes()).unwrap();
    bytes[at] = b'x';
    bytes
}

#[test]
fn pulse_widths_are_scaled_by_the_parameters_or_as_stated_and_never_by_a_guess() {
    let stated = ImportOptions { esc_signal_us: Some((1000.0, 2000.0)), ..ImportOptions::default() };
    for bytes in [bench(), chirp()] {
        let text = refusal(imported(&without(bytes.clone(), "MOT_PWM_MAX"), &ImportOptions::default()));
        assert!(text.contains("no parameter says") && text.contains("--pulse-us LOW..HIGH"), "{text}");
        assert!(imported(&without(bytes, "MOT_PWM_MAX"), &stated).is_ok());
    }
    let command = taken(imported(&bench(), &stated).unwrap()).command;
    assert_eq!(command[0], 0.3);
    // Without the parameters of the outputs motor 3 is the third.
    let three = ImportOptions { motor: Some(3), ..stated };
    let mut bytes = bench();
    for name in ["SERVO1_FUNCTION", "SERVO2_FUNCTION", "SERVO3_FUNCTION", "SERVO4_FUNCTION"] {
        bytes = without(bytes, name);
    }
    let log = imported(&bytes, &three).unwrap();
    assert!(log.summary.notes.iter().any(|note| note.contains("taken is output 3")), "{:?}", log.summary.notes);
    // Where no ESC of an output reports, those are named that do.
    let text = refusal(imported(&bytes, &ImportOptions { motor: Some(9), ..three }));
    assert!(text.contains("the ESC at output 9, where output 1, 2, 3, 4 reports"), "{text}");
}

/// A parameter under another name, which is not longer, and with another value unless that is `None`.
fn renamed(mut bytes: Vec<u8>, name: &str, to: &str, value: Option<f32>) -> Vec<u8> {
    let at = bytes.windows(name.len()).position(|part| part == name.as_bytes()).unwrap();
    bytes[at..at + 16].fill(0);
    bytes[at..at + to.len()].copy_from_slice(to.as_bytes());
    if let Some(value) = value {
        bytes[at + 16..at + 20].copy_from_slice(&value.to_le_bytes());
    }
    bytes
}

#[test]
fn the_throttle_of_a_plane_is_motor_1_and_its_surfaces_are_outputs() {
    // A throttle, and elevators.
    let mut bytes = bench();
    for (output, function) in [(1, 19.0), (2, 19.0), (3, 70.0), (4, 19.0)] {
        let name = format!("SERVO{output}_FUNCTION");
        bytes = renamed(bytes, &name, &name, Some(function));
    }
    let text = refusal(imported(&bytes, &ImportOptions::default()));
    assert!(text.contains("SERVOn_MIN and SERVOn_MAX"), "{text}");
    let bytes = renamed(renamed(bytes, "MOT_PWM_MIN", "SERVO3_MIN", None), "MOT_PWM_MAX", "SERVO3_MAX", None);
    let plane = imported(&bytes, &ImportOptions::default()).unwrap();
    assert!(plane.summary.notes.iter().any(|note| note.contains("SERVO3_MIN and SERVO3_MAX")), "{:?}", plane.summary);
    let (plane, copter) = (taken(plane), taken(imported(&bench(), &ImportOptions::default()).unwrap()));
    assert_eq!((plane.command, plane.rpm), (copter.command, copter.rpm));
    let text = refusal(imported(&in_flight(bytes.clone()), &ImportOptions::default()));
    assert!(text.contains("that of output 1, 2, 4"), "{text}");
}

/// Other outputs move as a controller has them move.
fn in_flight(mut bytes: Vec<u8>) -> Vec<u8> {
    let head = [0xa3, 0x95, 66];
    let mut k = 0_u32;
    for at in 0..bytes.len() - 40 {
        if bytes[at..at + 3] == head {
            for output in 0..4 {
                let place = at + 11 + 2 * output;
                let correction = ((k * 7 + 13 * output as u32) % 40) as u16;
                bytes[place..place + 2].copy_from_slice(&(1400 + correction * (output as u16 + 1)).to_le_bytes());
            }
            k += 1;
        }
    }
    bytes
}

#[test]
fn a_flight_is_refused() {
    let bytes = in_flight(bench());
    let text = refusal(imported(&bytes, &ImportOptions::default()));
    assert!(text.contains("a flight, and no bench run") && text.contains("of motor 2, 3, 4"), "{text}");
    assert!(text.contains("--excitation free"), "{text}");
    let free = ImportOptions { excitation: Some(Excitation::Free), ..ImportOptions::default() };
    assert_eq!(taken(imported(&bytes, &free).unwrap()).excitation, Excitation::Free);
}

#[test]
fn a_log_cut_anywhere_gives_its_whole_messages_or_an_error() {
    let bytes = bench();
    let whole = taken(imported(&bytes, &ImportOptions::default()).unwrap());
    let mut cut = 0;
    for length in (0..bytes.len()).step_by(97) {
        match imported(&bytes[..length], &ImportOptions::default()) {
            Ok(log) => {
                cut += usize::from(log.summary.notes.iter().any(|note| note.contains("ends within a message")));
                let record = taken(log);
                let rows = record.time_s.len();
                assert_eq!(record.rpm.as_ref().unwrap()[..], whole.rpm.as_ref().unwrap()[..rows]);
                assert_eq!(record.command[..], whole.command[..rows]);
            }
            Err(ImportError::NotALog { .. }) if length == 0 => {}
            Err(error) => assert!(error.to_string().contains("log.csv"), "{error}"),
        }
    }
    assert!(cut > 400, "{cut}");
}

#[test]
fn damaged_bytes_cost_the_messages_they_are_in() {
    let bytes = chirp();
    let whole = taken(imported(&bytes, &ImportOptions::default()).unwrap());
    let mut damaged = bytes.clone();
    // The head of a row in the middle of the second sweep.
    let at = (80_000..).find(|&at| bytes[at..at + 3] == [0xa3, 0x95, 240]).unwrap();
    damaged[at + 1] = 0;
    let log = imported(&damaged, &ImportOptions::default()).unwrap();
    let notes = log.summary.notes.join("; ");
    assert!(notes.contains(&format!("damaged in 1 place(s), the first at byte {at}: 23 bytes")), "{notes}");
    let record = taken(log);
    assert_eq!(record.time_s.len(), whole.time_s.len() - 1);

    let mut mostly = bytes[..20_000].to_vec();
    mostly.extend([0x55; 30_000]);
    let text = refusal(imported(&mostly, &ImportOptions::default()));
    assert!(text.contains("byte ") && text.contains("belong to no message"), "{text}");
}

#[test]
fn a_log_as_text_is_told_from_it() {
    let text =
        refusal(imported(b"FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\n", &ImportOptions::default()));
    assert!(text.contains("a DataFlash log as text") && text.contains(".bin"), "{text}");
}

proptest! {
    /// Whatever is changed, an import ends in a record or in an error that names the file.
    #[test]
    fn changed_bytes_never_panic(changes in prop::collection::vec((0_usize..60_000, any::<u8>()), 1..30)) {
        let mut bytes = bench();
        for (at, byte) in changes {
            bytes[at] = byte;
        }
        match imported(&bytes, &ImportOptions::default()) {
            Ok(log) => {
                let record = taken(log);
                prop_assert!(record.time_s.is_sorted_by(|a, b| a < b));
                prop_assert!(record.command.iter().all(|c| (0.0..=1.0).contains(c)));
            }
            Err(error) => prop_assert!(error.to_string().contains("log.csv"), "{error}"),
        }
    }
}
