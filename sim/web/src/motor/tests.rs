use serde_json::{Value, json};

use super::*;

/// A log that says all of itself.
const SAMPLE: &[u8] = include_bytes!("../../../cli/samples/staircase.csv");

fn motor(logs: &[(&str, &[u8])]) -> Motor {
    let mut motor = Motor::default();
    logs.iter().for_each(|(name, bytes)| motor.add((*name).to_owned(), bytes.to_vec()));
    motor
}

fn ask(motor: &mut Motor, question: Value) -> Value {
    let request = Request::parse(&question.to_string()).unwrap();
    motor.ask(&request, &|_, _| ()).unwrap_or_else(|fault| fault.json())
}

#[test]
fn a_log_is_taken_judged_and_designed_for() {
    let mut motor = motor(&[("staircase.csv", SAMPLE)]);
    let read = ask(&mut motor, json!({ "ask": "read" }));
    assert_eq!((&read["response"], &read["logs"][0]["format"]), (&json!("thrust"), &json!("rc_benchmark")));
    let answer = ask(&mut motor, json!({ "ask": "answer" }));
    assert_eq!(answer["identify"]["judgement"]["state"], "measure again");
    assert_eq!(answer["commands"], json!(["rotorlead report staircase.csv --no-diagnosis"]));
    assert_eq!(answer["sections"][0]["name"], "to_fly");
    let flown = ask(&mut motor, json!({ "ask": "fly", "natural_rad_s": 60.0, "purpose": "force" }));
    assert_eq!((&flown["refused"], &flown["compensator"]["natural_rad_s"]), (&Value::Null, &json!(60.0)));
    let commands = [
        "rotorlead report staircase.csv --kind inverse --no-diagnosis",
        "rotorlead identify staircase.csv --out model.toml",
        "rotorlead design model.toml --kind inverse --natural 60 --out compensator.toml",
    ];
    assert_eq!(flown["commands"], json!(commands));
    let kept = ask(&mut motor, json!({ "ask": "file", "name": "compensator.toml" }));
    assert!(kept["text"].as_str().unwrap().contains("natural_rad_s = 60"), "{kept}");
    let refused = ask(&mut motor, json!({ "ask": "fly", "natural_rad_s": 4000.0, "purpose": "force" }));
    assert!(refused["refused"].is_string() && refused["compensator"].is_null(), "{refused}");
    let none = ask(&mut motor, json!({ "ask": "file", "name": "compensator.h" }));
    assert!(none["error"]["message"].as_str().unwrap().contains("no compensator"), "{none}");
}

#[test]
fn another_purpose_is_another_design_for_what_was_found() {
    let mut motor = motor(&[("staircase.csv", SAMPLE)]);
    ask(&mut motor, json!({ "ask": "read" }));
    let force = ask(&mut motor, json!({ "ask": "answer", "purpose": "force" }));
    let lead = ask(&mut motor, json!({ "ask": "answer", "purpose": "force", "kind": "lead" }));
    assert_eq!(force["identify"], lead["identify"]);
    assert_eq!(lead["commands"], json!(["rotorlead report staircase.csv --kind lead --no-diagnosis"]));
    assert!(force["natural_rad_s"].is_number());
    let kept = ask(&mut motor, json!({ "ask": "file", "name": "compensator.toml" }));
    assert!(kept["text"].as_str().unwrap().contains("zero_rad_s"), "{kept}");
    assert_eq!(ask(&mut motor, json!({ "ask": "answer", "purpose": "force" })), force);
}

#[test]
fn what_a_log_does_not_say_is_asked_with_its_columns() {
    let table = String::from_utf8(SAMPLE.to_vec()).unwrap().replacen("ESC A (µs)", "x1", 1);
    let mut motor = motor(&[("bench.csv", table.as_bytes())]);
    let asked = ask(&mut motor, json!({ "ask": "read" }));
    let missing = &asked["error"]["missing"][0];
    assert_eq!(missing, &json!({ "option": "column", "quantity": "command", "header": null }), "{asked}");
    assert_eq!(asked["error"]["columns"], json!(["Time (s)", "x1", "Thrust A (N)"]));
    let options = json!({ "column": ["command=x1:us", "thrust=Thrust A (N):N"], "excitation": "staircase" });
    let read = ask(&mut motor, json!({ "ask": "read", "options": options }));
    assert_eq!(read["logs"][0]["rows_taken"], 2850, "{read}");
}

#[test]
fn a_run_that_is_held_out_judges_the_others_and_is_not_fitted() {
    let mut motor = motor(&[("a.csv", SAMPLE), ("b.csv", SAMPLE)]);
    let all = ask(&mut motor, json!({ "ask": "read", "held_out": ["a.csv", "b.csv"] }));
    assert!(all["error"]["message"].as_str().unwrap().starts_with("all runs are held out"), "{all}");
    ask(&mut motor, json!({ "ask": "read", "held_out": ["b.csv"] }));
    let answer = ask(&mut motor, json!({ "ask": "answer" }));
    let limits = answer["identify"]["judgement"]["limits"].to_string();
    assert!(!limits.contains("no record was held out"), "{limits}");
}

#[test]
fn a_folder_is_taken_by_its_files_and_names_the_one_that_is_not_there() {
    let mut logs = motor(&[("staircase.csv", SAMPLE)]);
    ask(&mut logs, json!({ "ask": "read" }));
    let experiment = logs.taken.unwrap().experiment;
    let files = experiment.files().unwrap();
    let given: Vec<(&str, &[u8])> = files.iter().map(|(name, bytes)| (&**name, &**bytes)).collect();
    let mut folder = motor(&given);
    let read = ask(&mut folder, json!({ "ask": "read" }));
    assert_eq!((&read["response"], &read["logs"]), (&json!("thrust"), &Value::Null), "{read}");
    assert_eq!(folder.taken.unwrap().experiment, experiment);
    let manifest: Vec<_> = given.into_iter().filter(|(name, _)| *name == "experiment.toml").collect();
    let missing = ask(&mut motor(&manifest), json!({ "ask": "read" }));
    assert!(missing["error"]["message"].as_str().unwrap().contains("staircase.csv"), "{missing}");
}
