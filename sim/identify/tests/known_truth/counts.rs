//! Speeds in counts that are larger than their noise: the error of a count does not average away where readings stand still.

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution as _, Normal};
use rotorlead_identify::lag::steps::{Direction, StaircaseFit, fit_staircase};
use rotorlead_identify::static_map::SteadyPoints;
use rotorlead_records::{Excitation, Output, Record, Setpoints};

/// Commands, each for a second and a half.
const LEVELS: [f64; 18] = [0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.2, 0.5, 0.8, 0.6, 0.3, 0.2];
const HELD_S: f64 = 1.5;
const DEAD_S: f64 = 0.01;
const UP_S: f64 = 0.03;

struct Counter {
    /// Speeds are whole multiples of it.
    count_rpm: f64,
    noise_rpm: f64,
    row_s: f64,
    rows_per_reading: usize,
    down_s: f64,
}

/// A reading of its own in each row.
const EACH_ROW: Counter = Counter { count_rpm: 300.0, noise_rpm: 20.0, row_s: 0.01, rows_per_reading: 1, down_s: UP_S };

impl Counter {
    /// A log, and where its speeds are at command 0.
    fn log(&self, seed: u64) -> (Record, f64) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let noise = Normal::new(0.0, self.noise_rpm).unwrap();
        // Levels are anywhere within a count.
        let zero = rng.random_range(2000.0..3000.0);
        let time_s: Vec<f64> =
            (0..(LEVELS.len() as f64 * HELD_S / self.row_s) as usize).map(|row| row as f64 * self.row_s).collect();
        // Commands come in any row between two readings.
        let held = (HELD_S / self.row_s).round() as usize;
        let begins: Vec<usize> =
            (0..LEVELS.len()).map(|place| place * held + rng.random_range(0..self.rows_per_reading)).collect();
        let places = (0..time_s.len()).map(|row| begins.partition_point(|begin| *begin <= row).saturating_sub(1));
        let command: Vec<f64> = places.map(|place| LEVELS[place]).collect();
        let first = rng.random_range(0..self.rows_per_reading);
        let (mut rpm, mut place, mut now_s, mut reading) = (level(zero, 0), 0, 0.0, 0.0);
        let rpm = time_s.iter().enumerate().map(|(row, &t)| {
            let mut until = |place: usize, until_s: f64| {
                let tau_s = if level(zero, place) > rpm { UP_S } else { self.down_s };
                rpm = level(zero, place) + (rpm - level(zero, place)) * (-(until_s - now_s) / tau_s).exp();
                now_s = until_s;
            };
            if let Some(next) = begins.get(place + 1).map(|&begin| time_s[begin] + DEAD_S).filter(|next| *next <= t) {
                until(place, next);
                place += 1;
            }
            until(place, t);
            if row == 0 || row % self.rows_per_reading == first {
                reading = ((rpm + noise.sample(&mut rng)) / self.count_rpm).round() * self.count_rpm;
            }
            reading
        });
        let rpm = rpm.collect();
        let record = Record {
            file: "counts.csv".into(),
            nominal: 0.5,
            excitation: Excitation::Staircase,
            period_s: None,
            amplitude: None,
            compensated: false,
            compensator: None,
            role: None,
            time_s,
            command,
            thrust_n: None,
            rpm: Some(rpm),
            command_log: None,
            esc_command: None,
            voltage_v: None,
            current_a: None,
            setpoints: Setpoints::default(),
        };
        (record, zero)
    }
}

fn level(zero: f64, place: usize) -> f64 {
    zero + 15_000.0 * LEVELS[place]
}

fn fitted(record: &Record) -> StaircaseFit {
    fit_staircase(record, Output::Rpm, None).unwrap()
}

/// How often intervals hold the truth.
#[derive(Debug, Default)]
struct Coverage {
    time_constant: Vec<bool>,
    up_and_down: Vec<bool>,
    delay: Vec<bool>,
    levels: Vec<bool>,
    steady_points: Vec<bool>,
    unequal: usize,
    /// Relative widths of the time constants' intervals.
    widths: Vec<f64>,
}

