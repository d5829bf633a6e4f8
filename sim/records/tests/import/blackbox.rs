//! Betaflight blackbox: what is taken of it and what is refused.

use std::fs;
use std::path::PathBuf;

use flights::blackbox;
use flights::flight::Flight;
use miette::Diagnostic as _;
use proptest::prelude::*;
use rotorlead_identify::identification::{IdentifyOptions, identify};
use rotorlead_records::import::{Import, ImportError, ImportOptions, import};
use rotorlead_records::{Excitation, Output};

use crate::importing::{self, message as refusal};

fn sample() -> PathBuf {
    importing::sample("blackbox.bbl")
}

fn options(motor: usize, log: Option<usize>) -> ImportOptions {
    ImportOptions { motor: Some(motor), log, excitation: Some(Excitation::Free), ..ImportOptions::default() }
}

fn imported(bytes: &[u8], motor: usize) -> Result<Import, ImportError> {
    importing::imported(bytes, &options(motor, None))
}

/// Frames of the sample's long flight; every 32nd stands alone.
const FRAMES: u32 = 320;
const I_INTERVAL: u32 = 32;
/// Frames at the start in which the motors are stopped.
const STOPPED: u32 = 10;

/// The counter of microseconds turns over within the log.
fn time_us(k: u32) -> u32 {
    (u32::MAX - 80_000).wrapping_add(500 * k + k % 3)
}

fn motor(k: u32, motor: u32) -> i32 {
    if k < STOPPED { 0 } else { (158 + (k * k * 7 + motor * 131) % 1890) as i32 }
}

fn erpm(k: u32, motor: u32) -> i32 {
    (k * 13 % 2900 + motor) as i32
}

fn volts(k: u32) -> i32 {
    1600 - (k / 8) as i32
}

