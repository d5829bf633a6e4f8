//! The conditioned inverse through every command that takes a compensator.

use serde_json::Value;

use crate::stand::Stand;

/// An inverse for two levels, and the folder `fast` that was recorded through it.
fn with_inverse() -> Stand {
    let stand = Stand::new();
    stand.run("design --kind inverse --slew 100 --model model.toml --out inverse.toml");
    stand.run("simulate --model model.toml --plan plan.toml --compensator inverse.toml --out fast");
    stand
}

fn close(value: &Value, expected: f64, part: f64) -> bool {
    value.as_f64().is_some_and(|value| (value / expected - 1.0).abs() < part)
}

#[test]
fn design_writes_and_says_what_the_controller_runs() {
    let stand = Stand::new();
    let values = stand.json("design --kind inverse --slew 20 --natural 100 --model model.toml --out inverse.toml");
    assert_eq!((&values["kind"], &values["setting"]), (&"inverse".into(), &"exact".into()));
    assert_eq!((&values["natural_rad_s"], &values["slew_per_s"]), (&100.0.into(), &20.0.into()));
    assert_eq!((&values["compensate_from"], &values["compensate_to"]), (&0.35.into(), &0.55.into()));
    assert_eq!(values["coefficients"]["g"].as_array().unwrap().len(), 33);
    for point in values["points"].as_array().unwrap() {
        assert!(close(&point["compensated_rad_s"], 100.0, 0.03), "{point}");
    }
    let file = stand.read("inverse.toml");
    assert!(file.starts_with("format = 1\nkind = \"inverse\"\nnatural_rad_s = 100.0\n"), "{file}");
    // Another integer is another filter.
    stand.edit("inverse.toml", "\na = ", "\na = 1 # ");
    let arguments = "bandwidth --model model.toml --compensator inverse.toml";
    stand.refuses(arguments, 1, &["inverse.toml:", "1 is stored, but the parameters give"]);
}

#[test]
fn what_is_recorded_through_it_is_taken_by_every_command() {
    let stand = with_inverse();
    assert!(stand.read("fast/compensator.toml").contains("kind = \"inverse\""));
    let bandwidth = "bandwidth --model model.toml --compensator fast/compensator.toml --sampled --esc-frame 600";
    let values = stand.json(&format!("{bandwidth} --steps 0.04 --records fast"));
    for point in values["measured"].as_array().unwrap() {
        assert!(point["compensated"] == true && close(&point["bandwidth_rad_s"], 93.0, 0.05), "{point}");
    }
    for step in values["steps"].as_array().unwrap() {
        let (with, without) = (&step["compensated"]["rise_s"], &step["uncompensated"]["rise_s"]);
        assert!(close(with, 0.023, 0.15) && without.as_f64().unwrap() > 0.1, "{step}");
        assert!(step["compensated"]["overshoot"].as_f64().unwrap() < 0.06, "{step}");
    }
    stand.run("validate fast --model model.toml");
    stand.run("check fast");
    stand.run("report fast --kind inverse --no-diagnosis --out fast.html");
    stand.run("simulate --model model.toml --plan plan.toml --out plain");
    stand.run("report plain --kind inverse --no-diagnosis --out plain.html");
    let report = stand.read("plain.html");
    assert!(report.contains("Time constants of the table, and the gains that they give"), "no curve of an inverse");
    // The column of what the ESC got is computed where it is not recorded.
    stand.run("diagnose fast --model model.toml --redesign --kind inverse --out-compensator again.toml");
    assert!(stand.read("again.toml").contains("kind = \"inverse\""));
}

#[test]
fn actuators_that_differ_are_shown_beside_the_lead() {
    let stand = with_inverse();
    let values = stand.json("bandwidth --model model.toml --compensator inverse.toml --robustness");
    let rows = values["robustness"].as_array().unwrap();
    let of = |compensator: &str, deviation: &str, key: &str| {
        let row = rows.iter().find(|row| row["compensator"] == compensator && row["deviation"] == deviation).unwrap();
        row[key].as_f64().unwrap()
    };
    assert!(of("inverse", "as the model", "lowest_rad_s") > 88.0);
    assert!(of("C(s)", "as the model", "lowest_rad_s") < 80.0);
    assert!((0.15..0.35).contains(&of("inverse", "tau -20 %", "overshoot")));
    assert!(of("inverse", "delay 26 ms", "lowest_phase_rad_s") < 45.0);
}
