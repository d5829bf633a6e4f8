//! A good folder has nothing wrong with it; with one fault in it, that fault is named, with the record and what to do.

use std::fmt::Write as _;

use serde_json::Value;

use crate::stand::{Stand, report};

const LOGS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../sim/records/tests/data");

/// Two levels with a multisine and a square wave each, as `good`.
fn good() -> Stand {
    let stand = Stand::with_two_levels();
    stand.run("simulate --model actuators.toml --plan plan.toml --out good");
    stand
}

/// Changes every row of a record: time, command and response.
fn change(stand: &Stand, file: &str, mut row: impl FnMut(usize, [f64; 3]) -> Option<[f64; 3]>) {
    let text = stand.read(file);
    let mut lines = text.lines();
    let mut changed = lines.next().unwrap().to_owned() + "\n";
    for (index, line) in lines.enumerate() {
        let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
        if let Some([time_s, command, response]) = row(index, [cells[0], cells[1], cells[2]]) {
            writeln!(changed, "{time_s},{command},{response}").unwrap();
        }
    }
    stand.write(file, changed);
}

/// What `check` finds, and its exit status.
#[track_caller]
fn findings(stand: &Stand, folder: &str) -> (Vec<Value>, i32) {
    let before = stand.everything();
    let output = stand.command(&format!("check {folder} --json -")).output().unwrap();
    let report = String::from_utf8(output.stderr).unwrap();
    assert!(!report.contains("panicked"), "{report}");
    let found: Value = serde_json::from_slice(&output.stdout).unwrap_or_else(|error| panic!("{error}: {report}"));
    assert!(stand.everything() == before, "`check` changes something");
    (found["findings"].as_array().unwrap().clone(), output.status.code().unwrap())
}

/// Asserts that `check` finds something of `severity` about `topic` in `file`, which says all of `parts` and what to do, and that
/// its exit status is that of its findings and of `identify`.
#[track_caller]
fn finds(stand: &Stand, severity: &str, topic: &str, file: &str, parts: &[&str]) {
    let (found, status) = findings(stand, "good");
    let is_error = found.iter().any(|finding| finding["severity"] == "error");
    assert_eq!(status, i32::from(is_error), "{found:#?}");
    let is_one = |finding: &&Value| {
        let said = format!("{} {}", finding["message"], finding["remedy"]);
        finding["severity"] == severity
            && finding["topic"] == topic
            && finding["file"] == file
            && finding["remedy"].is_string()
            && parts.iter().all(|part| said.contains(part))
    };
    assert!(found.iter().any(|finding| is_one(&finding)), "no {severity} about {topic} in {found:#?}");
    let identified = stand.command("identify good --out found.toml").output().unwrap().status.code();
    assert_eq!(identified, Some(status), "`identify` does otherwise: {found:#?}");
}

#[test]
fn a_good_folder_has_nothing_wrong_with_it() {
    let stand = good();
    let (found, status) = findings(&stand, "good");
    assert_eq!((found, status), (Vec::new(), 0));
    assert_eq!(
        stand.run("check good"),
        "good: 4 records; nothing is wrong with the records; `rotorlead identify` judges\n  the motor\n"
    );
}

#[test]
fn a_command_in_another_unit_is_told() {
    for (scale, offset, unit, remedy) in
        [(100.0, 0.0, "percent", "by 100"), (1000.0, 1000.0, "microseconds", "1000"), (1999.0, 48.0, "DSHOT", "1999")]
    {
        let stand = good();
        change(&stand, "good/u050_multisine.csv", |_, [t, u, y]| Some([t, scale * u + offset, y]));
        finds(&stand, "error", "command_unit", "u050_multisine.csv", &["row 1", unit, remedy]);
    }
}