/// A field: name, predictor and encoding in `I` frames and in `P` frames.
type Field = (&'static str, [u8; 4]);

/// Betaflight's order, predictors and encodings of these fields.
const FIELDS: [Field; 20] = [
    ("loopIteration", [0, 1, 6, 9]),
    ("time", [0, 1, 2, 0]),
    ("axisI[0]", [0, 0, 1, 7]),
    ("axisI[1]", [0, 0, 1, 7]),
    ("axisI[2]", [0, 0, 1, 7]),
    ("rcCommand[0]", [0, 0, 1, 8]),
    ("rcCommand[1]", [0, 0, 1, 8]),
    ("rcCommand[2]", [0, 0, 1, 8]),
    ("rcCommand[3]", [4, 1, 1, 8]),
    ("vbatLatest", [9, 3, 1, 6]),
    ("amperageLatest", [0, 0, 1, 6]),
    ("rssi", [0, 1, 1, 6]),
    ("motor[0]", [11, 1, 3, 0]),
    ("motor[1]", [5, 0, 3, 0]),
    ("motor[2]", [5, 0, 3, 0]),
    ("motor[3]", [5, 0, 3, 0]),
    ("eRPM[0]", [0, 1, 1, 0]),
    ("eRPM[1]", [0, 1, 1, 0]),
    ("eRPM[2]", [0, 1, 1, 0]),
    ("eRPM[3]", [0, 1, 1, 0]),
];

/// All fields of frame `k`, with steps of every width in those of no interest.
fn frame(k: u32) -> [i32; 20] {
    let wide = |k: u32, bits: u32| (k.wrapping_mul(2_654_435_761) >> (32 - bits)) as i32 - (1 << (bits - 1));
    let axis = |axis: u32| wide(k * 3 + axis, [2, 4, 6, 10, 18, 26][(k / 7 % 6) as usize]);
    let stick = |stick: u32| wide(k * 4 + stick, [1, 3, 6, 9][((k + stick) / 5 % 4) as usize]);
    let [m0, m1, m2, m3] = [0, 1, 2, 3].map(|m| motor(k, m));
    let [e0, e1, e2, e3] = [0, 1, 2, 3].map(|m| erpm(k, m));
    let [i0, i1, i2] = [0, 1, 2].map(axis);
    let [r0, r1, r2] = [0, 1, 2].map(stick);
    let amps = if k.is_multiple_of(5) { 1200 + k as i32 } else { 1200 };
    let (counter, time) = ((9000 + k).cast_signed(), time_us(k).cast_signed());
    [counter, time, i0, i1, i2, r0, r1, r2, 1200 + (k / 3) as i32, volts(k), amps, 900, m0, m1, m2, m3, e0, e1, e2, e3]
}

fn unsigned(out: &mut Vec<u8>, mut value: u32) {
    while value > 0x7f {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}

fn signed(out: &mut Vec<u8>, value: i32) {
    unsigned(out, (value << 1 ^ value >> 31).cast_unsigned());
}

fn fits(value: i32, bits: u32) -> bool {
    (-(1 << (bits - 1))..1 << (bits - 1)).contains(&value)
}

/// Three fields: all of 2, 4 or 6 bits, or each of 1 to 4 bytes.
fn tag2(out: &mut Vec<u8>, v: [i32; 3]) {
    let low = |value: i32, bits: u32| value as u8 & ((1_u16 << bits) - 1) as u8;
    match [2, 4, 6].into_iter().find(|&bits| v.iter().all(|&v| fits(v, bits))) {
        Some(2) => out.push(low(v[0], 2) << 4 | low(v[1], 2) << 2 | low(v[2], 2)),
        Some(4) => out.extend([0x40 | low(v[0], 4), low(v[1], 4) << 4 | low(v[2], 4)]),
        Some(_) => out.extend([0x80 | low(v[0], 6), low(v[1], 6), low(v[2], 6)]),
        None => {
            let bytes = v.map(|v| [8, 16, 24].into_iter().position(|bits| fits(v, bits)).unwrap_or(3));
            out.push(0xc0 | (bytes[0] | bytes[1] << 2 | bytes[2] << 4) as u8);
            for (value, bytes) in v.iter().zip(bytes) {
                out.extend(&value.to_le_bytes()[..=bytes]);
            }
        }
    }
}

/// Four fields of 0, 1, 2 or 4 half bytes each.
fn tag4(out: &mut Vec<u8>, v: [i32; 4]) {
    let mut nibbles = Vec::new();
    let mut tag = 0;
    for (k, &value) in v.iter().enumerate() {
        let (code, count) = if value == 0 {
            (0, 0)
        } else if fits(value, 4) {
            (1, 1)
        } else if fits(value, 8) {
            (2, 2)
        } else {
            (3, 4)
        };
        tag |= code << (2 * k);
        nibbles.extend((0..count).rev().map(|n| (value >> (4 * n)) as u8 & 0xf));
    }
    out.push(tag);
    out.extend(nibbles.chunks(2).map(|pair| pair[0] << 4 | pair.get(1).copied().unwrap_or(0)));
}

fn tag8(out: &mut Vec<u8>, v: &[i32]) {
    out.push(v.iter().enumerate().map(|(k, v)| u8::from(*v != 0) << k).sum());
    v.iter().filter(|v| **v != 0).for_each(|v| signed(out, *v));
}

/// Frame `k` as Betaflight writes it: an `I` frame becomes both frames that the next is a difference to.
fn encoded(k: u32, fields: &[Field]) -> Vec<u8> {
    let place = |name: &str| FIELDS.iter().position(|f| f.0 == name).unwrap();
    let intra = k.is_multiple_of(I_INTERVAL);
    let one = frame(k.saturating_sub(1));
    let two = if k % I_INTERVAL == 1 { one } else { frame(k.saturating_sub(2)) };
    let now = frame(k);
    let code = |(_, [ip, ie, pp, pe]): &Field| if intra { (*ip, *ie) } else { (*pp, *pe) };
    let raw: Vec<(u8, i32)> = fields
        .iter()
        .map(|field| {
            let at = place(field.0);
            let (predictor, encoding) = code(field);
            let predicted = match predictor {
                0 => 0,
                1 => one[at],
                2 => one[at].wrapping_mul(2).wrapping_sub(two[at]),
                3 => (one[at] + two[at]) / 2,
                4 => 1000,
                5 => now[place("motor[0]")],
                6 => one[at] + 1,
                9 => 1660,
                11 => 158,
                _ => unreachable!(),
            };
            (encoding, now[at].wrapping_sub(predicted))
        })
        .collect();
    let mut out = vec![if intra { b'I' } else { b'P' }];
    for group in raw.chunk_by(|a, b| a.0 == b.0) {
        let values: Vec<i32> = group.iter().map(|g| g.1).collect();
        match group[0].0 {
            0 => values.iter().for_each(|v| signed(&mut out, *v)),
            1 => values.iter().for_each(|v| unsigned(&mut out, v.cast_unsigned())),
            3 => values.iter().for_each(|v| unsigned(&mut out, -v as u32 & 0x3fff)),
            6 => tag8(&mut out, &values),
            7 => tag2(&mut out, values.try_into().unwrap()),
            8 => tag4(&mut out, values.try_into().unwrap()),
            9 => assert_eq!(values, [0]),
            _ => unreachable!(),
        }
    }
    out
}

fn header(fields: &[Field], revision: &str, protocol: u8) -> Vec<u8> {
    let list = |part: &dyn Fn(&Field) -> String| fields.iter().map(part).collect::<Vec<_>>().join(",");
    let codes = |k: usize| list(&move |f| f.1[k].to_string());
    let mut text = String::from("H Product:Blackbox flight data recorder by Nicholas Sherlock\nH Data version:2\n");
    text += &format!("H I interval:{I_INTERVAL}\nH P interval:1\n");
    text += &format!("H Field I name:{}\nH Field I signed:{}\n", list(&|f| f.0.into()), list(&|_| "0".into()));
    text += &format!("H Field I predictor:{}\nH Field I encoding:{}\n", codes(0), codes(1));
    text += &format!("H Field P predictor:{}\nH Field P encoding:{}\n", codes(2), codes(3));
    text += "H Field S name:flightModeFlags,stateFlags,failsafePhase,rxSignalReceived,rxFlightChannelsValid\n";
    text += "H Field S signed:0,0,0,0,0\nH Field S predictor:0,0,0,0,0\nH Field S encoding:1,1,7,7,7\n";
    text += &format!("H Firmware type:Cleanflight\nH Firmware revision:{revision}\nH minthrottle:1000\n");
    text += "H motorOutput:158,2047\nH vbatref:1660\nH features:541130760\nH acc_1G:4096\n";
    text += &format!("H motor_pwm_protocol:{protocol}\nH dshot_bidir:1\nH motor_poles:14\n");
    text.into_bytes()
}

const REVISION: &str = "Betaflight 2025.12.0 (79065c96b) STM32F7X2";

/// A log of the first `frames` frames, with a slow frame and an event among them.
fn flight(header: Vec<u8>, fields: &[Field], frames: u32) -> Vec<u8> {
    let mut log = header;
    for k in 0..frames {
        log.extend(encoded(k, fields));
        match k {
            // All flags off; a beep.
            20 => log.extend([b'S', 0, 0, 0]),
            21 => log.extend([b'E', 0, 0x85, 0x01]),
            _ => {}
        }
    }
    log
}

fn closed(mut log: Vec<u8>) -> Vec<u8> {
    log.extend(b"E\xffEnd of log\0");
    log
}

fn whole() -> Vec<u8> {
    closed(flight(header(&FIELDS, REVISION, 6), &FIELDS, FRAMES))
}

/// Two flights in a file, the first of a few frames.
fn sample_bytes() -> Vec<u8> {
    [closed(flight(header(&FIELDS, REVISION, 6), &FIELDS, 40)), whole()].concat()
}

#[test]
#[ignore = "writes the sample"]
fn write_the_sample() {
    fs::write(sample(), sample_bytes()).unwrap();
}

/// Every number of these frames, of motor 1 to 4.
fn check_frames(log: &Import, number: u32, frames: &[u32]) {
    let record = &log.experiment.records[0];
    assert_eq!(log.experiment.output, Output::Rpm);
    let seconds = |k: &u32| f64::from(time_us(*k).wrapping_sub(time_us(frames[0]))) * 1e-6;
    assert_eq!(record.time_s, frames.iter().map(seconds).collect::<Vec<_>>());
    let command = |k: &u32| (f64::from(motor(*k, number - 1)) - 48.0) / 1999.0;
    assert_eq!(record.command, frames.iter().map(command).collect::<Vec<_>>());
    let rpm = |k: &u32| f64::from(erpm(*k, number - 1)) * 200.0 / 14.0;
    assert_eq!(record.rpm.as_deref().unwrap(), frames.iter().map(rpm).collect::<Vec<_>>());
    let volts = frames.iter().map(|&k| f64::from(volts(k)) * 0.01).collect::<Vec<_>>();
    assert_eq!(record.voltage_v.as_deref().unwrap(), volts);
    assert_eq!((&record.current_a, &record.thrust_n), (&None, &None));
}

#[test]
fn the_sample_is_taken_number_by_number() {
    assert!(fs::read(sample()).unwrap() == sample_bytes(), "the sample is not what its writer writes");
    for number in 1..=4 {
        let log = import(&sample(), &options(number, None)).unwrap();
        check_frames(&log, number as u32, &(STOPPED..FRAMES).collect::<Vec<_>>());
        let summary = &log.summary;
        assert_eq!((summary.format.name, summary.rows_read), ("blackbox", FRAMES as usize));
        assert_eq!((summary.dropped.len(), summary.dropped[0].rows), (1, STOPPED as usize));
        assert_eq!(summary.columns.len(), FIELDS.len());
        let use_of = |name: &str| {
            let column = summary.columns.iter().find(|c| c.name == name).unwrap();
            column.taken_as.clone().ok_or(column.note.clone())
        };
        assert_eq!(use_of("time"), Ok("time_s".into()));
        assert_eq!(use_of(&format!("motor[{}]", number - 1)), Ok("command".into()));
        assert_eq!(use_of(&format!("eRPM[{}]", number - 1)), Ok("rpm".into()));
        assert_eq!(use_of("vbatLatest"), Ok("voltage_v".into()));
        assert_eq!(use_of("amperageLatest"), Err("the current of all motors".into()));
        assert_eq!(use_of(&format!("motor[{}]", number % 4)), Err("another motor".into()));
        assert_eq!(summary.notes[0], "2 logs are in the file: taken is number 2, the longest");
        assert!(summary.notes.len() == 2 && summary.notes[1].starts_with("free, "), "{:?}", summary.notes);
    }
}

#[test]
fn another_log_of_the_file_can_be_asked_for() {
    let second = import(&sample(), &options(1, Some(2))).unwrap();
    check_frames(&second, 1, &(STOPPED..FRAMES).collect::<Vec<_>>());
    assert!(second.summary.notes[0].starts_with("free, "), "{:?}", second.summary.notes);
    let few = importing::imported(&sample_bytes(), &options(1, Some(1)));
    assert!(refusal(few).contains("30 usable row(s)"));
    for log in [0, 3, usize::MAX] {
        assert!(refusal(importing::imported(&sample_bytes(), &options(1, Some(log)))).contains("but 2"));
    }
    // Garbage in front of the first log, as of a storage that was not erased.
    let bytes = [&b"\xff\xffIP\0"[..], &whole()].concat();
    check_frames(&imported(&bytes, 1).unwrap(), 1, &(STOPPED..FRAMES).collect::<Vec<_>>());
}

#[test]
fn a_log_without_electrical_speed_or_that_motor_is_told() {
    let fields: Vec<Field> = FIELDS.iter().filter(|f| !f.0.starts_with("eRPM")).copied().collect();
    let text = refusal(imported(&closed(flight(header(&fields, REVISION, 6), &fields, 200)), 1));
    assert!(text.contains("`rpm` of motor 1") && text.contains("bidirectional DSHOT"), "{text}");
    for motor in [0, 5, usize::MAX] {
        let text = refusal(imported(&whole(), motor));
        assert!(text.contains(&format!("`command` of motor {motor}")), "{text}");
    }
}

/// A log whose speeds are in `debug[]`, as of this firmware and debug mode.
fn with_debug(revision: &str, debug_mode: u32) -> Vec<u8> {
    let header = String::from_utf8(header(&FIELDS, revision, 6)).unwrap().replace("eRPM[", "debug[");
    closed(flight(format!("{header}H debug_mode:{debug_mode}\n").into_bytes(), &FIELDS, FRAMES))
}

#[test]
fn older_logs_have_the_speed_in_debug() {
    for version in ["4.1.0", "4.2.9", "4.4.3", "2025.12.0"] {
        let log = imported(&with_debug(&format!("Betaflight {version} (79065c96b) STM32F7X2"), 45), 3).unwrap();
        check_frames(&log, 3, &(STOPPED..FRAMES).collect::<Vec<_>>());
        let notes = log.summary.notes.join("; ");
        assert!(notes.contains("`debug[2]`: debug_mode 45 is DSHOT_RPM_TELEMETRY"), "{notes}");
    }
    // Another mode, whose numbers are anything; a version whose modes were numbered otherwise.
    for (version, mode) in [("4.2.9", 46), ("4.2.9", 0), ("4.0.6", 45)] {
        let text = refusal(imported(&with_debug(&format!("Betaflight {version} (x) Y"), mode), 1));
        assert!(text.contains(&format!("this one has debug_mode {mode}")) && text.contains("debug[0]"), "{text}");
    }
}

#[test]
fn poles_that_are_stated_go_before_those_of_the_log() {
    let header = String::from_utf8(header(&FIELDS, REVISION, 6)).unwrap();
    let without = closed(flight(header.replace("H motor_poles:14\n", "").into_bytes(), &FIELDS, FRAMES));
    let text = refusal(imported(&without, 1));
    assert!(text.contains("--motor-poles N"), "{text}");
    let stated = |bytes: &[u8], poles| {
        importing::imported(bytes, &ImportOptions { motor_poles: Some(poles), ..options(1, None) }).unwrap()
    };
    check_frames(&stated(&without, 14), 1, &(STOPPED..FRAMES).collect::<Vec<_>>());
    let log = stated(&whole(), 28);
    assert_eq!(log.experiment.records[0].rpm.as_ref().unwrap()[0], f64::from(erpm(STOPPED, 0)) * 200.0 / 28.0);
    assert!(log.summary.notes.iter().any(|note| note.contains("28 poles, as stated; the log says 14")));
}

/// Motors that have their turn one after the other, each for four seconds; the others stand still.
fn in_turn(motors: &'static [u32]) -> Vec<u8> {
    let turn = |k: u32, motor: u32| {
        let place = motors.iter().position(|moving| *moving == motor)?;
        (k / 4000 == place as u32).then_some(k % 4000)
    };
    let command = move |k: u32, motor: u32| turn(k, motor).map_or(48, |k| 400 + 300 * (k / 1000 % 3));
    let speed = move |k: u32, motor: u32| if command(k, motor) > 48 { command(k, motor) } else { 0 };
    let frames = 4000 * motors.len() as u32;
    plain_log(frames, |k| [1, 2, 3, 4].map(|motor| command(k, motor)), |k| [1, 2, 3, 4].map(|motor| speed(k, motor)))
}

#[test]
fn of_motors_of_which_the_first_stands_still_the_one_that_moves_is_taken() {
    let import = |bytes: &[u8], motor| importing::imported(bytes, &ImportOptions { motor, ..ImportOptions::default() });
    for (moving, number) in [(&[2][..], 2), (&[3], 3), (&[4], 4)] {
        let log = import(&in_turn(moving), None).unwrap();
        let notes = log.summary.notes.join("; ");
        assert!(notes.contains(&format!("taken is motor {number}, the only one that moves")), "{notes}");
        assert_eq!(log.experiment.records, import(&in_turn(moving), Some(number)).unwrap().experiment.records);
    }
    for (moving, named) in [(&[2, 3][..], "2, 3"), (&[4, 2], "2, 4"), (&[2, 3, 4], "2, 3, 4")] {
        let text = refusal(import(&in_turn(moving), None));
        assert!(text.contains(&format!("motor 1 stands still, and motors {named} move")), "{text}");
        assert!(text.contains("`--motor 2`"), "{text}");
        assert!(import(&in_turn(moving), Some(2)).is_ok());
    }
    // None moves.
    let text = refusal(import(&plain_log(500, |_| [48; 4], |_| [0; 4]), None));
    assert!(text.contains("the command is 0 in all"), "{text}");
}

#[test]
fn headers_that_leave_the_units_open_are_refused() {
    let edited = |from: &str, to: &str| {
        let header = String::from_utf8(header(&FIELDS, REVISION, 6)).unwrap();
        assert!(header.contains(from));
        refusal(imported(&closed(flight(header.replace(from, to).into_bytes(), &FIELDS, 200)), 1))
    };
    assert!(edited("H motor_poles:14\n", "").contains("header `motor_poles`"));
    assert!(edited("motor_poles:14", "motor_poles:0").contains("header `motor_poles`"));
    assert!(edited("features:541130760", "features:4096").contains("3D"));
    assert!(edited("motor_pwm_protocol:6", "motor_pwm_protocol:4").contains("header `motor_pwm_protocol`"));
    assert!(edited("Betaflight", "INAV").contains("`INAV 2025.12.0 (79065c96b) STM32F7X2` is not Betaflight"));
    assert!(edited("Data version:2", "Data version:3").contains("version of the blackbox"));
    assert!(edited("Field I encoding:1,", "Field I encoding:4,").contains("define the fields"));
    assert!(edited("H vbatref:1660\n", "").contains("define the fields"));
    assert!(edited("Field P predictor:6,", "Field P predictor:").contains("define the fields"));
}

#[test]
fn pulses_are_scaled_by_the_stated_range() {
    let log = closed(flight(header(&FIELDS, REVISION, 1), &FIELDS, FRAMES));
    let wide = ImportOptions { esc_signal_us: Some((0.0, 2500.0)), ..options(1, None) };
    let taken = importing::imported(&log, &wide).unwrap();
    assert!(taken.summary.pulse_widths);
    let expected: Vec<f64> = (0..FRAMES).map(|k| f64::from(motor(k, 0)) / 2500.0).collect();
    assert_eq!(taken.experiment.records[0].command, expected);
    assert!(refusal(imported(&log, 1)).contains("outside 1000..2000"));
}

#[test]
fn a_damaged_frame_costs_the_frames_up_to_the_next_that_stands_alone() {
    // The first byte of frame 70 is lost: 69 is not followed by a frame. Frames 96 and later are whole again.
    let mut log = flight(header(&FIELDS, REVISION, 6), &FIELDS, 70);
    log.extend(&encoded(70, &FIELDS)[1..]);
    (71..FRAMES).for_each(|k| log.extend(encoded(k, &FIELDS)));
    let taken = imported(&closed(log), 3).unwrap();
    let whole: Vec<u32> = (STOPPED..69).chain(96..FRAMES).collect();
    check_frames(&taken, 3, &whole);
    let notes = taken.summary.notes.join("; ");
    assert!(notes.contains("damaged in 1 place(s)") && notes.contains("25 frame(s)"), "{notes}");
}

/// Bytes changed all over the log never bring in a wrong number silently, except within the frame that they are in.
#[test]
fn frames_behind_damage_are_right_or_left_out() {
    let log = whole();
    let start = header(&FIELDS, REVISION, 6).len();
    let all = imported(&log, 1).unwrap().experiment.records.remove(0);
    let (mut right, mut wrong) = (0, 0);
    for at in (start..log.len() - 13).step_by(37) {
        let mut damaged = log.clone();
        damaged[at] ^= 0xff;
        let Ok(taken) = imported(&damaged, 1) else { continue };
        let record = &taken.experiment.records[0];
        let rpm = record.rpm.as_ref().unwrap();
        for (row, time) in record.time_s.iter().enumerate() {
            let place = all.time_s.iter().position(|t| t == time);
            let same = place
                .is_some_and(|k| all.command[k] == record.command[row] && all.rpm.as_ref().unwrap()[k] == rpm[row]);
            right += usize::from(same);
            wrong += usize::from(!same);
        }
    }
    // Without a checksum a changed difference stays unseen until the next frame that stands alone: 16 frames on average.
    assert!(right > 50 * 300 && wrong * 20 < right, "{right} right, {wrong} wrong");
}

#[test]
fn a_log_that_is_mostly_damage_is_refused() {
    let mut log = flight(header(&FIELDS, REVISION, 6), &FIELDS, 2);
    for k in 2..FRAMES {
        log.extend(encoded(k, &FIELDS));
        if k % I_INTERVAL == 3 {
            log.push(0);
        }
    }
    assert!(refusal(imported(&closed(log), 1)).contains("more frames are damaged than whole"));
}

#[test]
fn a_pause_of_logging_is_told() {
    let mut log = flight(header(&FIELDS, REVISION, 6), &FIELDS, 64);
    log.extend([b'E', 14]);
    unsigned(&mut log, 9000);
    unsigned(&mut log, time_us(128));
    (128..FRAMES).for_each(|k| log.extend(encoded(k, &FIELDS)));
    let taken = imported(&closed(log), 1).unwrap();
    check_frames(&taken, 1, &(STOPPED..64).chain(128..FRAMES).collect::<Vec<_>>());
    assert!(taken.summary.notes[0].contains("paused 1 time"), "{:?}", taken.summary.notes);
}

#[test]
fn a_log_cut_anywhere_gives_its_whole_frames_or_an_error() {
    let log = whole();
    let all = imported(&log, 1).unwrap().experiment.records.remove(0);
    let start = header(&FIELDS, REVISION, 6).len();
    let mut taken = 0;
    for length in (0..start).chain((start..log.len()).step_by(7)) {
        let cut = imported(&log[..length], 1);
        match cut {
            Ok(cut) => {
                let record = &cut.experiment.records[0];
                let rows = record.time_s.len();
                assert_eq!(record.command[..], all.command[..rows]);
                assert_eq!(record.rpm.as_ref().unwrap()[..], all.rpm.as_ref().unwrap()[..rows]);
                let notes = cut.summary.notes.join("; ");
                assert!(notes.contains("not closed") == (length < log.len() - 1), "{length}: {notes}");
                taken += 1;
            }
            Err(error) if length < start && length > 61 => {
                assert!(error.to_string().contains("ends within its headers"), "{length}: {error}");
            }
            Err(error) => assert!(error.help().is_some()),
        }
    }
    assert!(taken > 700, "{taken}");
    // Behind a cut, the storage is as it was erased.
    let erased = [&log[..start + 6000], &[0xff; 4096]].concat();
    let taken = imported(&erased, 1).unwrap();
    assert!(taken.summary.notes.len() == 2 && taken.summary.notes[0].contains("not closed"));
}

#[test]
fn fields_without_end_are_refused_at_once() {
    let list = |value: &str| vec![value; 20_000].join(",");
    let mut text = String::from("H Product:Blackbox flight data recorder by Nicholas Sherlock\nH Data version:2\n");
    text += &format!("H Field I name:time,motor[0],eRPM[0],{}\n", list("x"));
    for (frame, predictor, encoding) in [("I", "0", "9"), ("P", "1", "9")] {
        text += &format!("H Field {frame} predictor:0,0,0,{}\n", list(predictor));
        text += &format!("H Field {frame} encoding:1,1,1,{}\n", list(encoding));
    }
    text += &format!("H Firmware revision:{REVISION}\nI{}", "P".repeat(20_000));
    assert!(refusal(imported(text.as_bytes(), 1)).contains("more fields"));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    /// Changed bytes give an experiment of equal columns or an error with a remedy, and never a panic.
    #[test]
    fn damaged_files_are_taken_or_refused(
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
        early in prop::collection::vec((0_usize..1600, any::<u8>()), 0..2),
    ) {
        let mut bytes = sample_bytes();
        for (at, byte) in changes {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
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

/// A log of frames that stand alone, of four motors at 1 kHz, by millisecond.
fn plain_log(frames: u32, motors: impl Fn(u32) -> [u32; 4], erpm: impl Fn(u32) -> [u32; 4]) -> Vec<u8> {
    let names = "loopIteration,time,motor[0],motor[1],motor[2],motor[3],eRPM[0],eRPM[1],eRPM[2],eRPM[3]";
    let of_fields = |code: &str| [code; 10].join(",");
    let mut log = format!(
        "H Product:Blackbox flight data recorder by Nicholas Sherlock\nH Data version:2\nH I interval:1\nH P interval:1\n\
         H Field I name:{names}\nH Field I signed:{zeros}\nH Field I predictor:{zeros}\nH Field I encoding:{ones}\n\
         H Field P predictor:{zeros}\nH Field P encoding:{ones}\nH Firmware revision:{REVISION}\nH features:0\n\
         H motor_pwm_protocol:6\nH motor_poles:14\n",
        zeros = of_fields("0"),
        ones = of_fields("1"),
    )
    .into_bytes();
    for k in 0..frames {
        log.push(b'I');
        let numbers = [k, 1_000_000 + 1000 * k].into_iter().chain(motors(k)).chain(erpm(k));
        numbers.for_each(|number| unsigned(&mut log, number));
    }
    closed(log)
}

/// What `motor` does, in hundreds of electrical revolutions per minute: 50 ms behind the square root of its range, seen 8 ms late.
fn speeds(frames: u32, motor: impl Fn(u32) -> u32) -> Vec<u32> {
    let (mut speed, decay) = (0.0, (-1.0_f64 / 50.0).exp());
    let mut seen = vec![0; 8];
    for k in 0..frames {
        seen.push(f64::round(speed) as u32);
        let level = 1600.0 * ((f64::from(motor(k)) - 48.0) / 1999.0).max(0.0).sqrt();
        speed = level + (speed - level) * decay;
    }
    seen
}

#[test]
fn a_bench_run_gives_a_model() {
    let staircase = |k: u32| [248, 448, 748, 1148, 848, 548][(k / 1000).min(5) as usize];
    let seen = speeds(6000, staircase);
    let log = plain_log(6000, |k| [staircase(k), 0, 0, 0], |k| [seen[k as usize], 0, 0, 0]);
    let taken = importing::imported(&log, &ImportOptions::default()).unwrap();
    let found = identify(&taken.experiment, &IdentifyOptions::default()).unwrap();
    assert!(found.model.points.len() >= 3);
    println!("{:?} {:?}", found.lags.in_time().unwrap().delay_s, found.model.points);
    for point in &found.model.points {
        assert!((point.time_constant_s - 0.05).abs() < 0.002, "{point:?}");
    }
    assert!((found.lags.in_time().unwrap().delay_s.value - 0.008).abs() < 0.002);
    // All four at once, as by the master slider, are no flight.
    let log = plain_log(6000, |k| [staircase(k); 4], |k| [seen[k as usize]; 4]);
    assert!(importing::imported(&log, &ImportOptions::default()).is_ok());
}

#[test]
fn a_flight_is_refused() {
    // A mixer: throttle, and what roll, pitch and yaw add to or take from each motor.
    let motors = |k: u32| {
        let t = f64::from(k) * 1e-3;
        let throttle = 700.0 + 100.0 * (0.8 * t).sin();
        let [roll, pitch, yaw] =
            [(23.0, 40.0), (17.0, 30.0), (5.0, 15.0)].map(|(w, size): (f64, f64)| size * (w * t).sin());
        [[1.0, 1.0, 1.0], [-1.0, 1.0, -1.0], [1.0, -1.0, -1.0], [-1.0, -1.0, 1.0]]
            .map(|[r, p, y]: [f64; 3]| (throttle + r * roll + p * pitch + y * yaw) as u32)
    };
    let seen = speeds(4000, |k| motors(k)[0]);
    let log = plain_log(4000, motors, |k| [seen[k as usize]; 4]);
    let text = refusal(importing::imported(&log, &ImportOptions::default()));
    assert!(text.contains("a flight, and no bench run") && text.contains("--excitation flight"), "{text}");
    assert!(imported(&log, 1).is_ok());
}

#[test]
fn a_flight_is_taken_with_all_motors_where_it_is_called_one() {
    let flight = Flight::fly(3);
    let flown = ImportOptions { excitation: Some(Excitation::Flight), ..ImportOptions::default() };
    let taken = importing::imported(&blackbox::log(&flight), &flown).unwrap();
    let Import { experiment, summary } = taken;
    let files: Vec<&str> = experiment.records.iter().map(|record| record.file.as_str()).collect();
    assert!(files.len() == 4 && files[0].ends_with("_motor1.csv") && files[3].ends_with("_motor4.csv"), "{files:?}");
    assert_eq!(experiment.command_rate_hz, Some(4000.0));
    assert!(summary.notes.iter().any(|note| note.contains("4 motors are taken")), "{:?}", summary.notes);
    for (motor, record) in experiment.records.iter().enumerate() {
        for (read, flown) in record.command.iter().zip(&flight.commands[motor]) {
            assert!((read - flown).abs() < 1e-9);
        }
        let asked: Vec<&[f64]> = record.setpoints.columns().collect();
        for (read, flown) in asked.iter().zip(flight.rates.iter().chain([&flight.throttle])) {
            assert!(read.iter().zip(flown).all(|(read, flown)| (read - flown).abs() < 0.009));
        }
        assert_eq!(asked.len(), 4);
    }
    let found = identify(&experiment, &IdentifyOptions::default()).unwrap();
    let center = &found.model.points[found.model.points.len() / 2];
    let truth = flight.vehicle.time_constant_s(0, center.nominal, flight.mean_voltage_v);
    assert!((center.time_constant_s / truth - 1.0).abs() < 0.05, "{center:?} {truth}");
    // In high resolution the numbers of the rates are ten times as large, and that of the throttle is not.
    let log = String::from_utf8_lossy(&blackbox::log(&flight)[..2000]).into_owned();
    let place = log.find("H features").unwrap();
    let mut fine = blackbox::log(&flight);
    fine.splice(place..place, *b"H blackbox_high_resolution:1\n");
    let fine = importing::imported(&fine, &ImportOptions { motor: Some(1), ..flown.clone() }).unwrap().experiment;
    let (coarse, fine) = (&experiment.records[0].setpoints, &fine.records[0].setpoints);
    let largest =
        |column: &Option<Vec<f64>>| column.iter().flatten().fold(0.0, |most: f64, value| most.max(value.abs()));
    assert!((10.0 * largest(&fine.roll_rad_s) / largest(&coarse.roll_rad_s) - 1.0).abs() < 1e-9);
    assert_eq!(fine.throttle, coarse.throttle);
    // A part of it has a part of every column.
    let part = ImportOptions { seconds: Some((2.0, 5.0)), motor: Some(1), ..flown.clone() };
    let taken = importing::imported(&blackbox::log(&flight), &part).unwrap().experiment;
    let rows = taken.records[0].time_s.len();
    assert!(rows > 1000 && taken.records[0].setpoints.columns().all(|column| column.len() == rows));
    // One motor alone is a record of its own.
    let one = ImportOptions { motor: Some(2), ..flown };
    let taken = importing::imported(&blackbox::log(&flight), &one).unwrap().experiment;
    assert_eq!(taken.records.len(), 1);
    assert_eq!(taken.records[0].command, experiment.records[1].command);
}
