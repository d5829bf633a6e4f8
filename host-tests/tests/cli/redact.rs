//! Copies of logs for others: each identifies as its log does, and what is planted in the log is not in the copy.

use std::fs;
use std::path::PathBuf;

use serde_json::Value;

use crate::stand::{Stand, flowing};

/// What is planted, in an order of its own.
const NAMES: [&str; 3] = ["Jane Doe", "48.137154", "SN-0815-4711"];

/// Logs of real motors.
const REAL: [&str; 5] = [
    "Log_2019-11-09_181347.csv",
    "f40_steps_5-2.csv",
    "esc32v3_f60-1.csv",
    "micro_2023-12-17_162234.csv",
    "so_v5_2023-12-13_130935.csv",
];

fn has(bytes: &[u8], part: &str) -> bool {
    bytes.windows(part.len()).any(|window| window == part.as_bytes())
}

/// The numbers of an answer by the path of their keys. Text, in which files are named, is left out.
fn numbers(answer: &Value) -> Vec<(String, f64)> {
    fn add(path: &str, value: &Value, found: &mut Vec<(String, f64)>) {
        match value {
            Value::Number(number) => found.push((path.to_owned(), number.as_f64().unwrap())),
            Value::Array(items) => {
                items.iter().enumerate().for_each(|(k, item)| add(&format!("{path}[{k}]"), item, found))
            }
            Value::Object(keys) => keys.iter().for_each(|(key, item)| add(&format!("{path}.{key}"), item, found)),
            _ => {}
        }
    }
    let mut found = Vec::new();
    add("", answer, &mut found);
    found
}

/// Asserts that a log and its copy identify alike, with a model where there is to be one; gives what `redact` says.
#[track_caller]
fn redacts(log: &[u8], options: &str, (is_planted, has_model): (bool, bool)) -> Value {
    let stand = Stand::empty();
    stand.write("log.csv", log);
    let answer = stand.json(&format!("redact log.csv --out copy.csv {options}"));
    let copy = fs::read(stand.path("copy.csv")).unwrap();
    if is_planted {
        assert!(NAMES.iter().all(|name| has(log, name)), "nothing is planted");
    }
    for name in NAMES {
        assert!(!has(&copy, name), "{name} is in the copy");
    }
    let identify = |file: &str| {
        let printed = stand.command(&format!("identify {file} {options} --json -")).output().unwrap();
        (printed.status.code(), String::from_utf8(printed.stdout).unwrap(), String::from_utf8(printed.stderr).unwrap())
    };
    let ((status, of_log, said), (copy_status, of_copy, copy_said)) = (identify("log.csv"), identify("copy.csv"));
    assert_eq!((status, said.replace("log.csv", "copy.csv")), (copy_status, copy_said.clone()));
    assert_eq!(status == Some(0), has_model, "{copy_said}");
    if has_model {
        let [of_log, of_copy] = [of_log, of_copy].map(|text| numbers(&serde_json::from_str(&text).unwrap()));
        assert_eq!(of_log.len(), of_copy.len());
        assert!(of_log.len() > 50, "only {} numbers", of_log.len());
        for ((path, a), (other, b)) in of_log.iter().zip(&of_copy) {
            assert_eq!(path, other);
            // A clock that begins at zero has its last digits elsewhere.
            assert!((a - b).abs() <= 1e-6 * a.abs().max(1e-6), "{path}: {a} of the log, {b} of the copy");
        }
    }
    answer
}

/// The log with a remark of names in front of and behind its rows, and with a column of them.
fn with_names(log: &[u8]) -> Vec<u8> {
    let text = String::from_utf8(log.to_vec()).unwrap();
    let text = text.trim_start_matches('\u{feff}');
    let mut planted = String::new();
    for (k, line) in text.lines().enumerate() {
        let line = line.trim_end_matches('\r');
        let remark = line.starts_with('#') || line.is_empty();
        let cell = match k {
            _ if remark => "",
            0 => ",Operator",
            _ => ",Jane Doe at 48.137154",
        };
        planted += &format!("{line}{cell}\n");
    }
    (planted + "# stand SN-0815-4711\n").into_bytes()
}

