//! The slew limit of a lead, and the gain on the noise of the command.

use serde_json::Value;

use crate::stand::Stand;

#[test]
fn a_lead_has_the_slew_limit_that_is_given_and_none_otherwise() {
    let stand = Stand::new();
    let free = stand.json("design --kind lead --model model.toml --out free.toml");
    let limited = stand.json("design --kind lead --slew 1 --model model.toml --out limited.toml");
    assert_eq!((&free["slew_per_s"], &limited["slew_per_s"]), (&Value::Null, &1.0.into()));
    assert_eq!(free["coefficients"], limited["coefficients"]);
    assert!(!stand.read("free.toml").contains("slew_per_s"));
    assert!(stand.read("limited.toml").contains("\nslew_per_s = 1.0\n"));
    // What is simulated has it.
    for name in ["free", "limited"] {
        stand.run(&format!("simulate --model model.toml --plan plan.toml --compensator {name}.toml --out {name}"));
    }
    assert_ne!(stand.read("free/u050_square.csv"), stand.read("limited/u050_square.csv"));
}

#[test]
fn design_gives_the_gain_on_the_noise_of_the_command() {
    let stand = Stand::new();
    for kind in ["lead", "inverse"] {
        let values = stand.json(&format!("design --kind {kind} --model model.toml --out {kind}.toml"));
        let gains = values["command_noise_gain"].as_array().unwrap();
        let number = |at: &Value, key: &str| at[key].as_f64().unwrap();
        assert_eq!([0, 1, 2].map(|index: usize| number(&gains[index], "frequency_hz")), [15.0, 30.0, 50.0]);
        let [at_15, at_30, at_50] = [0, 1, 2].map(|index: usize| number(&gains[index], "gain"));
        assert!(at_15 > at_30 && at_30 > at_50 && at_50 > 1.0, "{kind}: {gains:?}");
        let text = stand.run(&format!("design --kind {kind} --model model.toml --out {kind}.toml"));
        for (frequency_hz, gain) in [(15, at_15), (30, at_30), (50, at_50)] {
            let row = text.lines().find(|line| line.trim_start().starts_with(&format!("gain at {frequency_hz} Hz")));
            assert!(row.is_some_and(|row| row.contains(&format!(" {gain:.1} "))), "{kind}: {text}");
        }
    }
}
