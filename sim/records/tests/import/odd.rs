//! Logs as they come: wrong ones, each with its message, and odd ones, each with what is taken of them.

use std::fmt::Write as _;
use std::path::Path;

use rotorlead_records::import::{Import, ImportError, ImportOptions, import};
use rotorlead_records::{Excitation, Output};

use crate::importing::{imported, message};

const HEADER: &str = "time_s,pwm_us,thrust_g,rpm";
const ROWS: usize = 400;

/// Time in seconds, pulse width, thrust and speed of a run up and down.
fn numbers() -> Vec<[f64; 4]> {
    let level = |row: usize| [1000.0, 1500.0, 1600.0, 1500.0][row / 100];
    (0..ROWS)
        .map(|row| {
            let thrust = if row < 100 { 2.0 } else { 100.0 + (row % 7) as f64 };
            [row as f64 / 200.0, level(row), thrust, 3000.0 + row as f64]
        })
        .collect()
}

/// [`numbers`] behind `header`, with what `cell` makes of each by its row and column.
fn table_text(header: &str, separator: &str, cell: impl Fn(usize, usize, f64) -> String) -> String {
    let mut text = format!("{header}\n");
    for (row, numbers) in numbers().iter().enumerate() {
        let cells: Vec<String> = numbers.iter().enumerate().map(|(column, value)| cell(row, column, *value)).collect();
        writeln!(text, "{}", cells.join(separator)).unwrap();
    }
    text
}

fn table() -> String {
    table_text(HEADER, ",", |_, _, value| value.to_string())
}

/// [`table`] with another text in the cells of `column` in `rows`.
fn with(column: usize, rows: std::ops::Range<usize>, text: &str) -> String {
    table_text(
        HEADER,
        ",",
        |row, at, value| {
            if at == column && rows.contains(&row) { text.to_owned() } else { value.to_string() }
        },
    )
}

/// [`table`] with the command put as `of` says.
fn with_command(name: &str, of: impl Fn(f64) -> f64) -> String {
    table_text(&format!("time_s,{name},thrust_g,rpm"), ",", |_, at, value| {
        if at == 1 { of(value).to_string() } else { value.to_string() }
    })
}

fn options(options: &str) -> ImportOptions {
    let mut made = ImportOptions { excitation: Some(Excitation::Staircase), ..ImportOptions::default() };
    for option in options.split_whitespace() {
        match option {
            "--tare" => made.tare = true,
            "thrust" => made.output = Some(Output::ThrustN),
            "rpm" => made.output = Some(Output::Rpm),
            "steady" => made.excitation = Some(Excitation::Steady),
            "none" => made.excitation = None,
            column => made.columns.push(column.parse().unwrap()),
        }
    }
    made
}

fn taken(text: impl AsRef<[u8]>, with: &str) -> Result<Import, ImportError> {
    imported(text.as_ref(), &options(with))
}

/// [`table`] with the unit of a column behind each of its numbers.
fn units_behind() -> String {
    let units = [" s", "us", " g", " RPM"];
    table_text("time,pwm,thrust,speed", ",", |_, at, value| format!("{value}{}", units[at]))
}

/// Characters up to U+00FF but those from 0x80 to 0x9f are their own number.
fn windows_1252(text: &str) -> Vec<u8> {
    text.chars().map(|c| u8::try_from(u32::from(c)).unwrap()).collect()
}

fn utf16(text: &str, order: fn(u16) -> [u8; 2]) -> Vec<u8> {
    std::iter::once(0xfeff).chain(text.encode_utf16()).flat_map(order).collect()
}

/// A thrust stand's log without unit behind its command, which `of` makes from 0, 1000, 1500 and so on.
fn stand(of: impl Fn(f64) -> String, speed: &str) -> String {
    let header =
        format!("Time (s),ESC signal,Thrust (gf),Motor Electrical Speed ({speed}),Motor Optical Speed ({speed}),");
    let mut text = format!("{header}\n");
    for [time, pulse, thrust, rpm] in numbers() {
        writeln!(text, "{time},{},{thrust},0,{rpm},", of(pulse)).unwrap();
    }
    text
}

fn dshot(pulse: f64) -> String {
    (if pulse == 1000.0 { 0.0 } else { 12.0 * (pulse - 1450.0) }).to_string()
}