#[test]
fn times_in_milliseconds_or_microseconds_are_told() {
    for (scale, unit, remedy) in [(1e3, "milliseconds", "by 1000"), (1e6, "microseconds", "by 1000000")] {
        let stand = good();
        change(&stand, "good/u050_multisine.csv", |_, [t, u, y]| Some([(t * scale).round(), u, y]));
        finds(&stand, "error", "time_unit", "u050_multisine.csv", &["sample_rate_hz", unit, remedy]);
        // Without a stated rate the period tells.
        stand.edit("good/experiment.toml", "sample_rate_hz = 200.0\n", "");
        finds(&stand, "error", "time_unit", "u050_multisine.csv", &["period of 10 s", unit, remedy]);
    }
}

#[test]
fn swapped_columns_are_no_percent() {
    let stand = good();
    change(&stand, "good/u050_multisine.csv", |_, [t, u, y]| Some([t, y, u]));
    let parts = ["columns seem to be swapped", "swap the names `command` and `thrust_n`"];
    finds(&stand, "error", "command_unit", "u050_multisine.csv", &parts);
    let (found, _) = findings(&stand, "good");
    assert!(!found.iter().any(|finding| finding["message"].to_string().contains("percent")), "{found:#?}");
}

#[test]
fn a_sensor_that_repeats_its_readings_is_told() {
    for file in ["u050_multisine.csv", "u050_square.csv"] {
        let stand = good();
        let mut held = 0.0;
        change(&stand, &format!("good/{file}"), |row, [t, u, y]| {
            held = if row % 4 == 0 { y } else { held };
            Some([t, u, held])
        });
        finds(&stand, "warning", "response", file, &["every 4 rows", "50 readings a second", "10.0 ms", "faster rate"]);
    }
}

#[test]
fn a_thrust_in_grams_or_kilograms_is_told() {
    for (scale, unit, remedy) in
        [(1e3 / 9.80665, "grams-force", "0.00980665"), (1.0 / 9.80665, "kilograms-force", "9.80665")]
    {
        let stand = good();
        change(&stand, "good/u050_multisine.csv", |_, [t, u, y]| Some([t, u, y * scale]));
        finds(&stand, "warning", "response_unit", "u050_multisine.csv", &["thrust_n", unit, remedy]);
    }
}

#[test]
fn a_reversed_sign_is_told_of_fitted_and_of_validation_records() {
    for file in ["u050_multisine.csv", "u050_square.csv"] {
        let stand = good();
        change(&stand, &format!("good/{file}"), |_, [t, u, y]| Some([t, u, -y]));
        finds(&stand, "warning", "sign", file, &["falls where the command rises", "sign"]);
    }
}

#[test]
fn a_report_on_records_with_a_wrong_unit_or_sign_begins_with_that_and_designs_nothing() {
    for (scale, said) in [(1e3 / 9.80665, "another unit than newtons"), (-1.0, "falls where the command rises")] {
        let stand = good();
        change(&stand, "good/u050_multisine.csv", |_, [t, u, y]| Some([t, u, y * scale]));
        let json = stand.json("report good --no-diagnosis --out report.html");
        let verdict = json["verdict"].as_str().unwrap();
        assert!(verdict.starts_with("Something is wrong with the records"), "{verdict}");
        assert!(json["sentences"][0].as_str().unwrap().contains(said), "{json}");
        assert!(json["left_out"]["compensator"].as_str().unwrap().contains("in doubt"), "{json}");
        let warnings = json["warnings"].as_array().unwrap();
        assert!(warnings.iter().any(|warning| warning.as_str().unwrap().contains(said)), "{warnings:?}");
        assert!(!stand.run("report good --no-diagnosis --out report.html").contains("speaks against"));
    }
}

#[test]
fn missing_rows_are_told_with_the_row() {
    let stand = good();
    change(&stand, "good/u050_multisine.csv", |row, cells| (!(1000..1040).contains(&row) && row != 7).then_some(cells));
    stand.edit("good/experiment.toml", "sample_rate_hz = 200.0\n", "");
    finds(&stand, "error", "sampling", "u050_multisine.csv", &["gap", "row 1000", "cut the record"]);
    let (found, _) = findings(&stand, "good");
    assert_eq!(found[0]["row"], 1000, "{found:#?}");
    // Where a rate is stated the same is said, once.
    let stand = good();
    change(&stand, "good/u050_multisine.csv", |row, cells| (!(1000..1040).contains(&row)).then_some(cells));
    finds(&stand, "error", "sampling", "u050_multisine.csv", &["one gap", "row 1001", "cut the record"]);
    let (found, _) = findings(&stand, "good");
    let of_rows: Vec<_> = found.iter().filter(|finding| finding["topic"] == "sampling").collect();
    assert_eq!(of_rows.len(), 1, "{found:#?}");
}

