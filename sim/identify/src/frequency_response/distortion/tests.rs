//! Levels of a polynomial against its exact harmonics.

use std::f64::consts::TAU;

use num_complex::Complex64;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use rotorlead_plant::bench::multisine::{DetectionRecipe, DetectionSet};

use super::*;
use crate::spectra::transient::TransientTest;
use crate::spectra::{SpectralLine, SpectrumOptions};
use crate::testing::{experiment, noise, record};

/// Rows per second: three times the top line is below half of it, so nothing folds back.
const RATE_HZ: f64 = 250.0;
const PERIOD_S: f64 = 10.0;
const ROWS: usize = 2500;

/// `y = u + a u^2 + b u^3`.
#[derive(Clone, Copy)]
struct Polynomial {
    a: f64,
    b: f64,
}

impl Polynomial {
    fn at(self, u: f64) -> f64 {
        u + self.a * u * u + self.b * u * u * u
    }

    /// Complex amplitudes of `y` at harmonics 0, 1, .., from those of `u`, by convolution of two-sided coefficients.
    fn harmonics(self, amplitudes: &[Complex64]) -> Vec<Complex64> {
        let top = amplitudes.len() - 1;
        let center = 3 * top;
        let mut first = vec![Complex64::ZERO; 2 * center + 1];
        for (harmonic, amplitude) in amplitudes.iter().enumerate() {
            first[center + harmonic] += 0.5 * amplitude;
            first[center - harmonic] += 0.5 * amplitude.conj();
        }
        let lines: Vec<usize> = (0..first.len()).filter(|&k| first[k] != Complex64::ZERO).collect();
        let times_u = |other: &[Complex64]| {
            let mut product = vec![Complex64::ZERO; first.len()];
            for &k in &lines {
                for (l, value) in other.iter().enumerate().filter(|(_, value)| **value != Complex64::ZERO) {
                    // Neither factor reaches beyond what the product has room for.
                    product[k + l - center] += first[k] * value;
                }
            }
            product
        };
        let second = times_u(&first);
        let third = times_u(&second);
        (0..=top)
            .map(|h| 2.0 * (first[center + h] + self.a * second[center + h] + self.b * third[center + h]))
            .collect()
    }
}

fn set(realizations: u32, seed: u64) -> DetectionSet {
    let recipe = DetectionRecipe { band_hz: (0.1, 30.0), period_s: PERIOD_S, group: 4, seed, realizations };
    DetectionSet::new(&recipe).unwrap()
}

/// Four periods of the polynomial, behind a lag of `tau_s` (none where zero), after three that are not recorded.
fn run(set: &DetectionSet, realization: usize, polynomial: Polynomial, tau_s: f64, noise_n: f64) -> Spectrum {
    let mut rng = ChaCha8Rng::seed_from_u64(99 + realization as u64);
    let scale = 0.05 / set.peak;
    let wave: Vec<f64> = set.realizations[realization].waveform(ROWS).iter().map(|x| scale * x).collect();
    let decay = if tau_s > 0.0 { (-1.0 / (RATE_HZ * tau_s)).exp() } else { 0.0 };
    let mut state = 0.0;
    let mut thrust_n = Vec::new();
    for row in 0..7 * ROWS {
        let target = polynomial.at(wave[row % ROWS]);
        if tau_s == 0.0 {
            state = target;
        }
        if row >= 3 * ROWS {
            let drawn: f64 = StandardNormal.sample(&mut rng);
            thrust_n.push(3.0 + state + noise_n * drawn);
        }
        if tau_s > 0.0 {
            state = target + (state - target) * decay;
        }
    }
    let command = (0..4 * ROWS).map(|row| 0.5 + wave[row % ROWS]).collect();
    let record = record(RATE_HZ, Some(PERIOD_S), command, thrust_n);
    Spectrum::from_record(&experiment(RATE_HZ, vec![]), &record, &SpectrumOptions::default()).unwrap()
}

