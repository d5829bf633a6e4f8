//! How late the whole chain is, and whether what a compensator gains can be used.

use std::f64::consts::PI;

use rotorlead_results::paper::table_1;
use serde_json::Value;

use crate::stand::{MODEL, Stand, flowing};

/// From pulse in to pulse out with the defaults: half of 1000 to 2000 us, the filter of the input, half a tick.
const LATENCY_S: f64 = 1602.2e-6;

/// A stand whose model has this dead time at both points.
fn late(delay_s: f64) -> Stand {
    let stand = Stand::new();
    stand.write("model.toml", MODEL.replace("time_constant_s", &format!("delay_s = {delay_s}\ntime_constant_s")));
    stand
}

fn number(value: &Value, key: &str) -> f64 {
    value[key].as_f64().unwrap_or_else(|| panic!("`{key}` is no number in {value:#}"))
}

/// The phase of lag and dead time, degrees.
fn lag_deg(omega: f64, time_constant_s: f64, dead_time_s: f64) -> f64 {
    -((omega * time_constant_s).atan() + omega * dead_time_s).to_degrees()
}

#[test]
fn beside_each_bandwidth_stands_the_phase_of_the_whole_chain() {
    let stand = late(0.036);
    let json = stand.json("bandwidth --model model.toml");
    let latency = &json["latency"];
    assert!((number(latency, "mean_s") - LATENCY_S).abs() < 1e-12, "{latency}");
    for (point, time_constant_s) in json["points"].as_array().unwrap().iter().zip([0.08, 0.06]) {
        assert_eq!(number(point, "dead_time_s"), 0.036);
        let (bandwidth, phase) = (number(point, "uncompensated_rad_s"), number(point, "uncompensated_phase_deg"));
        assert!((phase - lag_deg(bandwidth, time_constant_s, 0.036 + LATENCY_S)).abs() < 1e-6, "{point}");
        let minus_90 = number(point, "uncompensated_minus_90_rad_s");
        assert!((lag_deg(minus_90, time_constant_s, 0.036 + LATENCY_S) + 90.0).abs() < 1e-6, "{point}");
        // Two poles instead of the lag: they are at -90 degrees at their frequency, and the dead time comes to that.
        assert!(number(point, "compensated_minus_90_rad_s") > minus_90);
    }
    let fast = &json["points"][1];
    let (bandwidth, phase) = (number(fast, "compensated_rad_s"), number(fast, "compensated_phase_deg"));
    let omega_f = (200.0 * PI / 0.06).sqrt();
    let poles = (2f64.sqrt() * omega_f * bandwidth).atan2(omega_f.powi(2) - bandwidth.powi(2));
    assert!((phase + (poles + bandwidth * (0.036 + LATENCY_S)).to_degrees()).abs() < 1e-6, "{fast}");
    let text = stand.run("bandwidth --model model.toml");
    for part in [format!("{bandwidth:.4}"), format!("{phase:.1}")] {
        assert!(text.contains(&part), "no `{part}` in:\n{text}");
    }
    assert!(text.lines().all(|line| line.len() <= 80), "too wide:\n{text}");
    for part in ["1.60 ms on average from pulse in to pulse out", "36.00 ms of dead time in the model"] {
        assert!(flowing(&text).contains(part), "no `{part}` in:\n{text}");
    }
}

#[test]
fn a_sampled_chain_counts_its_holds_once_and_names_them() {
    let stand = Stand::new();
    table_1().write(&stand.path("model.toml")).unwrap();
    let counted = |options: &str| {
        let command = format!("bandwidth --model model.toml --sampled {options}");
        let latency = stand.json(&command)["latency"].clone();
        let part = |key: &str| 1e6 * number(&latency["counted"], key);
        let waits = ["tick_and_frame_uncompensated_s", "tick_and_frame_compensated_s"].map(part);
        assert!((part("input_pulse_s") + part("input_filter_s") - 1502.2).abs() < 1e-6, "{latency}");
        (waits, flowing(&stand.run(&command)))
    };
    let close = |[a, b]: [f64; 2], [c, d]: [f64; 2]| assert!((a - c).abs() < 1e-6 && (b - d).abs() < 1e-6, "{a} {b}");
    // The default frames follow: half a tick, and with the filter half a frame.
    let (waits, text) = counted("--esc-frame 450");
    close(waits, [100.0, 100.0 + 0.5e6 / 450.0]);
    assert!(text.contains("0.10 ms for the tick without the compensator, and 1.21 ms with it"), "{text}");
    assert!(text.contains("half an ESC frame at 450 Hz"), "{text}");
    // Frames that run freely, 12.5 ticks long, are held for half a frame, from a tick that is a quarter old on average.
    let (waits, text) = counted("--output-frame 400 --esc-frame 400");
    close(waits, [1300.0, 1300.0]);
    assert!(text.contains("1.30 ms for the holds of tick and ESC frame at 400 Hz, in place of 1.35 ms"), "{text}");
    let (waits, text) = counted("");
    close(waits, [100.0, 100.0]);
    assert!(text.contains("0.10 ms for tick and output frame"), "{text}");
    assert!(stand.json("bandwidth --model model.toml")["latency"].get("counted").is_none());
}

