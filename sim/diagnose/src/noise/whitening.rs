//! What makes a residual white: its spectrum over that of the noise.
//!
//! A residual of `N` rows has the spectrum `R_k = sum r_n e^(-2 pi j k n / N)`. Where the noise has the density `S(f)` per
//! row, `E |R_k|^2 = N S(f_k)`, and the real and imaginary parts of `R_k / sqrt(N S / 2)` are independent with variance 1
//! (Whittle 1953; Pintelon & Schoukens, sec. 16.17). Sums of their squares are then minus twice the log likelihood.
//!
//! The density comes from the records themselves: over several periods what repeats lies on every `P`-th line, and between
//! these lines there is only noise.

use std::f64::consts::TAU;
use std::fmt;
use std::sync::Arc;

use num_complex::Complex64;
use rotorlead_fourier::{RealToComplex, real_forward};
use rotorlead_identify::spectra::density;

/// Share of the row rate up to which residuals are compared: above, a logger's own filter acts. Chosen: a tenth below half the rate. Lower
/// loses lines that are excited at slow rows; higher compares the filter.
const HIGHEST_PART: f64 = 0.45;

/// Real part of the inner product.
pub(crate) fn dot(a: &[Complex64], b: &[Complex64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.re * b.re + a.im * b.im).sum()
}

/// Density of the noise over frequency: the variance of a row if it were white.
#[derive(Clone, Debug)]
pub(crate) struct NoiseDensity {
    /// Logarithms of frequency in hertz and of density, by increasing frequency, at the lines where there is only noise.
    bands: Vec<(f64, f64)>,
}

impl NoiseDensity {
    /// From a residual over whole periods: from the lines between the harmonics; from every other line where there is one
    /// period only. `None` where there is nothing to take it from.
    pub fn between_harmonics(residual: &[f64], periods: usize, rate_hz: f64) -> Option<Self> {
        let rows = residual.len();
        let spectrum = Whitening::unit(rows).spectrum(residual);
        // With one period the even lines: a multisine of odd lines leaves them to noise and even distortion.
        let is_noise = |line: usize| if periods > 1 { !line.is_multiple_of(periods) } else { line.is_multiple_of(2) };
        let lines: Vec<usize> = (1..spectrum.len()).filter(|line| is_noise(*line)).collect();
        let power: Vec<f64> = lines.iter().map(|line| spectrum[*line].norm_sqr() / rows as f64).collect();
        if lines.len() < 2 {
            return None;
        }
        let density = density(&power, &lines);
        let hz = |line: usize| line as f64 * rate_hz / rows as f64;
        let mut bands: Vec<(f64, f64)> =
            lines.iter().zip(density).map(|(line, density)| (hz(*line).ln(), density.ln())).collect();
        bands.retain(|(_, density)| density.is_finite());
        (!bands.is_empty()).then_some(Self { bands })
    }

    /// Density at a frequency: linear between the lines on both logarithms, and level beyond them.
    fn at(&self, hz: f64) -> f64 {
        let log_hz = hz.ln();
        let above = self.bands.partition_point(|(band, _)| *band < log_hz);
        let density = match (above.checked_sub(1).map(|index| self.bands[index]), self.bands.get(above).copied()) {
            (Some((low, from)), Some((high, to))) => from + (to - from) * (log_hz - low) / (high - low),
            (Some((_, density)), None) | (None, Some((_, density))) => density,
            (None, None) => 0.0,
        };
        density.exp()
    }
}

/// The transform of so many rows with the weights of its lines.
#[derive(Clone)]
pub(crate) struct Whitening {
    transform: Arc<dyn RealToComplex<f64>>,
    /// One over the standard deviation of either part of a line; 0 for lines that are not compared.
    weights: Vec<f64>,
    /// Variance of a row by the noise of all lines but the mean.
    variance: f64,
    /// One turn of the circle in steps of a line, clockwise, as far as lines are compared.
    turns: Arc<[Complex64]>,
}

impl Whitening {
    /// For noise that is not known yet.
    pub fn unit(rows: usize) -> Self {
        let transform = real_forward(rows);
        let turns = (0..=rows / 2).map(|line| Complex64::cis(-TAU * line as f64 / rows as f64)).collect();
        Self { transform, weights: vec![1.0; rows / 2 + 1], variance: 0.0, turns }
    }

    /// Weighs by a density.
    pub fn set_noise(&mut self, density: &NoiseDensity, rate_hz: f64) {
        let rows = self.transform.len() as f64;
        let last = (HIGHEST_PART * rows) as usize;
        // A line and its mirror image carry 2 |R|^2 / N^2, and E |R|^2 = N S.
        let hz = |line: usize| line as f64 * rate_hz / rows;
        self.variance = (1..self.weights.len()).map(|line| 2.0 * density.at(hz(line)) / rows).sum();
        for (line, weight) in self.weights.iter_mut().enumerate() {
            // The mean is not compared: a sensor's zero says nothing.
            *weight = if line == 0 || line > last { 0.0 } else { (0.5 * rows * density.at(hz(line))).sqrt().recip() };
        }
    }

    /// For one of so many parts of the rows, in the same noise: the density of a line is that of the line at its frequency,
    /// and the weight grows with the root of one over the length.
    pub fn shortened(&self, parts: usize) -> Self {
        let mut shorter = Self::unit(self.transform.len() / parts);
        let longer = self.weights.iter().step_by(parts).map(|weight| weight * (parts as f64).sqrt());
        shorter.weights.iter_mut().zip(longer).for_each(|(weight, longer)| *weight = longer);
        shorter.variance = self.variance;
        shorter
    }

    /// Rows of what is transformed.
    pub fn rows(&self) -> usize {
        self.transform.len()
    }

    /// Lines of the spectrum that are compared, from the first to the last.
    pub fn lines(&self) -> usize {
        self.weights.iter().rposition(|weight| *weight > 0.0).unwrap_or(0)
    }

    /// Variance of a row by the noise.
    pub fn row_variance(&self) -> f64 {
        self.variance
    }

    /// One over the standard deviation of either part of each line, the mean first.
    pub fn weights(&self) -> &[f64] {
        &self.weights
    }

    /// The spectrum of so many rows.
    pub fn spectrum(&self, rows: &[f64]) -> Vec<Complex64> {
        let mut input = rows.to_vec();
        let mut spectrum = self.transform.make_output_vec();
        // The lengths are the transform's own.
        if self.transform.process(&mut input, &mut spectrum).is_err() {
            spectrum.fill(Complex64::ZERO);
        }
        spectrum
    }

    /// The white residual, a complex number for each line from 1 on; either part has variance 1 where only noise is left.
    pub fn apply(&self, residual: &[f64]) -> Vec<Complex64> {
        let lines = self.lines();
        let mut spectrum = self.spectrum(residual);
        spectrum.truncate(lines + 1);
        spectrum.drain(..1);
        for (line, weight) in spectrum.iter_mut().zip(&self.weights[1..]) {
            *line *= *weight;
        }
        spectrum
    }
}

impl Whitening {
    /// [`Whitening::apply`] for a decay by `ratio` from row to row, from 1 on: a geometric series.
    pub fn apply_to_decay(&self, ratio: f64) -> Vec<Complex64> {
        let lines = self.lines();
        let all = 1.0 - ratio.powi(self.transform.len() as i32);
        let turns_and_weights = self.turns.iter().zip(&self.weights).take(lines + 1).skip(1);
        turns_and_weights.map(|(turn, weight)| all * weight / (1.0 - ratio * turn)).collect()
    }
}

impl fmt::Debug for Whitening {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Whitening of {} rows", self.transform.len())
    }
}
