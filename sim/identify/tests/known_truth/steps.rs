//! Staircases with known truth.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};
use rotorlead_identify::estimate::Estimate;
use rotorlead_identify::lag::steps::{Direction, StaircaseFit, StepsError, StepsWarning, fit_staircase};
use rotorlead_records::{Excitation, Output, Record};

/// A motor with time constants of its own for rising and falling.
pub(super) struct Motor {
    delay_s: f64,
    up: fn(f64) -> f64,
    down: fn(f64) -> f64,
}

pub(super) const MOTOR: Motor =
    Motor { delay_s: 0.0263, up: |u| 0.080 - 0.060 * u, down: |u| 1.4 * (0.080 - 0.060 * u) };

fn map(u: f64) -> f64 {
    2000.0 + 22000.0 * u - 8000.0 * u * u
}

/// Commands of the plateaus: up in small steps, down in large ones, twice.
const PLATEAUS: [f64; 21] = [
    0.20, 0.25, 0.30, 0.35, 0.40, 0.45, 0.50, 0.55, 0.60, 0.65, 0.70, 0.75, 0.80, 0.85, 0.90, 0.70, 0.50, 0.30, 0.60,
    0.90, 0.50,
];

pub(super) struct Bench {
    noise_std: f64,
    /// Correlation of the noise from row to row.
    color: f64,
    /// Commands change up to this long before the row that shows them.
    late_s: f64,
    /// Rows are this far apart, give or take a third.
    interval_s: f64,
}

pub(super) const BENCH: Bench = Bench { noise_std: 25.0, color: 0.0, late_s: 0.0, interval_s: 0.007 };

/// Simulates in exact steps from event to event; it shares no code with the fit.
fn staircase(motor: &Motor, bench: &Bench, seed: u64) -> Record {
    staircase_through(&PLATEAUS, motor, bench, seed)
}

pub(super) fn staircase_through(plateaus: &[f64], motor: &Motor, bench: &Bench, seed: u64) -> Record {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let normal = Normal::new(0.0, bench.noise_std).unwrap();
    let mut time_s = vec![0.0];
    while *time_s.last().unwrap() < 1.5 * plateaus.len() as f64 {
        let next = bench.interval_s * rng.random_range(0.67..1.33);
        time_s.push(time_s.last().unwrap() + next);
    }
    let command: Vec<f64> = time_s.iter().map(|t| plateaus[((t / 1.5) as usize).min(plateaus.len() - 1)]).collect();
    // When each change takes effect, and what it leads to.
    let mut changes: Vec<(f64, f64, f64)> = Vec::new();
    for k in 1..command.len() {
        if command[k] != command[k - 1] {
            let late = bench.late_s * rng.random_range(0.0..1.0);
            let up = command[k] > command[k - 1];
            let tau = if up { (motor.up)(command[k]) } else { (motor.down)(command[k]) };
            changes.push((time_s[k] + motor.delay_s - late, map(command[k]), tau));
        }
    }
    let (mut now, mut w, mut level, mut tau) = (0.0, map(command[0]), map(command[0]), 1.0);
    let mut changes = changes.into_iter().peekable();
    let mut colored = normal.sample(&mut rng);
    let rpm = time_s
        .iter()
        .map(|&t| {
            while let Some(change) = changes.next_if(|c| c.0 <= t) {
                w = level + (w - level) * (-(change.0 - now) / tau).exp();
                (now, level, tau) = change;
            }
            w = level + (w - level) * (-(t - now) / tau).exp();
            now = t;
            let fresh = (1.0 - bench.color * bench.color).sqrt();
            colored = bench.color * colored + fresh * normal.sample(&mut rng);
            w + colored
        })
        .collect();
    record(time_s, command, rpm)
}

fn record(time_s: Vec<f64>, command: Vec<f64>, rpm: Vec<f64>) -> Record {
    Record {
        file: "staircase.csv".into(),
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
        setpoints: rotorlead_records::Setpoints::default(),
    }
}

pub(super) fn fitted(record: &Record) -> StaircaseFit {
    fit_staircase(record, Output::Rpm, None).unwrap()
}