fn coverage(counter: &Counter, seeds: u64) -> Coverage {
    let mut coverage = Coverage::default();
    let holds = |(low, high): (f64, f64), truth: f64| (low..=high).contains(&truth);
    for seed in 0..seeds {
        let (record, zero) = counter.log(seed);
        let fit = fitted(&record);
        for step in &fit.steps {
            let Some(tau) = step.time_constant_s() else { continue };
            let truth = if step.direction() == Direction::Up { UP_S } else { counter.down_s };
            let interval = tau.interval_of_logarithm(0.95);
            coverage.time_constant.push(holds(interval, truth));
            coverage.widths.push((interval.1 - interval.0) / tau.value);
        }
        if let Some(curve) = &fit.curve {
            for (direction, truth) in [(Direction::Up, UP_S), (Direction::Down, counter.down_s)] {
                if let Some(tau) = curve.average(direction) {
                    coverage.up_and_down.push(holds(tau.interval_of_logarithm(0.95), truth));
                }
            }
            coverage.unequal += usize::from(curve.asymmetry().is_some());
        }
        coverage.delay.push(holds(fit.delay_s.interval(0.95), DEAD_S));
        for level in &fit.levels {
            for branch in [level.up, level.down].into_iter().flatten() {
                coverage.levels.push(holds(branch.mean.interval(0.95), zero + 15_000.0 * level.command));
            }
        }
        for point in SteadyPoints::from_record(&record, Output::Rpm, None).unwrap().running {
            assert!(point.std > 0.0);
            let off = (point.response - zero - 15_000.0 * point.command).abs();
            coverage.steady_points.push(off < 1.96 * point.std);
        }
    }
    coverage.widths.sort_by(f64::total_cmp);
    coverage
}

fn share(holds: &[bool]) -> f64 {
    holds.iter().filter(|&&holds| holds).count() as f64 / holds.len() as f64
}

/// The intervals hold what is right, and none of the equal lags is said to be unequal but by chance.
#[track_caller]
fn assert_covered(counter: &Counter) {
    let seeds = 40;
    let c = coverage(counter, seeds);
    let shares = [&c.time_constant, &c.up_and_down, &c.delay, &c.levels, &c.steady_points].map(|holds| share(holds));
    let width = c.widths[c.widths.len() / 2];
    println!(
        "{} rpm, {} rows: tau {:.3}, up and down {:.3}, delay {:.3}, levels {:.3}, points {:.3}; unequal {}, width {width:.2}",
        counter.count_rpm, counter.rows_per_reading, shares[0], shares[1], shares[2], shares[3], shares[4], c.unequal
    );
    assert!(shares.iter().all(|share| *share >= 0.9), "{shares:?}");
    if counter.down_s == UP_S {
        assert!(c.unequal <= 2, "{}", c.unequal);
    } else {
        assert!(c.unequal >= 38, "{}", c.unequal);
    }
}

#[test]
fn intervals_hold_the_truth_of_fine_and_coarse_counts() {
    for count_rpm in [50.0, 300.0, 1000.0] {
        for noise_rpm in [0.05, 0.2, 0.35] {
            assert_covered(&Counter { count_rpm, noise_rpm: noise_rpm * count_rpm, ..EACH_ROW });
        }
    }
}

#[test]
fn intervals_hold_the_truth_of_counts_that_stand_in_ten_rows() {
    for count_rpm in [50.0, 300.0, 1000.0] {
        assert_covered(&Counter { count_rpm, row_s: 0.002, rows_per_reading: 10, ..EACH_ROW });
    }
}

#[test]
fn unequal_lags_are_seen_in_counts() {
    for (count_rpm, down_s) in [(50.0, 0.045), (300.0, 0.09)] {
        assert_covered(&Counter { count_rpm, down_s, ..EACH_ROW });
        assert_covered(&Counter { count_rpm, down_s, row_s: 0.002, rows_per_reading: 10, ..EACH_ROW });
    }
}
