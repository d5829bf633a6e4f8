//! Sensors slower than the rows of their log: each reading stands in several rows, and is of a moment or the mean since the one before.

use std::fmt::Write as _;
use std::path::Path;

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution as _, Normal};
use rotorlead_identify::check::check_record;
use rotorlead_identify::identification::{IdentifyOptions, identify};
use rotorlead_identify::lag::steps::{Averaging, Direction, StaircaseFit, StepsWarning, fit_staircase};
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
        // No level is a whole number of a counter's steps.
        let rpm = 2117.0 + 13_943.0 * command;
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

fn averaging(fit: &StaircaseFit) -> Option<(f64, Averaging)> {
    fit.warnings.iter().find_map(|warning| match warning {
        StepsWarning::Repeats { rows_per_reading, averaging, .. } => Some((*rows_per_reading, *averaging)),
        _ => None,
    })
}

/// The repetition is seen, readings are taken as what they are or nothing is claimed, and the lag is that of the motor. How many of five
/// logs show what a reading is.
#[track_caller]
fn assert_right(sensor: &Sensor) -> usize {
    let is_mean = !matches!(sensor.reading, Reading::Momentary);
    let reading_s = sensor.row_s * sensor.rows_per_reading;
    let mut known = 0;
    for seed in 1..=5 {
        let experiment = sensor.experiment(seed);
        let record = &experiment.records[0];
        let findings = check_record(&experiment, record, false);
        assert!(findings.iter().any(|finding| finding.message.contains("is repeated")), "{findings:?}");
        let fit = fit_staircase(record, experiment.output, None).unwrap();
        let (rows, averaging) = averaging(&fit).expect("readings that repeat");
        assert!((rows / sensor.rows_per_reading - 1.0).abs() < 2e-3, "seed {seed}: {rows}");
        let costs_s = match averaging {
            // What it would be if each reading were a mean is said.
            Averaging::Unknown if is_mean => 0.5 * reading_s,
            Averaging::Unknown => 0.0,
            Averaging::Mean | Averaging::Counted => {
                assert!(is_mean, "seed {seed}: {averaging:?}");
                0.0
            }
            Averaging::Momentary => {
                assert!(!is_mean, "seed {seed}: {averaging:?}");
                0.0
            }
        };
        known += usize::from(averaging != Averaging::Unknown);
        let off_s = fit.delay_s.value - sensor.dead_s - costs_s;
        assert!(off_s.abs() < 0.1 * reading_s, "seed {seed}, {averaging:?}: {:?} of {}", fit.delay_s, sensor.dead_s);
        // Each by how well it is known: a step of few counts hardly shows its lag.
        let known_taus = fit.steps.iter().filter_map(|step| step.time_constant_s());
        let (sum, weights) = known_taus.fold((0.0, 0.0), |(sum, weights), tau| {
            let weight = (tau.value / tau.std).powi(2);
            (sum + weight * tau.value.ln(), weights + weight)
        });
        let tau_s = (sum / weights).exp();
        // A few readings are all there is of a lag that is shorter than they are apart; those that stand still on a count know it to what
        // its interval says.
        let known_s = 0.06 * (sensor.tau_s + reading_s);
        let holds = |direction| {
            let (low, high) = fit.curve.as_ref()?.average(direction)?.interval_of_logarithm(0.99);
            Some(low < sensor.tau_s && sensor.tau_s < high)
        };
        let is_held = [Direction::Up, Direction::Down].map(holds) == [Some(true); 2];
        let is_near = (tau_s - sensor.tau_s).abs() < known_s;
        assert!(is_near || is_held, "seed {seed}, {averaging:?}: {tau_s} of {}", sensor.tau_s);
        // As every command judges it.
        let model = identify(&experiment, &IdentifyOptions::default()).unwrap().model;
        let judged = &validate(&experiment, &model).unwrap()[0];
        assert!(judged.residual_power.is_none_or(|power| !power.is_below_noise()), "{:?}", judged.residual_power);
        assert!(judged.fit_percent > 90.0, "seed {seed}: {}", judged.fit_percent);
    }
    known
}

/// Steps of 300 rpm, each reading in 10 rows of 5 ms.
#[test]
fn repeated_speeds_of_a_coarse_sensor() {
    assert_right(&REPEATED);
    // No mean begins before its command.
    assert_eq!(assert_right(&Sensor { dead_s: 0.0, ..REPEATED }), 5);
}

/// The same steps as two and four pulses per revolution.
#[test]
fn counted_pulses() {
    for dead_s in [0.0, 0.05] {
        let counted = Sensor { reading: Reading::Pulses(4.0), dead_s, ..REPEATED };
        assert_eq!(assert_right(&counted), 5);
        assert_eq!(assert_right(&Sensor { reading: Reading::Pulses(2.0), row_s: 0.01, ..counted }), 5);
    }
}

#[test]
fn counted_pulses_of_fourteen_poles_in_fourteen_rows() {
    for dead_s in [0.0, 0.03] {
        let reading = Reading::Pulses(7.0);
        let counted = Sensor { reading, row_s: 0.002, rows_per_reading: 14.0, dead_s, tau_s: 0.045, ..REPEATED };
        assert_eq!(assert_right(&counted), 5);
    }
}

/// 80 readings a second in rows of 1 ms: twelve and thirteen rows.
#[test]
fn a_coarse_load_cell_with_a_clock_of_its_own() {
    for dead_s in [0.0, 0.05] {
        assert_right(&Sensor {
            column: "thrust_n",
            row_s: 0.001,
            rows_per_reading: 12.5,
            step: 0.05,
            noise: 0.03,
            dead_s,
            ..REPEATED
        });
    }
}

#[test]
fn a_load_cell_that_gives_the_mean_since_it_was_read() {
    let mean = Sensor {
        column: "thrust_n",
        reading: Reading::Mean,
        row_s: 0.01,
        rows_per_reading: 8.0,
        step: 0.02,
        noise: 0.02,
        ..REPEATED
    };
    assert!(assert_right(&mean) > 0);
    assert!(assert_right(&Sensor { dead_s: 0.0, ..mean }) > 0);
}

#[test]
fn fine_speeds_show_by_their_corners_whether_they_are_means() {
    let fine = Sensor { row_s: 0.004, step: 0.0, tau_s: 0.04, ..REPEATED };
    assert!(assert_right(&fine) > 2);
    assert!(assert_right(&Sensor { reading: Reading::Mean, ..fine }) > 2);
}

/// A hum that comes when the levels have settled makes the noise seem louder than it is where the response moves.
#[test]
fn less_than_noise_is_no_pass() {
    let mut experiment = Sensor { rows_per_reading: 1.0, step: 0.0, ..REPEATED }.experiment(1);
    let model = identify(&experiment, &IdentifyOptions::default()).unwrap().model;
    let before = validate(&experiment, &model).unwrap();
    assert!(before[0].judged_residual().is_some(), "{:?}", before[0].residual_power);
    let record = &mut experiment.records[0];
    for (t, rpm) in record.time_s.iter().zip(record.rpm.as_mut().unwrap()) {
        if t % HELD_S > 0.5 * HELD_S {
            *rpm += 60.0 * (t * 311.0).sin();
        }
    }
    let after = validate(&experiment, &model).unwrap();
    let power = after[0].residual_power.unwrap();
    assert!(power.is_below_noise() && power.p_value > 0.999 && after[0].judged_residual().is_none(), "{power:?}");
}
