//! Copies of logs without names and places: each is imported as its log is, and has nothing of what was planted in that.

use std::fs;
use std::path::Path;

use miette::Diagnostic as _;
use proptest::prelude::*;
use rotorlead_records::import::{Import, ImportError, ImportOptions, Redacted, import_bytes, redact_bytes};
use rotorlead_records::{Excitation, Experiment};

use crate::importing::sample;

/// Names and places that are planted.
const SECRETS: [&str; 5] = ["Jane Doe", "48.137154", "/home/jane", "SN-0815-4711", "Quad of Jane"];
/// A place as binary logs have it, 1e-7 degrees.
const LATITUDE: i32 = 481_371_540;

fn file() -> &'static Path {
    Path::new("log.csv")
}

fn staircase() -> ImportOptions {
    ImportOptions { excitation: Some(Excitation::Staircase), ..ImportOptions::default() }
}

fn redacted(log: &[u8], options: &ImportOptions) -> Redacted {
    let copy = redact_bytes(file(), log, options)
        .unwrap_or_else(|error| panic!("{error}: {:?}", error.help().map(|h| h.to_string())));
    for secret in SECRETS {
        let has = |bytes: &[u8]| bytes.windows(secret.len()).any(|part| part == secret.as_bytes());
        assert!(!has(&copy.bytes), "{secret} is in the copy");
    }
    let place = LATITUDE.to_le_bytes();
    assert!(!copy.bytes.windows(4).any(|part| part == place), "a place is in the copy");
    copy
}

fn imported(log: &[u8], options: &ImportOptions) -> Import {
    import_bytes(file(), log, options).unwrap_or_else(|error| panic!("{error}"))
}

/// Asserts that all numbers are the same, bit by bit.
fn assert_same(log: &[u8], copy: &[u8], options: &ImportOptions) -> Experiment {
    let [log, copy] = [log, copy].map(|bytes| imported(bytes, options));
    assert_eq!(log.summary.format, copy.summary.format);
    assert_eq!(log.experiment, copy.experiment);
    copy.experiment
}

fn has_dropped(copy: &Redacted, kind: &str, name: &str, count: usize) -> bool {
    copy.dropped.iter().any(|dropped| (dropped.kind, dropped.name.as_str(), dropped.count) == (kind, name, count))
}

/// `rows` of these columns, of which `{t}` is the time of row `k`, and the rest a staircase and what it drives.
fn rows(row: impl Fn(usize, f64, f64) -> String) -> String {
    (0..400).map(|k| row(k, 0.01 * k as f64, [0.2, 0.5, 0.8, 0.4][k / 100]) + "\n").collect()
}

#[test]
fn a_stands_log_keeps_its_numbers_bit_by_bit() {
    let log = fs::read_to_string(sample("rcbenchmark.csv")).unwrap();
    // Text in the last column, where the log has one already, and remarks behind the rows.
    let log = log.replacen("0.05,,\n", "0.05,\"Jane Doe, at 48.137154\",\n", 3) + "# /home/jane/SN-0815-4711\n";
    let options = ImportOptions::default();
    let copy = redacted(log.as_bytes(), &options);
    assert_same(log.as_bytes(), &copy.bytes, &options);
    assert!(has_dropped(&copy, "column", "App message", 4), "{:?}", copy.dropped);
    assert!(has_dropped(&copy, "remark", "", 1), "{:?}", copy.dropped);
    assert!(copy.kept.iter().any(|name| name == "ESC signal (µs)"), "{:?}", copy.kept);
    assert_eq!(copy.changes, Vec::<String>::new());
    // A copy of a copy is the same.
    assert_eq!(redacted(&copy.bytes, &options).bytes, copy.bytes);
}

#[test]
fn stamps_of_an_esc_begin_on_a_day_of_no_meaning() {
    let log = fs::read(sample("esc32.csv")).unwrap();
    let copy = redacted(&log, &ImportOptions::default());
    assert_same(&log, &copy.bytes, &ImportOptions::default());
    let text = String::from_utf8(copy.bytes).unwrap();
    assert!(text.contains("2000-01-01 00:00:00:868") && !text.contains("2019"), "{text:.200}");
    assert!(has_dropped(&copy_of(&log), "column", "State", log.iter().filter(|b| **b == b'\n').count() - 1));
}

