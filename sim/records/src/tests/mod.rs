//! What is refused, with the report that a user sees, and what comes back unchanged.

mod command_file;
mod long;
mod manifest;
mod round_trip;
mod sampling;
mod table;

use super::{Excitation, Experiment, Record};
use crate::files::FileError;
use crate::files::testing::{Scratch, assert_report};

const MANIFEST: &str = r#"format = 1
name = "stand run 3"
command = "duty"
output = "thrust_n"
[[record]]
file = "u050.csv"
nominal = 0.50
excitation = "free"
"#;

const CSV: &str = "time_s,command,thrust_n\n0.000,0.45,3.1\n0.001,0.55,3.2\n0.002,0.45,3.3\n";

fn read(manifest: &str, csv: &str) -> Result<Experiment, FileError> {
    let scratch = Scratch::new();
    scratch.file("experiment.toml", manifest);
    scratch.file("u050.csv", csv);
    Experiment::read(scratch.path())
}

/// The manifest with one text replaced, which must be in it.
fn edited(from: &str, to: &str) -> String {
    assert!(MANIFEST.contains(from));
    MANIFEST.replace(from, to)
}

#[track_caller]
fn refuses_manifest(manifest: &str, parts: &[&str]) {
    let error = read(manifest, CSV).unwrap_err();
    assert_report(error, parts);
}

#[track_caller]
fn refuses_csv(csv: &str, parts: &[&str]) {
    let error = read(MANIFEST, csv).unwrap_err();
    assert_report(error, parts);
}

/// A record of free excitation with a response of thrust.
fn record(time_s: Vec<f64>) -> Record {
    Record {
        file: "u050.csv".to_owned(),
        nominal: 0.5,
        excitation: Excitation::Free,
        period_s: None,
        amplitude: None,
        compensated: false,
        compensator: None,
        role: None,
        command: (0..time_s.len()).map(|k| (k % 2) as f64).collect(),
        thrust_n: Some(vec![1.0; time_s.len()]),
        time_s,
        rpm: None,
        command_log: None,
        esc_command: None,
        voltage_v: None,
        current_a: None,
        setpoints: crate::Setpoints::default(),
    }
}
