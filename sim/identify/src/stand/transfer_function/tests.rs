//! The fit as a whole, on lines made of known models.

use std::f64::consts::TAU;

use num_complex::Complex64;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::*;
use crate::frequency_response::ResponseLine;

/// 150 lines to 60 Hz of a response with noise of this standard deviation, its variance known.
fn lines(truth: impl Fn(f64) -> Complex64, std: f64, seed: u64) -> FrequencyResponse {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
    let lines = (0..150)
        .map(|k| {
            let omega_rad_s = TAU * (0.1 + 0.4 * f64::from(k));
            let noise = Complex64::new(normal(), normal()) * (std * std::f64::consts::FRAC_1_SQRT_2);
            ResponseLine { omega_rad_s, response: truth(omega_rad_s) + noise, variance: std * std }
        })
        .collect();
    FrequencyResponse { lines, degrees_of_freedom: f64::INFINITY, periods: 1 }
}

fn lag(omega: f64) -> Complex64 {
    7.0 / Complex64::new(1.0, 0.05 * omega)
}

#[test]
fn exact_lines_give_the_exact_model() {
    let fit = fit_parametric(&lines(lag, 0.0, 1), Structure::FIRST_ORDER).unwrap();
    assert!((fit.gain.value - 7.0).abs() < 1e-6, "{fit:?}");
    assert!((fit.poles[0].time_constant_s().unwrap().value - 0.05).abs() < 1e-8, "{fit:?}");
}

#[test]
fn two_real_poles_and_a_complex_pair_are_both_second_order() {
    for (frequency, damping) in [(40.0, 0.3), (40.0, 1.0), (40.0, 2.5)] {
        let truth = |omega: f64| {
            let x = Complex64::new(0.0, omega / frequency);
            2.0 / (1.0 + 2.0 * damping * x + x * x)
        };
        let fit = fit_parametric(&lines(truth, 1e-4, 2), Structure::SECOND_ORDER).unwrap();
        let (found, ratio) = fit.second_order().unwrap();
        assert!((found.value - frequency).abs() < 5.0 * found.std && found.std < 0.05, "{fit:?}");
        assert!((ratio.value - damping).abs() < 5.0 * ratio.std && ratio.std < 0.01, "{fit:?}");
        assert!(damping == 1.0 || fit.poles.len() == if damping < 1.0 { 1 } else { 2 }, "{fit:?}");
    }
}

#[test]
fn a_model_that_leaves_out_a_pole_fails_all_three_tests() {
    let truth = |omega: f64| lag(omega) / Complex64::new(1.0, 0.004 * omega);
    let response = lines(truth, 0.02, 3);
    let residual = fit_parametric(&response, Structure::FIRST_ORDER).unwrap().residual;
    assert!(residual.power_p_value < 1e-4 && residual.whiteness_p_value < 1e-4, "{residual:?}");
    assert!(residual.input_independence_p_value < 1e-4, "{residual:?}");
    let residual = fit_parametric(&response, Structure::SECOND_ORDER).unwrap().residual;
    assert!(residual.power_p_value > 1e-3 && residual.whiteness_p_value > 1e-3, "{residual:?}");
    assert!(residual.input_independence_p_value > 1e-3, "{residual:?}");
}

#[test]
fn an_unstable_pole_is_kept_out() {
    let truth = |omega: f64| 7.0 / Complex64::new(1.0, -0.05 * omega);
    if let Ok(kept) = fit_parametric(&lines(truth, 0.01, 4), Structure::FIRST_ORDER) {
        assert!(kept.transfer_function.is_stable() && kept.residual.power_p_value < 1e-9, "{kept:?}");
    }
}

#[test]
fn held_out_lines_choose_the_order() {
    for (poles, truth) in [
        (1, Box::new(lag) as Box<dyn Fn(f64) -> Complex64>),
        (
            3,
            Box::new(|w: f64| {
                lag(w) * (1.0 + 0.02 * Complex64::i() * w) / (1.0 + Complex64::new(-1e-4 * w * w, 0.004 * w))
            }),
        ),
    ] {
        for seed in 0..4 {
            let response = lines(&truth, 0.02, seed);
            let selection = select_order(&response, 1..=6).unwrap();
            assert_eq!(selection.fit.structure.poles, poles, "{:?}", selection.scores);
            let chosen = selection.scores.iter().find(|s| s.structure == selection.fit.structure).unwrap();
            // 300 numbers predicted: a standard deviation of 0.08.
            assert!((chosen.held_out - 1.0).abs() < 0.4, "{chosen:?}");
        }
    }
}

#[test]
fn the_stated_error_of_the_attenuation_is_its_spread() {
    let omega = TAU * 8.0;
    let mut attenuation = 0.0;
    for seed in 0..500 {
        let fit = fit_parametric(&lines(lag, 0.1, seed), Structure::FIRST_ORDER).unwrap();
        let off = (fit.response(omega) / lag(omega)).ln().re - (fit.gain.value / 7.0).ln();
        attenuation += (off / fit.attenuation_std(omega)).powi(2) / 500.0;
    }
    // A mean of 500 squares: standard deviation 0.063.
    assert!((attenuation - 1.0).abs() < 0.26, "{attenuation}");
}

#[test]
fn nonsense_is_refused() {
    let good = lines(lag, 0.01, 5);
    for structure in [Structure::new(0, 0), Structure::new(17, 3), Structure::new(2, 3)] {
        assert!(matches!(fit_parametric(&good, structure), Err(ParametricError::Structure { .. })), "{structure}");
    }
    let few = FrequencyResponse { lines: good.lines[..2].to_vec(), ..good };
    assert!(matches!(fit_parametric(&few, Structure::new(2, 1)), Err(ParametricError::TooFewLines { .. })));
    let unsure = FrequencyResponse { degrees_of_freedom: 2.0, ..good.clone() };
    assert!(matches!(fit_parametric(&unsure, Structure::FIRST_ORDER), Err(ParametricError::NoiseUnknown { .. })));
    for spoil in [
        (|line: &mut ResponseLine| line.response.re = f64::NAN) as fn(&mut ResponseLine),
        |line| line.variance = -1.0,
        |line| line.omega_rad_s = 0.0,
    ] {
        let mut bad = good.clone();
        spoil(&mut bad.lines[7]);
        assert!(matches!(fit_parametric(&bad, Structure::FIRST_ORDER), Err(ParametricError::Line { .. })));
    }
}
