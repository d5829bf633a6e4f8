//! Logs of other tools: what is taken of them and what is refused.

use std::fs;
use std::path::Path;

use miette::Diagnostic as _;
use proptest::prelude::*;
use rotorlead_records::import::{Import, ImportError, ImportOptions, import};
use rotorlead_records::{Excitation, Output};

use crate::importing::{imported, message, sample};

fn written(text: &str) -> Result<Import, ImportError> {
    imported(text.as_bytes(), &ImportOptions::default())
}

fn taken(name: &str) -> Import {
    import(&sample(name), &ImportOptions::default()).unwrap()
}

/// Imports the sample with `from` replaced by `to` in line `line` (the header is 1).
fn edited(name: &str, line: usize, from: &str, to: &str) -> Result<Import, ImportError> {
    let text = fs::read_to_string(sample(name)).unwrap();
    let mut lines: Vec<String> = text.lines().map(String::from).collect();
    assert!(lines[line - 1].contains(from), "{}", lines[line - 1]);
    lines[line - 1] = lines[line - 1].replacen(from, to, 1);
    written(&lines.join("\n"))
}

#[test]
fn an_rcbenchmark_log_becomes_a_staircase() {
    let Import { experiment, summary } = taken("rcbenchmark.csv");
    assert_eq!(summary.format.name, "rc_benchmark");
    assert_eq!(experiment.name, "rcbenchmark");
    assert_eq!(experiment.output, Output::Rpm);
    assert_eq!(experiment.sample_rate_hz, None);
    let record = &experiment.records[0];
    assert_eq!(record.excitation, Excitation::Staircase);
    // 240 rows, 6 without a command, one with the stamp of the row before.
    assert_eq!((summary.rows_read, summary.rows_taken), (240, 233));
    assert_eq!(summary.dropped.iter().map(|d| d.rows).sum::<usize>(), 7);
    assert_eq!(summary.timing.rows_reordered, 1);
    for column in [&record.command, record.rpm.as_ref().unwrap(), record.voltage_v.as_ref().unwrap()] {
        assert_eq!(column.len(), record.time_s.len());
    }
    assert_eq!(record.time_s[0], 0.0);
    assert!(record.time_s.is_sorted_by(|a, b| a < b));
    assert_eq!(record.command[0], 0.2);
    assert_eq!(*record.command.last().unwrap(), 0.3);
    assert_eq!(record.nominal, 0.25);
    assert!((record.amplitude.unwrap() - 0.05).abs() < 1e-15);
    assert_eq!(record.rpm.as_ref().unwrap()[0], 5000.0);
    assert!(record.thrust_n.is_none());
}

#[test]
fn the_summary_says_what_became_of_every_column() {
    let summary = taken("rcbenchmark.csv").summary;
    let find = |name: &str| summary.columns.iter().find(|c| c.name == name).unwrap();
    assert_eq!(summary.columns.len(), 10, "trailing commas are no columns");
    assert_eq!(find("ESC signal (µs)").taken_as.as_deref(), Some("command"));
    assert!(find("ESC signal (µs)").note.contains("1000..2000"));
    assert_eq!(find("Motor Electrical Speed (RPM)").taken_as.as_deref(), Some("rpm"));
    let thrust = find("Thrust (gf)");
    assert_eq!(thrust.taken_as, None);
    assert_eq!(thrust.note, "filled in 10 of 233 rows (6.1 Hz): too slow to show the lag");
    assert_eq!(find("App message").taken_as, None);
    assert!(summary.notes.iter().any(|n| n.contains("Electrical Speed")));
}

#[test]
fn the_range_of_the_esc_signal_can_be_stated() {
    let options =
        ImportOptions { name: Some("run 3".into()), esc_signal_us: Some((1100.0, 1900.0)), ..ImportOptions::default() };
    let Import { experiment, .. } = import(&sample("rcbenchmark.csv"), &options).unwrap();
    assert_eq!(experiment.name, "run 3");
    assert_eq!(experiment.records[0].command[0], 0.125);
    let narrow = ImportOptions { esc_signal_us: Some((1000.0, 1250.0)), ..ImportOptions::default() };
    let error = import(&sample("rcbenchmark.csv"), &narrow).unwrap_err();
    assert!(error.to_string().contains("line 122, column `ESC signal (µs)`: 1300 is outside 1000..1250"), "{error}");
    for esc_signal_us in [(2000.0, 1000.0), (1000.0, f64::NAN)] {
        let options = ImportOptions { esc_signal_us: Some(esc_signal_us), ..ImportOptions::default() };
        let error = import(&sample("rcbenchmark.csv"), &options).unwrap_err();
        assert!(matches!(error, ImportError::SignalRange { .. }));
    }
}

