//! One judgement: every command says of a motor what the others say, in the same words.

use std::fs;
use std::path::{Path, PathBuf};
use std::thread;

use serde_json::Value;

use crate::stand::{Stand, everything, flowing};

/// Bytes of the longest records that are diagnosed in a few seconds.
const SOON_DIAGNOSED: usize = 300_000;

/// Logs and experiments, whatever they hold: every file of the tests' data but the descriptions, and every folder with one.
fn all_records() -> Vec<PathBuf> {
    let own = Path::new(env!("CARGO_MANIFEST_DIR")).join("../sim/records/tests/data");
    let found = [Some(own), host_tests::data("")].into_iter().flatten().flat_map(|folder| everything(&folder));
    let is_record = |path: &PathBuf| match path.extension() {
        Some(end) => end != "toml" && end != "md",
        None => path.is_file() || path.join("experiment.toml").is_file(),
    };
    found.map(|(path, _)| path).filter(is_record).collect()
}

/// Asserts that every command judges what was measured alike, and gives the judgement. `folder` has the same for commands that take
/// no log.
#[track_caller]
fn judged_alike(stand: &Stand, measured: &str, folder: &str, name: &str) -> Value {
    let headline = stand.run(&format!("identify {measured} --out found.toml --json found.json"));
    let identified = serde_json::from_str::<Value>(&stand.read("found.json")).unwrap()["judgement"].clone();
    let word = identified["state"].as_str().unwrap().to_owned();
    let headline = headline.rsplit("\n\n").next().unwrap().replace('\n', " ");
    assert!(headline.contains(&format!(": {word}")), "{name}: {headline}");
    let report = stand.json(&format!("report {measured} --no-diagnosis --out page.html"));
    assert_eq!(report["judgement"], identified, "{name}: report");
    let said_of = |page: String| page.contains(&format!("Judged: {word}")) || page.contains(&format!(": {word}</p>"));
    assert!(said_of(stand.read("page.html")), "{name}: report");
    if stand.read("found.toml").contains("point = []") {
        // Of a static map alone nothing more is said.
        assert_eq!((word.as_str(), &identified["recommend"]), ("measure again", &Value::Null), "{name}");
        let commands = ["bandwidth", "design --out c.toml", &format!("validate {folder}")];
        commands.iter().for_each(|command| {
            stand.refuses(&format!("{command} --model found.toml"), 1, &["a static map alone"]);
        });
        return identified;
    }
    let validate = format!("validate {folder} --model found.toml --report page.html");
    if let Some(why) = report["left_out"]["validation"].as_str() {
        assert_eq!(word, "measure again", "{name}: {why}");
        stand.refuses(&validate, 1, &[why.split(": ").next().unwrap(), "was not compared"]);
    } else {
        assert_eq!(stand.json(&validate)["judgement"], identified, "{name}: validate");
        assert!(said_of(stand.read("page.html")), "{name}: validate");
    }
    // Without records they say what the file of the model says.
    let says = |found: &Value| found["warnings"].to_string().contains(&format!("as {word}"));
    let output = stand.command("bandwidth --model found.toml --json -").output().unwrap();
    match serde_json::from_slice(&output.stdout) {
        Ok(found) => assert_eq!(says(&found), word != "ready", "{name}: {}", found["warnings"]),
        // A lag that is hardly known gives no compensator to compare with.
        Err(_) => {
            let said = flowing(&String::from_utf8(output.stderr).unwrap());
            assert!(said.contains("is known to be within") && word == "measure again", "{name}: {word}: {said}");
        }
    }
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
    identified
}

/// Asserts that the diagnosis, which asks more, takes back neither of the two words that say something of the lag. It has nothing
/// to say of records of which nothing repeats and nothing rests.
#[track_caller]
fn diagnosed_alike(stand: &Stand, measured: &str, word: &str, name: &str) {
    let output = stand.command(&format!("diagnose {measured} --json -")).output().unwrap();
    if output.status.success() {
        let found: Value = serde_json::from_slice(&output.stdout).unwrap();
        let agrees = found["verdict"] == "agrees";
        assert!(word != "not a lag" || !agrees, "{name}: the diagnosis agrees with what is no lag");
        let missed = found["gap"]["before"].as_f64().unwrap();
        assert!(word != "ready" || agrees || missed < 0.05, "{name}: ready, and a lag misses {missed}");
    }
}

