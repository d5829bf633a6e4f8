//! What to fly: said by `identify`, built by `design` and drawn by `report` alike.

use crate::stand::{Stand, table_1};

#[test]
fn without_a_kind_what_is_recommended_for_the_purpose_is_designed() {
    let stand = Stand::new();
    stand.write("paper.toml", table_1());
    for (options, purpose, natural) in [("", "force", 94.0), ("--purpose rate-loop", "rate_loop", 200.0)] {
        let found = stand.json(&format!("design --model paper.toml --out c.toml {options}"));
        assert_eq!(found["natural_rad_s"], natural, "{found:#}");
        assert_eq!(found["recommend"][purpose]["omega_f_rad_s"], natural, "{found:#}");
        let candidates = found["candidates"].as_array().unwrap();
        let designed = candidates.iter().find(|one| one["actuator"] == format!("inverse {natural:.0}")).unwrap();
        let for_it = designed["recommended_for"].as_str().unwrap();
        assert_eq!(for_it, purpose.replace('_', " "), "{candidates:#?}");
        // By small signals an inverse is as fast as its reference model.
        let bandwidth = designed["bandwidth_rad_s"].as_f64().unwrap();
        assert!((bandwidth / natural - 1.0).abs() < 0.05 && designed["rise_ms"].is_number(), "{designed:#}");
        let text = stand.run(&format!("design --model paper.toml --out c.toml {options}"));
        for other in ["none", "lead", "inverse 94", "inverse 150", "inverse 200"] {
            assert!(text.lines().any(|line| line.trim_start().starts_with(other)), "no {other}: {text}");
        }
    }
    let asked = stand.json("design --kind lead --model paper.toml --out c.toml");
    assert!(asked["recommend"].is_null() && asked["zero_rad_s"].as_f64() > Some(14.0), "{asked:#}");
    // A parameter that only one kind has asks for it.
    let implied = stand.json("design --omega-g 300 --model paper.toml --out c.toml");
    assert!(implied["recommend"].is_null() && implied["zero_rad_s"].is_number(), "{implied:#}");
}

#[test]
fn for_what_is_no_lag_nothing_is_designed_unless_a_kind_is_asked_for() {
    let stand = Stand::new();
    let provenance = "[provenance]\nrecords = [\"a.csv\"]\nversion = \"0.1.0\"\noutput = \"thrust_n\"\n\
                      [provenance.judgement]\nstate = \"not a lag\"\nlimits = [\"the ESC seems to ramp its command\"]\n";
    stand.write("paper.toml", format!("{}{provenance}", table_1()));
    stand.refuses(
        "design --model paper.toml --out c.toml",
        1,
        &["none is recommended for a force", "the motor is not a lag", "`lead` or `inverse`"],
    );
    assert!(!stand.path("c.toml").exists());
    let text = stand.run("design --kind inverse --model paper.toml --out c.toml");
    let flowing = text.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(flowing.contains("as not a lag: the ESC seems to ramp its command"), "{text}");
}

#[test]
fn a_report_draws_what_it_recommends_first() {
    let stand = Stand::with_two_levels();
    stand.run("simulate --model actuators.toml --plan plan.toml --out sim");
    let identified = stand.json("identify sim --out model.toml");
    let report = stand.json("report sim --no-diagnosis --out page.html");
    assert_eq!(report["judgement"], identified["judgement"]);
    assert_eq!(report["candidates"], identified["candidates"]);
    assert_eq!(report["candidates"][0]["actuator"], "none", "{report:#}");
    let figures: Vec<&str> = report["figures"].as_array().unwrap().iter().filter_map(|name| name.as_str()).collect();
    assert_eq!(figures[..2], ["flight_step", "flight_response"], "{figures:?}");
    let page = stand.read("page.html");
    let place = |part: &str| page.find(part).unwrap_or_else(|| panic!("no {part}"));
    assert!(place("id=\"flight_step\"") < place("id=\"identification\""));
    assert!(place("id=\"identification\"") < place("What was done"));
}