#[test]
fn an_esc32_log_is_put_on_its_grid() {
    let Import { experiment, summary } = taken("esc32.csv");
    assert_eq!(summary.format.name, "esc32");
    let record = &experiment.records[0];
    assert_eq!(record.time_s.len(), 700);
    assert_eq!((record.command[0], record.command[699]), (0.15, 0.2));
    assert!(record.voltage_v.is_some() && record.current_a.is_some());
    // Stamps to 16.7 ms of rows every 10 ms; nine rows lost after row 399.
    assert_eq!(summary.timing.rows_missing, 9);
    assert!((summary.timing.rate_hz - 100.0).abs() < 0.02, "{:?}", summary.timing);
    let gap = record.time_s[400] - record.time_s[399];
    assert!((gap - 0.1).abs() < 1e-4, "{gap}");
    let step = record.time_s[351] - record.time_s[350];
    assert!((step - 0.01).abs() < 1e-5, "{step}");
    let residual = summary.timing.residual_rms_s.unwrap();
    assert!((0.003..0.007).contains(&residual), "{residual}");
    assert_eq!(experiment.sample_rate_hz, None, "a gap is no even grid");
}

#[test]
fn text_in_a_number_column_names_file_line_and_column() {
    let message = message(edited("rcbenchmark.csv", 30, ",5000,", ",fast,"));
    assert!(message.contains("log.csv, line 30, column `Motor Electrical Speed (RPM)`: `fast`"), "{message}");
    assert!(message.contains("delete the row"), "{message}");
    for text in ["NaN", "inf", "1,5", "1e999"] {
        let result = edited("esc32.csv", 12, ",15,4", &format!(",\"{text}\",4"));
        let message = self::message(result);
        assert!(message.contains("line 12, column `Duty`"), "{message}");
    }
}

#[test]
fn a_command_missing_in_the_middle_is_an_error() {
    let message = message(edited("rcbenchmark.csv", 60, ",1200,", ",,"));
    assert!(message.contains("line 60, column `ESC signal (µs)`: empty, though rows before"), "{message}");
    let message = self::message(edited("esc32.csv", 60, ",15,", ",,"));
    assert!(message.contains("line 60, column `Duty`: empty"), "{message}");
}

#[test]
fn a_missing_column_is_named() {
    let message = message(edited("esc32.csv", 1, "RPM", "Speed"));
    assert!(message.contains("line 1: column `RPM` is missing"), "{message}");
}

#[test]
fn what_is_no_table_lists_the_known_formats() {
    let message = message(written("nothing\nbut words\n"));
    assert!(message.contains("nothing") && message.contains("RCbenchmark") && message.contains("ESC32"));
}

#[test]
fn bad_time_is_refused() {
    let message = message(edited("esc32.csv", 100, "23:45:59", "23:45:58"));
    assert!(message.contains("line 100") && message.contains("backwards"), "{message}");
    let message = self::message(edited("esc32.csv", 9, "2019-11-07 ", "yesterday "));
    assert!(message.contains("line 9, column `Timestamp`"), "{message}");
    let message = self::message(edited("rcbenchmark.csv", 100, "0.6", "0.1"));
    assert!(message.contains("line 100") && message.contains("two logs"), "{message}");
}

#[test]
fn empty_short_and_missing_files_are_refused() {
    let header = fs::read_to_string(sample("esc32.csv")).unwrap();
    let header = header.lines().next().unwrap();
    assert!(message(written(header)).contains("0 usable row(s)"));
    let one = format!("{header}\n2019-11-07 18:45:58:868,0,0,0,0,0,0\n");
    assert!(message(written(&one)).contains("1 usable row(s)"));
    assert!(message(written("")).contains("the file is empty"));
    let error = import(Path::new("/nowhere/log.csv"), &ImportOptions::default());
    assert!(message(error).contains("cannot be read"));
    let bytes = [b"Timestamp,Duty,RPM\n".as_slice(), &[0xff, 0x02, b',', b'1', b',', b'2', b'\n']].concat();
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("log.csv");
    fs::write(&file, bytes).unwrap();
    assert!(message(import(&file, &ImportOptions::default())).contains("line 2: the byte 0x02"));
}

/// The sample with another number in every row of the electrical speed and of the optical one.
fn with_speeds(electrical: &str, optical: &str) -> Result<Import, ImportError> {
    let text = fs::read_to_string(sample("rcbenchmark.csv")).unwrap();
    let mut lines = text.lines();
    let mut edited = vec![lines.next().unwrap().to_string()];
    for line in lines {
        let mut cells: Vec<&str> = line.splitn(9, ',').collect();
        (cells[6], cells[7]) = (electrical, optical);
        edited.push(cells.join(","));
    }
    written(&edited.join("\n"))
}