#[test]
fn a_dead_time_that_makes_the_gained_bandwidth_worthless_is_warned_of() {
    let stand = late(0.036);
    let json = stand.json("bandwidth --model model.toml");
    let fast = &json["points"][1];
    for command in ["design --kind lead --model model.toml --out c.toml", "bandwidth --model model.toml"] {
        let warnings = stand.json(command)["warnings"].clone();
        let [Value::String(warning)] = warnings.as_array().unwrap().as_slice() else { panic!("{warnings}") };
        let bandwidth = number(fast, "compensated_rad_s");
        for part in [
            format!("promises {bandwidth:.1} rad/s instead of {:.1}", number(fast, "uncompensated_rad_s")),
            "37.6 ms (model 36.0, pulse in to pulse out 1.6)".to_owned(),
            format!("alone lags {:.0} degrees", (bandwidth * (0.036 + LATENCY_S)).to_degrees()),
            format!("whole chain is {:.0}", number(fast, "compensated_phase_deg")),
            format!("up to {:.1} rad/s, where it lags 90 degrees", number(fast, "compensated_minus_90_rad_s")),
            "record again".to_owned(),
            "A lower bandwidth does not shorten it".to_owned(),
        ] {
            assert!(warning.contains(&part), "no `{part}` in {warning}");
        }
        // What to do stands on lines of its own.
        let (message, remedy) = warning.split_once("; ").unwrap();
        let text = flowing(&stand.run(command));
        assert!(text.contains(&format!("warning: {message} help: {remedy}")), "{command}: {text}");
    }
    stand.run("bandwidth --model model.toml --report report.html");
    assert!(stand.read("report.html").contains("dead time makes the gained bandwidth worthless"));
    // Counted as an effect it is the same dead time.
    stand.write(
        "model.toml",
        format!("{MODEL}[[effect]]\nkind = \"transport_delay\"\nparameters = {{ delay_s = 0.036 }}\n"),
    );
    let same = stand.json("design --kind lead --model model.toml --out c.toml");
    assert_eq!(same["warnings"].as_array().unwrap().len(), 1);
    let (a, b) = (number(&same["points"][1], "compensated_phase_deg"), number(fast, "compensated_phase_deg"));
    assert!((a - b).abs() < 1e-6, "{a} and {b}");
}

#[test]
fn a_report_has_the_bandwidths_and_phases_of_its_model() {
    let stand = Stand::new();
    let model = format!("{MODEL}[[effect]]\nkind = \"transport_delay\"\nparameters = {{ delay_s = 0.02 }}\n");
    stand.write("model.toml", model);
    stand.run("simulate --model model.toml --plan plan.toml --out sim");
    stand.run("report sim --model model.toml --kind lead --no-diagnosis --out report.html --figures of-report");
    let page = stand.read("report.html");
    // What the table counts is said below it, as on a terminal.
    for part in ["on average from pulse in to pulse out", "Counted: transport_delay."] {
        assert!(page.contains(part), "no `{part}`");
    }
    stand.run("bandwidth --model model.toml --figures of-bandwidth");
    let table = stand.read("of-bandwidth/predicted_bandwidth.csv");
    assert!(table.contains("compensated_phase_deg"), "{table}");
    assert_eq!(stand.read("of-report/predicted_bandwidth.csv"), table);
}

#[test]
fn the_papers_motors_get_no_warning_with_any_protocol() {
    let stand = Stand::new();
    table_1().write(&stand.path("model.toml")).unwrap();
    for options in [
        "",
        "--output-frame 400",
        "--input-protocol oneshot125",
        "--input-protocol oneshot125 --output-frame 2000",
        "--input-protocol raw_duty",
    ] {
        for command in ["design --kind lead --model model.toml --out c.toml", "bandwidth --model model.toml"] {
            let json = stand.json(&format!("{command} {options}"));
            assert_eq!(json["warnings"], Value::Array(Vec::new()), "{options}");
        }
    }
    // Servo pulses at 50 Hz in and out are late by 11.6 ms.
    let slow = stand.json("bandwidth --model model.toml --input-frame 50 --output-frame 50");
    assert!((number(&slow["latency"], "mean_s") - 11602.2e-6).abs() < 1e-12);
    assert!(slow["warnings"][0].as_str().unwrap().contains("--output-protocol oneshot125"), "{slow}");
}

