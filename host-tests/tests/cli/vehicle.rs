//! `rotorlead vehicle`: what it compares, what it says of it, and what is no vehicle.

use std::fs;

use serde_json::Value;

use crate::stand::{AIRFRAME, Stand, flowing};

const SMALL: &str = "vehicle --airframe airframe.toml --model model.toml";

fn number(value: &Value, key: &str) -> f64 {
    value[key].as_f64().unwrap_or_else(|| panic!("`{key}` is no number in {value:#}"))
}

/// Bandwidth and disturbance peak of each actuator over those of none.
fn over_none(json: &Value, latency: usize, set: &str) -> Vec<(f64, f64)> {
    let rows = json["over_none"][latency][set].as_array().unwrap();
    rows.iter().map(|row| (number(&row["ratios"], "bandwidth"), number(&row["ratios"], "disturbance_peak"))).collect()
}

/// The prototype's ratios to none at a latency of 2 ms: lead, inverse at 94, 150 and 200 rad/s, speed loop.
#[test]
fn the_default_vehicle_has_the_ratios_that_are_known_and_says_where_compensation_does_not_pay() {
    let stand = Stand::new();
    let json = stand.json("vehicle");
    for (set, known) in [
        ("hover", [(0.80, 2.15), (0.80, 2.23), (1.20, 1.19), (1.30, 0.90), (1.30, 0.63)]),
        ("range", [(0.47, 3.56), (1.22, 1.53), (1.84, 0.83), (1.98, 0.64), (1.75, 0.56)]),
    ] {
        let found = over_none(&json, 0, set);
        assert_eq!((found.len(), found[0]), (6, (1.0, 1.0)));
        for (index, (found, known)) in found[1..].iter().zip(known).enumerate() {
            for (found, known) in [(found.0, known.0), (found.1, known.1)] {
                assert!((found / known - 1.0).abs() < 0.25, "{set}, row {index}: {found} is not {known}");
            }
        }
    }
    let worth = |latency: usize, set: &str, row: usize| json["over_none"][latency][set][row]["worth"].clone();
    assert_eq!((worth(0, "hover", 1), worth(0, "range", 1)), ("worse".into(), "worse".into()));
    assert_eq!((worth(0, "range", 4), worth(1, "range", 4)), ("better".into(), "better".into()));
    // Without a D term: the bare motor has no gains, the paper's C 44 rad/s, the inverse at 200 rad/s 90.
    let without_d = &json["latencies"][0]["without_d"];
    assert_eq!(without_d[0]["performance"], Value::Null);
    for (row, known) in [(1, 44.0), (4, 90.0)] {
        let found = number(&without_d[row]["performance"]["margins"], "bandwidth_rad_s");
        assert!((found / known - 1.0).abs() < 0.05, "{found} is not {known}");
    }
    // Lateral force: rise in milliseconds, tracking error in percent.
    for (row, rise_ms, error_percent) in [(0, 248.0, 82.0), (1, 153.0, 45.0), (2, 22.8, 20.0), (3, 14.4, 12.5)] {
        let found = &json["lateral"][row];
        assert!((1e3 * number(found, "rise_s") / rise_ms - 1.0).abs() < 0.1, "{found}");
        assert!((1e2 * number(found, "tracking_error") / error_percent - 1.0).abs() < 0.1, "{found}");
    }
    let findings: Vec<&str> = json["findings"].as_array().unwrap().iter().map(|one| one.as_str().unwrap()).collect();
    assert!(findings[0].starts_with("Tuned for 0.50 alone, latency 2.0 ms. Worse than none: lead"), "{findings:?}");
    assert!(findings.iter().any(|one| one.contains("tune for the latency")), "{findings:?}");
}

#[test]
fn text_json_figures_and_report_say_the_same_and_twice_the_same() {
    let stand = Stand::new();
    let text = stand.run(&format!("{SMALL} --json v.json --figures flight --report v.html"));
    let json: Value = serde_json::from_str(&stand.read("v.json")).unwrap();
    let bandwidth = number(&json["latencies"][0]["hover"][2]["performance"]["margins"], "bandwidth_rad_s");
    assert!(text.contains(&format!("{bandwidth:.1}")), "no {bandwidth:.1} in:\n{text}");
    let table = stand.read("flight/vehicle_hover_latency_1.csv");
    // To the digits that a reader of JSON keeps.
    assert!(table.contains(&format!("{bandwidth:.15}")[..12]), "no {bandwidth} in:\n{table}");
    for figure in ["vehicle_bandwidth", "vehicle_disturbance"] {
        for end in ["svg", "png", "csv"] {
            assert!(fs::metadata(stand.path(&format!("flight/{figure}.{end}"))).unwrap().len() > 100);
        }
    }
    assert!(!stand.path("flight/vehicle_force.svg").exists(), "this airframe has no hexarotor");
    assert!(stand.read("v.html").contains("What a compensator is worth in a vehicle"));
    let verdict = json["headline"].as_str().unwrap();
    assert!(verdict.contains("compensators make the vehicle worse"), "{verdict}");
    // It comes last, but for what was written.
    assert!(flowing(text.split("\n\nFigures in").next().unwrap()).ends_with(verdict), "{text}");
    stand.run(&format!("{SMALL} --json again.json"));
    assert_eq!(stand.read("v.json"), stand.read("again.json"));
    assert_eq!(stand.run(&format!("{SMALL} --quiet")), "");
    let verbose = stand.run(&format!("{SMALL} --verbose"));
    assert!(verbose.contains("Gain sets at a latency") && !text.contains("Gain sets"));
}

