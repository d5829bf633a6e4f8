//! Mean and variance of spectra over the periods of a record.

use num_complex::Complex64;

/// Mean over the periods, bin by bin.
pub(crate) fn mean(periods: &[Vec<Complex64>]) -> Vec<Complex64> {
    let count = periods.len() as f64;
    let bins = periods.first().map_or(0, Vec::len);
    (0..bins).map(|k| periods.iter().map(|p| p[k]).sum::<Complex64>() / count).collect()
}

/// Variance of one period from `residual(period, line)` around the mean over `periods`.
pub(crate) fn sample_variance(periods: usize, lines: usize, residual: impl Fn(usize, usize) -> Complex64) -> Vec<f64> {
    (0..lines).map(|k| (0..periods).map(|p| residual(p, k).norm_sqr()).sum::<f64>() / (periods - 1) as f64).collect()
}

/// Variance of the mean over `periods` from that of one.
pub(crate) fn variance_of_mean(variance: &[f64], periods: usize) -> Vec<f64> {
    variance.iter().map(|v| v / periods as f64).collect()
}