/// Every time constant found, with its truth.
fn time_constants(fit: &StaircaseFit, motor: &Motor) -> Vec<(Estimate, f64)> {
    let mut found = Vec::new();
    for level in &fit.levels {
        for (direction, truth) in [(Direction::Up, motor.up), (Direction::Down, motor.down)] {
            if let Some(tau) = level.branch(direction).and_then(|b| b.time_constant_s) {
                found.push((tau, truth(level.command)));
            }
        }
    }
    found
}

/// How often intervals hold the truth.
#[derive(Debug)]
struct Coverage {
    time_constant: f64,
    delay: f64,
    curvature: f64,
    /// Median relative width of the time constants' intervals, which says that they are not vacuous.
    width: f64,
}

fn coverage(bench: &Bench, seeds: u64) -> Coverage {
    let share = |hits: &[bool]| hits.iter().filter(|&&h| h).count() as f64 / hits.len() as f64;
    let holds = |(low, high): (f64, f64), truth: f64| (low..=high).contains(&truth);
    let (mut taus, mut delays, mut curvatures, mut widths) = (vec![], vec![], vec![], vec![]);
    for seed in 0..seeds {
        let fit = fitted(&staircase(&MOTOR, bench, seed));
        let found = time_constants(&fit, &MOTOR);
        assert_eq!(found.len(), 17, "14 levels up, 3 down");
        for (tau, truth) in found {
            let interval = tau.interval_of_logarithm(0.95);
            taus.push(holds(interval, truth));
            widths.push((interval.1 - interval.0) / tau.value);
        }
        let truth = MOTOR.delay_s - 0.5 * bench.late_s;
        delays.push(holds(fit.delay_s.interval(0.95), truth));
        curvatures.push(holds(fit.curvature.interval(0.95), 0.0));
    }
    widths.sort_by(f64::total_cmp);
    let coverage = Coverage {
        time_constant: share(&taus),
        delay: share(&delays),
        curvature: share(&curvatures),
        width: widths[widths.len() / 2],
    };
    println!("{coverage:?}");
    coverage
}

/// Uneven rows, a delay of 3.8 rows, steps down slower than steps up.
#[test]
fn intervals_hold_the_truth_in_white_noise() {
    let c = coverage(&BENCH, 24);
    assert!((0.92..=0.98).contains(&c.time_constant), "{c:?}");
    assert!(c.delay >= 0.9 && c.curvature >= 0.85, "{c:?}");
    assert!(c.width < 0.35, "{c:?}");
}

#[test]
fn intervals_hold_the_truth_in_colored_noise() {
    let bench = Bench { color: 0.7, noise_std: 15.0, ..BENCH };
    let c = coverage(&bench, 24);
    assert!((0.90..=0.99).contains(&c.time_constant), "{c:?}");
    assert!(c.delay >= 0.9 && c.curvature >= 0.85, "{c:?}");
    assert!(c.width < 0.5, "{c:?}");
}

/// As a 50 Hz ESC signal behind a stand that stamps commands when they are set.
#[test]
fn intervals_hold_the_truth_when_commands_take_effect_at_random_times() {
    let bench = Bench { late_s: 0.02, ..BENCH };
    let c = coverage(&bench, 24);
    assert!((0.91..=0.98).contains(&c.time_constant), "{c:?}");
    assert!(c.delay >= 0.85 && c.curvature >= 0.85, "{c:?}");
    assert!(c.width < 0.45, "{c:?}");
}

#[test]
fn without_noise_the_truth_comes_back() {
    let bench = Bench { noise_std: 1e-6, ..BENCH };
    let fit = fitted(&staircase(&MOTOR, &bench, 3));
    for (tau, truth) in time_constants(&fit, &MOTOR) {
        assert!((tau.value / truth - 1.0).abs() < 2e-3, "{tau:?} {truth}");
    }
    assert!((fit.delay_s.value - MOTOR.delay_s).abs() < 5e-5, "{:?}", fit.delay_s);
    assert!(fit.fit_percent > 99.9, "{}", fit.fit_percent);
    for level in &fit.levels {
        let mean = level.up.unwrap().mean.value;
        assert!((mean - map(level.command)).abs() < 0.01, "{level:?}");
        // A parabola's slope is exact except where there is a neighbor on one side only.
        let slope = 22000.0 - 16000.0 * level.command;
        let end = level.command < 0.21 || level.command > 0.89;
        let error = (level.gain.unwrap().value - slope).abs();
        assert!(error < if end { 401.0 } else { 0.5 }, "{level:?} {slope}");
    }
}