fn copy_of(log: &[u8]) -> Redacted {
    redacted(log, &ImportOptions::default())
}

/// Tables in the dialects that are read, each with names and places in it.
#[test]
fn tables_of_every_dialect_are_copied() {
    let poles = ImportOptions { motor_poles: Some(14), ..staircase() };
    let stated = |columns: &[&str]| ImportOptions {
        columns: columns.iter().map(|column| column.parse().unwrap()).collect(),
        ..staircase()
    };
    let since_1970 = |k: usize| format!("{}", 1_573_152_358_250_u64 + 10 * k as u64);
    let clock = |k: usize| format!("23:59:{:02}.{:02}0", 58 + k / 100 % 2, k % 100);
    let viewer = "\"Product\",\"Blackbox\"\n\"Craft name\",\"Quad of Jane\"\n\"Pilot\",\"Jane Doe\"\n";
    let cases: Vec<(&str, ImportOptions, String, &str)> = vec![
        (
            "a preamble, and a place in each row",
            staircase(),
            "Pilot: Jane Doe\nFile: /home/jane/x.csv\n\ntime_s,lat,command,rpm,note\n".to_owned()
                + &rows(|_, t, u| format!("{t:.2},48.137154,{u},{},Jane Doe", 9000.0 * u)),
            "time_s,command,rpm\n0.00,0.2,1800\n",
        ),
        (
            "milliseconds since 1970",
            staircase(),
            "time_ms,command,rpm,gps_lat\n".to_owned()
                + &rows(|k, _, u| format!("{},{u},{},48.137154", since_1970(k), 9000.0 * u)),
            "time_ms,command,rpm\n1000000000000,0.2,1800\n1000000000010,0.2,1800\n",
        ),
        (
            "a decimal comma, semicolons, and units below the names",
            staircase(),
            "time;throttle;rpm;serial\ns;%;rpm;-\n".to_owned()
                + &rows(|k, _, u| {
                    let t = format!("{:.2}", 1_573_152_358.0 + 0.01 * k as f64).replace('.', ",");
                    format!("{t};{};{};SN-0815-4711", (100.5 * u).to_string().replace('.', ","), 9000.0 * u)
                }),
            "time;throttle;rpm\ns;%;rpm\n1000000000,00;20,1;1800\n1000000000,01;20,1;1800\n",
        ),
        (
            "a row for each reading of a series, on a clock since 1970",
            staircase(),
            "time_s,command,rpm,pilot\n".to_owned()
                + &rows(|k, _, u| {
                    let (command, speed) = (u.to_string(), (9000.0 * u).to_string());
                    let cells = if k % 2 == 0 { command + "," } else { String::from(",") + &speed };
                    format!("{:.3},{cells},Jane Doe", 1_573_152_358.25 + 0.005 * k as f64)
                }),
            "time_s,command,rpm\n1000000000.250,0.2,\n1000000000.255,,1800\n",
        ),
        (
            "the clock",
            ImportOptions { seconds: Some((0.0, 1.5)), ..stated(&["time=when:clock"]) },
            "when,command,rpm,who\n".to_owned()
                + &rows(|k, _, u| format!("{},{u},{},Jane Doe", clock(k.min(199)), 9000.0 * u))
                    .lines()
                    .take(200)
                    .map(|l| format!("{l}\n"))
                    .collect::<String>(),
            "when,command,rpm\n00:00:00.000,0.2,1800\n00:00:00.010,0.2,1800\n",
        ),
        (
            "no names above, so that columns have places alone",
            stated(&["time=#1:s", "command=#3:duty", "rpm=#4:rpm"]),
            rows(|_, t, u| format!("{t:.2},48.137154,{u},{}", 9000.0 * u)),
            "0.00,,0.2,1800\n",
        ),
        (
            "blanks between the columns",
            staircase(),
            "time_s command rpm lat\n".to_owned() + &rows(|_, t, u| format!("{t:.2}  {u}   {}  48.137154", 9000.0 * u)),
            "time_s\tcommand\trpm\n0.00\t0.2\t1800\n",
        ),
        (
            "what the viewer of a blackbox exports",
            poles.clone(),
            viewer.to_owned()
                + "loopIteration,time,motor[0],motor[1],eRPM[0],eRPM[1],GPS_coord[0]\n"
                + &rows(|k, _, u| {
                    let command = 48.0 + 1999.0 * u;
                    format!("{k},{},{command:.0},48,{:.0},0,48.137154", 5_000_000 + 10_000 * k, 600.0 * u)
                }),
            "loopIteration,time,motor[0],motor[1],eRPM[0],eRPM[1]\n0,0,448,48,120,0\n",
        ),
        (
            "VESC Tool",
            poles,
            "ms_today;input_voltage;current_in;erpm;duty_cycle;gnss_lat;\n".to_owned()
                + &rows(|k, _, u| format!("{};24;5;{};{u};48.137154;", 40_000_000 + 10 * k, 140_000.0 * u)),
            "ms_today;input_voltage;current_in;erpm;duty_cycle\n0;24;5;28000;0.2\n",
        ),
        (
            "Crazyflie",
            ImportOptions::default(),
            "timestamp,motor.m1,rpm.m1,stateEstimate.x\n".to_owned()
                + &rows(|k, _, u| format!("{},{:.0},{},48.137154", 10 * k, 65_535.0 * u, 20_000.0 * u)),
            "timestamp,motor.m1,rpm.m1\n0,13107,4000\n",
        ),
        (
            "Flight Stand",
            ImportOptions::default(),
            "Time (s),Powertrain 1 - ESC throttle (μs),Powertrain 1 - rotation speed (rpm),Operator\n".to_owned()
                + &rows(|_, t, u| format!("{t:.2},{:.0},{},Jane Doe", 1000.0 + 1000.0 * u, 9000.0 * u)),
            "Time (s),Powertrain 1 - ESC throttle (μs),Powertrain 1 - rotation speed (rpm)\n0.00,1200,1800\n",
        ),
    ];
    for (what, options, log, beginning) in cases {
        let original = imported(log.as_bytes(), &options);
        let copy = redacted(log.as_bytes(), &options);
        let text = String::from_utf8(copy.bytes.clone()).unwrap();
        assert!(text.starts_with(beginning), "{what}: {text:.200}");
        assert_eq!(copy.rows, Some(original.summary.rows_taken), "{what}");
        let record = &imported(&copy.bytes, &options).experiment.records[0];
        let expected = &original.experiment.records[0];
        assert_eq!((&record.command, &record.rpm), (&expected.command, &expected.rpm), "{what}");
        assert_eq!(record.command_log.is_some(), expected.command_log.is_some(), "{what}");
        assert_eq!(record.command_log.is_some(), what.contains("row for each reading"), "{what}");
        for (a, b) in record.time_s.iter().zip(&expected.time_s) {
            assert!((a - b).abs() < 1e-6, "{what}: {a} for {b}");
        }
    }
}

