//! Noise of a thrust sensor.

use std::f64::consts::TAU;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal, Uniform};
use rotorlead_records::files::{Fault, KeyPath};
use serde::{Deserialize, Serialize};

use super::PlantError;

/// What the noise of a thrust sensor is like. The `[noise]` table of a plan.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Noise {
    /// Standard deviation in newtons, white and colored alike, 0 or more.
    #[serde(default)]
    pub sigma_n: f64,
    /// Whether a sample knows of the one before.
    #[serde(default)]
    pub color: Color,
    /// Pole of colored noise, -1..1 (both excluded), per row: the correlation of a sample with the one before.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pole: Option<f64>,
    /// Amplitude (peak) of the mains hum in newtons, 0 or more.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hum_n: Option<f64>,
    /// Frequency of the hum in hertz, above 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hum_hz: Option<f64>,
}

/// Spectrum of the noise.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Color {
    /// Every sample independent of the others.
    #[default]
    White,
    /// `n_k = pole n_(k-1) + e_k`, autoregressive of order 1.
    Ar1,
}

impl Noise {
    /// Whether it adds nothing.
    #[must_use]
    pub fn is_silent(&self) -> bool {
        self.sigma_n == 0.0 && self.hum_n.is_none_or(|hum_n| hum_n == 0.0)
    }

    /// Checks ranges and that nothing is missing; `place` is that of the table.
    ///
    /// # Errors
    /// A fault at the key.
    pub fn check(&self, place: &KeyPath) -> Result<(), Fault> {
        let numbers =
            [("sigma_n", Some(self.sigma_n)), ("pole", self.pole), ("hum_n", self.hum_n), ("hum_hz", self.hum_hz)];
        for (key, value) in numbers {
            value.map_or(Ok(()), |value| place.key(key).accept(value))?;
        }
        let missing =
            |key: &str, reason: &str| Err(place.key(key).fault(format!("missing: {reason}"), format!("add {key}")));
        match (self.color, self.pole) {
            (Color::Ar1, None) => missing("pole", "noise of color \"ar1\" has a pole"),
            (Color::White, Some(_)) => {
                Err(place.key("pole").fault("white noise has none", "remove it, or set color = \"ar1\""))
            }
            _ if self.hum_n.is_some() && self.hum_hz.is_none() => missing("hum_hz", "hum has a frequency"),
            _ => Ok(()),
        }
    }
}

/// A source of [`Noise`], one sample per row.
#[derive(Clone, Debug)]
pub struct SensorNoise {
    noise: Noise,
    pole: f64,
    /// Colored noise over its sigma.
    state: f64,
    hum_phase_rad: f64,
    rng: ChaCha8Rng,
}

impl SensorNoise {
    /// Noise from stream `stream` of the generator that `seed` starts. Streams do not overlap, so records that
    /// differ in nothing but their stream have independent noise.
    ///
    /// Colored noise starts in its stationary distribution: the first row is as noisy as any. The phase of the
    /// hum is drawn once.
    ///
    /// # Errors
    /// What [`Noise::check`] finds.
    pub fn new(noise: Noise, seed: u64, stream: u64) -> Result<Self, PlantError> {
        noise.check(&KeyPath::root()).map_err(PlantError::Noise)?;
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(stream);
        let turn = Uniform::new(0.0, TAU).expect("0 is below a turn");
        let hum_phase_rad = turn.sample(&mut rng);
        let state = StandardNormal.sample(&mut rng);
        let pole = match noise.color {
            Color::White => 0.0,
            Color::Ar1 => noise.pole.unwrap_or(0.0),
        };
        Ok(Self { noise, pole, state, hum_phase_rad, rng })
    }