/// A table of points: a command in percent, thrust and speed, 5 s apart unless `times` says otherwise.
fn points(times: impl Fn(usize) -> f64) -> String {
    let mut text = String::from("time_s,throttle_percent,thrust_g,rpm\n");
    for point in 0..12 {
        writeln!(text, "{},{},{},{}", times(point), 5 * point, 4 * point * point, 500 * point).unwrap();
    }
    text
}

/// Packets of nine bytes, as a ground station logs them.
fn telemetry(mark: u8, flags: u8) -> Vec<u8> {
    let head = if mark == 0xfe { 6 } else { 10 };
    let packet = |k: u64| {
        let mut packet = (1_700_000_000_000_000 + 250_000 * k).to_be_bytes().to_vec();
        packet.extend([mark, 9, flags]);
        packet.resize(8 + head + 9 + 2 + 13 * usize::from(flags), 0);
        packet
    };
    (0..50).flat_map(packet).collect()
}

/// Every input: what it is, its bytes, options, and what the message has to say.
type Wrong = (&'static str, Vec<u8>, &'static str, &'static [&'static str]);

#[test]
fn what_cannot_be_taken_says_what_where_and_what_to_do() {
    let repeated_header = table().replacen("\n1,", &format!("\n{HEADER}\n1,"), 1);
    let zip = |name: &str| format!("PK\u{3}\u{4}....[Content_Types].xml....{name}/workbook.xml").into_bytes();
    let hour = |point: usize| 3600.0 * point as f64;
    let cases: Vec<Wrong> = vec![
        ("nothing", b"".to_vec(), "", &["the file is empty", "export the log again"]),
        ("blanks", b"\n \n\t\n".to_vec(), "", &["the file is empty"]),
        ("header only", HEADER.into(), "", &["no line of it has two numbers", "time_s,pwm_us"]),
        ("words", b"hello\nthere\n".to_vec(), "", &["no table", "It begins with: hello"]),
        ("XLSX", zip("xl"), "", &["an Excel workbook (XLSX)", "export it as CSV"]),
        ("ZIP", zip("logs"), "", &["a ZIP archive", "unpack it"]),
        ("XLS", b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1..".to_vec(), "", &["an Excel workbook (XLS)", "export it as CSV"]),
        ("gzip", b"\x1f\x8b\x08....".to_vec(), "", &["a gzip archive", "unpack it"]),
        ("PNG", b"\x89PNG\r\n\x1a\n...".to_vec(), "", &["a picture (PNG)", "give the log itself"]),
        ("JPEG", b"\xff\xd8\xff\xe0....".to_vec(), "", &["a picture (JPEG)", "give the log itself"]),
        ("PDF", b"%PDF-1.7\n....".to_vec(), "", &["a PDF document", "give the log itself"]),
        ("SQLite", b"SQLite format 3\0....".to_vec(), "", &["an SQLite database", "as CSV"]),
        (
            "tlog of MAVLink 1",
            telemetry(0xfe, 0),
            "",
            &["a MAVLink telemetry log (.tlog)", ".bin of ArduPilot, .ulg of PX4"],
        ),
        ("tlog of MAVLink 2", telemetry(0xfd, 0), "", &["a MAVLink telemetry log (.tlog)", "that the autopilot wrote"]),
        ("signed tlog", telemetry(0xfd, 1), "", &["a MAVLink telemetry log (.tlog)", "that the autopilot wrote"]),
        ("no tlog", telemetry(0xfc, 0), "", &["belongs in no text"]),
        ("web page", b"<!DOCTYPE html>\n<html>1,2</html>".to_vec(), "", &["a web page", "download the log itself"]),
        (
            "null bytes",
            table().replacen("\n1,", "\n1,\0", 1).into(),
            "",
            &["line 202: the byte 0x00", "copy the file again"],
        ),
        (
            "binary rows",
            [table().as_bytes(), b"9,1500,\xb5\x01,1\n"].concat(),
            "",
            &["line 402: the byte 0x01", "copy the file again"],
        ),
        ("a sign in a number", [table().as_bytes(), b"9,1500,\xb5,1\n"].concat(), "", &["line 402", "`µ`"]),
        (
            "half of UTF-16",
            [&utf16(&table(), u16::to_le_bytes)[..], b"1"].concat(),
            "",
            &["byte 2: UTF-16 text", "save the file again"],
        ),
        ("two headers", repeated_header.into(), "", &["line 202: the header stands here once more", "two logs"]),
        (
            "columns of one name",
            table().replacen("thrust_g,rpm", "thrust_g,thrust_g", 1).into(),
            "",
            &["`thrust_g` and `thrust_g` are both called thrust", "--column thrust=thrust_g:UNIT"],
        ),
        (
            "no command",
            table().replacen("pwm_us", "x", 1).into(),
            "",
            &[
                "line 1: no column is known to be the command",
                "--column command=HEADER:UNIT",
                "`rotorlead import --no-command`",
            ],
        ),
        ("no time", table().replacen("time_s", "x", 1).into(), "", &["known to be the time", "--excitation steady"]),
        (
            "no response",
            table().replacen("thrust_g,rpm", "x,y", 1).into(),
            "",
            &["known to be the thrust, and none the rpm"],
        ),
        (
            "command blank throughout",
            with(1, 0..ROWS, "").into(),
            "",
            &["column `pwm_us`: empty in all 400 rows", "`rotorlead import --no-command`", "identify --align LOG"],
        ),
        ("command blank in a row", with(1, 9..10, "").into(), "", &["line 11, column `pwm_us`: empty, though"]),
        (
            "command not a number in a row",
            with(1, 9..10, "NaN").into(),
            "",
            &["line 11, column `pwm_us`: `NaN`, though"],
        ),
        ("time blank in a row", with(0, 9..10, "").into(), "", &["line 11, column `time_s`: empty, though"]),
        ("constant command", with(1, 0..ROWS, "1500").into(), "", &["the command is 0.5 in all of the 400 rows"]),
        ("text", with(2, 9..10, "off").into(), "", &["line 11, column `thrust_g`: `off` is not a finite number"]),
        (
            "percent in a column of pulses",
            with_command("pwm_us", |pulse| (pulse - 1000.0) / 10.0).into(),
            "",
            &["line 2, column `pwm_us`: 0 is outside 1000..2000", "its unit is another"],
        ),
        (
            "more than DShot has",
            with_command("cmd_dshot", |pulse| 2.0 * pulse).into(),
            "",
            &["line 102, column `cmd_dshot`: 3000 is outside 0..2047"],
        ),
        (
            "numbers of ten bits without a unit",
            with_command("throttle", |pulse| pulse - 1000.0).into(),
            "",
            &["`throttle` is the command without a unit", "--column command=throttle:UNIT", "dshot"],
        ),
        ("time back", with(0, 9..10, "0.01").into(), "", &["line 11, column `time_s`: time runs backwards by 0.03 s"]),
        (
            "milliseconds called seconds",
            table_text(HEADER, ",", |_, at, v| if at == 0 { (v * 1e4).to_string() } else { v.to_string() }).into(),
            "",
            &["column `time_s`: rows 50 s apart", "--column time='time_s:ms'"],
        ),
        (
            "microseconds called milliseconds",
            table_text(&HEADER.replace("time_s", "time_ms"), ",", |row, at, v| {
                if at == 0 { (row * 1_000_000).to_string() } else { v.to_string() }
            })
            .into(),
            "",
            &["column `time_ms`: rows 1000 s apart that last 110.8 hours"],
        ),
        (
            "rpm called rad/s",
            table().replacen("rpm", "speed (rad/s)", 1).replace(",31", ",310").into(),
            "rpm",
            &["line 102, column `speed (rad/s)`: `31000` in rad/s is more than 200000 rpm", "'rpm=speed (rad/s):UNIT'"],
        ),
        (
            "grams called kilograms",
            table().replacen("thrust_g", "thrust_kg", 1).replace(",106,", ",2106,").into(),
            "",
            &["column `thrust_kg`: `2106` in kgf is more than 10000 N", "--column thrust=thrust_kg:UNIT"],
        ),
        (
            "thousands or decimals",
            table_text(
                &HEADER.replace(',', ";"),
                ";",
                |_, at, v| if at == 3 { "1,200".into() } else { format!("{v:.0}") },
            )
            .into(),
            "",
            &["line 2, column `rpm`: `1,200` may be a number of thousands or have a decimal comma", "export"],
        ),
        (
            "both marks",
            table_text(
                &HEADER.replace(',', ";"),
                ";",
                |row, at, v| if at == 3 && row == 5 { "3,5".into() } else { v.to_string() },
            )
            .into(),
            "",
            &["line 7, column `rpm`: `3,5` is not a finite number"],
        ),
        (
            "too few rows",
            table().lines().take(50).collect::<Vec<_>>().join("\n").into(),
            "",
            &["49 usable row(s)", "steady"],
        ),
        (
            "three points",
            points(|k| 5.0 * k as f64).lines().take(4).collect::<Vec<_>>().join("\n").into(),
            "steady",
            &["3 usable"],
        ),
        ("points as a log", points(hour).into(), "", &["12 usable row(s); at least 100", "--excitation steady"]),
        (
            "a stated column that is mostly blank",
            with(3, 50..350, "").into(),
            "rpm=rpm",
            &["line 52, column `rpm`: empty, as in 300 of 400 rows", "choose another"],
        ),
        (
            "a response that is mostly blank",
            with(2, 0..250, "nan").into(),
            "thrust",
            &["line 2, column `thrust_g`: empty, as in 250 of 400 rows", "--response"],
        ),
        (
            "a response that is not there",
            table().replacen(",rpm", ",x", 1).into(),
            "rpm",
            &["no column was taken as rpm", "name its column with --column"],
        ),
        (
            "a zero of no thrust",
            table().replacen("thrust_g", "x", 1).into(),
            "--tare",
            &["--tare needs rows at zero command", "no thrust was taken", "leave --tare out"],
        ),
        (
            "a zero of a motor that never rests",
            with(1, 0..100, "1200").into(),
            "--tare",
            &["--tare needs", "there are 0"],
        ),
        ("a stated column that is not there", table().into(), "rpm=RPM:rpm", &["there is no column `RPM`", "`rpm`"]),
    ];
    assert!(cases.len() > 40);
    for (what, bytes, with, parts) in cases {
        let message = message(taken(&bytes, with));
        assert!(parts.iter().all(|part| message.contains(part)), "{what}: {message}");
    }
    let folder = tempfile::tempdir().unwrap();
    let error = import(folder.path(), &options("")).unwrap_err();
    assert!(error.to_string().contains("it is a folder, and no log"), "{error}");
    let error = import(Path::new("nowhere.csv"), &options("")).unwrap_err();
    assert!(error.to_string().contains("nowhere.csv: cannot be read"), "{error}");
}

#[test]
fn what_is_odd_and_means_one_thing_is_taken() {
    let expected = taken(table(), "").unwrap().experiment.records.remove(0);
    let quoted = |text: &str| format!("\"{text}\"");
    let cases: Vec<(&str, Vec<u8>)> = vec![
        ("a byte-order mark", format!("\u{feff}{}", table()).into()),
        ("CRLF", table().replace('\n', "\r\n").into()),
        ("no line end", table().trim_end().into()),
        ("trailing commas", table().replace('\n', ",,\n").into()),
        ("tabs", table().replace(',', "\t").into()),
        ("semicolons and decimal commas", table().replace(',', ";").replace('.', ",").into()),
        ("UTF-16, little end first", utf16(&table(), u16::to_le_bytes)),
        ("UTF-16, big end first", utf16(&table(), u16::to_be_bytes)),
        ("a comment in Windows-1252", [b"# supply 16.8 V \xb1 0.1 V\n", table().as_bytes()].concat()),
        ("a remark behind in Windows-1252", [table().as_bytes(), b"# \x84good\x93 at 21 \xb0C\n"].concat()),
        ("a name in Windows-1252", windows_1252(&table().replacen("pwm_us", "PWM (\u{b5}s)", 1))),
        ("a name of no quantity in Windows-1252", windows_1252(&table().replacen('\n', ",coil (\u{b0}C)\n", 1))),
        (
            "quotes",
            table_text(&HEADER.split(',').map(quoted).collect::<Vec<_>>().join(","), ",", |_, _, v| {
                quoted(&v.to_string())
            })
            .into(),
        ),
        ("blanks around the cells", table().replace(',', " , ").into()),
        ("a line of units", table().replacen(HEADER, "time,pwm,thrust,speed\ns,us,g,rpm", 1).into()),
        ("lines above", format!("# motor 2\nrun 3, blue propeller\n\n{}", table()).into()),
        ("a supply above", format!("blue propeller,14.8 V,20 A\n{}", table()).into()),
        ("units behind the numbers", units_behind().into()),
        ("remarks behind", format!("{}\n# tau: 0.03\n# std: 0.002, \"all\n", table()).into()),
        ("blank lines", table().replace("\n1,", "\n\n,,,\n1,").into()),
        (
            "negative times",
            table_text(HEADER, ",", |_, at, v| if at == 0 { (v - 8.0).to_string() } else { v.to_string() }).into(),
        ),
        (
            "thousands in quotes",
            table_text(HEADER, ",", |_, at, v| {
                if at == 3 && v > 999.0 { format!("\"{},{:03}.0\"", (v / 1e3) as u32, v % 1e3) } else { v.to_string() }
            })
            .into(),
        ),
        (
            "thousands between semicolons",
            table_text(&HEADER.replace(',', ";"), ";", |_, at, v| {
                if at == 3 { format!("{},{:03}", (v / 1e3) as u32, v % 1e3) } else { v.to_string() }
            })
            .into(),
        ),
        (
            "DShot as a unit",
            with_command("cmd [dshot]", |pulse| if pulse == 1000.0 { 0.0 } else { 48.0 + 1.999 * (pulse - 1000.0) })
                .into(),
        ),
    ];
    for (what, bytes) in cases {
        let found = taken(&bytes, "").unwrap_or_else(|error| panic!("{what}: {error}")).experiment.records.remove(0);
        let close = |a: &[f64], b: &[f64]| a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-9);
        assert!(close(&found.time_s, &expected.time_s), "{what}");
        assert!(close(&found.command, &expected.command), "{what}");
        assert!(close(found.thrust_n.as_ref().unwrap(), expected.thrust_n.as_ref().unwrap()), "{what}");
        assert!(close(found.rpm.as_ref().unwrap(), expected.rpm.as_ref().unwrap()), "{what}");
    }
}

