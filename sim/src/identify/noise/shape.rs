//! The smooth shape of a noise spectrum.
//!
//! A parabola in `x = ln(bin + b)` is fitted to the logarithms of the sample variances. Logarithms make
//! a line with a thousand times its share pull no harder than a few lines without any, and the shift
//! `b`, a fifth of the highest bin, keeps the few lines of the lowest decade from ruling the fit.
//! The fit needs no scale: [`super::pool`] finds that locally.

use nalgebra::{DMatrix, DVector};

/// With fewer lines than this the shape is flat.
const FEWEST_LINES: usize = 20;

/// The shape at each of `bins` from the `sample` variances of the lines that `counts`.
pub(super) fn of(sample: &[f64], bins: &[usize], counts: impl Fn(usize) -> bool) -> Vec<f64> {
    let flat = || vec![1.0; sample.len()];
    // A line without any noise has no logarithm; it says nothing of the shape.
    let used: Vec<usize> = (0..sample.len()).filter(|&k| counts(k) && sample[k] > 0.0).collect();
    let Some(top) = bins.last().filter(|_| used.len() >= FEWEST_LINES) else {
        return flat();
    };
    let shift = 0.2 * *top as f64;
    let x: Vec<f64> = bins.iter().map(|&bin| (bin as f64 + shift).ln()).collect();
    let (low, high) = (x[0], x[x.len() - 1]);
    let centered = |k: usize| (2.0 * x[k] - low - high) / (high - low);
    let matrix = DMatrix::from_fn(used.len(), 3, |row, power| centered(used[row]).powi(power as i32));
    let logs = DVector::from_iterator(used.len(), used.iter().map(|&k| sample[k].ln()));
    let normal = matrix.tr_mul(&matrix);
    let Some(coefficients) = normal.cholesky().map(|factor| factor.solve(&matrix.tr_mul(&logs))) else {
        return flat();
    };
    // A noise-free simulation has variances of 1e-35, whose exponential is still a number.
    (0..sample.len())
        .map(|k| {
            let x = centered(k);
            (coefficients[0] + x * (coefficients[1] + x * coefficients[2])).exp()
        })
        .collect()
}
