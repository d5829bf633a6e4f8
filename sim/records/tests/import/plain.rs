//! Plain tables: any logger's columns, units, separators and lines above the header.

use std::fmt::Write as _;

use proptest::prelude::*;
use rotorlead_records::import::{Import, ImportError, ImportOptions, import};
use rotorlead_records::{Excitation, Output, Record};

use crate::importing::{imported, message, sample};

const ROWS: usize = 400;

/// Row by row: time in milliseconds, pulse width in microseconds, thrust in gram-force.
fn numbers() -> Vec<[f64; 3]> {
    let level = |row: usize| [1400.0, 1500.0, 1600.0, 1500.0][row / 100];
    (0..ROWS).map(|row| [5.0 * row as f64, level(row), 100.0 + 0.5 * row as f64]).collect()
}

/// [`numbers`] behind `header`.
fn table(header: &str) -> String {
    let rows: String = numbers().iter().map(|[t, u, f]| format!("{t},{u},{f}\n")).collect();
    format!("{header}\n{rows}")
}

const HEADER: &str = "time_ms,pwm_us,thrust_g";

fn options(columns: &[&str]) -> ImportOptions {
    ImportOptions {
        columns: columns.iter().map(|column| column.parse().unwrap()).collect(),
        excitation: Some(Excitation::Staircase),
        ..ImportOptions::default()
    }
}

fn taken(text: &str) -> Result<Import, ImportError> {
    imported(text.as_bytes(), &options(&[]))
}

fn record(text: &str) -> Record {
    taken(text).unwrap().experiment.records.remove(0)
}

#[test]
fn units_in_the_header_are_converted() {
    let Import { experiment, summary } = taken(&table(HEADER)).unwrap();
    assert_eq!((summary.format.name, summary.rows_read, summary.rows_taken), ("plain", ROWS, ROWS));
    assert_eq!((experiment.output, experiment.sample_rate_hz), (Output::ThrustN, None));
    let record = &experiment.records[0];
    assert_eq!(record.file, "log.csv");
    assert_eq!((record.excitation, record.period_s), (Excitation::Staircase, None));
    assert_eq!((record.nominal, record.amplitude), (0.5, Some(0.1)));
    assert_eq!((record.time_s[0], record.time_s[1], record.time_s[399]), (0.0, 0.005, 1.995));
    assert_eq!((record.command[0], record.command[150]), (0.4, 0.5));
    assert!((record.thrust_n.as_ref().unwrap()[2] - 101.0 * 0.009_806_65).abs() < 1e-12);
    assert!((summary.timing.rate_hz - 200.0).abs() < 1e-9);
    let note = |name: &str| summary.columns.iter().find(|column| column.name == name).unwrap().note.clone();
    assert_eq!(note("pwm_us"), "1000..2000 µs become 0..1, stated and not measured");
    assert_eq!(note("thrust_g"), "in gf, times 0.00980665");
    assert!(
        summary.notes.iter().any(|note| note.contains("nominal 0.500 (middle of its range)")),
        "{:?}",
        summary.notes
    );
}

#[test]
fn every_unit_comes_to_the_same_record() {
    let expected = record(&table(HEADER));
    for (header, scale) in [
        ("Time (s),Throttle (%),Thrust [N]", [1e-3, 0.1, 0.009_806_65]),
        ("t_us,cmd (0..1),thrust_kgf", [1e3, 1e-3, 1e-3]),
        ("timestamp_ms,duty_percent,thrust (lbf)", [1.0, 0.1, 0.009_806_65 / 4.448_221_615_260_5]),
        ("timestamp_ms,duty_percent,thrust (oz)", [1.0, 0.1, 0.009_806_65 * 16.0 / 4.448_221_615_260_5]),
    ] {
        let offset = if header.contains("pwm") { 0.0 } else { 1000.0 };
        let rows: String = numbers()
            .iter()
            .map(|[t, u, f]| format!("{},{},{}\n", t * scale[0], (u - offset) * scale[1], f * scale[2]))
            .collect();
        let found = record(&format!("{header}\n{rows}"));
        let close = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-9);
        assert!(close(&found.time_s, &expected.time_s), "{header}");
        assert!(close(&found.command, &expected.command), "{header}");
        assert!(close(found.thrust_n.as_ref().unwrap(), expected.thrust_n.as_ref().unwrap()), "{header}");
    }
}

