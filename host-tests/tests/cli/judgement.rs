//! One judgement: every command says of a motor what the others say, in the same words.

use std::fs;
use std::path::{Path, PathBuf};
use std::thread;

use serde_json::Value;

use crate::stand::{Stand, flowing};

/// Logs with how they are imported.
fn logs() -> Vec<(PathBuf, &'static str)> {
    let own = Path::new(env!("CARGO_MANIFEST_DIR")).join("../sim/tests/data");
    let mut logs = vec![
        (own.join("rcbenchmark.csv"), ""),
        (own.join("esc32.csv"), "--excitation staircase"),
        (own.join("chirp.bin"), ""),
    ];
    let shared = [
        ("alspitz_esc_test/Log_2019-11-09_181347.csv", "--excitation staircase"),
        ("alspitz_esc_test/f40_steps_5-2.csv", "--excitation staircase"),
        ("alspitz_esc_test/esc32v3_f60-1.csv", "--excitation staircase"),
        ("sar_simulation/micro_2023-12-17_162234.csv", "--excitation staircase"),
        ("sar_simulation/so_v5_2023-12-13_130935.csv", "--excitation staircase"),
        ("cases/ramp-called-usable/log.csv", "--excitation staircase --column command=command:duty"),
        ("cases/thrust-square-called-unequal-lags/log.csv", "--excitation staircase --column command=command:duty"),
    ];
    logs.extend(shared.into_iter().filter_map(|(name, options)| Some((host_tests::data(name)?, options))));
    logs
}

/// Asserts that every command judges the experiment `stand` alike, and gives the word.
#[track_caller]
fn judged_alike(stand: &Stand, name: &str) -> Value {
    let identified = stand.json("identify stand --out found.toml")["judgement"].clone();
    let word = identified["state"].as_str().unwrap().to_owned();
    let headline = stand.run("identify stand --out found.toml");
    let headline = headline.rsplit("\n\n").next().unwrap().replace('\n', " ");
    assert!(headline.contains(&format!(": {word}")), "{name}: {headline}");
    for command in
        ["validate stand --model found.toml --report page.html", "report stand --no-diagnosis --out page.html"]
    {
        assert_eq!(stand.json(command)["judgement"], identified, "{name}: `{command}`");
        let page = stand.read("page.html");
        let says = page.contains(&format!("Judged: {word}")) || page.contains(&format!(": {word}</p>"));
        assert!(says, "{name}: `{command}`");
    }
    // Without records they say what the file of the model says.
    let says = |found: &Value| found["warnings"].to_string().contains(&format!("as {word}"));
    let found = stand.json("bandwidth --model found.toml");
    assert_eq!(says(&found), word != "ready", "{name}: {}", found["warnings"]);
    for (purpose, key) in [("force", "force"), ("rate-loop", "rate_loop")] {
        let command = format!("design --model found.toml --purpose {purpose} --out c.toml --json -");
        let output = stand.command(&command).output().unwrap();
        let expected = &identified["recommend"][key];
        if !output.status.success() {
            // Without a kind nothing is designed that is not recommended.
            let said = flowing(&String::from_utf8(output.stderr).unwrap());
            let why = expected["why"].as_str().unwrap();
            assert!(said.contains("none is recommended for a") && said.contains(why), "{name}: `{command}`: {said}");
            assert_eq!(expected["kind"], "none", "{name}: `{command}`");
            continue;
        }
        let found: Value = serde_json::from_slice(&output.stdout).unwrap();
        assert_eq!((&found["recommend"][key], says(&found)), (expected, word != "ready"), "{name}: `{command}`");
        assert_ne!(expected["kind"], "none", "{name}: `{command}`");
    }
    // The diagnosis asks more, and takes back neither of the two words that say something of the lag. It has nothing to say of
    // records of which nothing repeats and nothing rests.
    let output = stand.command("diagnose stand --json -").output().unwrap();
    if output.status.success() {
        let found: Value = serde_json::from_slice(&output.stdout).unwrap();
        let agrees = found["verdict"] == "agrees";
        assert!(word != "not a lag" || !agrees, "{name}: the diagnosis agrees with what is no lag");
        let missed = found["gap"]["before"].as_f64().unwrap();
        assert!(word != "ready" || agrees || missed < 0.05, "{name}: ready, and a lag misses {missed}");
    }
    identified
}