    /// The noise of the next row, whose time is `time_s`, in newtons.
    #[inline]
    pub fn sample(&mut self, time_s: f64) -> f64 {
        let sample = self.noise.sigma_n * self.state;
        // The innovation is scaled so that the variance stays 1 for any pole.
        let innovation: f64 = StandardNormal.sample(&mut self.rng);
        self.state = self.pole * self.state + (1.0 - self.pole * self.pole).sqrt() * innovation;
        match (self.noise.hum_n, self.noise.hum_hz) {
            (Some(hum_n), Some(hum_hz)) => sample + hum_n * (TAU * hum_hz * time_s + self.hum_phase_rad).sin(),
            _ => sample,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROWS: usize = 1_000_000;

    fn samples(noise: Noise, seed: u64, stream: u64, rows: usize) -> Vec<f64> {
        let mut source = SensorNoise::new(noise, seed, stream).unwrap();
        (0..rows).map(|row| source.sample(row as f64 / 1000.0)).collect()
    }

    fn correlation(x: &[f64], lag: usize) -> f64 {
        let power: f64 = x.iter().map(|v| v * v).sum();
        x.iter().zip(&x[lag..]).map(|(a, b)| a * b).sum::<f64>() / power
    }

    /// Tolerances are five standard errors: with `a` the pole and N rows, the standard error of sigma is sigma
    /// sqrt((1 + a^2) / (1 - a^2) / (2 N)), and that of a correlation at most sqrt((1 + a^2) / (1 - a^2) / N)
    /// (Bartlett).
    #[test]
    fn sigma_and_correlation_are_as_asked() {
        for pole in [0.0, 0.6, 0.95, -0.5] {
            let noise = if pole == 0.0 {
                Noise { sigma_n: 0.02, ..Noise::default() }
            } else {
                Noise { sigma_n: 0.02, color: Color::Ar1, pole: Some(pole), ..Noise::default() }
            };
            let x = samples(noise, 1, 0, ROWS);
            let inflation = (1.0 + pole * pole) / (1.0 - pole * pole) / ROWS as f64;
            let sigma = (x.iter().map(|v| v * v).sum::<f64>() / ROWS as f64).sqrt();
            assert!((sigma / 0.02 - 1.0).abs() < 5.0 * (inflation / 2.0).sqrt(), "sigma {sigma} for pole {pole}");
            for lag in 1..=5 {
                let (found, expected) = (correlation(&x, lag), pole.powi(lag as i32));
                assert!(
                    (found - expected).abs() < 5.0 * inflation.sqrt(),
                    "pole {pole}, lag {lag}: {found} for {expected}"
                );
            }
        }
    }

    /// Over many streams the first sample has the full variance; standard error of a sigma of 20 000 is 0.5 %.
    #[test]
    fn colored_noise_is_stationary_from_its_first_row() {
        let noise = Noise { sigma_n: 1.0, color: Color::Ar1, pole: Some(0.99), ..Noise::default() };
        let power: f64 = (0..20_000).map(|stream| samples(noise, 7, stream, 1)[0].powi(2)).sum();
        assert!(((power / 20_000.0).sqrt() - 1.0).abs() < 0.025);
    }

    #[test]
    fn hum_is_a_sinusoid_of_the_given_amplitude() {
        let hum = Noise { hum_n: Some(0.5), hum_hz: Some(50.0), ..Noise::default() };
        let x = samples(hum, 3, 0, 1000);
        let (mut re, mut im) = (0.0, 0.0);
        for (row, v) in x.iter().enumerate() {
            let angle = TAU * 50.0 * row as f64 / 1000.0;
            re += v * angle.cos();
            im += v * angle.sin();
        }
        assert!((2.0 / 1000.0 * f64::hypot(re, im) - 0.5).abs() < 1e-12);
        assert!((x.iter().map(|v| v * v).sum::<f64>() / 1000.0 - 0.125).abs() < 1e-12);
    }

    #[test]
    fn the_same_seed_gives_the_same_noise_and_another_stream_an_independent_one() {
        let noise = Noise { sigma_n: 1.0, ..Noise::default() };
        let x = samples(noise, 5, 2, 100_000);
        assert_eq!(x, samples(noise, 5, 2, 100_000));
        for (seed, stream) in [(5, 3), (6, 2)] {
            let product: f64 = x.iter().zip(samples(noise, seed, stream, 100_000)).map(|(a, b)| a * b).sum();
            assert!((product / 100_000.0).abs() < 5.0 / 100_000_f64.sqrt());
        }
    }

    #[test]
    fn nonsense_is_refused_by_name() {
        let good = Noise { sigma_n: 0.02, ..Noise::default() };
        for (noise, parameter) in [
            (Noise { sigma_n: -1.0, ..good }, "sigma_n"),
            (Noise { sigma_n: f64::NAN, ..good }, "sigma_n"),
            // As a plan's: the ranges are those of `docs/ranges.md`.
            (Noise { sigma_n: 1e9, ..good }, "sigma_n"),
            (Noise { hum_n: Some(0.1), hum_hz: Some(1e9), ..good }, "hum_hz"),
            (Noise { color: Color::Ar1, ..good }, "pole"),
            (Noise { color: Color::Ar1, pole: Some(1.0), ..good }, "pole"),
            (Noise { pole: Some(0.5), ..good }, "pole"),
            (Noise { hum_n: Some(0.1), ..good }, "hum_hz"),
            (Noise { hum_n: Some(0.1), hum_hz: Some(0.0), ..good }, "hum_hz"),
        ] {
            let fault = noise.check(&KeyPath::root()).unwrap_err();
            assert_eq!(fault.place, KeyPath::root().key(parameter), "{noise:?}");
        }
        assert_eq!(good.check(&KeyPath::root()), Ok(()));
    }
}
