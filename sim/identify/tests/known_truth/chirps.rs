//! Lags from chirps whose truth is known.

use std::f64::consts::TAU;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};
use rotorlead_identify::error::IdentifyError;
use rotorlead_identify::lag::chirp::{ChirpIdentification, identify_chirps};
use rotorlead_identify::lag::first_order::FirstOrderOptions;
use rotorlead_identify::lag::multisine::IdentifyWarning;
use rotorlead_records::{Excitation, Experiment, Output, Record, Role};

const ROW_S: f64 = 0.002;
const ROWS: usize = 20_000;
const GAIN: f64 = 10.0;
const TIME_CONSTANT_S: f64 = 0.1;
const DELAY_ROWS: usize = 5;

/// From 0.1 to 20 Hz in 40 s, held from row to row, on a lag that has not settled when the record begins.
fn chirp(sigma_n: f64, seed: u64) -> Experiment {
    let (low_hz, high_hz, length_s) = (0.1, 20.0, ROW_S * ROWS as f64);
    let command: Vec<f64> = (0..ROWS)
        .map(|row| ROW_S * row as f64)
        .map(|t| 0.5 + 0.05 * (TAU * (low_hz * t + 0.5 * (high_hz - low_hz) / length_s * t * t)).sin())
        .collect();
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let noise = Normal::new(0.0, sigma_n).unwrap();
    let decay = (-ROW_S / TIME_CONSTANT_S).exp();
    // Half a newton off.
    let mut state = 0.5 + 0.05;
    let thrust_n = (0..ROWS)
        .map(|row| {
            let seen = GAIN * state + noise.sample(&mut rng);
            let now = row.checked_sub(DELAY_ROWS).map_or(0.5, |row| command[row]);
            state = now + (state - now) * decay;
            seen
        })
        .collect();
    let record = Record {
        file: "chirp.csv".into(),
        nominal: 0.5,
        excitation: Excitation::Chirp,
        period_s: None,
        amplitude: Some(0.05),
        compensated: false,
        compensator: None,
        role: None,
        time_s: (0..ROWS).map(|row| ROW_S * row as f64).collect(),
        command,
        thrust_n: Some(thrust_n),
        rpm: None,
        command_log: None,
        esc_command: None,
        voltage_v: None,
        current_a: None,
        setpoints: rotorlead_records::Setpoints::default(),
    };
    Experiment {
        name: "chirp".into(),
        output: Output::ThrustN,
        sample_rate_hz: Some(1.0 / ROW_S),
        esc_frame_hz: None,
        command_rate_hz: None,
        records: vec![record],
    }
}

fn identified(experiment: &Experiment) -> Result<ChirpIdentification, IdentifyError> {
    identify_chirps(experiment, &FirstOrderOptions::default(), None)
}

#[test]
fn a_lag_is_found_within_its_intervals_though_the_record_begins_unsettled() {
    let repeats = 40;
    let mut held = [0; 3];
    for seed in 1..=repeats {
        let found = identified(&chirp(0.05, seed)).unwrap();
        assert_eq!(found.files, ["chirp.csv"]);
        let lag = &found.lags.nominals[0];
        let delay_s = lag.fit.delay_s.expect("10 ms are many standard errors");
        let truth =
            [(lag.fit.gain, GAIN), (lag.fit.time_constant_s, TIME_CONSTANT_S), (delay_s, ROW_S * DELAY_ROWS as f64)];
        for (k, (estimate, truth)) in truth.into_iter().enumerate() {
            assert!(estimate.std < 0.05 * truth, "{estimate:?} {truth}");
            assert!((estimate.value - truth).abs() < 4.5 * estimate.std, "{estimate:?} {truth}");
            held[k] += u32::from(!estimate.excludes(truth));
        }
        assert!(lag.warnings.is_empty(), "{:?}", lag.warnings);
    }
    println!("{held:?} of {repeats}");
    let quiet = identified(&chirp(0.001, 1)).unwrap().lags.nominals[0].fit_frequency_percent.unwrap();
    assert!(quiet > 95.0, "{quiet}");
    // 40 at 0.95: fewer than 33 in one of 3000 (binomial).
    assert!(held.iter().all(|&held| held >= 33), "{held:?}");
}

