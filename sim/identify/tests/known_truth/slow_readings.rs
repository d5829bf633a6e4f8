//! Sensors slower than the rows of their log: each reading stands in several rows, and is of a moment or the mean since the one before.

use std::fmt::Write as _;
use std::path::Path;

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution as _, Normal};
use rotorlead_identify::check::{RecordFault, check_record};
use rotorlead_identify::identification::{IdentifyOptions, identify};
use rotorlead_identify::lag::steps::{Averaging, StaircaseFit, StepsWarning, fit_staircase};
use rotorlead_identify::validate::validate;
use rotorlead_records::import::{ImportOptions, import_bytes};
use rotorlead_records::{Excitation, Experiment};

/// Commands, each for two seconds.
const LEVELS: [f64; 14] = [0.2, 0.35, 0.5, 0.65, 0.8, 0.65, 0.5, 0.35, 0.2, 0.4, 0.6, 0.8, 0.5, 0.2];
const HELD_S: f64 = 2.0;

#[derive(Clone, Copy)]
enum Reading {
    /// The response of the moment, with noise, rounded.
    Momentary,
    /// Its mean since the reading before, with noise, rounded.
    Mean,
    /// Whole pulses since the reading before, so many per revolution: the step is theirs.
    Pulses(f64),
}

#[derive(Clone, Copy)]
struct Sensor {
    column: &'static str,
    row_s: f64,
    rows_per_reading: f64,
    reading: Reading,
    /// Response units: the step of what is no counter, and its noise.
    step: f64,
    noise: f64,
    tau_s: f64,
    dead_s: f64,
}

const REPEATED: Sensor = Sensor {
    column: "rpm",
    row_s: 0.005,
    rows_per_reading: 10.0,
    reading: Reading::Momentary,
    step: 300.0,
    noise: 20.0,
    tau_s: 0.06,
    dead_s: 0.05,
};

impl Sensor {
    fn level(&self, command: f64) -> f64 {
        let rpm = 2000.0 + 14_000.0 * command;
        if self.column == "rpm" { rpm } else { 1e-7 * rpm * rpm }
    }

    /// The response, and its integral, at each tenth of a millisecond.
    fn response(&self) -> (Vec<f64>, Vec<f64>) {
        let decay = (-1e-4 / self.tau_s).exp();
        let (mut y, mut area) = (self.level(LEVELS[0]), 0.0);
        let (mut response, mut areas) = (Vec::new(), Vec::new());
        for k in 0..(LEVELS.len() as f64 * HELD_S * 1e4) as usize {
            response.push(y);
            areas.push(area);
            area += 1e-4 * y;
            let t = (k as f64 * 1e-4 - self.dead_s).max(0.0);
            let level = self.level(LEVELS[(t / HELD_S + 1e-9) as usize]);
            y = level + (y - level) * decay;
        }
        (response, areas)
    }

    fn experiment(&self, seed: u64) -> Experiment {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let noise = Normal::new(0.0, self.noise).unwrap();
        let (response, areas) = self.response();
        let phase: f64 = rng.random_range(0.0..1.0);
        let at = |t: f64| ((t * 1e4).round() as usize).min(response.len() - 1);
        let mean = |from: f64, until: f64| {
            let (from, until) = (at(from), at(until));
            if from < until { 1e4 * (areas[until] - areas[from]) / (until - from) as f64 } else { response[until] }
        };
        let reading_s = self.row_s * self.rows_per_reading;
        let mut table = format!("time_s,command,{}\n", self.column);
        let (mut next, mut now) = (phase * self.rows_per_reading, f64::NAN);
        let rows = (LEVELS.len() as f64 * HELD_S / self.row_s).round() as usize;
        for row in 0..rows {
            let t = row as f64 * self.row_s;
            if row == 0 || row as f64 >= next {
                next += if row as f64 >= next { self.rows_per_reading } else { 0.0 };
                let noisy = |y: f64, rng: &mut ChaCha8Rng| {
                    let y = y + noise.sample(rng);
                    if self.step > 0.0 { (y / self.step).round() * self.step } else { y }
                };
                now = match self.reading {
                    Reading::Momentary => noisy(response[at(t)], &mut rng),
                    Reading::Mean => noisy(mean((t - reading_s).max(0.0), t), &mut rng),
                    Reading::Pulses(per_turn) => {
                        let pulses = |t: f64| (areas[at(t)] / 60.0 * per_turn + phase).floor();
                        let counted = if t < reading_s {
                            (response[0] * reading_s / 60.0 * per_turn).round()
                        } else {
                            pulses(t) - pulses(t - reading_s)
                        };
                        counted * 60.0 / (per_turn * reading_s)
                    }
                };
            }
            let command = LEVELS[(t / HELD_S + 1e-9) as usize];
            writeln!(table, "{t:.4},{command},{now:.6}").unwrap();
        }
        let options = ImportOptions { excitation: Some(Excitation::Staircase), ..ImportOptions::default() };
        import_bytes(Path::new("log.csv"), table.as_bytes(), &options).unwrap().experiment
    }
}

fn show(name: &str, sensor: &Sensor) {
    for seed in 1..=3 {
        let experiment = sensor.experiment(seed);
        match fit_staircase(&experiment.records[0], experiment.output, None) {
            Ok(fit) => {
                let taus: Vec<f64> = fit.steps.iter().filter_map(|s| Some(1e3 * s.time_constant_s()?.value)).collect();
                let how = fit.warnings.iter().find_map(|w| match w {
                    StepsWarning::Repeats { rows_per_reading, averaging, .. } => Some((*rows_per_reading, *averaging)),
                    _ => None,
                });
                let mean = taus.iter().sum::<f64>() / taus.len() as f64;
                let v = identify(&experiment, &IdentifyOptions::default())
                    .map(|m| validate(&experiment, &m.model).unwrap()[0].residual_power);
                println!(
                    "{name} {seed}: tau {mean:.1} of {} ({} steps), dead {:.1} +- {:.1} of {}, {how:?} {v:?}",
                    1e3 * sensor.tau_s,
                    taus.len(),
                    1e3 * fit.delay_s.value,
                    1e3 * fit.delay_s.std,
                    1e3 * sensor.dead_s
                );
            }
            Err(error) => println!("{name} {seed}: {error}"),
        }
    }
}

#[test]
fn zz_explore() {
    for dead_s in [0.0, 0.05] {
        for row_s in [0.002, 0.005, 0.01] {
            let s = Sensor { dead_s, row_s, ..REPEATED };
            show(&format!("moment {row_s} {dead_s}"), &s);
            show(&format!("noisy moment {row_s} {dead_s}"), &Sensor { noise: 150.0, ..s });
            show(&format!("mean {row_s} {dead_s}"), &Sensor { reading: Reading::Mean, ..s });
            show(&format!("noisy mean {row_s} {dead_s}"), &Sensor { reading: Reading::Mean, noise: 150.0, ..s });
            show(&format!("pulses {row_s} {dead_s}"), &Sensor { reading: Reading::Pulses(0.02 / row_s), ..s });
        }
    }
}
