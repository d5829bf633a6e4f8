//! Empirical transfer function estimate at the excited lines (section 3.2 of the paper), smoothed.
//!
//! The raw estimate is `Y / U` at each line. The paper smooths it with a Hann window over
//! neighboring lines (Ljung, *System Identification*, 1999, section 6.4):
//!
//! ```text
//! G(w_k) = sum_i W_(i-k) G_i / s_i^2  /  sum_i W_(i-k) / s_i^2
//! ```
//!
//! with `s_i^2` the noise variance of line `i`. Averaging `G` itself bends the curve: a window of nine
//! lines 1.26 rad/s apart spans a whole decade around a pole at 6 rad/s. What is averaged here is
//! the ratio to a reference response, the fitted model with its holds, and the result is multiplied
//! back. Where the reference is right the ratio is one and smoothing adds no bias; where it is wrong
//! by some smooth factor, only the curvature of that factor is smoothed.

use std::f64::consts::PI;

use num_complex::Complex64;
use rand::Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::error::IdentifyError;
use crate::spectra::SpectralLine;

/// The frequency response at one line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ResponsePoint {
    /// Frequency in rad/s.
    pub omega_rad_s: f64,
    /// The complex response, response units per unit of command.
    pub response: Complex64,
    /// Variance of `response`, `E |G - E G|^2`.
    pub variance: f64,
}

impl ResponsePoint {
    /// Standard error of the magnitude: half the variance is radial.
    #[must_use]
    pub fn magnitude_std(&self) -> f64 {
        (0.5 * self.variance).sqrt()
    }
}

/// An empirical transfer function: raw at its lines, and smoothed.
#[derive(Clone, Debug, PartialEq)]
pub struct Etfe {
    raw: Vec<ResponsePoint>,
    reference: Vec<Complex64>,
    half_width: usize,
    smoothed: Vec<ResponsePoint>,
}

impl Etfe {
    /// Smooths the estimate at `lines` over `half_width` lines to either side, relative to
    /// `reference` (one value per line, any scale). A half width of zero leaves it raw.
    ///
    /// The window is `W_d = (1 + cos(pi d / (half_width + 1))) / 2`; at the ends it is cut off.
    /// The reference stands for the shape only, so its own uncertainty does not enter.
    ///
    /// # Errors
    /// [`IdentifyError::Setting`] when `reference` has another length than `lines`, or is zero or
    /// not finite somewhere.
    pub fn new(lines: &[SpectralLine], reference: &[Complex64], half_width: usize) -> Result<Self, IdentifyError> {
        let raw = lines
            .iter()
            .map(|line| ResponsePoint {
                omega_rad_s: line.omega_rad_s,
                response: line.ratio(),
                variance: line.ratio_variance(),
            })
            .collect();
        Self::from_points(raw, reference, half_width)
    }

    /// The same from points that were estimated elsewhere.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn from_points(
        raw: Vec<ResponsePoint>,
        reference: &[Complex64],
        half_width: usize,
    ) -> Result<Self, IdentifyError> {
        if reference.len() != raw.len() {
            return Err(IdentifyError::Setting {
                name: "length of the reference response",
                value: reference.len() as f64,
                range: "one value per line",
            });
        }
        if let Some(bad) = reference.iter().find(|r| !(r.norm() > 0.0 && r.is_finite())) {
            return Err(IdentifyError::Setting {
                name: "magnitude of the reference response",
                value: bad.norm(),
                range: "finite and above zero",
            });
        }
        let smoothed = smooth(&raw, reference, half_width);
        Ok(Self { raw, reference: reference.to_vec(), half_width, smoothed })
    }

    /// The estimate without smoothing.
    #[must_use]
    pub fn raw(&self) -> &[ResponsePoint] {
        &self.raw
    }

    /// The smoothed estimate. Its errors are correlated over `2 half_width` lines to either side.
    #[must_use]
    pub fn smoothed(&self) -> &[ResponsePoint] {
        &self.smoothed
    }

    /// Lines to either side that the window reaches.
    #[must_use]
    pub fn half_width(&self) -> usize {
        self.half_width
    }

    /// The estimate with known factors taken out, for instance the holds; one per line.
    ///
    /// # Errors
    /// As [`Self::new`], for `factors`.
    pub fn divided_by(&self, factors: &[Complex64]) -> Result<Self, IdentifyError> {
        let raw = self
            .raw
            .iter()
            .zip(factors)
            .map(|(point, factor)| ResponsePoint {
                response: point.response / factor,
                variance: point.variance / factor.norm_sqr(),
                ..*point
            })
            .collect();
        let reference: Vec<_> = self.reference.iter().zip(factors).map(|(r, f)| r / f).collect();
        Self::from_points(raw, &reference, self.half_width)
    }

    /// Another experiment as it could have been: the raw estimate with fresh noise of its variances,
    /// smoothed. The parametric bootstrap draws these. Smoothing is linear, so the draws scatter
    /// around the smoothed curve; starting from that curve would smooth twice and pull them
    /// toward the reference.
    pub(crate) fn resample<R: Rng>(&self, rng: &mut R) -> Self {
        let raw: Vec<_> = self
            .raw
            .iter()
            .map(|point| {
                let real: f64 = StandardNormal.sample(rng);
                let imaginary: f64 = StandardNormal.sample(rng);
                let noise = Complex64::new(real, imaginary) * (0.5 * point.variance).sqrt();
                ResponsePoint { response: point.response + noise, ..*point }
            })
            .collect();
        let smoothed = smooth(&raw, &self.reference, self.half_width);
        Self { raw, reference: self.reference.clone(), half_width: self.half_width, smoothed }
    }
}