#[test]
fn the_same_record_gives_the_same_fit() {
    let record = staircase(&MOTOR, &BENCH, 5);
    assert_eq!(fitted(&record), fitted(&record));
}

/// `dw/dt = a u - b w - c w^2 - e`, where a large step is no exponential.
#[test]
fn a_motor_with_drag_gives_its_small_signal_time_constants() {
    let (b, c) = (3.0, 1.0e-3);
    let torque = |w: f64| b * w + c * w * w;
    let plateaus = staircase(&MOTOR, &BENCH, 1);
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    let noise = Normal::new(0.0, 5.0).unwrap();
    let (mut w, mut now) = (map(plateaus.command[0]), 0.0);
    let mut level = w;
    let mut rpm = Vec::new();
    for (&t, &u) in plateaus.time_s.iter().zip(&plateaus.command) {
        while now < t - 1e-12 {
            let h = f64::min(2e-4, t - now);
            let rate = |w: f64| torque(level) - torque(w);
            let half = w + 0.5 * h * rate(w);
            w += h * rate(half);
            now += h;
        }
        level = map(u);
        rpm.push(w + noise.sample(&mut rng));
    }
    let fit = fitted(&record(plateaus.time_s, plateaus.command, rpm));
    let mut checked = 0;
    for level in &fit.levels {
        let truth = 1.0 / (b + 2.0 * c * map(level.command));
        for branch in [level.up, level.down].into_iter().flatten() {
            if let Some(tau) = branch.time_constant_s {
                let error = (tau.value / truth - 1.0).abs();
                assert!(error < 0.01 + 2.5 * tau.std / tau.value, "{level:?} {truth}");
                checked += 1;
            }
        }
    }
    assert_eq!(checked, 17);
    // c R tau at the median time constant.
    let mut taus: Vec<f64> = fit.levels.iter().map(|level| 1.0 / (b + 2.0 * c * map(level.command))).collect();
    taus.sort_by(f64::total_cmp);
    let truth = c * map(0.9) * taus[taus.len() / 2];
    assert!((fit.curvature.value / truth - 1.0).abs() < 0.1, "{:?} {truth}", fit.curvature);
    assert!(fit.fit_percent > 99.0, "{}", fit.fit_percent);
}

/// A record that begins at standstill, starts in jerks, has spikes, and drops at full command.
#[test]
fn odd_parts_are_left_out_and_named() {
    let mut record = staircase(&MOTOR, &BENCH, 7);
    let rpm = record.rpm.as_mut().unwrap();
    for (k, rpm) in rpm.iter_mut().enumerate() {
        match record.time_s[k] {
            t if t < 1.5 => {
                record.command[k] = 0.1;
                *rpm = if t < 0.8 { 0.0 } else { 600.0 + 500.0 * (40.0 * t).sin() };
            }
            // The top of the staircase turns slower than the level before it.
            t if (21.0..22.5).contains(&t) => *rpm -= 1200.0 * (1.0 - (-(t - 21.0) / 0.05f64).exp()),
            _ => {}
        }
    }
    let spikes = [900, 901, 1500, 2200, 2900];
    for &k in &spikes {
        rpm[k] *= 0.6;
    }
    let fit = fitted(&record);
    let start_s = record.time_s[fit.runs[0].start];
    assert!((1.5..2.2).contains(&start_s), "{start_s}");
    assert!(fit.warnings.contains(&StepsWarning::Spikes { rows: spikes.len(), column: "rpm" }), "{:?}", fit.warnings);
    assert!(fit.warnings.iter().any(|w| matches!(w, StepsWarning::PartLeftOut { from_s: None, .. })));
    let dropped = |w: &StepsWarning| matches!(w, StepsWarning::NotRising { command } if (command - 0.9).abs() < 1e-9);
    let top = fit.levels.last().unwrap();
    assert!(top.gain.is_none() && fit.warnings.iter().any(dropped), "{top:?}");
    let model = fit.to_model("test").unwrap();
    assert!(model.points.iter().all(|p| p.nominal < 0.88 && p.gain > 0.0), "{model:?}");
    assert!(model.points.len() >= 12);
    assert!(fit.fit_percent > fit.fit_percent_with_spikes + 0.5);
    // The level below the drop keeps the slope from below.
    let below = fit.levels[fit.levels.len() - 2].gain.unwrap();
    let truth = (map(0.85) - map(0.80)) / 0.05;
    assert!((below.value - truth).abs() < 2.0 * below.std + 100.0, "{below:?} {truth}");
}

