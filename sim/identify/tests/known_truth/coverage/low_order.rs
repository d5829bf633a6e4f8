//! Coverage, efficiency and bias of the fits of low order, over repeats.
//!
//! The bounds are computed here, from the true response by differences and the true variances.

use std::f64::consts::TAU;

use num_complex::Complex64;
use rotorlead_identify::estimate::Estimate;
use rotorlead_identify::stand::transfer_function::{ParametricFit, Structure, fit_parametric};

use super::synthesis::Synthesis;
use super::tally::{BIAS, Found, Pooled, SPREAD, Tally, first_seed, repeats, study_all};

/// Period of the excitation.
const PERIOD_S: f64 = 10.0;

/// Distance of two harmonics.
const BIN_RAD_S: f64 = TAU / PERIOD_S;

/// 150 lines, 0.1 to 59.7 Hz: mains hum is between them.
fn harmonics() -> Vec<u32> {
    (0..150).map(|k| 1 + 4 * k).collect()
}

fn lines() -> Vec<f64> {
    harmonics().into_iter().map(|harmonic| BIN_RAD_S * f64::from(harmonic)).collect()
}

/// What is identified.
#[derive(Clone, Copy, Debug)]
enum Plant {
    FirstOrder,
    SecondOrder,
}

impl Plant {
    const ALL: [Self; 2] = [Self::FirstOrder, Self::SecondOrder];

    /// Gain and time constant; or gain, undamped frequency and damping.
    fn truth(self) -> Vec<f64> {
        match self {
            Self::FirstOrder => vec![7.0, 0.05],
            Self::SecondOrder => vec![7.0, 40.0, 0.6],
        }
    }

    fn response(self, p: &[f64], omega: f64) -> Complex64 {
        let s = Complex64::new(0.0, omega);
        match self {
            Self::FirstOrder => p[0] / (1.0 + s * p[1]),
            Self::SecondOrder => {
                let x = s / p[1];
                p[0] / (1.0 + 2.0 * p[2] * x + x * x)
            }
        }
    }

    fn structure(self) -> Structure {
        match self {
            Self::FirstOrder => Structure::FIRST_ORDER,
            Self::SecondOrder => Structure::SECOND_ORDER,
        }
    }

    /// The estimates and their 95 % intervals.
    fn estimates(self, fit: &ParametricFit) -> Option<Vec<Found>> {
        let plain = |estimate: Estimate| (estimate, estimate.interval(0.95));
        let positive = |estimate: Estimate| (estimate, estimate.interval_of_logarithm(0.95));
        let tau = || fit.poles.first().and_then(|pole| pole.time_constant_s());
        Some(match self {
            Self::FirstOrder => vec![plain(fit.gain), positive(tau()?)],
            Self::SecondOrder => {
                let (frequency, damping) = fit.second_order()?;
                vec![plain(fit.gain), positive(frequency), positive(damping)]
            }
        })
    }

    /// Cramer-Rao bound of each parameter's standard deviation, for these variances of the averaged lines.
    fn bound(self, variances: &[f64]) -> Vec<f64> {
        let p = self.truth();
        let n = p.len();
        let mut information = nalgebra::DMatrix::<f64>::zeros(n, n);
        for (omega, variance) in lines().into_iter().zip(variances) {
            let by: Vec<Complex64> = (0..n)
                .map(|j| {
                    let h = 1e-5 * p[j];
                    let at = |by: f64| {
                        let mut q = p.clone();
                        q[j] += by;
                        self.response(&q, omega)
                    };
                    (at(h) - at(-h)) / (2.0 * h)
                })
                .collect();
            for i in 0..n {
                for j in 0..n {
                    information[(i, j)] += 2.0 * (by[i].conj() * by[j]).re / variance;
                }
            }
        }
        let inverse = information.try_inverse().unwrap();
        (0..n).map(|i| inverse[(i, i)].sqrt()).collect()
    }
}

#[derive(Clone, Copy, Debug)]
enum Noise {
    White,
    /// Power falls with frequency from 10 Hz on, by 16 dB up to the last line.
    Colored,
    /// From 1 Hz on, by 36 dB: within the width of one pool of variances it falls by 12 dB.
    Steep,
    /// White, and a hum at 49.93 Hz of ten times the amplitude that leaks to the lines around it. Its phase is drawn anew
    /// for each period and is common to all lines.
    Hum,
}