#[test]
fn every_command_says_the_same_of_a_motor() {
    let judge = |(log, options): (PathBuf, &str)| {
        let stand = Stand::empty();
        stand.run(&format!("import {} {options} --out stand", log.display()));
        judged_alike(&stand, &log.display().to_string());
    };
    thread::scope(|scope| logs().into_iter().for_each(|log| drop(scope.spawn(move || judge(log)))));
    let stand = Stand::of_two_levels();
    stand.run("simulate --model actuators.toml --plan plan.toml --out sim");
    fs::remove_dir_all(stand.path("stand")).unwrap();
    fs::rename(stand.path("sim"), stand.path("stand")).unwrap();
    let judgement = judged_alike(&stand, "simulated");
    assert_eq!(judgement["state"], "ready", "{judgement}");
    // The thorough search finds no more than the judgement does.
    assert_eq!(stand.json("diagnose stand")["verdict"], "agrees");
}

#[test]
fn a_ramp_that_a_lag_imitates_is_no_lag() {
    let Some(log) = host_tests::data("cases/ramp-called-usable/log.csv") else { return };
    let stand = Stand::empty();
    stand.run(&format!("import {} --excitation staircase --column command=command:duty --out stand", log.display()));
    let judgement = judged_alike(&stand, "ramp");
    assert_eq!(judgement["state"], "not a lag");
    // The whole diagnosis names it too, which goes in where it was to be asked, and leaves all else where it is.
    let mut diagnosed = stand.json("report stand --out page.html")["judgement"].clone();
    let reason = diagnosed["limits"][0].take();
    let reason = reason.as_str().unwrap();
    assert!(
        reason.contains("the diagnosis names slew-rate limit") && !reason.contains("rotorlead diagnose"),
        "{reason}"
    );
    diagnosed["limits"][0].clone_from(&judgement["limits"][0]);
    assert_eq!(diagnosed, judgement);
    let page = stand.read("page.html");
    assert!(page.contains(": not a lag") && page.contains("slew-rate limit"));
    assert!(judgement["limits"][0].as_str().unwrap().contains("by 0.80 of the range in a second"), "{judgement}");
}

#[test]
fn where_the_numbers_are_in_doubt_that_comes_first_and_nothing_is_built() {
    let stand = Stand::of_two_levels();
    stand.run("simulate --model actuators.toml --plan plan.toml --out sim");
    fs::remove_dir_all(stand.path("stand")).unwrap();
    fs::rename(stand.path("sim"), stand.path("stand")).unwrap();
    // Grams-force that are called newtons.
    for entry in fs::read_dir(stand.path("stand")).unwrap() {
        let file = entry.unwrap().path();
        if file.extension().is_some_and(|end| end == "csv") {
            let rows = fs::read_to_string(&file).unwrap();
            let in_grams = |line: &str| match line.rsplit_once(',').map(|(rest, last)| (rest, last.parse::<f64>())) {
                Some((rest, Ok(newtons))) => format!("{rest},{}\n", 101.97 * newtons),
                _ => format!("{line}\n"),
            };
            fs::write(&file, rows.lines().map(in_grams).collect::<String>()).unwrap();
        }
    }
    let judgement = judged_alike(&stand, "grams");
    assert_eq!((&judgement["state"], &judgement["in_doubt"]), (&"measure again".into(), &true.into()));
    assert!(judgement["limits"][0].as_str().unwrap().starts_with("the numbers are in doubt"), "{judgement}");
    for purpose in ["force", "rate_loop"] {
        assert_eq!(judgement["recommend"][purpose]["kind"], "none", "{judgement}");
    }
}
