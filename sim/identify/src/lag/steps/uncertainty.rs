//! Standard errors when the noise has a color.

use nalgebra::DMatrix;

use super::plateaus::Plateau;

/// Rows over which noise may depend on itself. Chosen: fewer cut off the correlation of a slow filter, which makes intervals too short;
/// more make them scatter.
const MAX_LAG: usize = 30;

/// How the noise depends on itself from row to row: its correlation at lags 0 to [`MAX_LAG`], tapered to zero
/// (Bartlett, so that a matrix made of it is positive; Newey and West 1987).
///
/// Taken from the settled rows of all plateaus, each about its own straight line, and pooled in units of each
/// plateau's variance. The residuals of the fit would not do: its parameters follow the slow part of the noise
/// in their short windows, which is the part that matters.
pub(super) fn correlation<'p>(y: &[f64], plateaus: impl IntoIterator<Item = &'p Plateau>) -> Vec<f64> {
    let mut sums = vec![0.0; MAX_LAG + 1];
    let mut counts = vec![0.0; MAX_LAG + 1];
    for plateau in plateaus {
        let r = about_its_line(&y[plateau.settled()]);
        let variance = r.iter().map(|v| v * v).sum::<f64>() / r.len().max(1) as f64;
        if variance <= 0.0 {
            continue;
        }
        for lag in 0..=MAX_LAG.min(r.len().saturating_sub(1)) {
            let products = r.iter().zip(&r[lag..]).map(|(a, b)| a * b);
            sums[lag] += products.sum::<f64>() / variance;
            counts[lag] += (r.len() - lag) as f64;
        }
    }
    let mut correlation: Vec<f64> = (0..=MAX_LAG)
        .map(|lag| {
            let taper = 1.0 - lag as f64 / (MAX_LAG + 1) as f64;
            sums[lag] / f64::max(counts[lag], 1.0) * taper
        })
        .collect();
    correlation[0] = 1.0;
    correlation
}

/// What is left of values when their least-squares line is taken off.
fn about_its_line(values: &[f64]) -> Vec<f64> {
    let n = values.len() as f64;
    let middle = 0.5 * (n - 1.0);
    let mean = values.iter().sum::<f64>() / n.max(1.0);
    let (mut xy, mut xx) = (0.0, 0.0);
    for (k, v) in values.iter().enumerate() {
        let x = k as f64 - middle;
        xy += x * (v - mean);
        xx += x * x;
    }
    let slope = if xx > 0.0 { xy / xx } else { 0.0 };
    let line = |k: usize| mean + slope * (k as f64 - middle);
    values.iter().enumerate().map(|(k, v)| v - line(k)).collect()
}

/// The covariance matrix of a step's residuals times its Jacobian.
///
/// Residuals are in units of the sensor's noise, which has unit variance and depends on its neighbors by
/// `correlation` per lag; what time stamps add by `stamp_variance` does not.
pub(super) fn correlated(jacobian: &DMatrix<f64>, correlation: &[f64], stamp_variance: &[f64]) -> DMatrix<f64> {
    let rows = jacobian.nrows();
    DMatrix::from_fn(rows, jacobian.ncols(), |i, column| {
        let beside = correlation.iter().enumerate().skip(1).map(|(lag, c)| {
            let before = if i >= lag { jacobian[(i - lag, column)] } else { 0.0 };
            let after = if i + lag < rows { jacobian[(i + lag, column)] } else { 0.0 };
            c * (before + after)
        });
        (1.0 + stamp_variance[i]) * jacobian[(i, column)] + beside.sum::<f64>()
    })
}
