//! Frequency responses without a model, and what is known of their noise.
//!
//! From a periodic record: the ratio of mean response to mean command at each excited line
//! ([`FrequencyResponse::from_spectrum`]). From any other record: the local polynomial method
//! ([`LocalPolynomial`]). Either is what the rows show of the recorded command's samples: the holds of
//! loop and ESC are in it ([`hold::HoldChain`]).

mod band;
pub mod bandwidth;
pub mod distortion;
pub mod etfe;
pub mod hold;
mod local_polynomial;
#[cfg(test)]
mod tests;

use num_complex::Complex64;

use crate::error::IdentifyError;
use crate::estimate::uncertainty::NoiseKnowledge;
use crate::spectra::period_statistics::{mean, sample_variance, variance_of_mean};
use crate::spectra::{SpectralLine, Spectrum, noise};
pub use local_polynomial::{LocalPolynomial, LocalPolynomialOptions};

/// One line of a frequency response.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ResponseLine {
    /// Frequency in rad/s.
    pub omega_rad_s: f64,
    /// Response over command.
    pub response: Complex64,
    /// Variance of `response`: `E |dG|^2` (both parts together).
    pub variance: f64,
}

/// A non-parametric frequency response with what is known of its noise.
#[derive(Clone, Debug, PartialEq)]
pub struct FrequencyResponse {
    /// The lines, by frequency.
    pub lines: Vec<ResponseLine>,
    /// Degrees of freedom (of complex samples) behind each line's variance, after pooling; infinite where the
    /// variance is known.
    pub degrees_of_freedom: f64,
    /// Periods averaged (1 for arbitrary records).
    pub periods: usize,
}

impl FrequencyResponse {
    /// Response over command at the lines of a periodic record.
    #[must_use]
    pub fn from_spectrum(spectrum: &Spectrum) -> Self {
        Self::from_lines(&spectrum.lines, spectrum.periods_used)
    }

    fn from_lines(lines: &[SpectralLine], periods: usize) -> Self {
        let of_line = |line: &SpectralLine| ResponseLine {
            omega_rad_s: line.omega_rad_s,
            response: line.ratio(),
            variance: line.ratio_variance(),
        };
        Self {
            lines: lines.iter().map(of_line).collect(),
            degrees_of_freedom: lines.first().map_or(0.0, |line| 0.5 * line.dof),
            periods,
        }
    }

    /// Mean and noise of the responses over command that several periods show: `periods[p][k]` is that of period `p` at the
    /// multiple `harmonics[k]` of `bin_rad_s`, harmonics increasing.
    ///
    /// Noise variances are pooled over `pool_half_width` lines to either side along the noise's own slope. Lines that scatter
    /// far more than their neighbors are left out, as [`Spectrum`] leaves them out.
    ///
    /// # Errors
    /// [`IdentifyError::Periods`] when there are fewer than two periods, or one has not as many numbers as there are harmonics,
    /// or the harmonics do not increase.
    pub fn from_periods(
        bin_rad_s: f64,
        harmonics: &[u32],
        periods: &[Vec<Complex64>],
        pool_half_width: usize,
    ) -> Result<Self, IdentifyError> {
        let count = periods.len();
        let lines = harmonics.len();
        let increase = harmonics.windows(2).all(|pair| pair[0] < pair[1]);
        if count < 2 || lines == 0 || !increase || periods.iter().any(|period| period.len() != lines) {
            return Err(IdentifyError::Periods { periods: count, lines });
        }
        let response = mean(periods);
        let sample = sample_variance(count, lines, |p, k| periods[p][k] - response[k]);
        let bins: Vec<usize> = harmonics.iter().map(|&harmonic| harmonic as usize).collect();
        let pooled = noise::pool(&sample, &bins, (count - 1) as f64, pool_half_width, 0.0);
        let variance = variance_of_mean(&pooled.variance, count);
        let line = |k: usize| ResponseLine {
            omega_rad_s: bin_rad_s * f64::from(harmonics[k]),
            response: response[k],
            variance: variance[k],
        };
        Ok(Self {
            lines: (0..lines).filter(|&k| !pooled.stands_out[k]).map(line).collect(),
            degrees_of_freedom: (pooled.neighbors * (count - 1)) as f64,
            periods: count,
        })
    }

    /// What is known of the noise behind its lines.
    pub(crate) fn noise_knowledge(&self) -> NoiseKnowledge {
        let dof = self.degrees_of_freedom;
        // Without periods the degrees of freedom come from neighbors, two lines' worth of them at least.
        let of_one_line = self.periods.saturating_sub(1).max(1) as f64;
        NoiseKnowledge { dof, pooled: if dof.is_finite() { (dof / of_one_line).max(1.0) } else { 1.0 } }
    }

    /// The response with a known factor (argument in rad/s) taken out, for instance the holds or a stand.
    #[must_use]
    pub fn divided_by(&self, factor: impl Fn(f64) -> Complex64) -> Self {
        let divided = |line: &ResponseLine| {
            let factor = factor(line.omega_rad_s);
            ResponseLine { response: line.response / factor, variance: line.variance / factor.norm_sqr(), ..*line }
        };
        Self { lines: self.lines.iter().map(divided).collect(), ..*self }
    }
}