#[test]
fn uneven_rows_are_told() {
    let stand = good();
    change(&stand, "good/u050_multisine.csv", |row, [t, u, y]| Some([t + if row == 500 { 0.002 } else { 0.0 }, u, y]));
    stand.edit("good/experiment.toml", "sample_rate_hz = 200.0\n", "");
    finds(&stand, "error", "sampling", "u050_multisine.csv", &["row 50", "even"]);
}

#[test]
fn a_wrong_sample_rate_is_told() {
    let stand = good();
    stand.edit("good/experiment.toml", "sample_rate_hz = 200.0", "sample_rate_hz = 250.0");
    let (found, status) = findings(&stand, "good");
    assert_eq!(status, 1);
    assert!(found.iter().all(|finding| finding["topic"] == "sampling"), "{found:#?}");
    for file in ["u050_multisine.csv", "u050_square.csv", "u065_multisine.csv", "u065_square.csv"] {
        let is_one = |finding: &&Value| {
            let said = format!("{} {}", finding["message"], finding["remedy"]);
            let parts = ["experiment.toml:5:18: ", "come at 200 Hz, not at 250", "write `sample_rate_hz = 200`"];
            finding["file"] == file && parts.iter().all(|part| said.contains(part))
        };
        assert!(found.iter().any(|finding| is_one(&finding)), "{file} is not named: {found:#?}");
    }
}

#[test]
fn rows_that_are_too_slow_for_the_lag_are_told() {
    let stand = good();
    change(&stand, "good/u065_multisine.csv", |row, cells| (row % 4 == 0).then_some(cells));
    stand.edit("good/experiment.toml", "sample_rate_hz = 200.0\n", "");
    finds(
        &stand,
        "warning",
        "sampling",
        "u065_multisine.csv",
        &["50 rows a second", "time constant", "rows a second or more"],
    );
}

#[test]
fn a_clipped_response_and_a_clipped_command_are_told() {
    let stand = good();
    change(&stand, "good/u050_multisine.csv", |_, [t, u, y]| Some([t, u, y.min(0.15)]));
    finds(&stand, "warning", "saturation", "u050_multisine.csv", &["thrust_n", "0.15", "limit"]);
    let stand = good();
    change(&stand, "good/u050_multisine.csv", |_, [t, u, y]| Some([t, u.min(0.53), y]));
    finds(&stand, "warning", "saturation", "u050_multisine.csv", &["command", "0.53", "cut off"]);
    for clipped in [|y: f64| y.min(0.4), |y: f64| y.max(-0.4)] {
        let stand = good();
        change(&stand, "good/u050_square.csv", |_, [t, u, y]| Some([t, u, clipped(y)]));
        finds(&stand, "warning", "saturation", "u050_square.csv", &["thrust_n", "0.4", "limit"]);
    }
}

#[test]
fn too_few_periods_are_told() {
    let stand = good();
    change(&stand, "good/u050_multisine.csv", |row, cells| (row < 4000).then_some(cells));
    finds(&stand, "warning", "periods", "u050_multisine.csv", &["2 whole periods", "four or more"]);
    change(&stand, "good/u050_multisine.csv", |row, cells| (row < 1500).then_some(cells));
    finds(&stand, "error", "periods", "u050_multisine.csv", &["less than one period"]);
}