#[test]
fn real_logs_identify_alike_without_what_was_planted() {
    for name in REAL {
        let Some(file) = host_tests::real_log(name) else { return };
        let log = fs::read(file).unwrap();
        println!("{name}");
        let answer = redacts(&with_names(&log), "", (true, true));
        assert!(answer["rows"].as_u64().is_some(), "{answer:#}");
        let is_operator = |dropped: &Value| dropped["kind"] == "column" && dropped["name"] == "Operator";
        assert!(answer["dropped"].as_array().unwrap().iter().any(is_operator), "{answer:#}");
        redacts(&log, "", (false, true));
    }
}

fn sample(name: &str) -> Vec<u8> {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../sim/records/tests/data").join(name);
    fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

#[test]
fn logs_of_autopilots_identify_alike() {
    // What is planted in these is in `sim/records/tests/import/redacted.rs`, which knows their containers.
    for name in ["bench.bin", "chirp.bin"] {
        println!("{name}");
        redacts(&sample(name), "", (false, true));
    }
    // These samples are too short for a model.
    redacts(&sample("esc_status.ulg"), "", (false, false));
    redacts(&sample("blackbox.bbl"), "--excitation staircase", (false, false));
}

#[test]
fn small_logs_of_autopilots_identify_alike() {
    for file in
        ["cases/command-stamps-dropped/log.bin", "cases/command-stamps-dropped/log.ulg", "cases/motor-2-moves/log.bin"]
    {
        let Some(file) = host_tests::data(file) else { return };
        println!("{}", file.display());
        redacts(&fs::read(file).unwrap(), "", (false, true));
    }
}

#[test]
fn what_is_dropped_is_said_and_nothing_is_written_over() {
    let stand = Stand::empty();
    let log = with_names(&sample("rcbenchmark.csv"));
    stand.write("log.csv", &log);
    let said = stand.run("redact log.csv --out copy.csv");
    for part in [
        "Kept: `Time (s)`",
        "column `Operator`: 240",
        "remark: 1",
        "is read as the log is: 233 rows",
        "Written to copy.csv",
    ] {
        assert!(said.contains(part), "no `{part}` in:\n{said}");
    }
    stand.refuses("redact log.csv --out log.csv", 2, &["would be read and then written over"]);
    // A copy is a log: it is not lost either.
    stand.refuses("redact log.csv --out copy.csv", 1, &["copy.csv` of --out exists", "--force"]);
    stand.run("redact log.csv --out copy.csv --force");
    stand.refuses("redact log.csv --out none/copy.csv", 1, &["there is no folder `none`"]);
    stand.refuses("redact gone.csv --out c.csv", 1, &["gone.csv"]);
    stand.write("log.mat", sample("vectors.mat"));
    stand.refuses("redact log.mat --out c.mat", 1, &["a MATLAB file", "`rotorlead import`"]);
    assert_eq!(fs::read(stand.path("log.csv")).unwrap(), log);
}

#[test]
fn stamps_since_1970_stay_some_and_a_copy_is_refused_for_the_reason_of_the_log() {
    let stand = Stand::empty();
    let row = |k: usize| {
        format!("{}.{:06},0.{},{}\n", 1_700_000_000 + k / 100, k % 100 * 10_000, 3 + k / 50 % 2, 5000 + k % 7)
    };
    stand.write("log.csv", "__time,command,rpm\n".to_owned() + &(0..400).map(row).collect::<String>());
    let said = flowing(&stand.run("redact log.csv --out copy.csv"));
    assert!(said.contains("`__time` begins at 1000000000"), "{said}");
    let refused = "the log does not say what drove the command";
    assert!(said.contains(refused), "{said}");
    for log in ["log.csv", "copy.csv"] {
        stand.refuses(&format!("identify {log}"), 2, &[refused]);
    }
    assert!(stand.read("copy.csv").starts_with("__time,command,rpm\n1000000000.000000,0.3,5000\n"));
}