#[test]
fn a_stands_log_with_dshot_and_rad_per_second_is_taken_at_the_first_try() {
    let Import { experiment, summary } = taken(stand(dshot, "rad/s"), "none").unwrap();
    assert_eq!((summary.format.name, summary.rows_taken), ("rc_benchmark", ROWS));
    let record = &experiment.records[0];
    assert_eq!((experiment.output, record.excitation), (Output::Rpm, Excitation::Staircase));
    // 600 of 48..2047.
    assert_eq!((record.command[0], record.command[100]), (0.0, 552.0 / 1999.0));
    assert!((record.rpm.as_ref().unwrap()[0] - 3000.0 * 30.0 / std::f64::consts::PI).abs() < 1e-9);
    assert!(record.thrust_n.is_some(), "both are complete");
    let note = |part: &str| summary.notes.iter().find(|note| note.contains(part)).unwrap_or_else(|| panic!("{part}"));
    assert!(note("is guessed").contains("`--column 'command=ESC signal:UNIT'` states another unit"));
    assert!(note("the response is the speed").contains("`--response thrust`"));
    let column = |name: &str| summary.columns.iter().find(|column| column.name.starts_with(name)).unwrap();
    assert_eq!(column("ESC signal").note, "DShot: 48..2047 become 0..1, 0 is stop; guessed");
    assert_eq!(column("Motor Electrical").note, "zero or blank in every row");
    // Where both speeds move, the electrical one is taken, and what it misses is said.
    let both = stand(dshot, "rad/s");
    let with_electrical = |line: &str| match line.split(',').collect::<Vec<_>>()[..] {
        [time, command, thrust, "0", optical, ""] => {
            let electrical = if command == "0" { 0.8 } else { 0.9 } * optical.parse::<f64>().unwrap();
            format!("{time},{command},{thrust},{electrical},{optical},\n")
        }
        _ => format!("{line}\n"),
    };
    let both: String = both.lines().map(with_electrical).collect();
    let Import { summary, .. } = taken(both, "none").unwrap();
    let note = summary.notes.iter().find(|note| note.contains("differ")).unwrap();
    assert!(note.contains("in 400 of 400 rows") && note.contains("'rpm=Motor Optical Speed (rad/s):rad/s'"), "{note}");
    // Orders to the ESC stand for a motor at rest.
    let orders = stand(dshot, "RPM").replace(",0,2,", ",13,2,");
    let Import { experiment, summary } = taken(&orders, "none").unwrap();
    assert_eq!(experiment.records[0].command[0], 0.0);
    assert!(summary.notes.iter().any(|note| note.starts_with("100 rows have a DShot number from 1 to 47")));
}