#[test]
fn times_off_a_clock_go_on_behind_midnight() {
    let clock = |ms: f64| {
        // From a second before midnight on.
        let ms = (86_399_000.0 + ms) as u64 % 86_400_000;
        let (s, ms) = (ms / 1000, ms % 1000);
        format!("{:02}:{:02}:{:02}.{ms:03}", s / 3600, s / 60 % 60, s % 60)
    };
    let expected = record(&table(HEADER));
    for (header, date) in [
        ("Time,pwm_us,thrust_g", ""),
        ("Time (hh:mm:ss),pwm_us,thrust_g", ""),
        ("timestamp,pwm_us,thrust_g", "2026-11-22 "),
    ] {
        let rows: String = numbers().iter().map(|[t, u, f]| format!("{date}{},{u},{f}\n", clock(*t))).collect();
        let found = record(&format!("{header}\n{rows}"));
        assert_eq!(found.command, expected.command);
        for (found, expected) in found.time_s.iter().zip(&expected.time_s) {
            assert!((found - expected).abs() < 1e-9, "{header}: {found} for {expected}");
        }
        let wrong = format!("{header}\n{}", rows.replacen("23:59:59.005", "23:59", 1));
        let parts = ["line 3", "23:59"];
        let said = message(taken(&wrong));
        assert!(parts.iter().all(|part| said.contains(part)), "{said}");
    }
}

#[test]
fn separators_and_decimal_commas_are_told_from_the_rows() {
    let expected = record(&table(HEADER));
    let english = table(HEADER);
    for text in [
        english.replace('.', ";").replace(',', "\t").replace(';', "."),
        english.replace(',', ";"),
        english.replace(',', ";").replace('.', ","),
        english.replace(',', "\t").replace('.', ","),
        english.replace('\n', "\r\n"),
        format!("\u{feff}{english}"),
    ] {
        let found = record(&text);
        assert_eq!((&found.time_s, &found.thrust_n), (&expected.time_s, &expected.thrust_n), "{}", &text[..60]);
    }
    let mixed = english.replace(',', ";").replacen("0;1400;100\n", "0;1400;100,25\n", 1);
    let message = message(taken(&mixed));
    assert!(message.contains("line 2, column `thrust_g`: `100,25` is not a finite number"), "{message}");
}

#[test]
fn columns_may_be_apart_by_blanks() {
    let expected = record(&table(HEADER));
    let apart = |text: &str| text.replace(',', "   ").replace('\n', "  \n    ");
    for text in [
        apart(&table(HEADER)),
        apart(&format!("# logger 3.1, 2024\n{}", table("% time_ms,pwm_us,thrust_g"))),
        apart(&table("time,throttle,thrust\nms,us,g")),
    ] {
        let found = record(&text);
        assert_eq!((&found.time_s, &found.thrust_n), (&expected.time_s, &expected.thrust_n), "{}", &text[..60]);
    }
    // Names of two words would be more columns than there are.
    let message = message(taken(&apart(&table("Time (ms),ESC (us),Thrust (g)"))));
    assert!(message.contains("`#1`, `#2`, `#3`"), "{message}");
}

#[test]
fn lines_above_the_header_and_a_line_of_units_are_read_over() {
    let expected = record(&table(HEADER));
    let rows = table("").trim_start().to_owned();
    for above in [
        "# logger 3.1, 2024-11-07\n\ntime_ms,pwm_us,thrust_g\n",
        "logger\nblue motor, 10 inch\ntime_ms,pwm_us,thrust_g\n",
        "# time_ms,pwm_us,thrust_g\n",
        "time,throttle,thrust\nms,us,g\n",
        "Time,ESC,Thrust\n[ms],[us],[gf]\n",
    ] {
        let found = record(&format!("{above}{rows}"));
        assert_eq!((found.time_s, found.thrust_n), (expected.time_s.clone(), expected.thrust_n.clone()), "{above}");
    }
    let bad = format!("# one\n# two\n{}", table(HEADER).replacen("10,1400", "ten,1400", 1));
    let message = message(taken(&bad));
    assert!(message.contains("log.csv, line 6, column `time_ms`: `ten`"), "{message}");
}