#[test]
fn a_chirp_that_shows_no_gain_or_stood_on_a_limit_says_so() {
    let mut dead = chirp(0.05, 1);
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    let noise = Normal::new(5.0, 1.0).unwrap();
    dead.records[0].thrust_n.as_mut().unwrap().iter_mut().for_each(|y| *y = noise.sample(&mut rng));
    assert!(matches!(identified(&dead), Err(IdentifyError::GainMayBeZero { .. })));

    let mut cut = chirp(0.05, 1);
    cut.records[0].thrust_n.as_mut().unwrap().iter_mut().for_each(|y| *y = y.min(5.2));
    let warnings = &identified(&cut).unwrap().lags.nominals[0].warnings;
    assert!(warnings.iter().any(|w| matches!(w, IdentifyWarning::Saturated { .. })), "{warnings:?}");

    let mut held_out = chirp(0.05, 1);
    held_out.records[0].role = Some(Role::Validate);
    assert!(matches!(identified(&held_out), Err(IdentifyError::NoFitRecord { .. })));
}

/// The rows of a script: 5 ms and what it took itself, up to 2 ms and now and then 6 ms. An exponential sweep from 0.5 to 15 Hz in 30 s, on
/// a motor that spins up when it begins; the speed is the telemetry's, `age_s` old and renewed every `renewed_s`.
fn uneven_chirp(sigma: f64, age_s: f64, renewed_s: f64, seed: u64) -> Experiment {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let noise = Normal::new(0.0, sigma).unwrap();
    let took = Normal::new(0.0, 1.0).unwrap();
    let (low_hz, high_hz, dwell_s, whole_s) = (0.5, 15.0, 4.0, 30.0_f64);
    let rate = f64::ln(high_hz / low_hz) / (whole_s - dwell_s);
    let (mut time_s, mut command) = (vec![0.0], Vec::new());
    while let Some(&t) = time_s.last().filter(|t| **t < whole_s) {
        let along = f64::max(t - dwell_s, 0.0);
        let phase =
            if t < dwell_s { TAU * low_hz * (t - dwell_s) } else { TAU * low_hz / rate * (rate * along).exp_m1() };
        command.push(0.45 + 0.1 * f64::min(t / 5.0, 1.0) * phase.sin());
        let late: f64 = took.sample(&mut rng);
        time_s.push(t + 0.005 + 0.001 * late.abs() + if late > 2.3 { 0.006 } else { 0.0 });
    }
    time_s.pop();
    // The state at each row, from rest, and by its exponential between rows.
    let mut states = vec![0.0];
    for row in 1..time_s.len() {
        let decay = (-(time_s[row] - time_s[row - 1]) / TIME_CONSTANT_S).exp();
        states.push(command[row - 1] + (states[row - 1] - command[row - 1]) * decay);
    }
    let state_at = |t: f64| {
        let row = time_s.partition_point(|row| *row <= t);
        if row == 0 {
            return 0.0;
        }
        command[row - 1] + (states[row - 1] - command[row - 1]) * (-(t - time_s[row - 1]) / TIME_CONSTANT_S).exp()
    };
    let mut report = |t: f64| GAIN * state_at(t - age_s) + noise.sample(&mut rng);
    // The autopilot draws a line from the report before to the newest, which it reaches when the next one is due
    // (`AP_ESC_Telem::get_rpm`).
    let (mut number, mut line) = (f64::NEG_INFINITY, [0.0; 2]);
    let seen = time_s.iter().map(|&t| {
        if renewed_s == 0.0 {
            return report(t);
        }
        if (t / renewed_s).floor() > number {
            number = (t / renewed_s).floor();
            line = [line[1], report(number * renewed_s)];
        }
        line[0] + (line[1] - line[0]) * (t / renewed_s - number)
    });
    let rpm = seen.collect();
    let mut experiment = chirp(0.05, seed);
    experiment.output = Output::Rpm;
    experiment.sample_rate_hz = None;
    let record = &mut experiment.records[0];
    (record.time_s, record.command, record.thrust_n, record.rpm) = (time_s, command, None, Some(rpm));
    experiment
}