#[test]
fn a_log_that_is_refused_is_copied_with_what_it_is_refused_for() {
    // A name in a column of numbers, in row 200.
    let log = "time_s,command,rpm\n".to_owned()
        + &rows(|k, t, u| {
            format!("{t:.2},{u},{}", if k == 200 { "Jane Doe".into() } else { (9000.0 * u).to_string() })
        });
    let copy = redacted(log.as_bytes(), &staircase());
    assert!(copy.refused.as_ref().is_some_and(|said| said.contains("line 202")), "{:?}", copy.refused);
    assert_eq!(copy.rows, None);
    assert!(has_dropped(&copy, "text in a cell", "", 1), "{:?}", copy.dropped);
    let said = import_bytes(file(), &copy.bytes, &staircase()).unwrap_err().to_string();
    assert!(said.contains("line 202, column `rpm`: `text` is not a finite number"), "{said}");
}

fn ulog_message(kind: u8, parts: &[&[u8]]) -> Vec<u8> {
    let data = parts.concat();
    [&(data.len() as u16).to_le_bytes()[..], &[kind], &data].concat()
}

#[test]
fn a_ulog_keeps_motors_and_escs_alone() {
    let log = fs::read(sample("esc_status.ulg")).unwrap();
    // Behind the header and the flags.
    let (head, rest) = log.split_at(16 + 43);
    let key = b"char[12] sys_uuid";
    let several = b"char[10] perf_top";
    let parameter = b"int32_t SDLOG_PILOT";
    let planted = [
        ulog_message(b'I', &[&[key.len() as u8], key, b"SN-0815-4711"]),
        ulog_message(b'M', &[&[0, several.len() as u8], several, b"/home/jane"]),
        ulog_message(b'P', &[&[parameter.len() as u8], parameter, &LATITUDE.to_le_bytes()]),
        ulog_message(b'F', &[b"vehicle_gps_position:uint64_t timestamp;int32_t lat;"]),
        ulog_message(b'A', &[&[0], &99_u16.to_le_bytes(), b"vehicle_gps_position"]),
        ulog_message(b'D', &[&99_u16.to_le_bytes(), &1_u64.to_le_bytes(), &LATITUDE.to_le_bytes()]),
        ulog_message(b'L', &[b"6", &1_u64.to_le_bytes(), b"armed by Jane Doe"]),
    ];
    let log = [head, &planted.concat(), rest].concat();
    let options = ImportOptions::default();
    let copy = redacted(&log, &options);
    assert_same(&log, &copy.bytes, &options);
    for (kind, name, count) in [
        ("information", "char[12] sys_uuid", 1),
        ("message", "vehicle_gps_position", 1),
        ("logged text", "", 1),
        ("parameter", "", 1),
    ] {
        assert!(has_dropped(&copy, kind, name, count), "{kind} {name}: {:?}", copy.dropped);
    }
    assert!(copy.kept.iter().any(|name| name == "esc_status"), "{:?}", copy.kept);
    // A damaged log is not copied up to its damage.
    let mut damaged = log.clone();
    damaged[16..24].copy_from_slice(&[40, 0, b'B', 1, 0, 0, 0, 0]);
    damaged[16 + 3 + 8] = 2;
    let said = redact_bytes(file(), &damaged, &options).unwrap_err().to_string();
    assert!(said.contains("byte 16"), "{said}");
}