#[test]
fn the_unit_of_a_command_is_guessed_where_its_numbers_fit_one_alone() {
    type Numbers = fn(f64) -> f64;
    // Of pulse widths of 1000, 1500 and 1600.
    let cases: [(&str, Numbers, Option<&str>); 8] = [
        ("pulse widths, which DShot has too", |pulse| pulse, Some("us")),
        ("fractions", |pulse| (pulse - 1000.0) / 1000.0, Some("duty")),
        ("percents", |pulse| (pulse - 1000.0) / 10.0, Some("percent")),
        ("percents below those of any run, or volts", |pulse| (pulse - 1000.0) / 100.0, None),
        ("ten bits", |pulse| pulse - 1000.0, None),
        ("pulse widths beyond the usual ones", |pulse| 2.0 * (pulse - 1500.0) + 2000.0, None),
        ("DShot", |pulse| f64::max(0.0, 12.0 * (pulse - 1450.0)), Some("dshot")),
        ("no whole numbers", |pulse| 48.5 + 3.0 * (pulse - 1000.0), None),
    ];
    for (what, numbers, unit) in cases {
        let log = with_command("throttle", numbers);
        match (taken(&log, ""), unit) {
            (Ok(Import { summary, .. }), Some(unit)) => {
                let guessed = format!("the unit of `throttle` is guessed to be {unit}: ");
                assert!(summary.notes.iter().any(|note| note.starts_with(&guessed)), "{what}: {:?}", summary.notes);
                assert!(summary.columns[1].note.ends_with("; guessed"), "{what}: {}", summary.columns[1].note);
            }
            (Err(error), None) => assert!(error.to_string().contains("without a unit"), "{what}: {error}"),
            (found, _) => panic!("{what}: {found:?}"),
        }
    }
}

