//! A record that stays on disk gives the same rows, and shows the same errors, as one that is read.

use std::fmt::Write as _;

use super::super::{Experiment, LongRecord, Record, RowCount};
use crate::files::FileError;
use crate::files::testing::{Scratch, assert_report, report};

const MANIFEST: &str = r#"format = 1
name = "long run"
command = "duty"
output = "thrust_n"
sample_rate_hz = 1000
[[record]]
file = "u050.csv"
nominal = 0.50
excitation = "multisine"
period_s = 10.0
"#;

/// Rows in the file: several blocks of them.
const ROWS: usize = 150_000;

/// Line, counted from one, of row `k`, counted from zero.
fn line(k: usize) -> usize {
    k + 2
}

fn csv() -> String {
    let mut text = String::from("command,time_s,esc_command,thrust_n\n");
    for k in 0..ROWS {
        let x = k as f64;
        writeln!(text, "{:.6},{:.3},{:.4},{}", 0.5 + 0.1 * x.sin(), x / 1000.0, 0.5 + 0.2 * x.cos(), (0.1 * x).sin())
            .unwrap();
    }
    text
}

/// Replaces row `k`.
fn with_row(csv: &str, k: usize, row: &str) -> String {
    let mut lines: Vec<_> = csv.lines().collect();
    lines[line(k) - 1] = row;
    lines.join("\n") + "\n"
}

struct Folder(Scratch);

impl Folder {
    fn new(csv: impl AsRef<[u8]>) -> Self {
        let scratch = Scratch::new();
        scratch.file("experiment.toml", MANIFEST);
        scratch.file("u050.csv", csv);
        Self(scratch)
    }

    fn short(&self) -> Result<Record, FileError> {
        let (mut experiment, long) = Experiment::read_except_long(self.0.path(), u64::MAX)?;
        assert!(long.is_empty());
        Ok(experiment.records.remove(0))
    }

    fn long(&self) -> LongRecord {
        let (experiment, mut long) = Experiment::read_except_long(self.0.path(), 1000).unwrap();
        assert!(experiment.records.is_empty());
        long.remove(0)
    }
}

/// All rows of a long record in memory, and how many blocks they came in.
fn collected(long: &LongRecord) -> Result<(Record, RowCount, usize), FileError> {
    let mut record = Record { thrust_n: Some(vec![]), esc_command: Some(vec![]), ..long.header.clone() };
    let mut blocks = 0;
    let count = long.for_each_block(|rows| {
        assert_eq!(rows.rows_before, record.time_s.len());
        record.time_s.extend(rows.time_s);
        record.command.extend(rows.command);
        record.thrust_n.as_mut().unwrap().extend(rows.response);
        record.esc_command.as_mut().unwrap().extend(rows.esc_command.unwrap());
        blocks += 1;
    })?;
    Ok((record, count, blocks))
}

#[test]
fn the_rows_are_those_of_a_record_in_memory() {
    let plain = csv();
    for text in [
        plain.clone(),
        plain.trim_end().to_owned(),
        format!("\u{feff}{plain}\n\r\n\n"),
        plain.replace('\n', "\r\n"),
        // Not plain numbers: a CSV reader's.
        with_row(&plain, 100_000, "\"0.5\", 100 ,\t0.5,1"),
    ] {
        let folder = Folder::new(&text);
        let (record, count, blocks) = collected(&folder.long()).unwrap();
        assert!(record == folder.short().unwrap());
        assert!(blocks > 3, "{blocks} blocks");
        assert_eq!(count, RowCount { rows: ROWS, first_s: 0.0, last_s: (ROWS - 1) as f64 / 1000.0 });
        assert_eq!(folder.long().row_count_by_lines().unwrap(), count);
    }
}