#[test]
fn a_model_has_the_mean_of_both_rates_and_the_static_map() {
    let fit = fitted(&staircase(&MOTOR, &BENCH, 2));
    let model = fit.to_model("1.2.3").unwrap();
    let point = model.points.iter().find(|p| (p.nominal - 0.5).abs() < 1e-9).unwrap();
    assert!(point.time_constant_down_s.unwrap() > point.time_constant_up_s.unwrap());
    let curve = fit.curve.as_ref().unwrap();
    let [up, down] = [Direction::Up, Direction::Down].map(|direction| curve.toward(0.5, direction).value);
    assert!(down > 1.2 * up);
    assert!((2.0 / point.time_constant_s - 1.0 / up - 1.0 / down).abs() < 1e-9);
    let band = model.time_constant_curve.as_ref().unwrap();
    let at = band.nominal.iter().position(|nominal| (nominal - 0.5).abs() < 1e-9).unwrap();
    assert_eq!(band.time_constant_s[at], point.time_constant_s);
    assert!(band.low_s[at] < point.time_constant_s && point.time_constant_s < band.high_s[at]);
    assert!(point.fit_step_percent.unwrap() > 80.0);
    assert_eq!(point.delay_s, fit.delay_s.value);
    let static_map = model.static_map.unwrap();
    assert_eq!(static_map.command.len(), fit.levels.len());
    assert!(static_map.response.is_sorted_by(|a, b| a < b));
    assert_eq!(model.provenance.unwrap().version, "1.2.3");
    // Half a frame of the delay is the frame's where the frame is known.
    let record = staircase(&MOTOR, &BENCH, 2);
    let framed = fit_staircase(&record, Output::Rpm, Some(600.0)).unwrap();
    let off = fit.delay_s.value - framed.delay_s.value;
    assert!((off - 0.5 / 600.0).abs() < 2e-4, "{off}");
}

/// What a small sine sees of a lag with two rates.
#[test]
fn a_lag_with_two_rates_answers_a_sine_between_its_two_means() {
    let (up, down) = (1.0 / 0.030, 1.0 / 0.045);
    for omega in [5.0, 25.0, 60.0] {
        let h = 1e-5;
        let period = 2.0 * std::f64::consts::PI / omega;
        let steps = (period / h).round() as usize;
        let h = period / steps as f64;
        let (mut w, mut re, mut im) = (0.0, 0.0, 0.0);
        for k in 0..6 * steps {
            let t = k as f64 * h;
            let gap = (omega * t).sin() - w;
            w += h * gap * if gap > 0.0 { up } else { down };
            if k >= 5 * steps {
                re += w * (omega * t).sin() * 2.0 / steps as f64;
                im += w * (omega * t).cos() * 2.0 / steps as f64;
            }
        }
        // Of a lag, tan(phase) = -omega tau.
        let tau = -im / re / omega;
        let (of_rates, of_times) = (2.0 / (up + down), 0.5 * (1.0 / up + 1.0 / down));
        println!("{omega}: {tau}");
        assert!((0.995 * of_rates..1.005 * of_times).contains(&tau), "{omega}: {tau}");
    }
}

