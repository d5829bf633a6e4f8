//! Simulated flights whose motors are known: how far the estimates are off, and how often their intervals hold the truth.
//!
//! `cargo run --release -p rotorlead-identify --example flights -- FIRST_SEED FLIGHTS`

#[path = "../tests/known_truth/flight_records.rs"]
mod flight_records;

use std::collections::BTreeMap;
use std::time::Instant;

use flight_records::{experiment, mean_time_constant_s};
use flights::flight::Flight;
use rayon::prelude::*;
use rotorlead_identify::flight::identify_flights;

struct Outcome {
    seed: u64,
    style: String,
    /// Error of the logarithm of the time constant at each level, and its standard error; or why there is none.
    levels: Result<Vec<(f64, f64)>, String>,
    /// Error of the dead time, ms, and its standard error.
    delay_ms: (f64, f64),
    /// Errors of the same for each motor at the median of the command.
    motors: Vec<f64>,
    seconds: f64,
}

fn outcome(seed: u64) -> Outcome {
    let began = Instant::now();
    let flight = Flight::fly(seed);
    let experiment = experiment(&flight);
    let found = identify_flights(&experiment);
    let style = format!("{:?}, {} Hz", flight.vehicle.style, 4000 / flight.vehicle.log_every);
    let mut outcome = Outcome {
        seed,
        style,
        levels: Err(String::new()),
        delay_ms: (f64::NAN, f64::NAN),
        motors: Vec::new(),
        seconds: 0.0,
    };
    match found {
        Ok(found) => {
            let error = |point: &rotorlead_plant::Point| {
                let truth = mean_time_constant_s(&flight, point.nominal);
                ((point.time_constant_s / truth).ln(), point.time_constant_s_std.unwrap() / point.time_constant_s)
            };
            let point = &found.points[0];
            let ms = |seconds: f64| 1e3 * seconds;
            outcome.delay_ms = (ms(point.delay_s - flight.vehicle.dead_time_s), ms(point.delay_s_std.unwrap()));
            let center = &found.points[found.points.len() / 2];
            let of_motor = |motor: usize| {
                let truth = flight.vehicle.time_constant_s(motor, center.nominal, flight.mean_voltage_v);
                (center.time_constant_s / truth).ln()
            };
            outcome.motors = (0..4).map(of_motor).collect();
            outcome.levels = Ok(found.points.iter().map(error).collect());
        }
        Err(error) => outcome.levels = Err(error.to_string()),
    }
    outcome.seconds = began.elapsed().as_secs_f64();
    outcome
}

fn main() {
    let numbers: Vec<u64> = std::env::args().skip(1).filter_map(|argument| argument.parse().ok()).collect();
    let [first, count] = numbers[..] else {
        eprintln!("give the first seed and how many");
        std::process::exit(2);
    };
    let outcomes: Vec<Outcome> = (first..first + count)
        .into_par_iter()
        .map(|seed| {
            let outcome = outcome(seed);
            let Outcome { style, delay_ms, seconds, .. } = &outcome;
            match &outcome.levels {
                Ok(levels) => {
                    let levels: Vec<String> = levels
                        .iter()
                        .map(|(off, std)| format!("{:+.1} +- {:.1} %", 100.0 * off, 100.0 * std))
                        .collect();
                    println!(
                        "{seed} {style}: {}; delay {:+.2} +- {:.2} ms; {seconds:.0} s",
                        levels.join(", "),
                        delay_ms.0,
                        delay_ms.1,
                    );
                }
                Err(error) => println!("{seed} {style}: {error}"),
            }
            outcome
        })
        .collect();
    let mut by_style: BTreeMap<&str, Vec<&Outcome>> = BTreeMap::new();
    for outcome in &outcomes {
        by_style.entry(outcome.style.split(',').next().unwrap_or_default()).or_default().push(outcome);
        by_style.entry("all").or_default().push(outcome);
    }
    for (style, outcomes) in by_style {
        let known: Vec<&&Outcome> = outcomes.iter().filter(|outcome| outcome.levels.is_ok()).collect();
        println!("{style}: {} of {} refused", outcomes.len() - known.len(), outcomes.len());
        for level in 0..3 {
            let of_level = |outcome: &&&Outcome| {
                let levels = outcome.levels.as_ref().ok()?;
                let place = if levels.len() == 1 { (level == 1).then_some(0)? } else { level };
                levels.get(place).copied()
            };
            let errors: Vec<(f64, f64)> = known.iter().filter_map(of_level).collect();
            let count = errors.len() as f64;
            let bias = errors.iter().map(|(off, _)| off).sum::<f64>() / count;
            let rms = (errors.iter().map(|(off, _)| off * off).sum::<f64>() / count).sqrt();
            let worst = errors.iter().map(|(off, _)| off.abs()).fold(0.0, f64::max);
            let inside = errors.iter().filter(|(off, std)| off.abs() <= 1.96 * std).count();
            println!(
                "  level {level}: bias {:+.2} %, RMS {:.2} %, worst {:.1} %, {inside} of {count} inside 95 %",
                100.0 * bias,
                100.0 * rms,
                100.0 * worst
            );
        }
        let delays: Vec<(f64, f64)> = known.iter().map(|outcome| outcome.delay_ms).collect();
        let motors = known.iter().flat_map(|outcome| {
            let levels = outcome.levels.as_deref().unwrap_or_default();
            let std = levels[levels.len() / 2].1;
            outcome.motors.iter().map(move |off| off.abs() <= 1.96 * std)
        });
        let inside = motors.filter(|inside| *inside).count();
        println!("  each motor, level 1: {inside} of {} inside 95 %", 4 * known.len());
        let inside = delays.iter().filter(|(off, std)| off.abs() <= 1.96 * std).count();
        println!("  dead time: {inside} of {} inside 95 %", delays.len());
    }
    let seeds: Vec<u64> =
        outcomes.iter().filter(|outcome| outcome.levels.is_err()).map(|outcome| outcome.seed).collect();
    println!("refused: {seeds:?}");
}