impl Noise {
    const ALL: [Self; 4] = [Self::White, Self::Colored, Self::Steep, Self::Hum];

    /// Standard deviation of the circular part at each line, with mean power one; and the hum's amplitude there.
    fn shape(self) -> (Vec<f64>, Vec<Complex64>) {
        let lines = lines();
        let power: Vec<f64> = lines
            .iter()
            .map(|w| match self {
                Self::Colored => 1.0 / (1.0 + (w / (10.0 * TAU)).powi(2)),
                Self::Steep => 1.0 / (1.0 + (w / TAU).powi(2)),
                Self::White | Self::Hum => 1.0,
            })
            .collect();
        let mean = power.iter().sum::<f64>() / power.len() as f64;
        let hum = lines.iter().map(|w| match self {
            Self::Hum => {
                // One period of e^(j 2 pi 49.93 t) at this line.
                let x = 0.5 * PERIOD_S * (TAU * 49.93 - w);
                10.0 * Complex64::cis(x) * (x.sin() / x)
            }
            Self::White | Self::Colored | Self::Steep => Complex64::ZERO,
        });
        (power.iter().map(|p| (p / mean).sqrt()).collect(), hum.collect())
    }
}

#[derive(Clone, Copy, Debug)]
struct Case {
    plant: Plant,
    noise: Noise,
    /// Mean power of the response at the lines over that of the circular noise, per period.
    snr_db: f64,
    periods: usize,
}

impl Case {
    fn all() -> impl Iterator<Item = Self> {
        Plant::ALL.into_iter().flat_map(|plant| {
            Noise::ALL.into_iter().flat_map(move |noise| {
                [20.0, 0.0].into_iter().flat_map(move |snr_db| {
                    [4, 14].into_iter().map(move |periods| Self { plant, noise, snr_db, periods })
                })
            })
        })
    }

    fn synthesis(&self) -> Synthesis {
        let p = self.plant.truth();
        let truth = lines().into_iter().map(|w| self.plant.response(&p, w)).collect();
        let level = self.level();
        let (std, hum) = self.noise.shape();
        let std = std.into_iter().map(|s| s * level).collect();
        let hum = hum.into_iter().map(|h| h * level).collect();
        Synthesis { truth, bin_rad_s: BIN_RAD_S, harmonics: harmonics(), std, hum, periods: self.periods }
    }

    fn level(&self) -> f64 {
        let p = self.plant.truth();
        let lines = lines();
        let power = lines.iter().map(|w| self.plant.response(&p, *w).norm_sqr()).sum::<f64>() / lines.len() as f64;
        (power / 10f64.powf(self.snr_db / 10.0)).sqrt()
    }
}

/// Repeats of one case.
fn study(case: &Case, repeats: u64) -> Tally {
    let synthesis = case.synthesis();
    let bound = case.plant.bound(&synthesis.variances());
    let mut tally = Tally::new(format!("{case:?}"), case.plant.truth(), bound);
    for seed in 0..repeats {
        let response = synthesis.draw(first_seed(case) + seed);
        let fit = fit_parametric(&response, case.plant.structure());
        tally.add(fit.ok().and_then(|fit| case.plant.estimates(&fit)));
    }
    tally
}

#[test]
#[ignore = "32 cases of 20 000 repeats, some minutes: `cargo xtask statistics`"]
fn coverage_efficiency_and_bias_are_those_claimed_at_full_count() {
    let cases: Vec<Case> = Case::all().collect();
    let repeats = repeats(20_000);
    Pooled::decide(&study_all(&cases, |case| study(case, repeats)), SPREAD, BIAS);
}

/// Six cases, 15 parameters.
#[test]
fn coverage_efficiency_and_bias_are_those_claimed() {
    let noises = [(Noise::Colored, 0.0, 4), (Noise::Steep, 0.0, 4), (Noise::White, 20.0, 14)];
    let cases = Plant::ALL.into_iter().flat_map(|plant| {
        noises.into_iter().map(move |(noise, snr_db, periods)| Case { plant, noise, snr_db, periods })
    });
    Pooled::check(&cases.map(|case| study(&case, 500)).collect::<Vec<_>>());
}