#[test]
fn every_command_says_the_same_of_the_square_of_a_speed() {
    let Some(log) = host_tests::data("cases/thrust-square-called-unequal-lags/log.csv") else { return };
    let stand = Stand::empty();
    stand.run(&format!("import {} --excitation staircase --column command=command:duty --out stand", log.display()));
    let judgement = judged_alike(&stand, "stand", "stand", "square");
    diagnosed_alike(&stand, "stand", judgement["state"].as_str().unwrap(), "square");
}

#[test]
fn every_command_says_the_same_of_a_simulated_motor() {
    let stand = Stand::with_two_levels();
    stand.run("simulate --model actuators.toml --plan plan.toml --out sim");
    fs::remove_dir_all(stand.path("stand")).unwrap();
    fs::rename(stand.path("sim"), stand.path("stand")).unwrap();
    let judgement = judged_alike(&stand, "stand", "stand", "simulated");
    assert_eq!(judgement["state"], "ready", "{judgement}");
    // The thorough search finds no more than the judgement does.
    assert_eq!(stand.json("diagnose stand")["verdict"], "agrees");
}

/// What one log or experiment is judged; nothing where `identify` refuses it, which `report` has to do in the same words.
fn judged(records: &Path) -> Option<String> {
    let (stand, name) = (Stand::empty(), records.display().to_string());
    let refused = |command: &str| {
        let command = format!("{command} {name}");
        let output = stand.command(&format!("{command} --out out")).output().unwrap();
        let why = || flowing(&String::from_utf8(output.stderr).unwrap()).replace(&command, "@");
        (!output.status.success()).then(why)
    };
    if let Some(why) = refused("identify") {
        assert_eq!(refused("report"), Some(why), "{name}: what `report` says of it");
        return None;
    }
    let measured = if records.is_dir() { &name } else { "stand" };
    if records.is_file() {
        stand.run(&format!("import {name} --out stand"));
    }
    let judgement = judged_alike(&stand, &name, measured, &name);
    let word = judgement["state"].as_str().unwrap();
    let bytes = everything(&stand.path(measured)).iter().flat_map(|(_, content)| content).map(Vec::len).sum::<usize>();
    if bytes < SOON_DIAGNOSED {
        diagnosed_alike(&stand, measured, word, &name);
    }
    Some(word.to_owned())
}

#[test]
fn every_command_says_the_same_of_all_records_that_are_taken_as_they_are() {
    let all = all_records();
    let found: Vec<_> = thread::scope(|scope| {
        let part = |records: &[PathBuf]| records.iter().filter_map(|records| judged(records)).collect::<Vec<_>>();
        // Those that take long lie side by side.
        let parts = (0..4).map(|first| all.iter().skip(first).step_by(4).cloned().collect::<Vec<_>>());
        let threads: Vec<_> = parts.map(|records| scope.spawn(move || part(&records))).collect();
        threads.into_iter().flat_map(|thread| thread.join().unwrap()).collect()
    });
    let count = if host_tests::data("").is_some() { 30 } else { 4 };
    assert!(found.len() >= count, "{} of {} are judged: {found:?}", found.len(), all.len());
}

#[test]
fn a_ramp_that_a_lag_imitates_is_no_lag() {
    let Some(log) = host_tests::data("cases/ramp-called-usable/log.csv") else { return };
    let stand = Stand::empty();
    stand.run(&format!("import {} --excitation staircase --column command=command:duty --out stand", log.display()));
    let judgement = judged_alike(&stand, "stand", "stand", "ramp");
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
    // With what was missing in it, it is no better a place to begin.
    stand.run("diagnose stand --out-model improved.toml");
    let improved: toml::Table = stand.read("improved.toml").parse().unwrap();
    assert_eq!(improved["provenance"]["judgement"]["state"].as_str(), Some("not a lag"));
    let refused = stand.command("design improved.toml --out c.toml").output().unwrap();
    assert!(String::from_utf8_lossy(&refused.stderr).contains("none is recommended for a force"), "{refused:?}");
    assert!(judgement["limits"][0].as_str().unwrap().contains("by 0.80 of the range in a second"), "{judgement}");
}

#[test]
fn where_the_numbers_are_in_doubt_that_comes_first_and_nothing_is_built() {
    let stand = Stand::with_two_levels();
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
    let judgement = judged_alike(&stand, "stand", "stand", "grams");
    assert_eq!((&judgement["state"], &judgement["in_doubt"]), (&"measure again".into(), &true.into()));
    assert!(judgement["limits"][0].as_str().unwrap().starts_with("the numbers are in doubt"), "{judgement}");
    for purpose in ["force", "rate_loop"] {
        assert_eq!(judgement["recommend"][purpose]["kind"], "none", "{judgement}");
    }
}