#[test]
fn the_response_is_the_one_that_is_asked_for_or_said_with_its_reason() {
    let responses = |text: &str, with: &str| {
        let Import { experiment, summary } = taken(text, with).unwrap();
        let record = &experiment.records[0];
        let note = summary.notes.into_iter().find(|note| note.starts_with("the response")).unwrap_or_default();
        (experiment.output, record.thrust_n.is_some(), record.rpm.is_some(), record.time_s.len(), note)
    };
    let (output, thrust, rpm, rows, note) = responses(&table(), "");
    assert_eq!((output, thrust, rpm, rows), (Output::ThrustN, true, true, ROWS));
    assert!(note.contains("`--response rpm` takes the other one"), "{note}");
    let (output, thrust, rpm, ..) = responses(&table(), "rpm");
    assert_eq!((output, thrust, rpm), (Output::Rpm, true, true));
    // A thrust with holes is no response, unless it is asked for.
    let holes = with(2, 120..140, "NaN");
    let (output, thrust, rpm, rows, note) = responses(&holes, "");
    assert_eq!((output, thrust, rpm, rows), (Output::Rpm, false, true, ROWS));
    assert!(note.contains("the thrust is in 380 of 400 rows alone"), "{note}");
    for with in ["thrust", "thrust=thrust_g:gf"] {
        let Import { summary, .. } = taken(&holes, with).unwrap();
        assert_eq!((summary.dropped[0].rows, summary.dropped[0].reason.as_str()), (20, "`thrust_g` is blank"));
    }
    assert_eq!(responses(&holes, "thrust").0, Output::ThrustN);
    // A speed that never moves is no response.
    let (output, _, rpm, _, note) = responses(&with(3, 0..ROWS, "0"), "");
    assert_eq!((output, rpm), (Output::ThrustN, false));
    assert!(note.contains("zero or blank in every row"), "{note}");
    // Of one alone there is nothing to say.
    assert_eq!(responses(&table().replacen("thrust_g", "x", 1), "").4, "");
}

