//! `identify --stand` and `--stand-model`, from a hammer's records on.

use std::f64::consts::TAU;
use std::fmt::Write as _;

use serde_json::Value;

use crate::stand::Stand;

/// A blow on a resonance at 60 Hz of damping 0.05, 2 s at 2 kHz, with a ripple of 1 mN for noise.
fn blow() -> String {
    let mut csv = String::from("time_s,command,thrust_n\n");
    let (mut position, mut velocity) = (0.0, 0.0);
    let omega = TAU * 60.0;
    let steps = 200;
    let h = 1.0 / 2000.0 / f64::from(steps);
    let force = |t: f64| 20.0 * (-0.5 * ((t - 0.02) / 1e-3).powi(2)).exp();
    let mut state = 1u64;
    for row in 0..4000 {
        let t = f64::from(row) / 2000.0;
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let ripple = 2e-3 * ((state >> 33) as f64 / 2f64.powi(31) - 0.5);
        writeln!(csv, "{t},{},{}", force(t), position + ripple).unwrap();
        for step in 0..steps {
            let u = force(t + (f64::from(step) + 0.5) * h);
            // Leapfrog: its error of (omega h)^2 / 24 is far below the noise.
            velocity += h * (omega * omega * (u - position) - 2.0 * 0.05 * omega * velocity);
            position += h * velocity;
        }
    }
    csv
}

fn hammer() -> Stand {
    let stand = Stand::new();
    std::fs::create_dir(stand.path("hammer")).unwrap();
    stand.write(
        "hammer/experiment.toml",
        "format = 1\nname = \"hammer\"\ncommand = \"force_n\"\noutput = \"thrust_n\"\n[[record]]\nfile = \"blow.csv\"\n\
         nominal = 0\nexcitation = \"free\"\n",
    );
    stand.write("hammer/blow.csv", blow());
    stand
}

#[test]
fn a_blow_becomes_a_table_and_a_file_that_the_motor_fit_takes() {
    let stand = hammer();
    let identify = ["identify", "--stand", "hammer", "--out", "stand.toml", "--json", "stand.json", "--order", "2"];
    let done = stand.run(&identify).success();
    let text = String::from_utf8(done.get_output().stdout.clone()).unwrap();
    for part in ["pole", "60.0", "0.050", "Usable up to 3", "Written to stand.toml"] {
        assert!(text.contains(part), "{part}: {text}");
    }
    let json: Value = serde_json::from_str(&std::fs::read_to_string(stand.path("stand.json")).unwrap()).unwrap();
    assert!((json["poles"][0]["frequency_hz"].as_f64().unwrap() - 60.0).abs() < 0.05, "{json:#}");
    assert!((json["poles"][0]["damping"].as_f64().unwrap() - 0.05).abs() < 1e-3, "{json:#}");
    // |1 / (1 - x^2 + 0.1 j x)| is 3 dB above one at x = 0.5412.
    assert!((json["usable_hz"].as_f64().unwrap() - 32.47).abs() < 0.1, "{json:#}");

    stand.run(&["simulate", "--model", "model.toml", "--plan", "plan.toml", "--out", "motor"]).success();
    stand.run(&["identify", "motor", "--out", "found.toml", "--stand-model", "stand.toml"]).success();
    let refused = stand.run(&["identify", "stand", "--out", "steps.toml", "--stand-model", "stand.toml"]).code(2);
    let words = String::from_utf8(refused.get_output().stderr.clone()).unwrap();
    assert!(words.contains("--stand-model is for multisine records"), "{words}");
}

#[test]
fn a_force_is_no_duty_and_a_duty_no_force() {
    let stand = hammer();
    for (arguments, part) in [
        (["identify", "hammer", "--out", "a.toml"].as_slice(), "identify --stand"),
        (&["identify", "--stand", "stand", "--out", "a.toml"], "force_n"),
    ] {
        let refused = stand.run(arguments).code(1);
        let words = String::from_utf8(refused.get_output().stderr.clone()).unwrap();
        assert!(words.contains(part) && words.contains("experiment.toml:3"), "{words}");
    }
    stand.run(&["identify", "stand", "--out", "a.toml", "--order", "8"]).code(2);
    stand.run(&["identify", "--stand", "hammer", "--out", "a.toml", "--stand-model", "b.toml"]).code(2);
}
