//! The simulated samples are what the motor and the plan beside them give. With `ROTORLEAD_UPDATE_PAGES=1` in the environment, as
//! `cargo xtask docs` sets it, they are written.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use rotorlead_plant::Model;
use rotorlead_plant::bench::{Plan, run};

/// What is hidden in `hidden.csv`: a ramp that somebody left on in the ESC.
const RAMP: &str = "[[effect]]\nkind = \"slew_limit\"\nparameters = { rate_per_s = 0.5 }\n";

fn samples() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("samples")
}

fn read(name: &str) -> String {
    fs::read_to_string(samples().join(name)).unwrap()
}

/// The log of a thrust stand of the RCbenchmark 1780 series, in its columns, units and decimals.
fn log(model: &str, seed: u64) -> String {
    let model: Model = toml::from_str(model).unwrap();
    let plan = Plan { seed, ..toml::from_str(&read("plan.toml")).unwrap() };
    let record = run(&plan, &model, None, &|_| ()).unwrap().records.remove(0);
    let mut table = String::from("Time (s),ESC A (µs),Thrust A (N)\n");
    for ((time_s, command), thrust_n) in record.time_s.iter().zip(&record.command).zip(&record.thrust_n.unwrap()) {
        writeln!(table, "{time_s:.3},{:.0},{thrust_n:.3}", 1000.0 + 1000.0 * command).unwrap();
    }
    table
}

#[test]
fn the_simulated_samples_are_made_from_their_motor_and_plan() {
    let motor = read("motor.toml");
    for (name, model, seed) in
        [("staircase.csv", motor.clone(), 1), ("second-run.csv", motor.clone(), 2), ("hidden.csv", motor + RAMP, 3)]
    {
        let log = log(&model, seed);
        if std::env::var_os("ROTORLEAD_UPDATE_PAGES").is_some() {
            fs::write(samples().join(name), log).unwrap();
        } else {
            assert!(read(name) == log, "`cargo xtask docs` brings {name} up to date");
        }
    }
}
