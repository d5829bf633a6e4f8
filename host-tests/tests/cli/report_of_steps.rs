//! What a report says of logs of real motors, beside what the single commands say.

use crate::stand::Stand;

/// `identify`, `design`, `bandwidth` and `report` have one set of numbers, whatever the diagnosis finds beside it.
#[test]
fn a_report_on_steps_has_the_numbers_of_the_single_commands() {
    for (log, is_delayed) in
        [("Log_2019-11-09_181347.csv", true), ("so_v5_2023-12-13_130935.csv", true), ("f40_steps_5-2.csv", false)]
    {
        let Some(file) = host_tests::real_log(log) else { return };
        let stand = Stand::new();
        stand.run(&format!("import {} --out log", file.display()));
        stand.run("identify log --out m.toml");
        let bandwidth = stand.json("bandwidth --model m.toml");
        let extent = |key: &str| {
            let values = bandwidth["points"].as_array().unwrap().iter().filter_map(|point| point[key].as_f64());
            values.fold((f64::INFINITY, 0.0), |(low, high): (f64, f64), value| (low.min(value), high.max(value)))
        };
        let (without, with) = (extent("uncompensated_rad_s"), extent("compensated_rad_s"));
        stand.run("report log --kind lead --out r.html --json r.json");
        let report: serde_json::Value = serde_json::from_str(&stand.read("r.json")).unwrap();
        let said = report["sentences"].to_string();
        let expected = format!(
            "Predicted bandwidth: {:.1} to {:.1} rad/s without, {:.1} to {:.1} rad/s with the compensator.",
            without.0, without.1, with.0, with.1
        );
        assert!(said.contains(&expected), "no `{expected}` in {said}");
        assert_eq!(report["points"], stand.json("identify log --out again.toml")["points"]);
        // The diagnosis names something, and its one lag for all levels stands beside them nowhere.
        assert_ne!(report["diagnosis"], "agrees", "{report:#}");
        assert!(!said.contains("With that in the model"), "{said}");
        let page = stand.read("r.html");
        assert!(page.contains("Kinds tried in turn on steps"), "{log}");
        assert_eq!(page.contains("Whose delay"), is_delayed, "{log}");
    }
}

#[test]
fn a_report_on_a_table_of_averages_has_its_static_map_and_says_what_cannot_be_known() {
    let Some(file) = host_tests::real_log("so_v5_steps_2024-02-06_103903.csv") else { return };
    let stand = Stand::new();
    stand.run(&format!("import {} --out log", file.display()));
    stand.run("report log --out r.html --json r.json");
    let report: serde_json::Value = serde_json::from_str(&stand.read("r.json")).unwrap();
    assert_eq!(report["points"], serde_json::json!([]));
    for part in ["validation", "compensator", "diagnosis"] {
        assert!(report["left_out"][part].is_string(), "{part}: {report:#}");
    }
    assert!(report["left_out"]["validation"].to_string().contains("a static map alone"), "{report:#}");
    assert!(stand.read("r.html").contains("Static map"));
}