#[test]
fn what_experiment_toml_says_is_held_against_the_rows() {
    for (from, to, severity, topic, parts) in [
        (
            "nominal = 0.5\n",
            "nominal = 0.45\n",
            "warning",
            "command",
            &["0.45", "mean command is 0.500", "correct"][..],
        ),
        ("amplitude = 0.05", "amplitude = 0.2", "warning", "command", &["`amplitude` is 0.2", "0.05", "correct"]),
        ("period_s = 10.0", "period_s = 7.0", "error", "periods", &["period", "correct period_s"]),
        ("period_s = 10.0", "period_s = 10.0013", "error", "periods", &["not a whole number", "correct period_s"]),
    ] {
        let stand = good();
        stand.edit("good/experiment.toml", from, to);
        finds(&stand, severity, topic, "u050_multisine.csv", parts);
    }
}

#[test]
fn a_square_wave_of_another_period_than_stated_is_told() {
    let stand = good();
    let text = stand.read("good/experiment.toml");
    let (before, square) = text.split_once("u050_square.csv").unwrap();
    assert!(square.contains("period_s = 10.0"), "{square}");
    let square = square.replacen("period_s = 10.0", "period_s = 7.0", 1);
    stand.write("good/experiment.toml", format!("{before}u050_square.csv{square}"));
    let parts = ["`period_s` is 7", "every 10", "correct `period_s`"];
    finds(&stand, "warning", "periods", "u050_square.csv", &parts);
}

#[test]
fn a_constant_command_and_a_constant_response_are_told() {
    let stand = good();
    change(&stand, "good/u050_multisine.csv", |_, [t, _, y]| Some([t, 0.5, y]));
    finds(&stand, "error", "command", "u050_multisine.csv", &["constant", "excite"]);
    let stand = good();
    change(&stand, "good/u050_square.csv", |_, [t, u, _]| Some([t, u, 1.0]));
    finds(&stand, "error", "response", "u050_square.csv", &["constant", "sensor"]);
}

#[test]
fn a_sensor_that_stops_or_jumps_is_told() {
    let stand = good();
    change(&stand, "good/u050_square.csv", |row, [t, u, y]| Some([t, u, if row > 4000 { 0.25 } else { y }]));
    finds(&stand, "warning", "response", "u050_square.csv", &["reads the same", "20.005"]);
    let stand = good();
    change(&stand, "good/u050_multisine.csv", |row, [t, u, y]| Some([t, u, if row == 900 { 900.0 } else { y }]));
    finds(&stand, "warning", "response", "u050_multisine.csv", &["jump", "4.5"]);
}

#[test]
fn a_file_that_is_missing_and_one_that_no_record_names_are_told() {
    let stand = good();
    std::fs::rename(stand.path("good/u050_square.csv"), stand.path("good/square.csv")).unwrap();
    finds(&stand, "error", "files", "u050_square.csv", &["experiment.toml:", "does not exist", "correct the name"]);
    finds(&stand, "warning", "files", "square.csv", &["no record names it", "[[record]]"]);
}

#[test]
fn a_folder_in_which_nothing_is_recorded_says_so_once() {
    let stand = good();
    for file in ["u050_multisine.csv", "u050_square.csv", "u065_multisine.csv", "u065_square.csv"] {
        std::fs::remove_file(stand.path(&format!("good/{file}"))).unwrap();
    }
    let (found, status) = findings(&stand, "good");
    assert_eq!((found.len(), status), (1, 1), "{found:#?}");
    for part in ["nothing is recorded yet", "u050_multisine.csv", "u065_square.csv", "record each on the stand"] {
        let said = format!("{} {}", found[0]["message"], found[0]["remedy"]);
        assert!(said.contains(part), "no `{part}` in {said}");
    }
}