/// What the levels must be: even and odd, relative to the linear response, dB.
fn exact(set: &DetectionSet, realization: usize, polynomial: Polynomial, tau_s: f64) -> (f64, f64) {
    let mut amplitudes = vec![Complex64::ZERO; 300];
    let scale = 0.05 / set.peak;
    for (&harmonic, &phase) in set.lines.harmonics().iter().zip(set.realizations[realization].phases_rad()) {
        amplitudes[harmonic as usize] = Complex64::from_polar(scale, phase);
    }
    let mut harmonics = polynomial.harmonics(&amplitudes);
    if tau_s > 0.0 {
        let decay = (-1.0 / (RATE_HZ * tau_s)).exp();
        for (h, amplitude) in harmonics.iter_mut().enumerate() {
            *amplitude *= (1.0 - decay) / (Complex64::cis(TAU * h as f64 / ROWS as f64) - decay);
        }
    }
    let power = |of: &[u32]| of.iter().map(|&h| harmonics[h as usize].norm_sqr()).sum::<f64>() / of.len() as f64;
    let even: Vec<u32> = (1..150).map(|k| 2 * k).collect();
    let linear = power(set.lines.harmonics());
    (10.0 * (power(&even) / linear).log10(), 10.0 * (power(&set.skipped) / linear).log10())
}

#[test]
fn levels_of_a_polynomial_are_within_a_decibel_with_and_without_a_lag() {
    let mut worst = 0.0_f64;
    for seed in 1..=5 {
        let set = set(1, seed);
        for (a, b, tau_s) in [(4.0, 150.0, 0.0), (-1.5, 60.0, 0.1), (8.0, -300.0, 0.1), (0.8, 40.0, 0.0)] {
            let polynomial = Polynomial { a, b };
            let (even, odd) = exact(&set, 0, polynomial, tau_s);
            let found = Distortion::from_spectra(&[&run(&set, 0, polynomial, tau_s, 2e-4)]).unwrap();
            let (seen_even, seen_odd) = (found.even.unwrap(), found.odd.unwrap());
            println!(
                "a {a} b {b} tau {tau_s}: even {even:.2} found {:.2}, odd {odd:.2} found {:.2}, noise {:.2}",
                seen_even.relative_db,
                seen_odd.relative_db,
                found.noise_db()
            );
            assert!(seen_even.is_seen() && seen_odd.is_seen());
            worst = worst.max((seen_even.relative_db - even).abs()).max((seen_odd.relative_db - odd).abs());
        }
    }
    println!("worst: {worst:.3} dB");
    assert!(worst < 1.0, "{worst}");
}

#[test]
fn even_and_odd_are_not_mixed_up() {
    let set = set(1, 1);
    let level = |a, b| Distortion::from_spectra(&[&run(&set, 0, Polynomial { a, b }, 0.1, 1e-5)]).unwrap();
    let square = level(10.0, 0.0);
    assert!(square.even.unwrap().is_strong() && !square.odd.unwrap().is_seen(), "{square:?}");
    let cube = level(0.0, 300.0);
    assert!(cube.odd.unwrap().is_seen() && !cube.even.unwrap().is_seen(), "{cube:?}");
}

