use std::path::Path;

use super::{CSV, MANIFEST, edited, read, refuses_manifest};
use crate::experiment::{Excitation, Experiment, Output, Role};
use crate::files::testing::{Scratch, assert_report};

#[test]
fn every_key_is_read() {
    let scratch = Scratch::new();
    let manifest = r#"
        format = 1
        name = "all"
        command = "duty"
        output = "rpm"
        sample_rate_hz = 1000
        esc_frame_hz = 600
        command_rate_hz = 5000
        [[record]]
        file = "runs/a.csv"
        nominal = 0.5
        excitation = "multisine"
        period_s = 10
        amplitude = 0.05
        compensated = true
        compensator = "compensator.toml"
        role = "validate"
    "#;
    scratch.file("experiment.toml", manifest);
    scratch.file("compensator.toml", "");
    std::fs::create_dir(scratch.path().join("runs")).unwrap();
    let csv = "current_a,rpm,voltage_v,time_s,esc_command,thrust_n,command\n\
               1,2,3,0.000,0.4,5,0.6\n1,2,3,0.001,0.4,-5,0.7\n";
    scratch.file("runs/a.csv", csv);
    let experiment = Experiment::read(scratch.path()).unwrap();
    assert_eq!(experiment.name, "all");
    assert_eq!(experiment.output, Output::Rpm);
    assert_eq!(experiment.sample_rate_hz, Some(1000.0));
    assert_eq!(experiment.esc_frame_hz, Some(600.0));
    assert_eq!(experiment.command_rate_hz, Some(5000.0));
    let record = &experiment.records[0];
    assert_eq!(record.file, "runs/a.csv");
    assert_eq!(record.nominal, 0.5);
    assert_eq!(record.excitation, Excitation::Multisine);
    assert_eq!(record.period_s, Some(10.0));
    assert_eq!(record.amplitude, Some(0.05));
    assert!(record.compensated);
    assert_eq!(record.compensator.as_deref(), Some(Path::new("compensator.toml")));
    assert_eq!(record.role, Some(Role::Validate));
    assert_eq!(record.time_s, [0.0, 0.001]);
    assert_eq!(record.command, [0.6, 0.7]);
    assert_eq!(record.esc_command.as_deref(), Some(&[0.4, 0.4][..]));
    assert_eq!(record.thrust_n.as_deref(), Some(&[5.0, -5.0][..]));
    assert_eq!(record.response(Output::Rpm), Some(&[2.0, 2.0][..]));
    assert_eq!(record.voltage_v.as_deref(), Some(&[3.0, 3.0][..]));
    assert_eq!(record.current_a.as_deref(), Some(&[1.0, 1.0][..]));
}

#[test]
fn a_folder_that_is_missing_or_not_an_experiment_is_named() {
    let scratch = Scratch::new();
    let missing = Experiment::read(&scratch.path().join("run")).unwrap_err();
    assert_report(missing, &["run", "does not exist", "check the path"]);
    let empty = Experiment::read(scratch.path()).unwrap_err();
    assert_report(empty, &["experiment.toml", "does not exist", "rotorlead import"]);
    let file = Experiment::read(&scratch.file("log.csv", CSV)).unwrap_err();
    assert_report(file, &["log.csv", "is not a folder", "holds experiment.toml"]);
}

#[test]
fn a_record_whose_file_is_missing_is_shown_where_it_is_named() {
    let scratch = Scratch::new();
    scratch.file("experiment.toml", MANIFEST);
    let error = Experiment::read(scratch.path()).unwrap_err();
    let parts = ["experiment.toml:6:8", "u050.csv` does not exist", "correct the name"];
    assert_report(error, &parts);
}

#[test]
fn a_compensator_that_is_missing_is_shown_where_it_is_named() {
    let with = edited("\"free\"", "\"free\"\ncompensated = true\ncompensator = \"c.toml\"");
    refuses_manifest(&with, &["experiment.toml:10:15", "c.toml` does not exist", "correct the name"]);
}

#[test]
fn unknown_keys_are_refused() {
    let top = edited("output", "colour = 1\noutput");
    refuses_manifest(&top, &["experiment.toml:4:1", "`colour`", "remove `colour`"]);
    let in_record = edited("nominal", "nominel");
    refuses_manifest(&in_record, &["experiment.toml:7:1", "did you mean `nominal`"]);
}

