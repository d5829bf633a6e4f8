//! Spectra synthesized line by line and period by period, without any run in time, so that thousands of repeats take
//! seconds.

use std::f64::consts::TAU;

use num_complex::Complex64;
use rand::{RngExt as _, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use rotorlead_sim::identify::{FrequencyResponse, ResponseLine};

/// Lines whose variances are pooled, to either side.
const POOL: usize = 5;

/// Draws experiments.
pub struct Synthesis {
    /// The true response at each line.
    pub truth: Vec<Complex64>,
    /// Frequencies, rad/s.
    pub lines: Vec<f64>,
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

    /// One experiment: means and pooled sample variances over its periods.
    pub fn draw(&self, seed: u64) -> FrequencyResponse {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let count = self.lines.len();
        let (mut sum, mut squares) = (vec![Complex64::ZERO; count], vec![0.0; count]);
        for _ in 0..self.periods {
            let phase = Complex64::cis(rng.random_range(0.0..TAU));
            for k in 0..count {
                let (re, im): (f64, f64) = (StandardNormal.sample(&mut rng), StandardNormal.sample(&mut rng));
                let noise =
                    Complex64::new(re, im) * (self.std[k] * std::f64::consts::FRAC_1_SQRT_2) + phase * self.hum[k];
                sum[k] += noise;
                squares[k] += noise.norm_sqr();
            }
        }
        let periods = self.periods as f64;
        let sample: Vec<f64> =
            (0..count).map(|k| (squares[k] - sum[k].norm_sqr() / periods) / (periods - 1.0) / periods).collect();
        let width = 2 * POOL + 1;
        let lines = (0..count)
            .map(|k| {
                let first = k.saturating_sub(POOL).min(count - width);
                ResponseLine {
                    omega_rad_s: self.lines[k],
                    response: self.truth[k] + sum[k] / periods,
                    variance: sample[first..first + width].iter().sum::<f64>() / width as f64,
                }
            })
            .collect();
        FrequencyResponse { lines, degrees_of_freedom: (width * (self.periods - 1)) as f64, periods: self.periods }
    }
}