#[test]
fn records_without_a_staircase_are_refused() {
    let good = staircase(&MOTOR, &BENCH, 4);
    let n = good.time_s.len();
    let refused = |record: &Record| fit_staircase(record, Output::Rpm, None).unwrap_err();

    let constant = Record { command: vec![0.5; n], ..good.clone() };
    assert!(matches!(refused(&constant), StepsError::ConstantCommand { .. }));
    let still = Record { rpm: Some(vec![0.0; n]), ..good.clone() };
    assert!(matches!(refused(&still), StepsError::NotRunning { .. }));
    let deaf = Record { rpm: Some(vec![5000.0; n]), ..good.clone() };
    assert!(matches!(refused(&deaf), StepsError::NoUsableStep { .. }));
    let thrust = fit_staircase(&good, Output::ThrustN, None).unwrap_err();
    assert!(thrust.to_string().contains("staircase.csv: no column `thrust_n`"));
    let short = Record { time_s: good.time_s[1..].to_vec(), ..good.clone() };
    assert!(matches!(refused(&short), StepsError::Malformed { .. }));
    let mut nan = good.clone();
    nan.command[17] = f64::NAN;
    assert!(matches!(refused(&nan), StepsError::Malformed { .. }));
    for rows in 0..3 {
        let few = record(good.time_s[..rows].to_vec(), good.command[..rows].to_vec(), vec![1.0; rows]);
        assert!(matches!(refused(&few), StepsError::ConstantCommand { .. }));
    }
    // White noise as a command: no plateau at all.
    let restless = Record { command: (0..n).map(|k| (k % 7) as f64 / 7.0).collect(), ..good };
    assert!(matches!(refused(&restless), StepsError::NoPlateaus { long: 0, .. }));
}

/// The largest reading of a sensor, revolutions per minute: between those of commands 0.60 and 0.65.
const END_OF_SCALE: f64 = 12_700.0;

fn clipped(seed: u64) -> Record {
    let mut record = staircase(&MOTOR, &BENCH, seed);
    record.rpm.as_mut().unwrap().iter_mut().for_each(|rpm| *rpm = rpm.min(END_OF_SCALE));
    record
}

#[test]
fn levels_on_a_limit_are_left_out_and_named() {
    for seed in 1..=8 {
        let fit = fitted(&clipped(seed));
        assert!(fit.levels.iter().all(|level| level.command < 0.65), "{:?}", fit.levels);
        assert_eq!(fit.levels.len(), 9, "those below are all there");
        for (tau, truth) in time_constants(&fit, &MOTOR) {
            assert!((tau.value / truth - 1.0).abs() < 0.15, "{tau:?} {truth}");
        }
        let limited = fit.warnings.iter().find(|w| matches!(w, StepsWarning::Limited { .. })).unwrap();
        let StepsWarning::Limited { at, commands, rows } = *limited else { unreachable!() };
        assert_eq!((at, commands), (END_OF_SCALE, (0.65, 0.90)));
        assert!(rows > 1500, "{rows}");
        assert!(limited.to_string().contains("exactly on 12700, at commands 0.650 to 0.900"), "{limited}");
        let model = fit.to_model("test").unwrap();
        assert!(model.points.iter().all(|point| point.nominal < 0.65));
        assert!(model.static_map.unwrap().command.iter().all(|&command| command < 0.65));
    }
}

#[test]
fn a_coarse_sensor_stands_on_no_limit() {
    for (resolution, noise_std) in [(1.0, 25.0), (50.0, 25.0), (50.0, 5.0), (200.0, 25.0), (50.0, 0.001)] {
        let mut record = staircase(&MOTOR, &Bench { noise_std, ..BENCH }, 3);
        record.rpm.as_mut().unwrap().iter_mut().for_each(|rpm| *rpm = (*rpm / resolution).round() * resolution);
        let fit = fitted(&record);
        let limited = fit.warnings.iter().find(|w| matches!(w, StepsWarning::Limited { .. }));
        assert_eq!(limited, None, "{resolution} {noise_std}");
    }
}

#[test]
fn a_record_of_which_every_step_is_on_a_limit_says_so() {
    let mut record = staircase(&MOTOR, &BENCH, 1);
    record.rpm.as_mut().unwrap().iter_mut().for_each(|rpm| *rpm = rpm.min(7000.0));
    let error = fit_staircase(&record, Output::Rpm, None).unwrap_err();
    assert_eq!(error, StepsError::AtLimit { record: "staircase.csv".into(), at: 7000.0 });
}

#[test]
fn a_response_that_is_a_deviation_is_refused_and_not_called_unsteady() {
    let mut record = staircase(&MOTOR, &BENCH, 1);
    record.rpm.as_mut().unwrap().iter_mut().for_each(|rpm| *rpm -= map(0.5));
    let error = fit_staircase(&record, Output::Rpm, None).unwrap_err();
    assert!(matches!(error, StepsError::BelowZero { command: 0.20, .. }), "{error}");
    assert!(error.to_string().contains("follows the command below zero"), "{error}");
}