fn padded(text: &str, length: usize) -> Vec<u8> {
    let mut text = text.as_bytes().to_vec();
    text.resize(length, 0);
    text
}

#[test]
fn a_dataflash_log_keeps_outputs_reports_and_chirps_alone() {
    let format = |kind: u8, name: &str, length: u8, kinds: &str, labels: &str| {
        let said = [&padded(name, 4)[..], &padded(kinds, 16), &padded(labels, 64)].concat();
        [&[0xa3, 0x95, 128, kind, length][..], &said].concat()
    };
    let planted = [
        format(201, "GPS", 3 + 4, "L", "Lat"),
        [&[0xa3, 0x95, 201][..], &LATITUDE.to_le_bytes()].concat(),
        format(202, "VER", 3 + 64, "Z", "FWS"),
        [&[0xa3, 0x95, 202][..], &padded("Quad of Jane SN-0815-4711", 64)].concat(),
    ]
    .concat();
    for (name, kept) in [("bench.bin", &["ESC", "PARM", "RCOU"][..]), ("chirp.bin", &["ECRP"])] {
        let log = [fs::read(sample(name)).unwrap(), planted.clone()].concat();
        let options = ImportOptions::default();
        let copy = redacted(&log, &options);
        assert_same(&log, &copy.bytes, &options);
        assert!(kept.iter().all(|kept| copy.kept.iter().any(|name| name == kept)), "{name}: {:?}", copy.kept);
        for dropped in ["GPS", "VER"] {
            assert!(has_dropped(&copy, "message", dropped, 1), "{name}: {:?}", copy.dropped);
        }
    }
}