#[test]
fn the_latency_is_that_of_the_pulses_that_are_given() {
    let stand = Stand::new();
    let latency = |options: &str| stand.json(&format!("bandwidth --model model.toml {options}"))["latency"].clone();
    for (options, mean_us, worst_us, start) in [
        ("", 1602.2, 2202.2, "follows_input"),
        // Frames as fast as the input's drift: half a frame and a whole one.
        ("--output-frame 400", 2852.2, 4702.2, "free_running"),
        ("--output-frame 380", 2917.9895, 4833.7789, "free_running"),
        // Half a frame and a whole one for the pulse, and again for the frame.
        ("--input-protocol raw_duty", 1768.8667, 3535.5333, "free_running"),
        ("--input-protocol oneshot125", 298.0333, 452.2, "follows_input"),
        // Several frames to an input pulse.
        ("--output-protocol oneshot125", 1810.5333, 2618.8667, "free_running"),
        ("--output-protocol oneshot125 --output-frame 450", 1602.2, 2202.2, "follows_input"),
        ("--output-protocol raw_duty --output-frame 1000", 2102.2, 3202.2, "free_running"),
        ("--loop-rate 10000", 1552.2, 2102.2, "follows_input"),
    ] {
        let found = latency(options);
        assert!((1e6 * number(&found, "mean_s") - mean_us).abs() < 1e-2, "{options}: {found:#}");
        assert!((1e6 * number(&found, "worst_s") - worst_us).abs() < 1e-3, "{options}: {found:#}");
        assert_eq!(found["output_start"], start, "{options}");
        let steps = found["steps"].as_object().unwrap();
        assert!(
            (steps.values().map(|step| number(step, "mean_s")).sum::<f64>() - number(&found, "mean_s")).abs() < 1e-12
        );
    }
    // A compensator brings its own loop.
    stand.run("design --kind lead --model model.toml --loop-rate 10000 --out c.toml");
    assert_eq!(latency("--compensator c.toml"), latency("--loop-rate 10000"));
}

#[test]
fn pulses_that_a_controller_refuses_are_wrong_use() {
    let stand = Stand::new();
    for command in ["design --kind lead --model model.toml --out c.toml", "bandwidth --model model.toml"] {
        for (options, parts) in [
            ("--input-protocol dshot1200", &["--input-protocol", "standard_pwm", "oneshot125", "raw_duty"][..]),
            ("--input-frame 500", &["input.frame_hz", "2000 us", "use 495 Hz or less", "--input-frame"]),
            ("--output-protocol oneshot125 --output-frame 4000", &["output.frame_hz", "use 3703 Hz or less"]),
            ("--input-protocol raw_duty --input-frame 1501", &["input.frame_hz is 1501", "40 to 1500"]),
            ("--input-frame 39", &["input.frame_hz is 39", "40 to 4000"]),
            ("--output-frame -5", &["--output-frame", "-5"]),
        ] {
            stand.refuses(&format!("{command} {options}"), 2, parts);
        }
    }
}

#[test]
fn a_real_log_with_32_ms_of_dead_time_is_warned_of_and_one_with_none_is_not() {
    let designed = |log: &str, columns: &[&str]| {
        let file = host_tests::real_log(log)?;
        let stand = Stand::new();
        let mut import = stand.command("import --out log --excitation staircase");
        import.arg(file).args(columns).assert().code(0);
        stand.run("identify log --out found.toml");
        Some(stand.json("design --kind lead --model found.toml --out c.toml"))
    };
    let warnings = |json: &Value| {
        let all = json["warnings"].as_array().unwrap().iter().map(|warning| warning.as_str().unwrap().to_owned());
        all.filter(|warning| warning.contains("dead time")).collect::<Vec<_>>()
    };
    // A thrust stand's log, of about 85 rows per second; commands of DShot, 0 to 2047.
    let columns = [
        "--pulse-us",
        "0..2047",
        "--column",
        "command=ESC signal:us",
        "--column",
        "rpm=Motor Optical Speed (rad/s):rad/s",
    ];
    if let Some(json) = designed("../sar_simulation/micro_2023-12-17_162234.csv", &columns) {
        let [warning] = &warnings(&json)[..] else { panic!("{json:#}") };
        assert!(warning.contains("worthless at 17 of 17 points") && warning.contains("model 32.3"), "{warning}");
        for point in json["points"].as_array().unwrap() {
            let (bandwidth, usable) = (number(point, "compensated_rad_s"), number(point, "compensated_minus_90_rad_s"));
            assert!((50.0..180.0).contains(&bandwidth) && (29.0..39.0).contains(&usable), "{point}");
        }
    }
    // The ESC's own log has no dead time.
    if let Some(json) = designed("esc32v3_f60-1.csv", &[]) {
        assert_eq!(warnings(&json), [""; 0]);
    }
}
