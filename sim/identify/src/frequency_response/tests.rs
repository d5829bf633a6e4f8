//! Do the bands cover, and how far does the local polynomial method come?
//!
//! Spectra are drawn directly, one complex normal number per bin and period. The lines of a repeat share
//! their pooled variances eleven at a time, so a share of covered lines is judged as if one line in eleven
//! had been drawn, which overstates its scatter: with a thousand repeats of 150 lines one standard deviation
//! is 0.0019, and 0.94 is 4.5 of them from what the estimator has.

use std::f64::consts::{PI, TAU};

use num_complex::Complex64;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::*;
use crate::frequency_response::etfe::{Etfe, ResponsePoint};
use crate::spectra;
use crate::spectra::SpectrumOptions;
use crate::spectra::estimate::{Periods, estimate};
use crate::testing::{experiment, noise, record};

/// Bins are 0.1 Hz apart.
const BIN_RAD_S: f64 = TAU * 0.1;
/// Amplitude of the command at each line.
const COMMAND: f64 = 0.004;

fn lag(omega_rad_s: f64) -> Complex64 {
    10.0 / Complex64::new(1.0, 0.1 * omega_rad_s)
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Noise {
    White,
    /// First-order drift with its corner at 1.6 Hz, a hundred times the white floor.
    Colored,
    /// White, and mains hum of 30 dB more than a line's noise somewhere from 49.8 to 50.2 Hz.
    Hum,
}

impl Noise {
    fn top_bin(self) -> usize {
        if self == Self::Hum { 599 } else { 299 }
    }

    fn variance(self, bin: usize) -> f64 {
        let scale = 1e-6;
        match self {
            Self::White | Self::Hum => scale,
            Self::Colored => scale * (0.01 + 1.0 / (1.0 + (bin as f64 / 16.0).powi(2))),
        }
    }
}

/// One record: odd lines up to the top bin, every period with fresh noise, hum running on from period to period.
fn draw(rng: &mut ChaCha8Rng, kind: Noise, periods: usize) -> Periods {
    let bins = kind.top_bin() + 12;
    let command: Vec<Complex64> = (0..bins)
        .map(|bin| {
            if bin % 2 == 1 && bin <= kind.top_bin() {
                Complex64::cis(bin as f64 * bin as f64) * COMMAND
            } else {
                Complex64::ZERO
            }
        })
        .collect();
    let hum_bin = rng.random_range(498.0..502.0);
    let hum_phase = rng.random_range(0.0..TAU);
    let hum = if kind == Noise::Hum { (1000.0 * kind.variance(0)).sqrt() } else { 0.0 };
    let response = (0..periods)
        .map(|p| {
            (0..bins)
                .map(|bin| {
                    let x = PI * (hum_bin - bin as f64);
                    let leak = Complex64::cis(hum_phase + TAU * hum_bin * p as f64 + x) * (x.sin() / x);
                    lag(BIN_RAD_S * bin as f64) * command[bin] + noise(rng) * kind.variance(bin).sqrt() + leak * hum
                })
                .collect()
        })
        .collect();
    Periods { bin_rad_s: BIN_RAD_S, command: vec![command; periods], response, esc_command: None }
}

#[derive(Default, Debug)]
struct Coverage {
    /// By harmonic: discs that cover, and all.
    disc: std::collections::BTreeMap<u32, (u32, u32)>,
    magnitude: u32,
    lines: u32,
    left_out: u32,
    removed: u32,
    /// Within ten bins of the hum: discs that cover, and all.
    beside_hum: (u32, u32),
}

impl Coverage {
    fn count(kind: Noise, periods: usize, repeats: u64) -> Self {
        let mut found = Self::default();
        for repeat in 0..repeats {
            let mut rng = ChaCha8Rng::seed_from_u64(repeat);
            let drawn = draw(&mut rng, kind, periods);
            let estimated = estimate(&drawn, &SpectrumOptions::default(), "drawn").unwrap();
            let response = FrequencyResponse::from_lines(&estimated.lines, estimated.periods_used);
            found.left_out += estimated.disturbed.len() as u32;
            found.removed += estimated.removed.len() as u32;
            for (line, drawn) in response.lines.iter().zip(&estimated.lines) {
                let truth = lag(line.omega_rad_s);
                let covers = (line.response - truth).norm() <= response.confidence_radius(line, 0.95);
                let (low, high) = response.magnitude_interval(line, 0.95);
                let count = found.disc.entry(drawn.harmonic).or_default();
                count.0 += u32::from(covers);
                count.1 += 1;
                if drawn.harmonic.abs_diff(500) <= 10 {
                    found.beside_hum.0 += u32::from(covers);
                    found.beside_hum.1 += 1;
                }
                found.magnitude += u32::from((low..=high).contains(&truth.norm()));
                found.lines += 1;
            }
        }
        found
    }

    fn disc_share(&self) -> f64 {
        f64::from(self.disc.values().map(|(covered, _)| covered).sum::<u32>()) / f64::from(self.lines)
    }

    fn magnitude_share(&self) -> f64 {
        f64::from(self.magnitude) / f64::from(self.lines)
    }

    fn worst_line(&self) -> (f64, u32) {
        let share =
            self.disc.iter().map(|(harmonic, (covered, all))| (f64::from(*covered) / f64::from(*all), *harmonic));
        share.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap()
    }
}

fn bands_cover(repeats: u64) {
    for kind in [Noise::White, Noise::Colored, Noise::Hum] {
        for periods in [2, 4, 14] {
            let found = Coverage::count(kind, periods, repeats);
            let (disc, magnitude) = (found.disc_share(), found.magnitude_share());
            let (worst, harmonic) = found.worst_line();
            let left_out = f64::from(found.left_out) / repeats as f64;
            let removed = f64::from(found.removed) / repeats as f64;
            println!(
                "{kind:?} {periods}: disc {disc:.4} magnitude {magnitude:.4}, worst {worst:.3} at {harmonic}; {left_out:.3} lines left out, {removed:.3} sinusoids removed"
            );
            if kind == Noise::Hum {
                let beside = f64::from(found.beside_hum.0) / f64::from(found.beside_hum.1);
                println!("    within ten bins of the hum {beside:.4} of {}", found.beside_hum.1);
                assert!((0.92..=0.97).contains(&beside), "{periods}: {beside}");
            }
            assert!((0.94..=0.96).contains(&disc), "{kind:?} {periods}: {disc}");
            assert!((0.94..=0.96).contains(&magnitude), "{kind:?} {periods}: {magnitude}");
        }
    }
}

#[test]
fn bands_of_95_percent_cover_in_94_to_96() {
    bands_cover(1000);
}

#[test]
#[ignore = "ten thousand repeats"]
fn bands_of_95_percent_cover_in_94_to_96_of_many() {
    bands_cover(10_000);
}

/// A lag of 0.1 s behind a hold of one row, at rest `before` the record instead of at its mean, and white noise.
struct Run {
    row_rate_hz: f64,
    command: Vec<f64>,
    thrust_n: Vec<f64>,
}

impl Run {
    fn new(rng: &mut ChaCha8Rng, rows: usize, row_rate_hz: f64, before: f64, noise_n: f64) -> Self {
        let decay = (-10.0 / row_rate_hz).exp();
        let mut state = 10.0 * before;
        let command: Vec<f64> = (0..rows).map(|_| 0.5 + rng.random_range(-0.05..0.05)).collect();
        let thrust_n = command
            .iter()
            .map(|command| {
                let drawn: f64 = StandardNormal.sample(rng);
                let row = state + noise_n * drawn;
                let target = 10.0 * (command - 0.5);
                state = target + (state - target) * decay;
                row
            })
            .collect();
        Self { row_rate_hz, command, thrust_n }
    }

    /// Response over command, exactly: `K (1 - a) / (z - a)`.
    fn truth(&self, omega_rad_s: f64) -> Complex64 {
        let decay = (-10.0 / self.row_rate_hz).exp();
        10.0 * (1.0 - decay) / (Complex64::cis(omega_rad_s / self.row_rate_hz) - decay)
    }

    fn local_polynomial(&self, band_hz: (f64, f64)) -> LocalPolynomial {
        let record = record(self.row_rate_hz, None, self.command.clone(), self.thrust_n.clone());
        let options = LocalPolynomialOptions { band_hz, ..LocalPolynomialOptions::default() };
        LocalPolynomial::from_record(&experiment(self.row_rate_hz, vec![]), &record, &options).unwrap()
    }

    /// The paper's estimate on the same bins: the ratio of the coefficients, smoothed by a Hann window with the command's
    /// power as weight.
    fn etfe(&self, half_width: usize) -> Vec<ResponsePoint> {
        let spectrum = |column: &[f64]| {
            let mean = column.iter().sum::<f64>() / column.len() as f64;
            let around: Vec<f64> = column.iter().map(|x| x - mean).collect();
            spectra::transform(&around, column.len()).swap_remove(0)
        };
        let (command, response) = (spectrum(&self.command), spectrum(&self.thrust_n));
        let points = (1..command.len() - 1)
            .map(|bin| ResponsePoint {
                omega_rad_s: TAU * bin as f64 * self.row_rate_hz / self.command.len() as f64,
                response: response[bin] / command[bin],
                variance: 1.0 / command[bin].norm_sqr(),
            })
            .collect::<Vec<_>>();
        let flat = vec![Complex64::ONE; points.len()];
        Etfe::from_points(points, &flat, half_width).unwrap().smoothed().to_vec()
    }

    /// Root of the mean squared relative error over a band.
    fn error(&self, points: impl Iterator<Item = (f64, Complex64)>, band_hz: (f64, f64)) -> f64 {
        let inside = points.filter(|(omega, _)| (TAU * band_hz.0..=TAU * band_hz.1).contains(omega));
        let (sum, count) = inside.fold((0.0, 0.0), |(sum, count), (omega, response)| {
            (sum + (response / self.truth(omega) - 1.0).norm_sqr(), count + 1.0)
        });
        (sum / count).sqrt()
    }
}

#[test]
fn on_a_short_record_with_a_transient_the_local_polynomial_has_half_the_error_of_the_best_hann_window() {
    let band_hz = (0.25, 10.0);
    let mut mean = [0.0; 2];
    let runs = 10;
    for seed in 0..runs {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        // Eight seconds at 200 Hz, from a steady state 0.5 N away, noise of 0.01 N.
        let run = Run::new(&mut rng, 1600, 200.0, 0.05, 0.01);
        let found = run.local_polynomial(band_hz);
        assert_eq!(found.left_out, 0);
        let local = run.error(found.response.lines.iter().map(|l| (l.omega_rad_s, l.response)), band_hz);
        let of_width = |w| run.error(run.etfe(w).iter().map(|p| (p.omega_rad_s, p.response)), band_hz);
        // The best of all windows, known only to whoever knows the truth.
        let etfe = (1..=20).map(of_width).fold(f64::INFINITY, f64::min);
        mean[0] += local / runs as f64;
        mean[1] += etfe / runs as f64;
    }
    println!("relative error: local polynomial {:.4}, Hann {:.4}", mean[0], mean[1]);
    assert!(mean[0] < 0.5 * mean[1], "{mean:?}");
}

fn local_polynomial_covers(repeats: u64) {
    let (mut covered, mut all, mut noise) = (0, 0, 0.0);
    for repeat in 0..repeats {
        let mut rng = ChaCha8Rng::seed_from_u64(repeat);
        // 40 s at 100 Hz.
        let run = Run::new(&mut rng, 4000, 100.0, 0.05, 0.05);
        let found = run.local_polynomial((0.5, 10.0));
        // A window apart, so that lines are independent.
        for (line, variance) in found.response.lines.iter().zip(&found.noise_variance).step_by(15) {
            let distance = (line.response - run.truth(line.omega_rad_s)).norm();
            covered += u32::from(distance <= found.response.confidence_radius(line, 0.95));
            all += 1;
            // White noise of variance s^2 has coefficients of variance 4 s^2 / N.
            noise += variance / (4.0 * 0.05 * 0.05 / 4000.0);
        }
    }
    let (share, noise) = (f64::from(covered) / f64::from(all), noise / f64::from(all));
    println!("{share:.4} of {all} covered, noise {noise:.3} of what it is");
    assert!((0.94..=0.96).contains(&share), "{share}");
    assert!((noise - 1.0).abs() < 0.02, "{noise}");
}

#[test]
fn local_polynomial_bands_cover() {
    // 7800 independent lines: 0.94 is four standard deviations (binomial, 0.0025) below 0.95.
    local_polynomial_covers(300);
}

#[test]
#[ignore = "three thousand repeats"]
fn local_polynomial_bands_cover_of_many() {
    local_polynomial_covers(3000);
}

#[test]
fn a_command_of_few_lines_is_left_out_and_nonsense_is_refused() {
    let rows = 4000;
    let wave = |k: usize| (TAU * 40.0 * k as f64 / rows as f64).sin();
    let command: Vec<f64> = (0..rows).map(|k| 0.5 + 0.05 * wave(k)).collect();
    let thrust_n: Vec<f64> = (0..rows).map(wave).collect();
    let of = |command: Vec<f64>, options: LocalPolynomialOptions| {
        let record = record(100.0, None, command, thrust_n.clone());
        LocalPolynomial::from_record(&experiment(100.0, vec![]), &record, &options)
    };
    let options = LocalPolynomialOptions::default();
    // One line cannot tell a response from a transient anywhere.
    assert!(of(command.clone(), options).is_err());
    assert!(of(vec![0.5; rows], options).is_err());
    assert!(of(command.clone(), LocalPolynomialOptions { half_width: 2, ..options }).is_err());
    assert!(of(command, LocalPolynomialOptions { band_hz: (1.0, 60.0), ..options }).is_err());
}

#[test]
fn radii_are_those_of_the_tables() {
    let line = ResponseLine { omega_rad_s: 1.0, response: Complex64::ONE, variance: 2.0 };
    let response = |degrees_of_freedom| FrequencyResponse { lines: vec![line], degrees_of_freedom, periods: 4 };
    // F(2, 20) at 0.95: 3.492828; chi-square(2) / 2: 2.995732.
    assert!((response(10.0).confidence_radius(&line, 0.95).powi(2) / 2.0 - 3.492_828).abs() < 1e-6);
    assert!((response(f64::INFINITY).confidence_radius(&line, 0.95).powi(2) / 2.0 - 2.995_732).abs() < 1e-6);
    let (low, high) = response(10.0).magnitude_interval(&line, 0.95);
    assert!((high - 1.0 - 2.085_963).abs() < 1e-5 && low == 0.0);
    let (low, high) = response(10.0).phase_interval_rad(&line, 0.95);
    assert!((high - low - TAU).abs() < 1e-12);
}
