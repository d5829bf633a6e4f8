//! The logs that are in the program: what each is good for holds, and no file of the user's is lost to one.

use std::fs;
use std::path::Path;

use crate::one_command::without_tags;
use crate::stand::{Stand, flowing};

#[test]
fn every_sample_is_written_as_it_is_in_the_sources_and_every_command_for_it_runs() {
    let stand = Stand::empty();
    let listed = stand.json("sample");
    let text = flowing(&stand.run("sample"));
    let samples = listed["samples"].as_array().unwrap();
    assert!(samples.len() >= 4, "{listed}");
    for sample in samples {
        let name = sample["name"].as_str().unwrap();
        assert!(text.contains(name) && text.contains(sample["purpose"].as_str().unwrap()), "{name} is not in {text}");
        let said = stand.run(&format!("sample {name}"));
        let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("../sim/cli/samples").join(name);
        assert!(fs::read(stand.path(name)).unwrap() == fs::read(source).unwrap(), "{name} is another file");
        assert_eq!(sample["bytes"], fs::metadata(stand.path(name)).unwrap().len());
        for command in sample["commands"].as_array().unwrap() {
            let command = command.as_str().unwrap();
            assert!(said.contains(command), "no `{command}` in {said}");
            // No browser of whoever runs the tests is opened.
            stand.run(command.strip_prefix("rotorlead ").unwrap().trim_end_matches(" --open"));
        }
    }
}

#[test]
fn the_samples_are_read_without_a_question_and_show_what_is_said_of_them() {
    let stand = Stand::empty();
    for name in ["staircase", "second-run.csv", "hidden.csv", "chirp.bin"] {
        stand.run(&format!("sample {name}"));
    }
    let state = |measured: &str| stand.json(&format!("identify {measured}"))["judgement"]["state"].clone();
    assert_eq!(state("staircase.csv"), "measure again");
    stand.run("import staircase.csv --out stand");
    stand.run("import second-run.csv --append --role validate --out stand");
    assert_eq!(state("stand"), "ready");
    let named = |log: &str| {
        stand.run(&format!("import {log} --out {log}-folder"));
        let found = stand.json(&format!("diagnose {log}-folder"));
        let kinds =
            found["effects"].as_array().unwrap().iter().map(|effect| effect["kind"].as_str().unwrap().to_owned());
        kinds.collect::<Vec<_>>()
    };
    let (plain, hidden) = (named("staircase.csv"), named("hidden.csv"));
    assert!(!plain.contains(&"slew_limit".to_owned()), "{plain:?}");
    assert!(hidden.contains(&"slew_limit".to_owned()), "{hidden:?}");
    let chirp = stand.json("identify chirp.bin");
    assert!((chirp["points"][0]["time_constant_s"].as_f64().unwrap() - 0.08).abs() < 0.002, "{chirp}");
}

#[test]
fn a_file_of_another_kind_is_replaced_by_force_alone_and_a_sample_by_its_like() {
    let stand = Stand::empty();
    stand.write("staircase.csv", "time_s,command,thrust_n\n0,0.4,1\n");
    let parts = ["`staircase.csv` exists", "a sample would replace it", "another file with --out", "--force"];
    stand.refuses("sample staircase.csv", 1, &parts);
    let parts = ["`staircase.csv` of --out exists", "a sample would replace it", "--force"];
    stand.refuses("sample hidden.csv --out staircase.csv", 1, &parts);
    let said = stand.run("sample hidden.csv --out staircase.csv --force");
    assert!(said.starts_with("Replaced staircase.csv\n"), "{said}");
    // What the program has can be had again.
    stand.run("sample staircase.csv");
    stand.run("sample chirp.bin --out staircase.csv");
    stand.refuses("sample chirp.bin --out no/such", 1, &["there is no folder `no`"]);
    stand.refuses("sample nothing.csv", 2, &["staircase.csv", "chirp.bin"]);
    stand.refuses("sample --out staircase.csv", 2, &["<NAME>"]);
    let moved = stand.run("sample hidden.csv --out other.csv");
    assert!(moved.contains("rotorlead report other.csv --open"), "{moved}");
}

#[test]
fn each_part_of_the_report_of_a_sample_has_a_command_that_runs() {
    let stand = Stand::empty();
    stand.run("sample staircase.csv");
    stand.run("report staircase.csv");
    let page = without_tags(&stand.read("report.html"));
    let commands: Vec<&str> = page.lines().filter_map(|line| line.trim().strip_prefix("rotorlead ")).collect();
    let names: Vec<&str> = commands.iter().map(|command| command.split(' ').next().unwrap()).collect();
    assert_eq!(names, ["report", "import", "identify", "validate", "diagnose", "design", "bandwidth"], "{commands:?}");
    for command in commands {
        stand.run(command);
    }
}