#[test]
fn a_zero_of_thrust_is_taken_from_the_motor_at_rest() {
    let thrust = |text: &str, with: &str| {
        let Import { experiment, summary } = taken(text, with).unwrap();
        let thrust = experiment.records[0].thrust_n.clone().unwrap();
        (thrust, summary.notes.join("\n"))
    };
    let gf = 0.009_806_65;
    let (found, notes) = thrust(&table(), "--tare");
    assert!(found[0].abs() < 1e-12 && (found[105] - 98.0 * gf).abs() < 1e-12, "{}", found[105]);
    assert!(notes.contains("0.0196 N subtracted from the thrust: its mean over 100 rows at rest"), "{notes}");
    // 1 gf is less than 1 % of what it pulls; 20 are more.
    assert!(!thrust(&with(2, 0..100, "1"), "").1.contains("--tare"));
    let (found, notes) = thrust(&with(2, 0..100, "20"), "");
    assert!((found[0] - 20.0 * gf).abs() < 1e-12);
    assert!(notes.contains("thrust at rest is 0.1961 N, and not zero, over 100 rows"), "{notes}");
    // Each steady point at zero command is at rest.
    let (found, notes) = thrust(&points(|point| 5.0 * point as f64).replace(",0,0,0\n", ",0,8,0\n"), "none --tare");
    assert!(found[0].abs() < 1e-12 && notes.contains("over 1 rows"), "{notes}");
}

