//! Lags from chirps whose truth is known.

use std::f64::consts::TAU;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};
use rotorlead_identify::{ChirpIdentification, FirstOrderOptions, IdentifyError, IdentifyWarning, identify_chirps};
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
        esc_command: None,
        voltage_v: None,
        current_a: None,
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
