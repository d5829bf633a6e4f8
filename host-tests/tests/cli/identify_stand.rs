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
    let text = stand.run("identify --stand hammer --out stand.toml --json stand.json --order 2");
    for part in ["pole", "60.00", "0.0500", "Usable up to 32.", "Written to stand.toml"] {
        assert!(text.contains(part), "{part}: {text}");
    }
    let json: Value = serde_json::from_str(&stand.read("stand.json")).unwrap();
    assert!((json["poles"][0]["frequency_hz"].as_f64().unwrap() - 60.0).abs() < 0.05, "{json:#}");
    assert!((json["poles"][0]["damping"].as_f64().unwrap() - 0.05).abs() < 1e-3, "{json:#}");
    // |1 / (1 - x^2 + 0.1 j x)| is 3 dB above one at x = 0.5423.
    assert!((json["usable_hz"].as_f64().unwrap() - 32.54).abs() < 0.1, "{json:#}");

    stand.run("simulate --model model.toml --plan plan.toml --out motor");
    stand.run("identify motor --out found.toml --stand-model stand.toml");
    stand.refuses(
        "identify stand --out steps.toml --stand-model stand.toml",
        2,
        &["--stand-model is for multisine records"],
    );
}

#[test]
fn a_force_is_no_duty_and_a_duty_no_force() {
    let stand = hammer();
    stand.refuses("identify hammer --out a.toml", 1, &["experiment.toml:3", "identify --stand"]);
    stand.refuses("identify --stand stand --out a.toml", 1, &["experiment.toml:3", "force_n"]);
    stand.refuses("identify stand --out a.toml --order 8", 2, &["--stand"]);
    stand.refuses("identify --stand hammer --out a.toml --stand-model b.toml", 2, &["--stand-model"]);
}

#[test]
fn poles_that_zeros_cancel_are_named_and_the_chosen_order_has_none() {
    let stand = hammer();
    let text = stand.run("identify --stand hammer --out a.toml --order 6");
    assert!(text.contains("have a zero where they"), "{text}");
    let chosen = stand.json("identify --stand hammer");
    assert_eq!(chosen["poles"].as_array().unwrap().len(), 1, "{chosen:#}");
    assert_eq!(chosen["warnings"].as_array().unwrap().len(), 0, "{chosen:#}");
}