#[test]
fn lines_that_are_no_rows_are_miscounted_but_not_misread() {
    let plain = csv();
    let blank = with_row(&plain, 70_000, "\n0.5,70,0.5,1");
    let folder = Folder::new(&blank);
    let long = folder.long();
    assert_eq!(long.row_count_by_lines().unwrap().rows, ROWS + 1);
    assert_eq!(collected(&long).unwrap().1.rows, ROWS);
}

#[test]
fn an_error_is_reported_as_that_of_a_record_in_memory() {
    let plain = csv();
    for (row, name) in [(3, "0.5,0.003,0.5,3.2 N"), (90_000, "0.5,90,0.5,x"), (149_990, "0.5,149.99,0.5,")] {
        let faults = [
            name.to_owned(),
            format!("1.5,{},0.5,1", row as f64 / 1000.0),
            format!("0.5,{},0.5", row as f64 / 1000.0),
            format!("0.5,{},0.5,inf", row as f64 / 1000.0),
            format!("0.5,{},0.5,1", row as f64 / 1000.0 - 0.001),
            format!("0.5,{},0.5,1", row as f64 / 1000.0 - 0.5).replace("0.5,-", "0.5,-1"),
        ];
        for fault in faults {
            let folder = Folder::new(with_row(&plain, row, &fault));
            let expected = report(&folder.short().unwrap_err());
            assert!(expected.contains(&format!("u050.csv:{}:", line(row))), "{expected}");
            assert_eq!(report(&collected(&folder.long()).unwrap_err()), expected, "{fault}");
        }
    }
    let mut bytes = plain.clone().into_bytes();
    let bad = bytes.len() - 100;
    bytes[bad] = 0xff;
    let folder = Folder::new(bytes);
    assert_eq!(report(&collected(&folder.long()).unwrap_err()), report(&folder.short().unwrap_err()));
    for header in ["command,time_s,esc_command,thrust\n", "command,esc_command,thrust_n\n"] {
        let folder = Folder::new(header.to_owned() + plain.split_once('\n').unwrap().1);
        let expected = report(&folder.short().unwrap_err());
        assert_eq!(report(&collected(&folder.long()).unwrap_err()), expected);
        assert_eq!(report(&folder.long().row_count_by_lines().unwrap_err()), expected);
    }
}

#[test]
fn times_that_contradict_the_stated_rate_are_shown() {
    let plain = csv();
    let late = with_row(&plain, 120_000, "0.5,120.0006,0.5,1");
    let folder = Folder::new(&late);
    let place = format!("u050.csv:{}:5", line(120_000));
    assert_report(folder.short().unwrap_err(), &[&place]);
    let parts = [place.as_str(), "row 120001", "0.0005999", "`sample_rate_hz` of experiment.toml, 1000"];
    assert_report(collected(&folder.long()).unwrap_err(), &parts);
    let near = Folder::new(with_row(&plain, 120_000, "0.5,120.00004,0.5,1"));
    assert!(near.short().is_ok() && collected(&near.long()).is_ok());
}

#[test]
fn times_that_are_no_motors_are_refused_as_those_of_a_record_in_memory() {
    type Clock = fn(usize) -> f64;
    let cases: [(Clock, &str); 3] = [
        (|k| if k < 120_000 { k as f64 / 1000.0 } else { 3600.0 + k as f64 / 1000.0 }, "the clock jumps by 3600.001"),
        (|k| k as f64, "rows come every 1 s, and no motor shows"),
        (|k| k as f64 * 1e-8, "rows come every 1e-8 s, faster than any logger"),
    ];
    for (time_s, part) in cases {
        let rows: String = (0..ROWS).map(|k| format!("{},0.5,1\n", time_s(k))).collect();
        let folder = Folder::new(format!("time_s,command,thrust_n\n{rows}"));
        folder.0.file("experiment.toml", MANIFEST.replace("sample_rate_hz = 1000\n", ""));
        let expected = report(&folder.short().unwrap_err());
        assert!(expected.contains(part), "{expected}");
        assert_eq!(report(&folder.long().for_each_block(|_| ()).unwrap_err()), expected);
    }
}