#[test]
fn the_optical_speed_stands_in_for_an_electrical_one_that_is_not_there() {
    for electrical in ["", "0"] {
        let log = with_speeds(electrical, "4321").unwrap();
        assert_eq!(log.experiment.records[0].rpm.as_ref().unwrap()[9], 4321.0);
        let taken = |c: &&rotorlead_records::import::ColumnUse| c.taken_as.as_deref() == Some("rpm");
        let column = log.summary.columns.iter().find(taken).unwrap();
        assert_eq!(column.name, "Motor Optical Speed (RPM)");
        assert!(log.summary.notes.iter().all(|note| !note.contains("poles")), "{:?}", log.summary.notes);
    }
    let still = with_speeds("0", "").unwrap();
    assert!(still.experiment.records[0].rpm.as_ref().unwrap().iter().all(|&v| v == 0.0));
    let message = message(with_speeds("", ""));
    assert!(message.contains("column `Thrust (gf)`: empty, as in 223 of 234 rows"), "{message}");
}

#[test]
fn a_log_whose_command_never_changes_says_so() {
    for (name, column) in [("rcbenchmark.csv", 1), ("esc32.csv", 1)] {
        let text = fs::read_to_string(sample(name)).unwrap();
        let mut lines = text.lines();
        let header = lines.next().unwrap();
        let command = header.split(',').position(|cell| cell.trim() == "ESC signal (µs)" || cell.trim() == "Duty");
        let command = command.unwrap_or(column);
        let mut first = None;
        let constant: Vec<String> = lines
            .map(|line| {
                let mut cells: Vec<&str> = line.split(',').collect();
                if let Some(cell) = cells.get_mut(command).filter(|cell| !cell.is_empty()) {
                    *cell = first.get_or_insert(*cell);
                }
                cells.join(",")
            })
            .collect();
        let error = written(&format!("{header}\n{}", constant.join("\n"))).unwrap_err();
        assert!(matches!(error, ImportError::ConstantCommand { .. }), "{name}: {error}");
        assert!(error.to_string().contains("nothing can be identified"), "{error}");
    }
}

#[test]
fn an_empty_file_is_called_empty() {
    for text in ["", "\n\n  \n"] {
        assert!(message(written(text)).contains("the file is empty"));
    }
}

/// What of a changed log an import may be.
fn taken_or_refused(bytes: &[u8]) -> Result<(), TestCaseError> {
    match imported(bytes, &ImportOptions::default()) {
        Ok(Import { experiment, summary }) => {
            let record = &experiment.records[0];
            prop_assert!(record.time_s.is_sorted_by(|a, b| a < b));
            prop_assert_eq!(record.time_s.len(), record.command.len());
            prop_assert_eq!(record.time_s.len(), record.rpm.as_ref().or(record.thrust_n.as_ref()).unwrap().len());
            prop_assert!(record.command.iter().all(|c| (0.0..=1.0).contains(c)));
            let dropped: usize = summary.dropped.iter().map(|d| d.rows).sum();
            prop_assert_eq!(summary.rows_taken + dropped, summary.rows_read);
        }
        Err(error) => prop_assert!(error.help().is_some()),
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    /// Changed bytes, lost rows and cells of any text give an experiment of equal columns or an error with a remedy, and never a
    /// panic.
    #[test]
    fn damaged_logs_of_text_are_taken_or_refused(
        esc32 in any::<bool>(),
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..6),
        rows in prop::collection::vec(any::<prop::sample::Index>(), 0..4),
        cells in prop::collection::vec((any::<prop::sample::Index>(), 0_usize..8, "[-+0-9.eEnaif:, \"]{0,24}"), 0..4),
    ) {
        let name = if esc32 { "esc32.csv" } else { "rcbenchmark.csv" };
        let text = fs::read_to_string(sample(name)).unwrap();
        let mut lines: Vec<Vec<&str>> = text.lines().map(|line| line.split(',').collect()).collect();
        for (line, cell, text) in &cells {
            let line = &mut lines[line.index(200)];
            let cell = cell % line.len();
            line[cell] = text;
        }
        for row in rows {
            let row = row.index(lines.len());
            lines.remove(row);
        }
        let lines: Vec<String> = lines.iter().map(|cells| cells.join(",")).collect();
        let mut bytes = lines.join("\n").into_bytes();
        for (at, byte) in changes {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
        taken_or_refused(&bytes)?;
    }
}
