//! Where the words go, how they look, and what the exit status says.

use std::io::Read as _;
use std::process::{Command as Process, Stdio};

use clap::CommandFactory as _;
use rotorlead_cli::Arguments;

use crate::stand::{Stand, flowing, program, report};

/// Commands without `--json`: what they print is a script, a page or an address.
const WITHOUT_JSON: [&str; 3] = ["completions", "man", "serve"];

/// Every command that the program has.
fn commands() -> Vec<String> {
    let program = Arguments::command();
    let names: Vec<String> = program.get_subcommands().map(|command| command.get_name().to_owned()).collect();
    assert!(names.len() >= 15, "{names:?}");
    names
}

#[test]
fn a_report_is_not_colored_and_keeps_paths_and_sentences_whole_when_piped() {
    let stand = Stand::new();
    let name = format!("{}-with-hyphens-and spaces.toml", "long/".repeat(60));
    let assert = program().args(["bandwidth", "--model", &name]).assert().code(1);
    let report = report(&assert);
    assert!(report.contains(&name), "the path is broken:\n{report}");
    assert!(!report.contains('\u{1b}'), "colored:\n{report}");
    drop(stand);
}

#[test]
fn every_command_refuses_an_unknown_option_as_wrong_use() {
    for command in commands() {
        Stand::new().refuses(&format!("{command} --no-such-option"), 2, &["--no-such-option", "--help"]);
    }
    Stand::new().refuses("--quiet", 2, &["Usage: rotorlead"]);
    Stand::new().refuses("identfy", 2, &["identfy", "identify"]);
}

#[test]
fn help_says_what_every_command_does() {
    let stand = Stand::new();
    let overview = stand.run("--help");
    assert!(overview.contains("Exit status: 0 done, 1 failed, 2 wrong use, 129 hung up, 130 interrupted,"));
    for command in commands() {
        let help = stand.run(&format!("{command} --help"));
        let purpose = flowing(help.split("\n\n").next().unwrap());
        assert!(flowing(&overview).contains(&purpose), "`{purpose}` is not in:\n{overview}");
        let has_json = help.contains("--json <FILE>");
        assert_eq!(has_json, !WITHOUT_JSON.contains(&command.as_str()), "{help}");
        assert!(help.lines().all(|line| line.chars().count() <= 100), "too wide:\n{help}");
    }
}

#[test]
fn help_says_units_and_defaults() {
    for (command, parts) in [
        ("demo", &["[default: demo-out]", "Seed", "[default: 1]", "0.02 N"][..]),
        ("excite", &["Band in hertz", "0.1..30", "Period in seconds", "[default: 10]", "[default: 5000]", "0..1"]),
        ("simulate", &["the paper's experiment unless given", "instead of the plan's"]),
        (
            "import",
            &["microseconds", "1000..2000 unless given", "the log's file name, and of several logs the folder's"],
        ),
        ("identify", &["[default: auto]", "experiment's folder"]),
        ("validate", &["%", "experiment's folder"]),
        ("compare", &["95 %", "a model, an experiment's folder, or a log"]),
        ("design", &["<RAD_S>", "rad/s", "<HZ>", "5000 Hz unless given", "1/sqrt(2) unless given"]),
        ("vehicle", &["a quadrotor of 450 mm unless given", "Table 1 unless given", "docs/vehicle.md"]),
        ("bandwidth", &["3 dB", "rad/s", "<HZ>", "a lead is designed from the model"]),
    ] {
        let help = flowing(&Stand::new().run(&format!("{command} --help")));
        for part in parts {
            assert!(help.contains(part), "no `{part}` in the help of {command}:\n{help}");
        }
    }
}

#[test]
fn a_reader_that_stops_early_is_no_failure() {
    let stand = Stand::new();
    for arguments in ["bandwidth --model model.toml", "bandwidth --model model.toml --json -", "--help"] {
        let program = stand.command(arguments).get_program().to_owned();
        let mut child = Process::new(program)
            .current_dir(stand.path("."))
            .args(arguments.split(' '))
            .stdout(closed_pipe())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut report = String::new();
        child.stderr.take().unwrap().read_to_string(&mut report).unwrap();
        assert_eq!(child.wait().unwrap().code(), Some(0), "{arguments}: {report}");
        assert_eq!(report, "", "{arguments}");
    }
}

/// The end of a pipe that nobody reads.
fn closed_pipe() -> Stdio {
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    writer.into()
}

#[cfg(target_os = "linux")]
#[test]
fn output_that_cannot_be_written_is_a_failure() {
    let stand = Stand::new();
    let full = std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
    let program = stand.command("").get_program().to_owned();
    let arguments = ["bandwidth", "--model", "model.toml"];
    let output = Process::new(program).current_dir(stand.path(".")).args(arguments).stdout(full).output().unwrap();
    let report = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{report}");
    assert!(report.contains("cannot write to standard output") && report.contains("No space left"), "{report}");
}

#[test]
fn the_json_file_and_standard_output_are_the_same_and_the_text_stays() {
    let stand = Stand::new();
    let text = stand.run("bandwidth --model model.toml");
    let printed = stand.run("bandwidth --model model.toml --json -");
    let beside = stand.run("bandwidth --model model.toml --json b.json");
    assert_eq!(text, beside);
    let read = |text: &str| serde_json::from_str::<serde_json::Value>(text).unwrap();
    let mut file = read(&stand.read("b.json"));
    // In a file is by whom it was written.
    let generator = file.as_object_mut().unwrap().remove("generator").unwrap();
    assert!(generator.as_str().unwrap().starts_with("rotorlead "), "{generator}");
    assert_eq!(file, read(&printed));
    // Also into a folder that the command makes itself.
    stand.run("new first --json first/new.json");
    assert!(serde_json::from_str::<serde_json::Value>(&stand.read("first/new.json")).unwrap().is_object());
}

#[test]
fn nothing_but_json_is_on_standard_output_of_any_command() {
    let stand = Stand::new();
    let log = concat!(env!("CARGO_MANIFEST_DIR"), "/../sim/records/tests/data/esc32.csv");
    for arguments in [
        "simulate --model model.toml --plan plan.toml --out sim",
        "identify sim --out found.toml",
        "validate sim --model found.toml",
        "design --kind lead --model found.toml --out c.toml",
        "bandwidth --model found.toml --compensator c.toml",
        "excite --band 0.1..2 --rate 100 --starts 1",
        &format!("import {log} --out imported"),
        "vehicle --airframe airframe.toml --model model.toml",
        "demo",
        "sample",
        "sample staircase.csv",
    ] {
        let assert = stand.command(&format!("{arguments} --json -")).assert().code(0);
        assert_eq!(report(&assert), "", "{arguments}");
        let output = &assert.get_output().stdout;
        assert!(serde_json::from_slice::<serde_json::Value>(output).unwrap().is_object(), "{arguments}");
    }
}
