use super::{CSV, edited, read};
use crate::Excitation;
use crate::experiment::Experiment;
use crate::files::FileError;
use crate::files::testing::{Scratch, assert_report};

/// An experiment whose record names a command file; `rows` is its CSV file.
fn with_commands(excitation: &str, rows: &str, commands: &str) -> Result<Experiment, FileError> {
    let scratch = Scratch::new();
    let manifest = edited("file = \"u050.csv\"\n", "file = \"u050.csv\"\ncommand_file = \"u050_command.csv\"\n");
    scratch.file("experiment.toml", manifest.replace("\"free\"", excitation));
    scratch.file("u050.csv", rows);
    scratch.file("u050_command.csv", commands);
    let inspection = Experiment::inspect(scratch.path());
    assert_eq!((inspection.unnamed, inspection.unreadable.len() > 1), (vec![], false));
    Experiment::read(scratch.path())
}

const ROWS: &str = "time_s,thrust_n\n0.000,3.1\n0.020,3.2\n0.040,3.3\n0.060,3.4\n";
const COMMANDS: &str = "time_s,command\n-0.005,0.2\n0.005,0.2\n0.015,0.4\n0.025,0.4\n0.030,0.6\n";

#[test]
fn rows_without_a_command_have_that_of_its_file() {
    let steps = with_commands("\"free\"", ROWS, COMMANDS).unwrap().records.remove(0);
    assert_eq!(steps.command, [0.2, 0.4, 0.6, 0.6]);
    // The file repeats its commands every 10 ms, and each changed up to that before its stamp.
    let (times, commands) = steps.command_changes(0..4).unwrap();
    assert_eq!(commands, [0.2, 0.4, 0.6]);
    assert!(times.iter().zip([0.0, 0.010, 0.025]).all(|(time, exact)| (time - exact).abs() < 1e-12), "{times:?}");
    // A chirp's is the mean of each row, and is not to be held.
    let chirp = with_commands("\"chirp\"", ROWS, COMMANDS).unwrap().records.remove(0);
    assert_eq!((chirp.excitation, chirp.command_changes(0..4)), (Excitation::Chirp, None));
    assert!((chirp.command[0] - 0.25).abs() < 1e-12, "{:?}", chirp.command);
}

#[test]
fn what_contradicts_a_command_file_is_shown() {
    let contradicting = "time_s,command,thrust_n\n0.000,0.2,3.1\n0.020,0.2,3.2\n0.040,0.6,3.3\n";
    let error = with_commands("\"free\"", contradicting, COMMANDS).unwrap_err();
    assert_report(
        error,
        &["the command is 0.2, and `u050_command.csv` has 0.4 at that time", "u050.csv", "leave the column out"],
    );
    let late = COMMANDS.replace("-0.005", "0.001");
    let error = with_commands("\"free\"", ROWS, &late).unwrap_err();
    assert_report(error, &["the first command is at 0.001 s", "u050_command.csv", "in force at the first row"]);
    let error = with_commands("\"free\"", ROWS, "time_s,duty\n0,0.2\n1,0.3\n").unwrap_err();
    assert_report(error, &["u050_command.csv", "column `duty` is not known"]);
}

#[test]
fn a_command_file_that_is_missing_or_a_record_is_named() {
    let key =
        |name: &str| edited("file = \"u050.csv\"\n", &format!("file = \"u050.csv\"\ncommand_file = \"{name}\"\n"));
    assert_report(read(&key("none.csv"), CSV).unwrap_err(), &["none.csv` does not exist", "command_file"]);
    assert_report(read(&key("u050.csv"), CSV).unwrap_err(), &["`u050.csv` is named twice", "command_file"]);
    assert_report(read(&key("../x.csv"), CSV).unwrap_err(), &["`../x.csv` is not the name of a file inside"]);
}