fn smooth(raw: &[ResponsePoint], reference: &[Complex64], half_width: usize) -> Vec<ResponsePoint> {
    // A noise-free line would take all the weight, so no line counts as more than a million
    // times as precise as the average one, which is chosen; without any noise all count the same.
    let precision = |k: usize| raw[k].variance / reference[k].norm_sqr();
    let mean = (0..raw.len()).map(precision).sum::<f64>() / raw.len() as f64;
    let floor = if mean > 0.0 { 1e-6 * mean } else { 1.0 };
    let reach = half_width as f64 + 1.0;
    let hann: Vec<f64> = (0..=half_width).map(|d| 0.5 * (1.0 + (PI * d as f64 / reach).cos())).collect();
    (0..raw.len())
        .map(|k| {
            let first = k.saturating_sub(half_width);
            let last = (k + half_width).min(raw.len() - 1);
            let (mut sum, mut total, mut variance) = (Complex64::ZERO, 0.0, 0.0);
            for i in first..=last {
                let weight = hann[i.abs_diff(k)] / precision(i).max(floor);
                sum += raw[i].response / reference[i] * weight;
                variance += weight * weight * precision(i);
                total += weight;
            }
            ResponsePoint {
                omega_rad_s: raw[k].omega_rad_s,
                response: sum / total * reference[k],
                variance: variance / (total * total) * reference[k].norm_sqr(),
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;

    fn lag(omega: f64, tau_s: f64) -> Complex64 {
        10.0 / Complex64::new(1.0, omega * tau_s)
    }

    fn lines() -> impl Iterator<Item = f64> {
        (0..150).map(|k| std::f64::consts::TAU * (0.1 + 0.2 * f64::from(k)))
    }

    fn exact(variance: f64) -> Vec<ResponsePoint> {
        lines().map(|omega_rad_s| ResponsePoint { omega_rad_s, response: lag(omega_rad_s, 0.16), variance }).collect()
    }

    fn worst_error(points: &[ResponsePoint]) -> f64 {
        points.iter().map(|p| (p.response / lag(p.omega_rad_s, 0.16) - 1.0).norm()).fold(0.0, f64::max)
    }

    #[test]
    fn smoothing_the_ratio_to_the_model_adds_no_bias_where_smoothing_the_curve_does() {
        let flat = vec![Complex64::ONE; 150];
        let plain = Etfe::from_points(exact(1e-3), &flat, 4).unwrap();
        assert!(worst_error(plain.smoothed()) > 0.2, "{}", worst_error(plain.smoothed()));

        let model: Vec<_> = lines().map(|w| lag(w, 0.16)).collect();
        let ratio = Etfe::from_points(exact(1e-3), &model, 4).unwrap();
        assert!(worst_error(ratio.smoothed()) < 1e-14);

        // A reference whose pole is 10 % off still leaves a thousandth.
        let off: Vec<_> = lines().map(|w| lag(w, 0.176)).collect();
        let ratio = Etfe::from_points(exact(1e-3), &off, 4).unwrap();
        println!("{}", worst_error(ratio.smoothed()));
        assert!(worst_error(ratio.smoothed()) < 0.02);
    }

    #[test]
    fn the_stated_variance_is_that_of_the_smoothed_curve() {
        let model: Vec<_> = lines().map(|w| lag(w, 0.16)).collect();
        let etfe = Etfe::from_points(exact(0.01), &model, 4).unwrap();
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let runs = 400;
        let mut chi_square = 0.0;
        for _ in 0..runs {
            let again = etfe.resample(&mut rng);
            for (a, b) in again.smoothed().iter().zip(etfe.smoothed()) {
                chi_square += (a.response - b.response).norm_sqr() / b.variance;
            }
        }
        // 400 runs of about 25 independent windows: the mean of |z|^2 has a deviation of 0.01.
        let mean = chi_square / f64::from(runs) / 150.0;
        assert!((mean - 1.0).abs() < 0.035, "{mean}");
        // Nine Hann weights average to 1 / sum(w)^2 * sum(w^2) = 0.15 of the raw variance.
        let reduction = etfe.smoothed()[75].variance / etfe.raw()[75].variance;
        assert!((reduction - 0.15).abs() < 0.005, "{reduction}");
    }

    #[test]
    fn a_reference_of_the_wrong_length_or_of_zero_is_refused() {
        assert!(Etfe::from_points(exact(1.0), &[Complex64::ONE], 4).is_err());
        assert!(Etfe::from_points(exact(1.0), &vec![Complex64::ZERO; 150], 4).is_err());
    }

    #[test]
    fn lines_without_noise_are_smoothed_all_the_same() {
        let model: Vec<_> = lines().map(|w| lag(w, 0.16)).collect();
        let etfe = Etfe::from_points(exact(0.0), &model, 4).unwrap();
        assert!(worst_error(etfe.smoothed()) < 1e-14);
        assert!(etfe.smoothed().iter().all(|p| p.variance == 0.0));
    }
}
