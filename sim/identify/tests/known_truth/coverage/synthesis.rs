//! Spectra synthesized line by line and period by period, without any run in time, so that thousands of repeats take
//! seconds.

use std::f64::consts::TAU;

use num_complex::Complex64;
use rand::{RngExt as _, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use rotorlead_identify::frequency_response::FrequencyResponse;

/// Lines whose variances are pooled, to either side.
const POOL: usize = 5;

/// Draws experiments.
pub struct Synthesis {
    /// The true response at each line.
    pub truth: Vec<Complex64>,
    /// Distance of two harmonics, rad/s.
    pub bin_rad_s: f64,
    /// Harmonic of each line.
    pub harmonics: Vec<u32>,
    /// Standard deviation of a period's circular noise.
    pub std: Vec<f64>,
    /// Amplitude of a hum, whose phase is drawn anew for each period and is common to all lines.
    pub hum: Vec<Complex64>,
    /// Periods of an experiment.
    pub periods: usize,
}

impl Synthesis {
    /// True variances of the averaged lines.
    pub fn variances(&self) -> Vec<f64> {
        let periods = self.periods as f64;
        self.std.iter().zip(&self.hum).map(|(s, h)| (s * s + h.norm_sqr()) / periods).collect()
    }

    /// One experiment, averaged as the library averages periods.
    pub fn draw(&self, seed: u64) -> FrequencyResponse {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut period = || -> Vec<Complex64> {
            let phase = Complex64::cis(rng.random_range(0.0..TAU));
            let lines = self.truth.iter().zip(&self.std).zip(&self.hum);
            lines
                .map(|((truth, std), hum)| {
                    let (re, im): (f64, f64) = (StandardNormal.sample(&mut rng), StandardNormal.sample(&mut rng));
                    truth + Complex64::new(re, im) * (std * std::f64::consts::FRAC_1_SQRT_2) + phase * hum
                })
                .collect()
        };
        let periods: Vec<_> = (0..self.periods).map(|_| period()).collect();
        FrequencyResponse::from_periods(self.bin_rad_s, &self.harmonics, &periods, POOL).unwrap()
    }
}
