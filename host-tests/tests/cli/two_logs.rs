//! One run of a real motor, logged by its ESC with the command and by the thrust stand without it, each on a clock of its own.

use serde_json::Value;

use crate::stand::Stand;

struct Pair {
    esc: &'static str,
    stand: &'static str,
    /// Delay at a time of the stand's log, and skew of the clocks, by hand: for each step the shift that lays the two speeds over each
    /// other best, and a line through the shifts of the steps that both logs show whole.
    by_hand: (f64, f64, f64),
}

const PAIRS: [Pair; 2] = [
    Pair { esc: "f40_steps_5-2.csv", stand: "Log_2019-11-05_171350.csv", by_hand: (12.930, 70.0, 0.0) },
    Pair { esc: "esc32v3_f60-1.csv", stand: "Log_2019-11-07_184325.csv", by_hand: (-8.086, 49.99, 0.0836) },
];

/// A stand with both logs imported, the stand's without a command.
fn imported(pair: &Pair) -> Option<Stand> {
    let (esc, log) = (host_tests::real_log(pair.esc)?, host_tests::real_log(pair.stand)?);
    let stand = Stand::new();
    stand.run(&format!("import {} --out esc", esc.display()));
    let text = stand.run(&format!("import {} --no-command --out apart", log.display()));
    assert!(text.contains("taken without a command") && text.contains("identify\n      --align LOG"), "{text}");
    Some(stand)
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap_or_else(|| panic!("{value}")).iter().filter_map(Value::as_f64).collect()
}

/// Times and the logarithms of the ends of the 95 % intervals of steps with a lag.
fn lags(identified: &Value) -> Vec<(f64, f64, f64)> {
    let steps = identified["detail"]["steps"].as_array().unwrap();
    let with_lag = steps.iter().filter(|step| step["left_out"].is_null() && !step["time_constant_s"].is_null());
    with_lag
        .map(|step| {
            let interval = numbers(&step["time_constant_s_interval"]);
            (step["time_s"].as_f64().unwrap(), interval[0].ln(), interval[1].ln())
        })
        .collect()
}

#[test]
fn a_stand_is_aligned_with_an_esc_by_the_speed_and_gives_the_same_time_constants() {
    for pair in &PAIRS {
        let Some(stand) = imported(pair) else { return };
        let align = format!("identify apart --align esc/{} --merged whole --out stand.toml", pair.esc);
        let (of_stand, of_esc) = (stand.json(&align), stand.json("identify esc --out esc.toml"));
        let found = &of_stand["alignment"][0];
        assert!(found["time_constant_s"].is_null(), "{found:#}");
        let (delay_s, skew) = (numbers(&found["delay_s_interval"]), numbers(&found["skew_interval"]));
        println!("{}: delay {delay_s:.4?} s, skew {skew:.5?}", pair.stand);
        assert!(delay_s[1] - delay_s[0] < 0.012 && skew[1] - skew[0] < 5e-4, "{found:#}");
        let (by_hand_s, at_s, by_hand_skew) = pair.by_hand;
        let value = |key: &str| found[key].as_f64().unwrap();
        // The delay grows by as much on the response's clock.
        let there_s = value("delay_s") + (at_s - value("reference_s")) * value("skew") / (1.0 + value("skew"));
        assert!((there_s - by_hand_s).abs() < 0.02, "{there_s} {found:#}");
        assert!((value("skew") - by_hand_skew).abs() < 1e-3, "{found:#}");

        let (stand_lags, esc_lags) = (lags(&of_stand), lags(&of_esc));
        let pairs: Vec<_> = stand_lags
            .iter()
            .flat_map(|one| {
                esc_lags.iter().filter(|other| (one.0 - other.0).abs() < 0.1).map(move |other| (one, other))
            })
            .collect();
        let differ = pairs.iter().filter(|(one, other)| {
            let half = |lag: &(f64, f64, f64)| (lag.2 - lag.1) / 2.0;
            let middle = |lag: &(f64, f64, f64)| f64::midpoint(lag.1, lag.2);
            (middle(one) - middle(other)).abs() > half(one).hypot(half(other))
        });
        let differ = differ.count();
        println!("{differ} of {} steps have another time constant on the other log", pairs.len());
        assert!(pairs.len() >= 15 && differ <= 1, "{differ} of {}", pairs.len());
    }
}

#[test]
fn what_was_merged_is_a_record_like_any_other() {
    let Some(stand) = imported(&PAIRS[1]) else { return };
    let log = PAIRS[1].esc;
    stand.refuses(
        "identify apart --out a.toml",
        1,
        &["column `command` is missing", "`rotorlead identify --align LOG`"],
    );
    let text = stand.run(&format!("identify apart --align esc/{log} --merged whole --out a.toml"));
    let finding = text.rsplit("\n\n").next().unwrap();
    assert!(finding.contains("ms up") && finding.lines().count() <= 7, "the finding is the last: {finding}");
    for part in ["by the rpm in both logs", "merged records written to whole", "fast by 8.3", "agrees with\n  a watch"]
    {
        assert!(text.contains(part), "no `{part}` in {text}");
    }
    // Voltage and current came along.
    let header = stand.read(&format!("whole/{}", PAIRS[1].stand));
    assert_eq!(header.lines().next(), Some("time_s,command,rpm,voltage_v,current_a"));
    let manifest = stand.read("whole/experiment.toml");
    assert!(manifest.contains("nominal = 0.5") && manifest.contains("amplitude = 0.5"), "{manifest}");
    let (merged, again) = (stand.model("a.toml"), {
        stand.run("identify whole --out b.toml");
        stand.model("b.toml")
    });
    assert_eq!(merged, again);
}

#[test]
fn a_log_without_a_command_takes_no_option_about_one() {
    let stand = Stand::new();
    stand.write("log.csv", "time_s,rpm\n0,1\n");
    let import = "import log.csv --no-command --out motor";
    stand.refuses(&format!("{import} --pulse-us 1000..2000"), 2, &["--no-command", "--pulse-us"]);
    stand.refuses(&format!("{import} --append"), 2, &["--no-command", "--append"]);
}

/// Two staircases look alike, and are of two motors.
#[test]
fn the_log_of_another_run_is_refused() {
    let Some(stand) = imported(&PAIRS[1]) else { return };
    let Some(other) = host_tests::real_log(PAIRS[0].esc) else { return };
    stand.run(&format!("import {} --out other", other.display()));
    let align = format!("identify apart --align other/{} --out m.toml", PAIRS[0].esc);
    stand.refuses(&align, 1, &["agree to 81.7 % fit only", "of the same run"]);
}
