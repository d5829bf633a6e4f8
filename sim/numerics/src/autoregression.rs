//! The color of a noise, as an autoregression of its rows.
//!
//! `r_k = sum_i phi_i r_(k-i) + e_k` with white `e`. Least squares on `e` instead of `r` is then the maximum-likelihood
//! fit (Ljung, *System Identification*, 2nd ed., section 7.6), and its standard errors are those of the noise at hand:
//! ordinary ones are too small by the square root of the number of rows over which the noise remembers itself.

use std::ops::Range;

/// The highest order that is tried. Enough for a low-pass sensor, mains hum at a hundred rows per cycle and below, and both. Chosen: the
/// criterion takes fewer where they do, so that more cost only time.
const MAX_ORDER: usize = 30;
/// At least this many rows per coefficient. Chosen: a coefficient then has a standard error of at most 1 / sqrt(20) = 0.22; fewer rows
/// describe themselves.
const ROWS_PER_COEFFICIENT: usize = 20;

/// The coefficients for residuals that are without a gap in each of `runs`; none where the noise is white.
///
/// Yule-Walker's equations by Levinson's recursion; the order has the least `n ln(variance) + order ln(n)` (BIC, which
/// finds the order, where AIC would err on the high side).
#[must_use]
pub fn fit_autoregression(residuals: &[f64], runs: &[Range<usize>]) -> Vec<f64> {
    let rows: usize = runs.iter().map(Range::len).sum();
    let most = MAX_ORDER.min(rows / ROWS_PER_COEFFICIENT);
    let covariance: Vec<f64> = (0..=most)
        .map(|lag| {
            let products = |run: &Range<usize>| {
                let r = &residuals[run.clone()];
                r.iter().zip(r.get(lag..).unwrap_or(&[])).map(|(a, b)| a * b).sum::<f64>()
            };
            runs.iter().map(products).sum()
        })
        .collect();
    if covariance[0] <= 0.0 {
        return Vec::new();
    }
    let n = rows as f64;
    let mut variance = covariance[0];
    let mut coefficients: Vec<f64> = Vec::new();
    let (mut best, mut least) = (Vec::new(), n * variance.ln());
    for order in 1..=most {
        let predicted: f64 = coefficients.iter().enumerate().map(|(i, phi)| phi * covariance[order - 1 - i]).sum();
        let reflection = (covariance[order] - predicted) / variance;
        // Rounding alone can bring it to one, for a response without noise.
        if reflection.abs() >= 1.0 {
            break;
        }
        let before = coefficients.clone();
        for (phi, other) in coefficients.iter_mut().zip(before.iter().rev()) {
            *phi -= reflection * other;
        }
        coefficients.push(reflection);
        variance *= 1.0 - reflection * reflection;
        let criterion = n * variance.ln() + order as f64 * n.ln();
        if criterion < least {
            (best, least) = (coefficients.clone(), criterion);
        }
    }
    best
}

/// Replaces rows by what the autoregression does not foretell of them. The first rows of each run, for which it has too
/// few to look back on, become zero.
pub fn whiten(values: &mut [f64], runs: &[Range<usize>], coefficients: &[f64]) {
    if coefficients.is_empty() {
        return;
    }
    let order = coefficients.len();
    for run in runs {
        let rows = &mut values[run.clone()];
        for k in (0..rows.len()).rev() {
            rows[k] = if k < order {
                0.0
            } else {
                rows[k] - coefficients.iter().enumerate().map(|(i, phi)| phi * rows[k - 1 - i]).sum::<f64>()
            };
        }
    }
}

/// How many rows [`whiten`] gives a value: all but the first `order` of each run.
#[must_use]
pub fn whitened_rows(runs: &[Range<usize>], order: usize) -> usize {
    runs.iter().map(|run| run.len().saturating_sub(order)).sum()
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;

    #[test]
    fn a_colored_noise_gives_its_coefficients_back_and_becomes_white() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut noise = vec![0.0; 20_000];
        for k in 2..noise.len() {
            let fresh: f64 = StandardNormal.sample(&mut rng);
            noise[k] = 1.5 * noise[k - 1] - 0.7 * noise[k - 2] + fresh;
        }
        let runs = [0..12_000, 12_000..20_000];
        let phi = fit_autoregression(&noise, &runs);
        assert_eq!(phi.len(), 2, "{phi:?}");
        // The standard error is sqrt((1 - 0.49) / 20000), 0.005.
        assert!((phi[0] - 1.5).abs() < 0.02 && (phi[1] + 0.7).abs() < 0.02, "{phi:?}");
        let mut white = noise.clone();
        whiten(&mut white, &runs, &phi);
        let rows = whitened_rows(&runs, phi.len()) as f64;
        let variance = white.iter().map(|e| e * e).sum::<f64>() / rows;
        let neighbors = white.windows(2).map(|pair| pair[0] * pair[1]).sum::<f64>() / rows;
        assert!((variance - 1.0).abs() < 0.04 && neighbors.abs() < 0.03, "{variance} {neighbors}");
        assert_eq!(white[12_000], 0.0, "nothing reaches across the gap");
    }

    #[test]
    fn white_noise_has_no_coefficients_and_neither_has_none() {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let noise: Vec<f64> = (0..5_000).map(|_| StandardNormal.sample(&mut rng)).collect();
        assert!(fit_autoregression(&noise, &[0..2_500, 2_500..5_000]).is_empty());
        assert!(fit_autoregression(&[0.0; 100], &[0..50, 50..100]).is_empty());
        assert!(fit_autoregression(&[], &[]).is_empty());
    }
}
