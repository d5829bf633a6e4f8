//! Noise of the load cell: white, colored and mains hum, with the spectrum that the likelihood knows.

use std::f64::consts::TAU;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::excitation::ROWS_HZ;

/// Bins this close to the hum or its third harmonic count nothing in a likelihood, in hertz.
const HUM_NOTCH_HZ: f64 = 1.5;

/// A stationary noise as a sum of white noise, first-order colored noises, and hum.
#[derive(Clone, Debug, PartialEq)]
pub struct Noise {
    /// Standard deviation of the white part in newtons.
    pub white_n: f64,
    /// Standard deviation in newtons and corner in hertz of each colored part.
    pub colored: Vec<(f64, f64)>,
    /// Standard deviation of the hum in newtons.
    pub hum_n: f64,
    /// Its frequency in hertz.
    pub hum_hz: f64,
}

impl Noise {
    /// A noise of standard deviation `sigma_n` in all. Its power is shared out at random: a part of 0.1 to 1 is white;
    /// of the rest half the cases give all to one color with a corner of 0.3 to 30 Hz, the others spread it over three
    /// corners a decade apart, which is 1/f between them; up to 0.3 of the whole is then hum, of 50 or 60 Hz with the
    /// grid 0.2 % off.
    #[must_use]
    pub fn draw(sigma_n: f64, rng: &mut ChaCha8Rng) -> Self {
        let hum: f64 = rng.random_range(0.0..0.3);
        let white: f64 = rng.random_range(0.1..1.0);
        let (white_power, colored_power) = ((1.0 - hum) * white, (1.0 - hum) * (1.0 - white));
        let corners = if rng.random_bool(0.5) {
            vec![0.3 * 100.0_f64.powf(rng.random_range(0.0..1.0))]
        } else {
            vec![0.3, 3.0, 30.0]
        };
        let each = sigma_n * (colored_power / corners.len() as f64).sqrt();
        let mains: f64 = if rng.random_bool(0.5) { 50.0 } else { 60.0 };
        Self {
            white_n: sigma_n * white_power.sqrt(),
            colored: corners.into_iter().map(|corner| (each, corner)).collect(),
            hum_n: sigma_n * hum.sqrt(),
            hum_hz: mains * (1.0 + rng.random_range(-0.002..0.002)),
        }
    }

    /// White noise alone.
    #[must_use]
    pub fn white(sigma_n: f64) -> Self {
        Self { white_n: sigma_n, colored: Vec::new(), hum_n: 0.0, hum_hz: 50.0 }
    }

    /// Newtons of noise for `rows` rows. The hum has a random phase and a tenth of its size at three times its
    /// frequency.
    #[must_use]
    pub fn sample(&self, rows: usize, rng: &mut ChaCha8Rng) -> Vec<f64> {
        let mut normal = || -> f64 { StandardNormal.sample(rng) };
        let mut out: Vec<f64> = (0..rows).map(|_| self.white_n * normal()).collect();
        for (sigma, corner) in &self.colored {
            let pole = pole(*corner);
            let innovation = sigma * (1.0 - pole * pole).sqrt();
            let mut state = sigma * normal();
            for value in &mut out {
                *value += state;
                state = pole * state + innovation * normal();
            }
        }
        let size = self.hum_n * 2.0_f64.sqrt();
        let (phase, third): (f64, f64) = (rng.random_range(0.0..TAU), rng.random_range(0.0..TAU));
        for (row, value) in out.iter_mut().enumerate() {
            let angle = TAU * self.hum_hz * row as f64 / ROWS_HZ;
            *value += size * ((angle + phase).sin() + 0.1 * (3.0 * angle + third).sin());
        }
        out
    }

    /// Weight of each bin `1..rows / 2` of a discrete Fourier transform of `rows` rows: the root of one over the power
    /// that noise has there, `E |N_k|^2 / rows`, in 1/newtons; zero beside the hum.
    #[must_use]
    pub fn weights(&self, rows: usize) -> Vec<f64> {
        (1..rows / 2)
            .map(|bin| {
                let hz = bin as f64 * ROWS_HZ / rows as f64;
                let hums = [self.hum_hz, 3.0 * self.hum_hz];
                if self.hum_n > 0.0 && hums.iter().any(|hum| (hz - hum).abs() < HUM_NOTCH_HZ) {
                    return 0.0;
                }
                let cos = (TAU * hz / ROWS_HZ).cos();
                let colored = self.colored.iter().map(|(sigma, corner)| {
                    let pole = pole(*corner);
                    sigma * sigma * (1.0 - pole * pole) / (1.0 - 2.0 * pole * cos + pole * pole)
                });
                (self.white_n * self.white_n + colored.sum::<f64>()).sqrt().recip()
            })
            .collect()
    }
}

fn pole(corner_hz: f64) -> f64 {
    (-TAU * corner_hz / ROWS_HZ).exp()
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::super::whiten::Spectrum;
    use super::*;

    #[test]
    fn the_whole_has_the_stated_size() {
        for seed in 0..8 {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let noise = Noise::draw(0.02, &mut rng);
            let out = noise.sample(120_000, &mut rng);
            let size = (out.iter().map(|value| value * value).sum::<f64>() / 120_000.0).sqrt();
            assert!((size / 0.02 - 1.0).abs() < 0.1, "seed {seed}: {size}");
        }
    }

    #[test]
    fn whitened_noise_is_white() {
        let mut spectrum = Spectrum::new(30_000);
        for seed in 0..8 {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let noise = Noise::draw(0.02, &mut rng);
            let weights = noise.weights(30_000);
            let (mut low, mut all) = (Vec::new(), Vec::new());
            for _ in 0..6 {
                let bins = spectrum.whitened(&noise.sample(30_000, &mut rng), &weights);
                let powers: Vec<f64> = bins.chunks(2).map(|bin| bin[0] * bin[0] + bin[1] * bin[1]).collect();
                low.extend(powers[2..300].to_vec());
                all.extend(powers.into_iter().filter(|power| *power > 0.0));
            }
            let mean = |powers: &[f64]| powers.iter().sum::<f64>() / powers.len() as f64;
            // The mean of n exponential numbers of mean 1 is off by 1/sqrt(n): 0.024 and 0.0034. Leakage adds 1 %.
            assert!((mean(&low) - 1.0).abs() < 0.1, "seed {seed}: {}", mean(&low));
            assert!((mean(&all) - 1.0).abs() < 0.03, "seed {seed}: {}", mean(&all));
        }
    }
}
