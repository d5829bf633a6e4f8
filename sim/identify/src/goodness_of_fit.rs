//! How much of a measurement a model explains: % fit, and its residual over the noise.
//!
//! `100 (1 - ||y - yhat|| / ||y - mean(y)||)` is the % fit that the paper and Ljung's toolbox use: 100 is perfect, 0 no better than
//! the mean; there is no lower limit.

use std::ops::Sub;

use num_complex::Complex64;

/// A ratio of powers above this is unknown: the noise does not show. Chosen: the noise would be a millionth as large as the residual, and
/// neither the digits of a log nor the sensor go so far.
const LARGEST_KNOWN_RATIO: f64 = 1e12;

/// Below this tail probability the residual shows that a model is too simple. Chosen: one sound fit, or stand, in a thousand is warned of.
pub(crate) const MODEL_LEVEL: f64 = 1e-3;

/// What can be compared: real records and complex frequency responses.
pub trait Sample: Copy + Sub<Output = Self> + std::iter::Sum {
    /// `|x|^2`.
    fn power(self) -> f64;
    /// `x / n`.
    fn divided(self, n: f64) -> Self;
}

impl Sample for f64 {
    fn power(self) -> f64 {
        self * self
    }
    fn divided(self, n: f64) -> Self {
        self / n
    }
}

impl Sample for Complex64 {
    fn power(self) -> f64 {
        self.norm_sqr()
    }
    fn divided(self, n: f64) -> Self {
        self / n
    }
}

/// % fit of `model` to `measured`. `None` when they differ in length, are empty, or `measured` is
/// constant: there is then nothing to explain.
#[must_use]
pub fn fit_percent<T: Sample>(measured: &[T], model: &[T]) -> Option<f64> {
    if measured.len() != model.len() || measured.is_empty() {
        return None;
    }
    let error: f64 = measured.iter().zip(model).map(|(&y, &m)| (y - m).power()).sum();
    let spread = spread(measured);
    (spread > 0.0).then(|| percent_with_residual(error, spread))
}

/// `||y - mean(y)||^2`: what there is to explain; zero for nothing.
pub(crate) fn spread<T: Sample>(measured: &[T]) -> f64 {
    let mean = measured.iter().copied().sum::<T>().divided(measured.len() as f64);
    measured.iter().map(|&y| (y - mean).power()).sum()
}

/// % fit when of a `spread` above zero this `error` is left, both sums of squares.
pub(crate) fn percent_with_residual(error: f64, spread: f64) -> f64 {
    100.0 * (1.0 - (error / spread).sqrt())
}

/// Power over that of the noise; `None` where the noise does not show.
#[must_use]
pub fn power_over_noise(ratio: f64) -> Option<f64> {
    (ratio <= LARGEST_KNOWN_RATIO).then_some(ratio)
}

/// The same with so many decimals, as the end of "the model leaves".
#[must_use]
pub fn times_noise(ratio: f64, decimals: usize) -> String {
    match power_over_noise(ratio) {
        Some(ratio) => format!("{ratio:.decimals$} times the noise power"),
        None => String::from("more than the noise, which does not show"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn perfect_is_100_and_the_mean_is_0() {
        let y = [1.0, 2.0, 4.0, 5.0];
        assert_eq!(fit_percent(&y, &y), Some(100.0));
        assert_eq!(fit_percent(&y, &[3.0; 4]), Some(0.0));
        // ||y - yhat|| = 1, ||y - mean|| = sqrt(10).
        let off = fit_percent(&y, &[1.0, 2.0, 4.0, 6.0]).unwrap();
        assert!((off - 100.0 * (1.0 - 0.1f64.sqrt())).abs() < 1e-12);
    }

    #[test]
    fn complex_responses_count_both_parts() {
        let y = [Complex64::new(1.0, 1.0), Complex64::new(-1.0, -1.0)];
        let model = [Complex64::new(1.0, 0.0), Complex64::new(-1.0, -1.0)];
        assert!((fit_percent(&y, &model).unwrap() - 50.0).abs() < 1e-12);
    }

    #[test]
    fn nothing_to_compare_is_none() {
        assert_eq!(fit_percent(&[2.0, 2.0], &[2.0, 2.0]), None);
        assert_eq!(fit_percent::<f64>(&[], &[]), None);
        assert_eq!(fit_percent(&[1.0], &[1.0, 2.0]), None);
    }

    #[test]
    fn a_ratio_to_noise_that_does_not_show_is_none() {
        assert_eq!((power_over_noise(1.0), power_over_noise(1e9)), (Some(1.0), Some(1e9)));
        assert_eq!([1e13, f64::INFINITY, f64::NAN].map(power_over_noise), [None; 3]);
        assert_eq!(times_noise(1.234, 2), "1.23 times the noise power");
        assert!(times_noise(1e20, 2).contains("does not show"));
    }
}