#[test]
fn all_that_is_wrong_is_said_in_one_go_and_errors_first() {
    let stand = good();
    change(&stand, "good/u050_multisine.csv", |_, [t, u, y]| Some([t, 100.0 * u, y]));
    stand.edit("good/u050_square.csv", "\n0.025,", "\nhalf a row,");
    change(&stand, "good/u065_multisine.csv", |row, [t, u, y]| (row < 4000).then_some([t, u, -y]));
    std::fs::remove_file(stand.path("good/u065_square.csv")).unwrap();
    let (found, status) = findings(&stand, "good");
    assert_eq!(status, 1);
    let topics: Vec<_> = found
        .iter()
        .map(|f| {
            (f["severity"].as_str().unwrap(), f["topic"].as_str().unwrap(), f["file"].as_str().unwrap_or_default())
        })
        .collect();
    assert_eq!(
        topics,
        [
            ("error", "command_unit", "u050_multisine.csv"),
            ("error", "files", "u050_square.csv"),
            ("error", "files", "u065_square.csv"),
            ("warning", "periods", "u065_multisine.csv"),
            ("warning", "sign", "u065_multisine.csv"),
        ],
        "{found:#?}"
    );
    // For people the same, in lines that a terminal of 80 columns takes, and a report that says how it ends.
    let assert = stand.command("check good").assert().code(1);
    let text = String::from_utf8(assert.get_output().stdout.clone()).unwrap();
    assert!(text.ends_with("good: 4 records; 3 errors, 2 warnings\n"), "{text}");
    assert!(text.lines().all(|line| line.chars().count() <= 80), "{text}");
    let of = |severity: &str| text.lines().filter(|line| line.starts_with(severity)).count();
    assert_eq!((of("error: "), of("warning: "), of("  help: ")), (3, 2, 5), "{text}");
    assert!(report(&assert).contains("`good` has 3 errors"), "{}", report(&assert));
    // Whoever wants errors only gets them.
    let assert = stand.command("check good --quiet").assert().code(1).stdout("");
    let said = report(&assert);
    for part in ["percent", "u050_square.csv:", "u065_square.csv", "`good` has 3 errors"] {
        assert!(said.contains(part), "no `{part}` in {said}");
    }
    assert!(!said.contains("whole periods"), "a warning is no error: {said}");
    assert!(!said.contains('␊'), "each error has lines of its own: {said}");
}

#[test]
fn an_experiment_toml_that_cannot_be_read_is_shown() {
    for (from, to, parts) in [
        ("output = ", "outptu = ", &["experiment.toml:", "unknown field `outptu`", "did you mean `output`?"][..]),
        ("[[record]]", "[[record]", &["experiment.toml:", "TOML"]),
    ] {
        let stand = good();
        stand.edit("good/experiment.toml", from, to);
        let (found, status) = findings(&stand, "good");
        assert_eq!((found.len(), status), (1, 1));
        let said = format!("{} {}", found[0]["message"], found[0]["remedy"]);
        assert!(parts.iter().all(|part| said.contains(part)), "{said}");
    }
    let stand = good();
    stand.edit("good/experiment.toml", "nominal = 0.5\n", "nominal = 1.5\n");
    stand.edit("good/experiment.toml", "nominal = 0.65\n", "nominal = 6.5\n");
    let (found, _) = findings(&stand, "good");
    let faults: Vec<_> = found.iter().filter(|finding| finding["message"].to_string().contains("`nominal`")).collect();
    assert_eq!(faults.len(), 2, "{found:#?}");
    let (found, status) = findings(&stand, "nowhere");
    assert_eq!(status, 1);
    assert!(found[0]["message"].to_string().contains("`nowhere` does not exist"), "{found:#?}");
}

#[test]
fn what_import_gives_is_taken() {
    let logs =
        ["rcbenchmark.csv", "esc32.csv", "blackbox.bbl", "esc_status.ulg", "bench.bin", "chirp.bin", "vectors.mat"];
    for log in logs {
        let stand = Stand::new();
        // The blackbox is of a flight.
        let flight = if log == "blackbox.bbl" { "--excitation free" } else { "" };
        stand.run(&format!("import {LOGS}/{log} {flight} --out good"));
        let (found, status) = findings(&stand, "good");
        let identified = stand.command("identify good --out found.toml").output().unwrap().status.code();
        assert_eq!(identified, Some(status), "{log}: `identify` does otherwise: {found:#?}");
        for topic in ["time_unit", "command_unit", "response_unit", "sign"] {
            assert!(found.iter().all(|finding| finding["topic"] != topic), "{log}: {found:#?}");
        }
    }
}
