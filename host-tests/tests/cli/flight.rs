//! A simulated flight, as Betaflight logs it, through the commands.

use flights::blackbox;
use flights::flight::Flight;
use serde_json::Value;

use crate::stand::Stand;

/// Freestyle of 500 rows a second, which is fast to fit.
const SEED: u64 = 4;

#[test]
fn a_blackbox_of_a_flight_gives_a_lag_a_compensator_and_no_diagnosis() {
    let flight = Flight::fly(SEED);
    let stand = Stand::new();
    stand.write("flight.bbl", blackbox::log(&flight));

    stand.refuses("import flight.bbl --out bench", 1, &["a flight, and no bench run", "--excitation flight"]);
    let text = stand.run("import flight.bbl --excitation flight --out air");
    assert!(text.contains("4 motors are taken") && text.contains("setpoint_roll_rad_s"), "{text}");

    let text = stand.run("identify air --out motor.toml --verbose --json found.json");
    assert!(text.contains("Identified in flight") && text.contains("Each motor"), "{text}");
    let identified: Value = serde_json::from_str(&stand.read("found.json")).unwrap();
    assert_eq!(identified["judgement"]["state"], "ready within limits", "{identified:#}");
    assert_eq!(identified["motors"].as_array().unwrap().len(), 4);
    let points = identified["points"].as_array().unwrap();
    let center = &points[points.len() / 2];
    let number = |key: &str| center[key].as_f64().unwrap();
    let truth = flight.vehicle.time_constant_s(0, number("nominal"), flight.mean_voltage_v);
    assert!((number("time_constant_s") / truth - 1.0).abs() < 0.05, "{center:#} {truth}");
    let model = stand.read("motor.toml");
    assert!(model.contains("excitation = \"flight\""), "{model}");

    let designed: Value = stand.json("design motor.toml --out lead.toml");
    assert_eq!(designed["kind"], "inverse", "{designed:#}");
    stand.refuses("diagnose air", 1, &["in flight the command answers the response"]);
    stand.run("validate air --model motor.toml");
    stand.run("report air --out air.html");
}