#[test]
fn columns_without_a_name_are_called_by_their_place() {
    let rows = table("").trim_start().to_owned();
    let message = message(imported(rows.as_bytes(), &options(&[])));
    assert!(message.contains("`#1`, `#2`, `#3`"), "{message}");
    let columns = ["time=#1:ms", "command=#2:us", "thrust=#3:g"];
    let found = imported(rows.as_bytes(), &options(&columns)).unwrap();
    assert_eq!(found.experiment.records[0].time_s, record(&table(HEADER)).time_s);
    assert!(found.summary.notes.iter().any(|note| note.contains("no header")), "{:?}", found.summary.notes);
}

#[test]
fn a_stands_log_stays_one_where_columns_are_stated() {
    let log = sample("rcbenchmark.csv");
    let known = import(&log, &options(&[])).unwrap();
    assert_eq!(known.summary.format.name, "rc_benchmark");
    let stated = import(&log, &options(&["rpm=Motor Electrical Speed (RPM)"])).unwrap();
    assert_eq!(stated, known);
}

#[test]
fn a_sign_is_mentioned_and_turned_when_asked() {
    let text = table(HEADER);
    let columns = ["thrust=thrust_g:-gf"];
    let Import { experiment, summary } = imported(text.as_bytes(), &options(&columns)).unwrap();
    let thrust = experiment.records[0].thrust_n.clone().unwrap();
    assert!(thrust.iter().all(|thrust| *thrust < 0.0));
    assert!(summary.columns[2].note.contains("sign turned"));
    let note = summary.notes.iter().find(|note| note.contains("below zero in 400 of 400 rows")).unwrap();
    assert!(note.contains("`--column thrust=thrust_g:gf`"), "{note}");
}

#[test]
fn repeated_stamps_are_left_out_and_counted_and_time_that_runs_back_is_refused() {
    let text = table(HEADER).replacen("\n15,", "\n10,", 1).replacen("\n500,", "\n495,", 1);
    let Import { experiment, summary } = taken(&text).unwrap();
    assert_eq!((summary.rows_read, summary.rows_taken), (ROWS, ROWS - 2));
    assert_eq!(summary.dropped[0].rows, 2);
    assert_eq!(summary.dropped[0].reason, "same time stamp as the row before");
    assert_eq!(experiment.records[0].time_s[2..4], [0.01, 0.02]);
    let message = message(taken(&table(HEADER).replacen("\n15,", "\n1,", 1)));
    assert!(message.contains("line 5, column `time_ms`: time runs backwards by 0.009 s"), "{message}");
}

#[test]
fn what_a_cell_may_not_be_is_said_with_line_and_column() {
    for (from, to, part) in [
        ("\n10,1400,", "\n10,fast,", "line 4, column `pwm_us`: `fast` is not a finite number"),
        ("\n10,1400,", "\n10,NaN,", "line 4, column `pwm_us`: `NaN`"),
        ("\n10,1400,", "\n10,2400,", "line 4, column `pwm_us`: 2400 is outside 1000..2000"),
        ("\n10,1400,", "\n10,,", "line 4, column `pwm_us`: empty"),
        ("\n10,1400,101\n", "\n10,1400,1e308\n", "line 4, column `thrust_g`: `1e308` in kgf is more than 10000 N"),
    ] {
        // A kilogram-force is the unit that makes a number larger.
        let header = if to.contains("1e308") { "time_ms,pwm_us,thrust_g" } else { HEADER };
        let text = table(header).replacen(from, to, 1);
        assert_ne!(text, table(header));
        let result = if to.contains("1e308") {
            imported(text.as_bytes(), &options(&["thrust=thrust_g:kgf"]))
        } else {
            taken(&text)
        };
        let message = message(result);
        assert!(message.contains(part), "{message}");
    }
}