#[test]
fn a_table_of_steady_points_is_a_static_map() {
    let record = |text: &str, with: &str| {
        let Import { experiment, summary } = taken(text, with).unwrap();
        (experiment.records.into_iter().next().unwrap(), summary.notes.join("\n"))
    };
    let (found, notes) = record(&points(|point| 5.0 * point as f64), "none");
    assert_eq!((found.excitation, found.time_s[11], found.command[11]), (Excitation::Steady, 55.0, 0.55));
    assert!(
        notes.contains("each has another command: 12 steady points, which give a static map and no lag"),
        "{notes}"
    );
    // Times that step back say nothing.
    let (found, notes) = record(&points(|point| if point == 1 { -0.001 } else { 5.0 * point as f64 }), "none");
    assert_eq!(found.time_s[..3], [0.0, 1.0, 2.0]);
    assert!(notes.contains("do not increase, so they are numbered"), "{notes}");
    // Stated, they need neither times nor to be slow.
    let (found, notes) = record(&points(|_| 0.0).replace("time_s", "x"), "steady");
    assert_eq!((found.excitation, found.time_s[11]), (Excitation::Steady, 11.0));
    assert!(notes.contains("has no time"), "{notes}");
    let (found, _) = record(&points(|point| 0.1 * point as f64), "steady");
    assert_eq!((found.excitation, found.time_s.len()), (Excitation::Steady, 12));
    // A log of more rows than that is none, nor is one that holds its levels.
    assert!(message(taken(table(), "none")).contains("does not say what drove the command"));
}

#[test]
fn a_fraction_in_a_column_called_percent_is_one() {
    let fraction = |name: &str| with_command(name, |pulse| (pulse - 1000.0) / 1000.0);
    for name in ["Throttle (%)", "throttle_percent", "cmd [pct]"] {
        let Import { experiment, summary } = taken(fraction(name), "").unwrap();
        assert_eq!(experiment.records[0].command[150], 0.5, "{name}");
        let note = summary.notes.iter().find(|note| note.contains("guessed to be duty")).unwrap();
        assert!(note.contains(name) && note.contains("no motor turns at 1 percent"), "{note}");
    }
    // What is stated is obeyed, and so is a header that may be right.
    let Import { experiment, .. } = taken(fraction("throttle"), "command=throttle:percent").unwrap();
    assert_eq!(experiment.records[0].command[150], 0.005);
    let low = with_command("Throttle (%)", |pulse| (pulse - 1000.0) / 100.0);
    assert_eq!(taken(low, "").unwrap().experiment.records[0].command[150], 0.05);
}