#[test]
fn a_linear_actuator_is_seldom_said_to_distort() {
    // 2000 levels at 0.1 %: two are expected, nine or more come up once in 4000 times (Poisson).
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut seen = 0;
    for _ in 0..1000 {
        let mut periods = crate::spectra::estimate::Periods {
            bin_rad_s: TAU / PERIOD_S,
            command: vec![vec![Complex64::ZERO; 310]; 4],
            response: Vec::new(),
            esc_command: None,
        };
        for bin in (1..300).step_by(2).filter(|bin| bin % 8 != 3) {
            for command in &mut periods.command {
                command[bin] = Complex64::cis((bin * bin) as f64);
            }
        }
        periods.response =
            periods.command.iter().map(|command| command.iter().map(|u| u + 0.1 * noise(&mut rng)).collect()).collect();
        let found = crate::spectra::estimate::estimate(&periods, &SpectrumOptions::default(), "").unwrap();
        let spectrum = Spectrum {
            file: String::new(),
            row_rate_hz: RATE_HZ,
            period_s: PERIOD_S,
            periods: 4,
            periods_used: found.periods_used,
            rows_left_out: 0,
            transient: TransientTest { p_value: None, level: 0.05, dropped: 0 },
            noise: found.noise,
            lines: found.lines,
            unexcited: found.unexcited,
            disturbed: found.disturbed,
            removed: found.removed,
        };
        let found = Distortion::from_spectra(&[&spectrum]).unwrap();
        seen += [found.even, found.odd].into_iter().flatten().filter(DistortionLevel::is_seen).count();
    }
    println!("{seen} of 2000 levels seen");
    assert!(seen <= 8, "{seen}");
}

#[test]
fn realizations_disagree_by_as_much_as_the_skipped_lines_show() {
    let set = set(8, 1);
    let polynomial = Polynomial { a: 0.0, b: 300.0 };
    let spectra: Vec<_> = (0..8).map(|m| run(&set, m, polynomial, 0.1, 1e-4)).collect();
    let spectra: Vec<&Spectrum> = spectra.iter().collect();
    let robust = RobustResponse::from_spectra(&spectra).unwrap();
    let odd = Distortion::from_spectra(&spectra).unwrap().odd.unwrap();
    println!("stochastic {:.2} dB, odd {:.2} dB", robust.stochastic_db, odd.relative_db);
    assert!((robust.stochastic_db - odd.relative_db).abs() < 2.0);

    // The best linear approximation of a cube under a Gaussian signal is 1 + 3 b var u (Bussgang), less a term of the
    // order of one over the number of lines.
    let variance = 0.5 * 113.0 * (0.05 / set.peak).powi(2);
    let decay = (-1.0 / (RATE_HZ * 0.1_f64)).exp();
    let gain = |line: &crate::frequency_response::ResponseLine| {
        let lag = (1.0 - decay) / (Complex64::cis(line.omega_rad_s / RATE_HZ) - decay);
        line.response / lag
    };
    let lines = &robust.response.lines;
    let mean = lines.iter().map(gain).sum::<Complex64>() / lines.len() as f64;
    let best = 1.0 + 3.0 * 300.0 * variance;
    println!("gain {mean:.4}, best linear approximation {best:.4}");
    assert!((mean - best).norm() < 0.02 * best);
    // The stated variance is that of the scatter over the lines around it.
    let scatter: f64 = lines.iter().map(|l| (l.response - l.response / gain(l) * mean).norm_sqr() / l.variance).sum();
    let scatter = scatter / lines.len() as f64;
    println!("scatter {scatter:.3} of the stated variance");
    // 113 lines; deviation of the mean of |z|^2 with 77 degrees of freedom each is 0.095.
    assert!((scatter - 1.0).abs() < 0.33, "{scatter}");
}

#[test]
fn what_cannot_tell_gives_no_level() {
    let set = set(2, 1);
    let one = run(&set, 0, Polynomial { a: 1.0, b: 0.0 }, 0.1, 1e-4);
    assert!(RobustResponse::from_spectra(&[&one]).is_none());
    assert!(RobustResponse::from_spectra(&[&one, &one]).is_none(), "the same phases twice");
    let even = SpectralLine { harmonic: 2, ..one.lines[0] };
    let mut with_even = one.clone();
    with_even.lines.push(even);
    assert!(Distortion::from_spectra(&[&with_even]).is_none());
    let mut last_period = one.clone();
    last_period.noise = NoiseSource::UnexcitedLines;
    assert!(Distortion::from_spectra(&[&last_period]).is_none());
    assert!(Distortion::from_spectra(&[]).is_none());
}