/// What intervals of 95 % hold of gain, time constant and delay, over this many records, and the mean error of each in shares of
/// its truth.
fn coverage(repeats: u64, age_s: f64, renewed_s: f64, sigma: f64) -> ([u32; 3], [f64; 3]) {
    let (mut held, mut bias) = ([0; 3], [0.0; 3]);
    for seed in 1..=repeats {
        let found = identified(&uneven_chirp(sigma, age_s, renewed_s, seed)).unwrap();
        let fit = &found.lags.nominals[0].fit;
        let delay_s = fit.delay_s.expect("10 ms and more are many standard errors");
        // A line from the report before to the newest is late by as long as it lasts.
        let truths = [GAIN, TIME_CONSTANT_S, age_s + renewed_s];
        for (k, (estimate, truth)) in [fit.gain, fit.time_constant_s, delay_s].into_iter().zip(truths).enumerate() {
            held[k] += u32::from(!estimate.excludes(truth));
            bias[k] += (estimate.value / truth - 1.0) / repeats as f64;
        }
    }
    println!("age {age_s} s, renewed every {renewed_s} s: {held:?} of {repeats} held, mean error {bias:.4?}");
    (held, bias)
}

#[test]
fn uneven_rows_and_old_telemetry_give_lag_and_delay_within_their_intervals() {
    let repeats = 100;
    for age_s in [0.01, 0.03, 0.05] {
        let (held, bias) = coverage(repeats, age_s, 0.0, 0.05);
        // 100 at 0.95: fewer than 88 in one of 1000 (binomial).
        assert!(held.iter().all(|&held| held >= 88), "{held:?}");
        assert!(bias.iter().all(|bias| bias.abs() < 0.01), "{bias:?}");
    }
}

#[test]
fn a_line_between_reports_is_an_interval_older_and_lengthens_the_lag_as_the_page_says() {
    for (renewed_s, percent) in [(0.01, 0.2), (0.02, 1.6), (0.04, 5.9)] {
        let (_, bias) = coverage(20, 0.02, renewed_s, 0.02);
        assert!(bias[0].abs() < 0.005 && bias[2].abs() < 0.03, "{bias:?}");
        assert!((100.0 * bias[1] - percent).abs() < 0.2, "{bias:?}");
    }
}

#[test]
fn rows_that_the_logger_lost_are_told() {
    let mut experiment = uneven_chirp(0.05, 0.02, 0.0, 1);
    let record = &mut experiment.records[0];
    for time in &mut record.time_s[1000..] {
        *time += 0.3;
    }
    let error = identified(&experiment).unwrap_err();
    assert!(matches!(error, IdentifyError::Gap { row: 1000, .. }), "{error}");
    // Rows that are said to be even have to be.
    experiment.sample_rate_hz = Some(180.0);
    assert!(matches!(identified(&experiment), Err(IdentifyError::UnevenRows { .. })));
}

#[test]
fn coherence_is_high_where_the_response_follows_and_low_in_noise() {
    let coherence = |sigma: f64| {
        let found = identified(&uneven_chirp(sigma, 0.02, 0.0, 1)).unwrap();
        let chirp = &found.responses[0];
        assert_eq!(chirp.coherence.len(), chirp.response.lines.len());
        chirp.coherence.iter().sum::<f64>() / chirp.coherence.len() as f64
    };
    let (quiet, loud) = (coherence(0.002), coherence(0.5));
    println!("{quiet} {loud}");
    assert!(quiet > 0.99 && loud < 0.8 && loud > 0.2, "{quiet} {loud}");
}