#[test]
fn a_blackbox_loses_its_headers_of_names_and_its_positions() {
    let log = fs::read(sample("blackbox.bbl")).unwrap();
    let marker = b"H Product:Blackbox flight data recorder by Nicholas Sherlock\n";
    let starts: Vec<usize> = (0..log.len()).filter(|at| log[*at..].starts_with(marker)).collect();
    let mut planted = log[..starts[0]].to_vec();
    for (at, end) in starts.iter().zip(starts.iter().skip(1).chain([&log.len()])) {
        planted.extend(marker);
        planted.extend(b"H Craft name:Quad of Jane\nH Pilot name:Jane Doe\nH DeviceUID:SN-0815-4711\n");
        planted.extend(&log[at + marker.len()..*end]);
    }
    for number in 1..=starts.len() {
        let options =
            ImportOptions { log: Some(number), excitation: Some(Excitation::Free), ..ImportOptions::default() };
        if import_bytes(file(), &planted, &options).is_err() {
            continue;
        }
        let copy = redacted(&planted, &options);
        assert_same(&planted, &copy.bytes, &options);
        assert!(has_dropped(&copy, "header", "Craft name", starts.len()), "{:?}", copy.dropped);
        assert!(copy.dropped.iter().any(|dropped| dropped.kind == "frame"), "{:?}", copy.dropped);
    }
    // Damage in the middle: what hangs on it goes, and all else stays.
    let middle = planted.len() / 2;
    planted[middle..middle + 8].fill(0xff);
    let options = ImportOptions { excitation: Some(Excitation::Free), ..ImportOptions::default() };
    let copy = redacted(&planted, &options);
    assert_same(&planted, &copy.bytes, &options);
}

#[test]
fn what_cannot_be_copied_is_refused_with_what_to_hand_over() {
    let refused = |log: &[u8], options: &ImportOptions| {
        let error = redact_bytes(file(), log, options).unwrap_err();
        format!("{error} | {}", error.help().unwrap())
    };
    let said = refused(&fs::read(sample("vectors.mat")).unwrap(), &ImportOptions::default());
    assert!(said.contains("log.csv: a MATLAB file") && said.contains("`rotorlead import` makes a folder"), "{said}");
    let said = refused(b"a,b,c\n1,2,3\n2,3,4\n", &ImportOptions::default());
    assert!(said.contains("no column says what it measures") && said.contains("--column time=t:ms"), "{said}");
    let said = refused(b"PK\x03\x04", &ImportOptions::default());
    assert!(said.contains("a ZIP archive"), "{said}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    /// A damaged log gives a copy that is imported as it is, or an error with a remedy, and never a panic.
    #[test]
    fn damaged_logs_are_copied_or_refused(
        kind in 0_usize..6,
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8),
        cut in prop::option::of(any::<prop::sample::Index>()),
    ) {
        let name = ["rcbenchmark.csv", "esc32.csv", "esc_status.ulg", "bench.bin", "chirp.bin", "blackbox.bbl"][kind];
        let mut log = fs::read(sample(name)).unwrap();
        for (at, byte) in changes {
            let at = at.index(log.len());
            log[at] = byte;
        }
        if let Some(cut) = cut {
            log.truncate(cut.index(log.len()));
        }
        let options = ImportOptions { excitation: Some(Excitation::Free), ..ImportOptions::default() };
        let is_imported = import_bytes(file(), &log, &options).is_ok();
        match redact_bytes(file(), &log, &options) {
            Ok(copy) => prop_assert_eq!(copy.rows.is_some(), is_imported),
            Err(error) => {
                prop_assert!(error.help().is_some(), "{}", error);
                // What is imported can only be refused for its copy.
                prop_assert!(!is_imported || matches!(error, ImportError::NotRedacted { .. }), "{}", error);
            }
        }
    }
}
