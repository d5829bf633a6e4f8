//! What a table does not say of itself: what is guessed from its numbers, and what is asked, ready to be typed.

use rotorlead_records::import::ImportOptions;
use rotorlead_records::{Excitation, Record};

use crate::importing::{imported, message};

const ROWS: usize = 400;

/// A staircase of 0.2, 0.4, 0.6 and 0.8.
fn level(row: usize) -> f64 {
    0.2 * (1 + 4 * row / ROWS) as f64
}

/// A table of 100 rows a second: `time` and `command` as text, and newtons or whatever else.
fn table(header: &str, time: impl Fn(f64) -> String, command: impl Fn(f64) -> f64) -> String {
    let row = |row: usize| format!("{},{},{}\n", time(0.01 * row as f64), command(level(row)), 10.0 * level(row));
    format!("{header}\n{}", (0..ROWS).map(row).collect::<String>())
}

fn in_s(time_s: f64) -> String {
    time_s.to_string()
}

fn staircase() -> ImportOptions {
    ImportOptions { excitation: Some(Excitation::Staircase), ..ImportOptions::default() }
}

/// The record, and what is said of it.
fn taken(text: &str) -> (Record, String) {
    let mut found = imported(text.as_bytes(), &staircase()).unwrap();
    (found.experiment.records.remove(0), found.summary.notes.join("\n"))
}

/// The options that are missing, and all that is said.
fn asked(text: &str) -> (Vec<String>, String) {
    let refused = imported(text.as_bytes(), &staircase());
    let missing = refused.as_ref().unwrap_err().missing_options();
    (missing.iter().map(ToString::to_string).collect(), message(refused))
}

#[test]
fn times_since_1970_show_their_unit() {
    type Stamp = fn(f64) -> String;
    let stamps: [(&str, Stamp); 4] = [
        ("s", |time_s| format!("{:.3}", 1_764_400_000.0 + time_s)),
        ("ms", |time_s| format!("{:.0}", 1_764_400_000_000.0 + 1e3 * time_s)),
        ("us", |time_s| format!("{:.0}", 1_764_400_000_000_000.0 + 1e6 * time_s)),
        ("ns", |time_s| format!("{}000", 1_764_400_000_000_000_u64 + (1e6 * time_s) as u64)),
    ];
    for (unit, stamp) in stamps {
        let (record, notes) = taken(&table("timestamp,throttle_percent,thrust_n", stamp, |u| 100.0 * u));
        assert!(record.time_s.iter().enumerate().all(|(row, time)| (time - 0.01 * row as f64).abs() < 2e-6), "{unit}");
        assert!(notes.contains(&format!("guessed to be {unit}: its numbers are times since 1970")), "{notes}");
    }
    // Half an hour since the logger started, in microseconds or nanoseconds: no date, though of the same size.
    for counts in [1e6, 1e9] {
        let stamp = |time_s: f64| format!("{:.0}", counts * (1765.0 + time_s));
        let (missing, _) = asked(&table("timestamp,throttle_percent,thrust_n", stamp, |u| 100.0 * u));
        assert_eq!(missing, ["--column time=timestamp:UNIT"]);
    }
}

#[test]
fn counts_are_offered_in_the_range_that_they_fit() {
    for (most, range) in [(255.0, "0..255"), (4095.0, "0..4095"), (8191.0, "0..8191"), (65_535.0, "0..65535")] {
        let count = |u: f64| (most * u).round();
        let (missing, said) = asked(&table("time_s,throttle,thrust_n", in_s, count));
        assert_eq!(missing, [format!("--column command=throttle:{range}")], "{said}");
        let options =
            ImportOptions { columns: vec![format!("command=throttle:{range}").parse().unwrap()], ..staircase() };
        let found = imported(table("time_s,throttle,thrust_n", in_s, count).as_bytes(), &options).unwrap();
        assert!((found.experiment.records[0].command[0] - count(0.2) / most).abs() < 1e-12);
    }
    // These may be pulses of OneShot125, of 125 to 250 microseconds; and these may be of ten bits, or numbers of DShot.
    for count in [|u: f64| (100.0 + 125.0 * u).round() + 5.0, |u: f64| (1000.0 * u).round()] {
        let (missing, _) = asked(&table("time_s,throttle,thrust_n", in_s, count));
        assert_eq!(missing, ["--column command=throttle:UNIT"]);
    }
}

#[test]
fn what_has_no_known_name_is_asked_for_as_what_it_may_be() {
    let (missing, said) = asked(&table("time_s,throttle_percent,load", in_s, |u| 100.0 * u));
    assert_eq!(missing, ["--column thrust=HEADER:UNIT"]);
    assert!(said.contains("--column rpm=HEADER:UNIT"), "{said}");
    let (missing, said) = asked(&table("stamp,throttle_percent,thrust_n", in_s, |u| 100.0 * u));
    assert_eq!(missing, ["--column time=stamp:UNIT"]);
    assert!(said.contains("`stamp` increases from row to row"), "{said}");
    // What falls and rises is no time, so that it may have none.
    let (missing, said) =
        asked(&table("heat,throttle_percent,thrust_n", |time_s| (time_s * 7.0 % 3.0).to_string(), |u| 100.0 * u));
    assert_eq!(missing, ["--rate HZ"]);
    assert!(said.contains("--column time=HEADER:UNIT") && said.contains("--excitation steady"), "{said}");
}

#[test]
fn a_duty_may_be_called_that() {
    let (record, _) = taken(&table("time_s,throttle_duty,thrust_n", in_s, |u| u));
    assert_eq!((record.command[0], record.command[ROWS - 1]), (0.2, 0.8));
}

#[test]
fn a_motor_that_is_asked_for_and_stands_still_says_which_one_moves() {
    let header = "loopIteration, time (us), axisP[0], vbatLatest (V), amperageLatest (A), motor[0], motor[1], motor[2], eRPM[0], eRPM[1], eRPM[2]";
    let row = |row: usize| {
        let u = level(row);
        format!("{row},{},0,16,3,48,48,{},0,0,{}\n", 5_000_000 + 10_000 * row, (48.0 + 1999.0 * u).round(), 700.0 * u)
    };
    let text = format!("{header}\n{}", (0..ROWS).map(row).collect::<String>());
    let with_motor = |motor| ImportOptions { motor, motor_poles: Some(14), ..staircase() };
    let said = message(imported(text.as_bytes(), &with_motor(Some(1))));
    assert!(said.contains("motor 1 stands still, and motor 3 moves") && said.contains("`--motor 3`"), "{said}");
    let found = imported(text.as_bytes(), &with_motor(None)).unwrap();
    assert!(found.summary.notes.iter().any(|note| note.contains("taken is motor 3")));
}

#[test]
fn an_older_blackbox_without_a_speed_says_where_it_may_be() {
    let row = |row: usize| {
        format!("{row},{},{},{}\n", 10_000 * row, (48.0 + 1999.0 * level(row)).round(), 700.0 * level(row))
    };
    let text = format!("loopIteration, time (us), motor[0], debug[0]\n{}", (0..ROWS).map(row).collect::<String>());
    let said = message(imported(text.as_bytes(), &staircase()));
    assert!(said.contains("'rpm=debug[0]:erpm/100'"), "{said}");
    let columns = vec!["rpm=debug[0]:erpm/100".parse().unwrap()];
    let found = imported(text.as_bytes(), &ImportOptions { columns, motor_poles: Some(14), ..staircase() }).unwrap();
    assert_eq!(found.experiment.records[0].rpm.as_ref().unwrap()[0], 2000.0);
}
