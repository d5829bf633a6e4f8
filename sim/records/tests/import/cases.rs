//! Small logs of kinds that came out wrong, each with what is right. They are looked for where [`rotorlead_records::shared_data`] says.

use rotorlead_records::import::{Import, ImportError, ImportOptions, import};
use rotorlead_records::shared_data::data;
use rotorlead_records::{Excitation, Record};

/// The log of a case, with these columns stated; `None` where it is not there.
fn imported(log: &str, excitation: Option<Excitation>, columns: &[&str]) -> Option<Result<Import, ImportError>> {
    let columns = columns.iter().map(|column| column.parse().unwrap()).collect();
    let options = ImportOptions { excitation, columns, ..ImportOptions::default() };
    Some(import(&data(&format!("cases/{log}"))?, &options))
}

fn staircase(log: &str, columns: &[&str]) -> Option<Record> {
    let found = imported(log, Some(Excitation::Staircase), columns)?;
    Some(found.unwrap_or_else(|error| panic!("{log}: {error}")).experiment.records.remove(0))
}

#[test]
fn a_byte_of_windows_1252_in_a_remark_is_read() {
    let Some(record) = staircase("latin1-byte-in-comment/log.csv", &[]) else { return };
    assert!(record.time_s.len() > 100 && record.rpm.is_some());
}

#[test]
fn a_speed_that_an_esc_reports_is_no_command() {
    let Some(record) = staircase("esc-rpm-called-command/log.csv", &[]) else { return };
    assert_eq!(record.command[0], 0.2);
    assert_eq!(record.rpm.unwrap()[0], 485.0);
}

#[test]
fn series_of_one_row_each_are_put_together() {
    let columns = ["time=__time:s", "command=/motor/command:duty", "rpm=/motor/rpm:rpm"];
    let Some(record) = staircase("interleaved-series/log.csv", &columns) else { return };
    assert_eq!((record.command[0], record.rpm.unwrap()[0]), (0.3, 5988.0));
}

#[test]
fn numbers_of_dshot_below_its_range_are_orders() {
    let Some(record) = staircase("dshot-order-blocks-guess/log.csv", &[]) else { return };
    assert_eq!(record.command.iter().copied().fold(1.0, f64::min), 0.0);
}

#[test]
fn the_motor_that_moves_is_taken() {
    let Some(found) = imported("motor-2-moves/log.bin", None, &[]) else { return };
    let Import { experiment, summary } = found.unwrap();
    assert!(experiment.records[0].command.iter().any(|command| *command > 0.1));
    assert!(summary.notes.iter().any(|note| note.contains("taken is motor 2")), "{:?}", summary.notes);
}

#[test]
fn columns_of_a_matlab_file_are_stated() {
    let columns = ["command=u:duty", "rpm=y:rpm", "time=t:s"];
    let Some(record) = staircase("mat-column-ignored/log.mat", &columns) else { return };
    assert!(record.time_s.len() > 1000 && record.rpm.is_some());
    assert!(record.command.iter().all(|command| (0.0..=1.0).contains(command)));
}

#[test]
fn a_random_binary_command_is_seen() {
    let Some(found) = imported("prbs-not-named/log.csv", None, &["command=command:duty"]) else { return };
    let Import { experiment, summary } = found.unwrap();
    assert_eq!(experiment.records[0].excitation, Excitation::Random);
    assert!(summary.notes.iter().any(|note| note.contains("random, as its switching shows")), "{:?}", summary.notes);
}

#[test]
fn of_two_speeds_the_one_is_taken_that_the_thrust_agrees_with() {
    let columns = ["command=ESC signal:dshot"];
    let Some(found) = imported("slower-of-two-speeds/log.csv", Some(Excitation::Staircase), &columns) else { return };
    let Import { experiment, summary } = found.unwrap();
    let most = experiment.records[0].rpm.as_ref().unwrap().iter().copied().fold(0.0, f64::max);
    assert!((41_000.0..43_000.0).contains(&most), "{most}: the optical one reads 4391 rad/s");
    assert!(summary.notes.iter().any(|note| note.contains("0.857 = 6/7")), "{:?}", summary.notes);
}