#[test]
fn the_airframe_of_the_page_is_the_default_one() {
    let page = fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/vehicle.md")).unwrap();
    let block = page.split("`airframe.toml`:\n\n```toml\n").nth(1).unwrap().split("```").next().unwrap();
    let read: rotorlead_vehicle::Airframe = toml::from_str(block).unwrap();
    assert_eq!(read, rotorlead_vehicle::Airframe::default());
}

#[test]
fn a_latency_that_grows_takes_bandwidth_and_a_quieter_gyro_gives_it_to_the_bare_motor() {
    let stand = Stand::new();
    let bare = |json: &Value| number(&json["latencies"][0]["hover"][0]["performance"]["margins"], "bandwidth_rad_s");
    let first = bare(&stand.json(SMALL));
    stand.write("airframe.toml", AIRFRAME.replace("[0.002]", "[0.012]"));
    let late = bare(&stand.json(SMALL));
    assert!(late < 0.7 * first, "{late} is not below {first}");
    stand.write("airframe.toml", AIRFRAME.replace("sqrt_hz = 0.05", "sqrt_hz = 0.02"));
    let quiet = bare(&stand.json(SMALL));
    assert!(quiet > first, "{quiet} is not above {first}");
    // The dead time of the model is added to the latency.
    stand.write("airframe.toml", AIRFRAME);
    let model = stand.read("model.toml");
    stand.write("model.toml", model.replace("time_constant_s", "delay_s = 0.01\ntime_constant_s"));
    assert!((bare(&stand.json(SMALL)) / late - 1.0).abs() < 1e-9);
}

#[test]
fn an_effect_that_is_left_out_is_named() {
    let stand = Stand::new();
    let effect = "[[effect]]\nkind = \"slew_limit\"\n[effect.parameters]\nrate_per_s = 0.6\n";
    stand.write("model.toml", stand.read("model.toml") + effect);
    assert!(flowing(&stand.run(SMALL)).contains("Left out of the model: slew_limit."));
}

#[test]
fn an_inverse_that_the_model_is_too_uncertain_for_is_left_out_with_its_reason() {
    let stand = Stand::new();
    let model = stand.read("model.toml");
    stand.write(
        "model.toml",
        model.replace("time_constant_s = 0.06", "time_constant_s = 0.06\ntime_constant_s_std = 0.01"),
    );
    let text = flowing(&stand.run(SMALL));
    assert!(text.contains("There is no inverse 150:"), "{text}");
    assert!(stand.json(SMALL)["refused"][0]["reason"].as_str().unwrap().len() > 20);
}

#[test]
fn what_is_no_vehicle_is_refused_with_place_and_remedy() {
    for (from, to, parts) in [
        ("inertia_kg_m2 = 0.0125", "inertia_kg_m2 = -0.0125", &["airframe.toml:3:17", "`roll`, `inertia_kg_m2`"][..]),
        ("inertia_kg_m2 = 0.0125", "inertia_kg_m2 = nan", &["airframe.toml:3:17", "NaN is not a finite number"]),
        (
            "inertia_kg_m2 = 0.0125",
            "inertia_kg_m2 = \"small\"",
            &["airframe.toml:3:17", "a text in quotes where a number"],
        ),
        ("inertia_kg_m2", "inertia_kgm2", &["airframe.toml:3:1", "unknown field", "did you mean `inertia_kg_m2`"]),
        ("motors = 4", "motors = 5", &["airframe.toml:5:10", "even number"]),
        ("motors = 4", "motors = 4.5", &["airframe.toml:5:10", "a whole number"]),
        ("arm_m = 0.159\n", "", &["airframe.toml", "missing field `arm_m`", "add `arm_m`"]),
        ("rate_hz = 1000", "rate_hz = 300", &["airframe.toml:9:11", "no divisor"]),
        ("[0.002]", "[2]", &["airframe.toml:13:14", "seconds, not milliseconds"]),
        ("[0.4, 0.5]", "[0.5, 0.4]", &["airframe.toml:17:9", "lower command first"]),
        ("[0.4, 0.5]", "[0.3, 0.5]", &["`model.toml`", "hovers at 0.3 to 0.5", "holds from 0.4 to 0.5", "[hover]"]),
        ("[150]", "[-150]", &["airframe.toml:19:18", "`inverse_rad_s` 1", "above 0"]),
        ("[150]", "[150]\nspeed_loop_rad_s = 5", &["not faster than the motor", "raise `speed_loop_rad_s`"]),
        ("[150]", "[150]\nspeed_loop_rad_s = 9000", &["too fast", "lower `speed_loop_rad_s`"]),
        ("format = 1", "format = 7", &["airframe.toml:1:10", "layout 7"]),
    ] {
        let stand = Stand::new();
        stand.edit("airframe.toml", from, to);
        stand.refuses(SMALL, 1, parts);
    }
    let stand = Stand::new();
    stand.edit("model.toml", "gain = 6.2", "gain = -6.2");
    stand.edit("model.toml", "gain = 7.1", "gain = -7.1");
    stand.refuses(SMALL, 1, &["`model.toml`", "thrust has to rise", "above 0"]);
    stand.refuses("vehicle model.toml airframe.toml", 2, &["unexpected argument"]);
}

#[test]
fn a_model_of_a_speed_is_refused() {
    let stand = Stand::new();
    let provenance = "[provenance]\nrecords = [\"a.csv\"]\nversion = \"0.1.0\"\noutput = \"rpm\"\n";
    stand.write("model.toml", stand.read("model.toml") + provenance);
    stand.refuses(SMALL, 1, &["`model.toml`", "torque needs thrust", "--response thrust"]);
}