#[test]
fn missing_keys_are_refused() {
    for key in ["format", "name", "command", "output", "file", "nominal", "excitation"] {
        let start = MANIFEST.find(key).unwrap();
        let end = start + MANIFEST[start..].find('\n').unwrap() + 1;
        let without = [&MANIFEST[..start], &MANIFEST[end..]].concat();
        refuses_manifest(&without, &["experiment.toml:", &format!("add `{key}`")]);
    }
}

#[test]
fn another_format_or_command_is_refused() {
    let parts = ["experiment.toml:1:10", "layout 2", "version that wrote"];
    refuses_manifest(&edited("format = 1", "format = 2"), &parts);
    let parts = ["experiment.toml:3:11", "`us`", "expected `duty`"];
    refuses_manifest(&edited("\"duty\"", "\"us\""), &parts);
}

#[test]
fn an_experiment_without_records_is_refused() {
    let top = MANIFEST.split("[[record]]").next().unwrap();
    refuses_manifest(top, &["experiment.toml:1:1", "no record", "add a [[record]]"]);
}

#[test]
fn rates_are_positive_and_finite() {
    for key in ["sample_rate_hz", "esc_frame_hz", "command_rate_hz"] {
        for rate in ["0", "-600", "nan", "inf"] {
            let text = edited("[[record]]", &format!("{key} = {rate}\n[[record]]"));
            refuses_manifest(&text, &["experiment.toml:5:", key, "above 0", "give a value"]);
        }
    }
}

#[test]
fn a_command_slower_than_the_rows_is_refused() {
    let text = edited("[[record]]", "sample_rate_hz = 1000\ncommand_rate_hz = 500\n[[record]]");
    refuses_manifest(&text, &["experiment.toml:6:19", "slower than the rows", "remove it"]);
}

#[test]
fn nominal_and_amplitude_have_a_range() {
    for nominal in ["-0.1", "1.1", "50", "nan"] {
        let text = edited("0.50", nominal);
        refuses_manifest(&text, &["experiment.toml:7:11", "`record` 1, `nominal`", "0 to 1"]);
    }
    for amplitude in ["0.0", "-0.1", "5", "nan"] {
        let text = format!("{MANIFEST}amplitude = {amplitude}\n");
        refuses_manifest(&text, &["experiment.toml:9:13", "`amplitude`", "give a value"]);
    }
}

#[test]
fn a_periodic_record_has_a_positive_period() {
    for excitation in ["multisine", "square"] {
        let text = edited("free", excitation);
        refuses_manifest(&text, &["experiment.toml:5:1", "`period_s`", "add `period_s`"]);
    }
    let text = format!("{MANIFEST}period_s = 0\n");
    refuses_manifest(&text, &["experiment.toml:9:12", "`period_s`", "above 0"]);
}

#[test]
fn compensated_and_compensator_go_together() {
    let text = format!("{MANIFEST}compensated = true\n");
    refuses_manifest(&text, &["experiment.toml:9:15", "add `compensator`"]);
    let text = format!("{MANIFEST}compensator = \"c.toml\"\n");
    refuses_manifest(&text, &["experiment.toml:9:15", "set `compensated = true`"]);
}

#[test]
fn files_stay_inside_the_folder() {
    for name in ["../u050.csv", "/tmp/u050.csv", "", "a/../u050.csv"] {
        let text = edited("u050.csv", name);
        refuses_manifest(&text, &["experiment.toml:6:8", "`file`", "put the file in the folder"]);
    }
    let text = format!("{MANIFEST}compensated = true\ncompensator = \"../c.toml\"\n");
    refuses_manifest(&text, &["experiment.toml:10:15", "`compensator`", "without `..`"]);
}

#[test]
fn a_file_named_twice_is_refused() {
    let record = &MANIFEST[MANIFEST.find("[[record]]").unwrap()..];
    let text = format!("{MANIFEST}{record}");
    refuses_manifest(&text, &["experiment.toml:10:8", "`record` 2, `file`", "count double"]);
}

#[test]
fn a_constant_command_is_read_and_known_as_such() {
    let moving = read(MANIFEST, CSV).unwrap();
    assert!(!moving.records[0].is_constant());
    let constant = read(MANIFEST, &CSV.replace("0.55", "0.45")).unwrap();
    assert!(constant.records[0].is_constant());
}
