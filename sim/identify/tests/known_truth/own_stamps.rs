//! Steps whose command is logged on stamps of its own: the dead time counts from those, and not from the next row of the response.

use std::fmt::Write as _;
use std::path::Path;

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution as _, Normal};
use rotorlead_identify::lag::steps::{StaircaseFit, StepsWarning, fit_staircase};
use rotorlead_records::import::{Import, ImportOptions, import, import_bytes};
use rotorlead_records::shared_data::data;
use rotorlead_records::{Excitation, Output, Record};

const TAU_S: f64 = 0.06;
/// Commands, each for two seconds.
const LEVELS: [f64; 7] = [0.2, 0.35, 0.5, 0.65, 0.5, 0.35, 0.2];

/// A motor of 60 ms behind a dead time, and when its commands were given.
struct Motor {
    dead_s: f64,
    begins_s: [f64; LEVELS.len()],
}

impl Motor {
    /// Its commands come at any moment between two reports.
    fn new(dead_s: f64, seed: u64) -> (Self, ChaCha8Rng) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let begins_s = std::array::from_fn(|k| 2.0 * k as f64 + rng.random_range(0.0..0.04));
        (Self { dead_s, begins_s }, rng)
    }

    fn command(&self, t: f64) -> f64 {
        LEVELS[self.begins_s.partition_point(|begin| *begin <= t).saturating_sub(1)]
    }

    fn rpm(&self, t: f64) -> f64 {
        let (mut rpm, mut from) = (LEVELS[0], self.begins_s[0]);
        for (k, begin) in self.begins_s.iter().enumerate().skip(1) {
            let until = (begin + self.dead_s).min(t);
            rpm = LEVELS[k - 1] + (rpm - LEVELS[k - 1]) * (-(until - from).max(0.0) / TAU_S).exp();
            from = until;
        }
        let last = self.begins_s.partition_point(|begin| begin + self.dead_s <= t).max(1) - 1;
        1e4 * (LEVELS[last] + (rpm - LEVELS[last]) * (-(t - from).max(0.0) / TAU_S).exp())
    }

    /// The same, whose commands are given at the first of some stamps.
    fn at(mut self, stamps_s: &[f64]) -> Self {
        let next = |begin: f64| stamps_s.iter().copied().find(|stamp| *stamp >= begin).unwrap_or(begin);
        self.begins_s = self.begins_s.map(next);
        self
    }

    /// A reading, with noise.
    fn reading(&self, rng: &mut ChaCha8Rng, t: f64) -> f64 {
        self.rpm(t) + Normal::new(0.0, 10.0).unwrap().sample(rng)
    }

    /// Moments about `interval_s` apart.
    fn stamps(rng: &mut ChaCha8Rng, interval_s: f64) -> Vec<f64> {
        (0..(14.0 / interval_s) as usize).map(|k| interval_s * (k as f64 + 1.0 + rng.random_range(-0.1..0.1))).collect()
    }
}

fn fitted(record: &Record) -> StaircaseFit {
    fit_staircase(record, Output::Rpm, None).unwrap()
}

/// The record has all steps, and its dead time holds `dead_s` to within `known_s`.
#[track_caller]
fn assert_dead_time(record: &Record, dead_s: f64, known_s: f64) {
    let fit = fitted(record);
    let (low, high) = fit.delay_s.interval(0.99);
    assert!(low < dead_s && dead_s < high && high - low < 2.0 * known_s, "{low} to {high}, where {dead_s} is right");
    let taus: Vec<f64> = fit.steps.iter().filter_map(|step| Some(step.time_constant_s()?.value)).collect();
    assert_eq!(taus.len(), 6, "{:?}", fit.steps);
    assert!(taus.iter().all(|tau| (tau / TAU_S - 1.0).abs() < 0.08), "{taus:?}");
}

fn imported(table: &str) -> Record {
    let options = ImportOptions { excitation: Some(Excitation::Staircase), ..ImportOptions::default() };
    import_bytes(Path::new("log.csv"), table.as_bytes(), &options).unwrap().experiment.records.remove(0)
}

#[test]
fn autopilots_that_log_the_command_faster_than_the_esc() {
    for (log, known_s) in [("log.bin", 0.009), ("log.ulg", 0.004)] {
        let Some(log) = data(&format!("cases/command-stamps-dropped/{log}")) else { continue };
        let Import { experiment, .. } = import(&log, &ImportOptions::default()).unwrap();
        let record = &experiment.records[0];
        assert!(record.command_log.is_some());
        assert_dead_time(record, 0.020, known_s);
    }
}

