//! The local polynomial method: a frequency response from any record, its transients taken out.
//!
//! The Fourier coefficients of a record that is not periodic, or has not settled, are not `G U` but
//!
//! ```text
//! Y(k + r) = G(k + r) U(k + r) + T(k + r) + V(k + r)
//! ```
//!
//! where `T`, the leakage of what happened before the record and is left over after it, is as smooth in
//! frequency as `G` is, while `U` is rough. Around each bin both are parabolas in `r`, fitted to the
//! `2 n + 1` nearest bins by least squares; what is left over is the noise (Pintelon & Schoukens, 2012,
//! chapter 7). With 6 complex unknowns `q = 2 n - 5` degrees of freedom remain:
//!
//! ```text
//! var V = |residual|^2 / q,    var G = [(K^H K)^-1]_00 var V
//! ```
//!
//! It asks for a command that is rough from bin to bin: noise, a chirp, a flight, several steps, not the few lines
//! of a multisine over whole periods, which [`super::Spectrum`] handles without any transient. Bins
//! around which the command cannot tell `G` from `T` are left out.

use std::f64::consts::TAU;

use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;
use rotorlead_numerics::sample::mean;
use rotorlead_records::{Experiment, Record};

use super::{FrequencyResponse, ResponseLine};
use crate::error::IdentifyError;
use crate::rows::columns;
use crate::spectra;

/// Coefficients of a parabola.
const COEFFICIENTS: usize = 3;

/// The least that the smallest singular value may be of the largest, columns scaled alike. Chosen: below, the noise of `G` would be more
/// than a thousand times that of a bin; a higher limit leaves out more lines.
const SMALLEST_SINGULAR: f64 = 1e-3;

/// Windows in which the command is below this share of its largest coefficient hold rounding, not excitation. Chosen: the square root of
/// a double's resolution; a record that is 160 dB below its largest line shows nothing.
const SMALLEST_COMMAND: f64 = 1e-8;

/// How the local polynomial method is used.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LocalPolynomialOptions {
    /// Lowest and highest frequency of interest, hertz. The default is the band of the paper's multisine, 0.1 to 30 Hz.
    pub band_hz: (f64, f64),
    /// Bins to either side that a parabola is fitted to, `n` above; 4 or more, so that `q` is 3: the inverse of a variance of fewer degrees
    /// of freedom has no finite variance. Wider windows have less noise and more bias; the default of 7 is chosen, with `q = 9`. At the
    /// ends of the spectrum the window keeps its width.
    pub half_width: usize,
}

impl Default for LocalPolynomialOptions {
    fn default() -> Self {
        Self { band_hz: (0.1, 30.0), half_width: 7 }
    }
}

/// What the local polynomial method finds.
#[derive(Clone, Debug, PartialEq)]
pub struct LocalPolynomial {
    /// Response over command. Errors of lines closer than the window's `2 n` bins are correlated.
    pub response: FrequencyResponse,
    /// Noise variance `E |V|^2` of the response's Fourier coefficient at each line, `(2 / N) sum y e^(-j w t)`.
    pub noise_variance: Vec<f64>,
    /// Mean power `|U|^2` of the command's Fourier coefficients in the window of each line.
    pub command_power: Vec<f64>,
    /// Lines of the band around which the command does not tell response and transient apart.
    pub left_out: usize,
}