#[test]
fn a_table_that_is_none_or_says_too_little_is_refused() {
    for (text, parts) in [
        (HEADER.to_owned(), ["no line of it has two numbers", "time_ms"]),
        (String::from("just words\nand more\n"), ["no table", "just words"]),
        (table(HEADER).lines().take(50).collect::<Vec<_>>().join("\n"), ["49 usable row(s)", "100"]),
        (table("t,esc_us,gf"), ["line 1: `t` is the time without a unit", "--column thrust=HEADER:UNIT"]),
        (table(HEADER).replace(",1400,", ",1500,").replace(",1600,", ",1500,"), ["the command is 0.5 in all", "400"]),
    ] {
        let message = message(taken(&text));
        assert!(parts.iter().all(|part| message.contains(part)), "{message}");
    }
    let message = message(imported(table(HEADER).as_bytes(), &ImportOptions::default()));
    assert!(message.contains("does not say what drove the command") && message.contains("--period"), "{message}");
}

#[test]
fn a_part_of_a_log_is_a_record_of_its_own() {
    let options = ImportOptions { seconds: Some((0.5, 1.5)), ..options(&[]) };
    let Import { experiment, summary } = imported(table(HEADER).as_bytes(), &options).unwrap();
    let record = &experiment.records[0];
    assert_eq!((record.time_s.len(), record.time_s[0], record.command[0], record.command[199]), (200, 0.0, 0.5, 0.6));
    assert_eq!(record.file, "log_0.5s.csv");
    assert_eq!((summary.rows_taken, summary.dropped[0].rows), (200, 200));
    let options = ImportOptions { seconds: Some((1.9, 3.0)), ..options };
    let message = message(imported(table(HEADER).as_bytes(), &options));
    assert!(message.contains("20 row(s) from 1.9 to 3 s; the log ends 2.0 s behind its first row"), "{message}");
}

/// A multisine of three lines in whole microseconds, in `periods` periods of 2 s.
fn multisine(periods: f64, nominal_us: f64) -> String {
    let row = |row: usize| {
        let phase = std::f64::consts::PI * row as f64 / 200.0;
        let wave = (phase).sin() + (3.0 * phase + 1.0).sin() + (7.0 * phase + 2.0).cos();
        format!("{},{:.0},{}\n", 5 * row, nominal_us + 17.0 * wave, 300 + row % 3)
    };
    let rows: String = (0..(400.0 * periods) as usize).map(row).collect();
    format!("{HEADER}\n{rows}")
}