/// A row for each message, as PlotJuggler exports them: the command at these stamps, and a speed every 20 ms.
fn messages(motor: &Motor, stamps: Vec<f64>, rng: &mut ChaCha8Rng) -> Record {
    let commands = stamps.into_iter().map(|t| (t, format!("{t},{},\n", motor.command(t))));
    let reports = Motor::stamps(rng, 0.02).into_iter();
    let reports = reports.map(|t| (t, format!("{t},,{}\n", motor.reading(rng, t))));
    let mut rows: Vec<(f64, String)> = commands.chain(reports).collect();
    rows.sort_by(|a, b| a.0.total_cmp(&b.0));
    let rows: String = rows.into_iter().map(|(_, row)| row).collect();
    imported(&format!("time_s,command,rpm\n{rows}"))
}

/// With and without a dead time.
#[test]
fn a_row_for_each_message() {
    for (seed, dead_s) in [(1, 0.020), (2, 0.0)] {
        let (motor, mut rng) = Motor::new(dead_s, seed);
        let stamps = Motor::stamps(&mut rng, 0.005);
        let motor = motor.at(&stamps);
        assert_dead_time(&messages(&motor, stamps, &mut rng), dead_s, 0.005);
    }
}

/// Commands that are logged every so many seconds are stamped late by as much at most: by the same at each step, or by another.
#[test]
fn the_interval_of_the_stamps_is_in_that_of_the_dead_time() {
    for interval_s in [0.0025, 0.01, 0.1] {
        for phase in [Some(0.0), Some(0.3), Some(0.7), None] {
            let (mut held, mut widths) = (0, Vec::new());
            for seed in 0..40 {
                let dead_s = 0.035;
                let (mut motor, mut rng) = Motor::new(dead_s, seed);
                let first = rng.random_range(0.0..interval_s);
                let stamps: Vec<f64> =
                    (0..(14.0 / interval_s) as usize).map(|k| first + interval_s * k as f64).collect();
                for (k, begin) in motor.begins_s.iter_mut().enumerate() {
                    let after = phase.unwrap_or_else(|| rng.random_range(0.0..1.0));
                    // 2 s are whole intervals; what is given at a stamp is in it.
                    *begin = 2.0 * k as f64 + first + after * interval_s - 1e-9;
                }
                let fit = fitted(&messages(&motor, stamps, &mut rng));
                let (low, high) = fit.delay_s.interval(0.95);
                held += usize::from(low <= dead_s && dead_s <= high);
                widths.push(high - low);
                let lead = fit.warnings.iter().any(|warning| matches!(warning, StepsWarning::NegativeDelay { .. }));
                assert!(!lead && fit.steps.iter().all(|step| step.time_constant_s().is_some()), "{:?}", fit.warnings);
            }
            widths.sort_by(f64::total_cmp);
            println!("{interval_s} s, {phase:?}: {held} of 40, width {:.4} s", widths[20]);
            assert!(held >= 36, "{interval_s} s, {phase:?}: {held} of 40");
        }
    }
}

/// A speed that is not in every row of the command: its blank rows have commands all the same.
#[test]
fn rows_without_a_speed() {
    let (motor, mut rng) = Motor::new(0.020, 3);
    let stamps = Motor::stamps(&mut rng, 0.015);
    let motor = motor.at(&stamps);
    let mut table = String::from("time_s,command,rpm\n");
    for (k, t) in stamps.into_iter().enumerate() {
        let rpm = if k % 3 == 0 { String::new() } else { motor.reading(&mut rng, t).to_string() };
        writeln!(table, "{t},{},{rpm}", motor.command(t)).unwrap();
    }
    let record = imported(&table);
    assert!(record.command_log.is_some());
    assert_dead_time(&record, 0.020, 0.013);
}

/// As messages on a bus: a command is sent once, when it changes.
#[test]
fn commands_that_are_logged_when_they_change() {
    for (seed, dead_s) in [(4, 0.020), (5, 0.0)] {
        let (motor, mut rng) = Motor::new(dead_s, seed);
        let mut rows: Vec<(f64, String)> = Motor::stamps(&mut rng, 0.02)
            .into_iter()
            .map(|t| (t, format!("{t},,{}\n", motor.reading(&mut rng, t))))
            .collect();
        rows.extend(motor.begins_s.iter().zip(LEVELS).map(|(t, command)| (*t, format!("{t},{command},\n"))));
        rows.sort_by(|a, b| a.0.total_cmp(&b.0));
        let rows: String = rows.into_iter().map(|(_, row)| row).collect();
        assert_dead_time(&imported(&format!("time_s,command,rpm\n{rows}")), dead_s, 0.002);
    }
}