impl LocalPolynomial {
    /// The frequency response of any one evenly sampled record, at the multiples of one over its length.
    ///
    /// # Errors
    /// [`IdentifyError::Setting`] for a window or band that is none, [`IdentifyError::ConstantCommand`], and what is
    /// wrong with the record's rows: [`IdentifyError::NoResponse`], [`IdentifyError::UnevenRows`],
    /// [`IdentifyError::TooShort`]; also when no line of the band is left.
    pub fn from_record(
        experiment: &Experiment,
        record: &Record,
        options: &LocalPolynomialOptions,
    ) -> Result<Self, IdentifyError> {
        let response = columns::response_column(record, experiment.output)?;
        let row_rate_hz = columns::row_rate_hz(record, experiment.sample_rate_hz)?;
        let (low_hz, high_hz) = options.band_hz;
        // Chosen: the upper limit bounds the time and memory of a window's decomposition.
        if !(4..=10_000).contains(&options.half_width) {
            let value = options.half_width as f64;
            return Err(IdentifyError::Setting { name: "half_width", value, range: "4 to 10000 bins" });
        }
        if !(low_hz >= 0.0 && high_hz > low_hz && high_hz < 0.5 * row_rate_hz) {
            let range = "0 <= low < high, below half of the row rate";
            return Err(IdentifyError::Setting { name: "top of the band in hertz", value: high_hz, range });
        }
        let rows = response.len();
        let command = coefficients(&record.command);
        let response = coefficients(response);
        let largest = command.iter().map(|u| u.norm()).fold(0.0, f64::max);
        // Rounding, not excitation, as for periodic records: 1e-9 of a command of 0..1.
        if largest.is_nan() || largest <= 1e-9 {
            return Err(IdentifyError::ConstantCommand { file: record.file.clone() });
        }
        let least_power = (SMALLEST_COMMAND * largest).powi(2);
        let width = 2 * options.half_width + 1;
        // Neither the mean nor the last bin, which is real, belongs to a window.
        let bins = 1..command.len() - 1;
        let too_short = || IdentifyError::TooShort { file: record.file.clone(), rows, period_rows: 2 * (width + 2) };
        if bins.len() < width {
            return Err(too_short());
        }
        let bin_hz = row_rate_hz / rows as f64;
        let first = ((low_hz / bin_hz).ceil() as usize).max(bins.start);
        let last = ((high_hz / bin_hz).floor() as usize).min(bins.end - 1);
        let mut lines = Vec::new();
        let mut noise_variance = Vec::new();
        let mut command_power = Vec::new();
        let mut left_out = 0;
        for bin in first..=last {
            let from = bin.saturating_sub(options.half_width).clamp(bins.start, bins.end - width);
            let window = from..from + width;
            let (command, response) = (&command[window.clone()], &response[window]);
            let power = command.iter().map(Complex64::norm_sqr).sum::<f64>() / width as f64;
            let local = if power > least_power { fit(command, response, bin - from, power.sqrt()) } else { None };
            match local {
                Some(local) => {
                    lines.push(ResponseLine {
                        omega_rad_s: TAU * bin_hz * bin as f64,
                        response: local.response,
                        variance: local.gain_of_noise * local.noise,
                    });
                    noise_variance.push(local.noise);
                    command_power.push(power);
                }
                None => left_out += 1,
            }
        }
        if lines.is_empty() {
            return Err(too_short());
        }
        let degrees_of_freedom = (width - 2 * COEFFICIENTS) as f64;
        Ok(Self {
            response: FrequencyResponse { lines, degrees_of_freedom, periods: 1 },
            noise_variance,
            command_power,
            left_out,
        })
    }
}

impl LocalPolynomial {
    /// Coherence of command and response at line `k`, 0..1: the share of the response's power, its transient aside, that `G`
    /// makes of the command.
    #[must_use]
    pub fn coherence(&self, k: usize) -> f64 {
        let followed = self.command_power[k] * self.response.lines[k].response.norm_sqr();
        followed / (followed + self.noise_variance[k])
    }
}

/// The Fourier coefficients of a whole record around its mean.
fn coefficients(samples: &[f64]) -> Vec<Complex64> {
    let mean = mean(samples);
    let around: Vec<f64> = samples.iter().map(|s| s - mean).collect();
    spectra::transform(&around, samples.len()).swap_remove(0)
}

/// The fit around one bin.
struct Local {
    response: Complex64,
    /// Variance of one bin's noise.
    noise: f64,
    /// Variance of the response over that.
    gain_of_noise: f64,
}

/// Fits both parabolas to a window whose line of interest is at `place`, of a command of this root mean square; `None`
/// when they cannot be separated.
fn fit(command: &[Complex64], response: &[Complex64], place: usize, scale: f64) -> Option<Local> {
    let width = command.len();
    let half = 0.5 * width as f64;
    let matrix = DMatrix::from_fn(width, 2 * COEFFICIENTS, |row, column| {
        let r = Complex64::from((row as f64 - place as f64) / half);
        let at = r.powu((column % COEFFICIENTS) as u32);
        if column < COEFFICIENTS { at * command[row] / scale } else { at }
    });
    // What is no number has no decomposition.
    if !matrix.iter().all(|entry| entry.norm_sqr().is_finite()) {
        return None;
    }
    let svd = matrix.clone().svd(true, true);
    let (left, right) = (svd.u.as_ref()?, svd.v_t.as_ref()?);
    let largest = svd.singular_values.max();
    if svd.singular_values.min() < SMALLEST_SINGULAR * largest {
        return None;
    }
    let target = DVector::from_column_slice(response);
    let mut projected = left.adjoint() * &target;
    for (p, s) in projected.iter_mut().zip(svd.singular_values.iter()) {
        *p /= *s;
    }
    let solution = right.adjoint() * projected;
    let residual = target - matrix * &solution;
    let noise = residual.norm_squared() / (width - 2 * COEFFICIENTS) as f64;
    let of_first: f64 =
        right.column(0).iter().zip(svd.singular_values.iter()).map(|(v, s)| v.norm_sqr() / (s * s)).sum();
    Some(Local { response: solution[0] / scale, noise, gain_of_noise: of_first / (scale * scale) })
}
