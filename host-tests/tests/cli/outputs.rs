//! Where results go: never over what is read, never twice to one place, and all of a command or none.

use std::fs;

use crate::stand::Stand;

fn simulated() -> Stand {
    let stand = Stand::new();
    stand.run("simulate --model model.toml --plan plan.toml --out sim");
    stand
}

#[test]
fn no_output_takes_the_place_of_what_is_read() {
    let stand = simulated();
    stand.run("design --kind lead --model model.toml --out sim/lead.toml");
    stand.edit(
        "sim/experiment.toml",
        "role = \"validate\"",
        "compensated = true\ncompensator = \"lead.toml\"\nrole = \"validate\"",
    );
    stand.write("compensated.toml", "compensator = \"sim/lead.toml\"\n".to_owned() + crate::stand::PLAN);
    stand.run("identify sim --out sim/model.toml");
    for arguments in [
        "diagnose sim --redesign --out-compensator sim/u050_square.csv",
        "diagnose sim --redesign --out-compensator sim/experiment.toml",
        "diagnose sim --model model.toml --redesign --out-compensator model.toml",
        "identify sim --out sim/lead.toml",
        "check sim --json sim/lead.toml",
        "simulate --model model.toml --plan compensated.toml --out again --json sim/lead.toml",
        "report sim --out sim/model.toml --no-diagnosis",
    ] {
        stand.refuses(arguments, 2, &["written over", "name another file"]);
    }
    for arguments in ["identify sim --out m.toml --figures sim", "demo --out sim"] {
        stand.refuses(arguments, 2, &["`experiment.toml` lies", "name another folder"]);
    }
    // A model that is made of the records may be made again.
    stand.run("identify sim --out sim/model.toml");
}

#[test]
fn what_a_fleet_is_compared_from_is_not_written_over() {
    let stand = Stand::new();
    fs::create_dir_all(stand.path("fleet/a")).unwrap();
    stand.write("fleet/fleet.csv", "log,motor\na,M1\n");
    stand.write("fleet/a/model.toml", crate::stand::MODEL);
    stand.write("fleet/a/diagnose.json", "{}");
    for output in ["--json fleet/a/model.toml", "--report fleet/a/diagnose.json", "--json fleet/fleet.csv"] {
        stand.refuses(&format!("fleet fleet {output}"), 2, &["written over", "name another file"]);
    }
    stand.refuses("fleet fleet --figures fleet", 2, &["`fleet.csv` lies"]);
}

#[test]
fn two_outputs_have_two_places() {
    let stand = simulated();
    for (arguments, parts) in [
        ("diagnose sim --out-model both --out-plan ./both", ["--out-plan and --out-model", "different files"]),
        (
            "diagnose sim --redesign --out-compensator both --json sim/../both",
            ["--json and --out-compensator", "different files"],
        ),
        ("import log.csv --out new --json new/experiment.toml", ["--out writes", "another folder"]),
        ("identify sim --out found/tau.csv --figures found", ["--figures writes", "another folder"]),
        ("simulate --model model.toml --out new --figures new", ["--figures and --out", "different files"]),
        ("new first --json first/plan.toml", ["DIR writes", "another folder"]),
        (
            "device --port tcp:127.0.0.1:1 --json new/u050.csv inject --model model.toml --out new",
            ["--out writes", "new"],
        ),
        (
            "excite --band 0.1..2 --rate 100 --detection --realizations 2 --out a.csv --json a_2.csv",
            ["--out and --json", "different files"],
        ),
    ] {
        stand.refuses(arguments, 2, &parts);
    }
    stand.run("new first --json first/made.json");
    stand.run("validate sim --model model.toml --json /dev/null --report /dev/null");
}

#[cfg(unix)]
#[test]
fn a_command_that_finds_no_room_leaves_all_outputs_as_they_were() {
    let stand = simulated();
    stand.write("old.toml", crate::stand::MODEL);
    stand.write("old.json", r#"{"generator": "rotorlead 0"}"#);
    for (blocks, arguments) in [
        (8, "identify sim --out old.toml --json old.json --figures found"),
        (8, "identify sim --out old.toml --report old.html"),
        (8, "bandwidth --model model.toml --figures found --json old.json"),
        (8, "man --out found"),
    ] {
        let before = stand.everything();
        let (status, report) = crate::interrupted::with_little_room(&stand, blocks, arguments);
        assert_eq!(status, Some(1), "`{arguments}`: {report}");
        assert!(report.contains("cannot write"), "{report}");
        let names = |all: Vec<(std::path::PathBuf, _)>| all.into_iter().map(|(path, _)| path).collect::<Vec<_>>();
        let after = stand.everything();
        assert!(after == before, "`{arguments}` leaves {:?}", names(after));
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_terminal_that_closes_does_not_end_what_nohup_started() {
    let stand = simulated();
    let program = stand.command("").get_program().to_owned();
    let script = "trap '' HUP; \"$0\" diagnose sim --out-model found.toml & sleep 0.2; kill -HUP $!; wait $!";
    let mut shell = std::process::Command::new("sh");
    let status = shell.args(["-c", script]).arg(program).current_dir(stand.path(".")).status().unwrap();
    assert_eq!(status.code(), Some(0));
    assert!(stand.path("found.toml").exists());
}

#[cfg(target_os = "linux")]
#[test]
fn a_system_without_threads_to_give_is_no_panic() {
    let stand = simulated();
    for arguments in [
        "identify sim --out found.toml --figures found",
        "simulate --model model.toml --plan plan.toml --out again",
        "check sim",
    ] {
        // Each thread asks for room that there is not; what the program does alone needs none of it.
        let output = stand.command(arguments).env("RUST_MIN_STACK", "1000000000000000").output().unwrap();
        let report = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(0), "`{arguments}`: {report}");
    }
}