#[test]
fn the_nominal_command_is_the_mean_of_whole_periods_or_the_middle_of_the_range() {
    let described = |text: &str, excitation, period_s, nominal| {
        let options = ImportOptions { excitation: Some(excitation), period_s, nominal, ..ImportOptions::default() };
        let Import { experiment, summary } = imported(text.as_bytes(), &options).unwrap();
        let record = &experiment.records[0];
        (record.nominal, record.amplitude.unwrap(), record.period_s, summary.notes.last().unwrap().clone())
    };
    for periods in [3.0, 3.5] {
        let (nominal, amplitude, period_s, note) =
            described(&multisine(periods, 1400.0), Excitation::Multisine, Some(2.0), None);
        assert_eq!((nominal, period_s), (0.4, Some(2.0)), "{periods}");
        assert!((0.03..0.051).contains(&amplitude), "{amplitude}");
        assert!(note.contains("multisine with a period of 2 s, nominal 0.400 (mean of 3 whole periods)"), "{note}");
    }
    let (nominal, .., note) = described(&multisine(0.9, 1400.0), Excitation::Multisine, Some(2.0), None);
    assert!((nominal - 0.4).abs() < 0.02 && note.contains("middle of its range"), "{nominal}: {note}");
    let square = multisine(2.0, 1400.0).replace(",13", ",1350.").replace(",14", ",1450.");
    assert_eq!(described(&square, Excitation::Square, Some(2.0), Some(0.41)).0, 0.41);
    // A step starts at its nominal command.
    let step = table(HEADER).replace(",1600,", ",1500,");
    let (nominal, amplitude, ..) = described(&step, Excitation::Step, None, None);
    assert_eq!((nominal, (amplitude * 1e3).round()), (0.4, 100.0));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(500))]

    /// Changed bytes and cells of any text give an experiment of equal columns or an error with a remedy, and never a panic.
    #[test]
    fn damaged_tables_are_taken_or_refused(
        header in prop::sample::select(vec![HEADER, "Time (s);Throttle (%);Thrust [N]", "t\tu\tv", "time_s,command,rpm"]),
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..6),
        cells in prop::collection::vec((0_usize..120, 0_usize..4, "[-+0-9.eEnaif:, ;\t\"#]{0,24}"), 0..4),
    ) {
        let separator = header.chars().find(|c| [',', ';', '\t'].contains(c)).unwrap();
        let mut lines: Vec<Vec<String>> =
            numbers().iter().take(200).map(|row| row.iter().map(f64::to_string).collect()).collect();
        for (line, cell, text) in cells {
            let line = &mut lines[line];
            line.resize(line.len().max(cell + 1), String::new());
            line[cell] = text;
        }
        let lines: Vec<String> = lines.iter().map(|cells| cells.join(&separator.to_string())).collect();
        let mut bytes = format!("{header}\n{}", lines.join("\n")).into_bytes();
        for (at, byte) in changes {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
        match imported(&bytes, &options(&[])) {
            Ok(Import { experiment, summary }) => {
                let record = &experiment.records[0];
                prop_assert!(record.time_s.is_sorted_by(|a, b| a < b));
                prop_assert_eq!(record.time_s.len(), record.command.len());
                prop_assert_eq!(record.time_s.len(), record.rpm.as_ref().or(record.thrust_n.as_ref()).unwrap().len());
                prop_assert!(record.command.iter().all(|c| (0.0..=1.0).contains(c)));
                let dropped: usize = summary.dropped.iter().map(|d| d.rows).sum();
                prop_assert_eq!(summary.rows_taken + dropped, summary.rows_read);
            }
            Err(error) => prop_assert!(miette::Diagnostic::help(&error).is_some()),
        }
    }
}

/// As programs export messages: one row for each of a series, the other cells blank.
fn interleaved_series(rows: impl Iterator<Item = (f64, Option<f64>, Option<f64>, Option<f64>)>) -> String {
    let cell = |value: Option<f64>| value.map(|value| value.to_string()).unwrap_or_default();
    let row = |(time_s, command, rpm, voltage): (f64, _, _, _)| {
        format!("{time_s},{},{},{}\n", cell(command), cell(rpm), cell(voltage))
    };
    format!("__time,/motor/command,/motor/rpm,/battery/voltage\n{}", rows.map(row).collect::<String>())
}

fn interleaved(text: &str) -> Result<Import, ImportError> {
    let columns = ["time=__time:s", "command=/motor/command:duty", "rpm=/motor/rpm:rpm", "voltage=/battery/voltage:V"];
    imported(text.as_bytes(), &options(&columns))
}

#[test]
fn series_of_one_row_each_hold_until_their_next_one() {
    let command = |message: u32| if message % 200 < 100 { 0.3 } else { 0.6 };
    let messages = (0..400_u32).flat_map(|message| {
        let at_s = 1.7e9 + 0.01 * f64::from(message);
        let slow = (message % 10 == 0).then_some((at_s, None, None, Some(16.0)));
        let others = [
            (at_s + 0.001, Some(command(message)), None, None),
            (at_s + 0.004, None, Some(5000.0 + f64::from(message)), None),
        ];
        slow.into_iter().chain(others)
    });
    let text = interleaved_series(messages);
    let Import { experiment, summary } = interleaved(&text).unwrap();
    let record = &experiment.records[0];
    assert_eq!((summary.rows_read, summary.rows_taken, record.command.len()), (840, 400, 400));
    for row in 0..400 {
        assert_eq!(record.command[row as usize], command(row), "row {row}");
    }
    assert_eq!(record.rpm.as_ref().unwrap()[7], 5007.0);
    assert_eq!(record.voltage_v.as_ref().unwrap()[7], 16.0);
    assert!(summary.notes.iter().any(|note| note.contains("each row has one series")), "{:?}", summary.notes);
    // Speeds that cannot be, more than glitches are, are still said with their line.
    let wrong = text.replace(",53", ",530053");
    assert!(message(interleaved(&wrong)).contains("line 634"), "{}", message(interleaved(&wrong)));
}

#[test]
fn a_command_that_is_logged_on_change_alone_holds_from_there() {
    let messages = (0..400_u32).flat_map(|message| {
        let at_s = 0.01 * f64::from(message);
        let change = (message % 100 == 0).then_some((at_s, Some(0.3 + f64::from(message) / 1000.0), None, None));
        change.into_iter().chain([(at_s + 0.002, None, Some(5000.0), Some(16.0))])
    });
    let found = interleaved(&interleaved_series(messages)).unwrap();
    let command = &found.experiment.records[0].command;
    assert_eq!((command[99], command[100], command[399]), (0.3, 0.4, 0.6));
}

#[test]
fn a_hole_in_the_command_of_whole_rows_stays_an_error() {
    let rows = (0..400_u32).map(|row| {
        let command = (!(200..220).contains(&row)).then_some(0.4);
        (0.01 * f64::from(row), command, Some(5000.0), Some(16.0))
    });
    let error = message(interleaved(&interleaved_series(rows)));
    assert!(error.contains("line 202, column `/motor/command`: empty"), "{error}");
}

/// A stand's log with what its two sensors of the speed read of each level's speed; with the thrust or without.
fn two_speeds(electrical: impl Fn(f64) -> f64, optical: impl Fn(f64) -> f64, has_thrust: bool) -> Import {
    let mut text =
        String::from("Time (s),ESC signal (µs),Thrust (gf),Motor Electrical Speed (RPM),Motor Optical Speed (RPM)\n");
    for row in 0..600 {
        let pulse = [1000, 1100, 1300, 1600, 1900, 1300][row / 100];
        let speed = 30.0 * f64::from(pulse - 1000);
        let thrust = if has_thrust { (1e-6 * speed * speed + 0.3).to_string() } else { String::new() };
        let ripple = (row % 3) as f64;
        let [electrical, optical] =
            [electrical(speed), optical(speed)].map(|s| if speed > 0.0 { s + ripple } else { 0.0 });
        writeln!(text, "{},{pulse},{thrust},{electrical},{optical}", row as f64 / 100.0).unwrap();
    }
    imported(text.as_bytes(), &ImportOptions::default()).unwrap()
}

#[test]
fn a_speed_that_is_lost_at_some_levels_gives_way_to_the_other() {
    let most = |import: &Import| import.experiment.records[0].rpm.as_ref().unwrap().iter().copied().fold(0.0, f64::max);
    let says = |import: &Import, part: &str| import.summary.notes.iter().any(|note| note.contains(part));
    let lost_below = |from: f64| move |speed: f64| if speed < from { 40.0 } else { speed * 11.0 / 12.0 };
    // The electrical one is lost at the lowest level, at the lowest two, and at the highest without any thrust.
    for lost in [lost_below(4000.0), lost_below(10_000.0)] {
        let taken = two_speeds(lost, |speed| speed, true);
        assert_eq!(most(&taken), 27_002.0);
        assert!(says(&taken, "0.917 = 11/12 of the other: check the pole count"), "{:?}", taken.summary.notes);
    }
    let taken = two_speeds(|speed| if speed > 20_000.0 { 100.0 } else { speed }, |speed| speed, false);
    assert_eq!(most(&taken), 27_002.0);
    // The optical one is lost: the electrical one stays.
    let taken = two_speeds(|speed| speed * 0.5, |speed| if speed < 4000.0 { 0.0 } else { speed }, true);
    assert_eq!(most(&taken), 13_502.0);
    assert!(says(&taken, "0.500 = 1/2 of the other"), "{:?}", taken.summary.notes);
    // Both agree with the thrust.
    let taken = two_speeds(|speed| speed * 6.0 / 7.0, |speed| speed, true);
    assert_eq!(most(&taken), 27_000.0 * 6.0 / 7.0 + 2.0);
    assert!(says(&taken, "0.857 = 6/7 of the other"), "{:?}", taken.summary.notes);
}
