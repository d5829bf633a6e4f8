//! The noise of a flight: gusts, the vehicle's own wind, quantization, as an autoregression whose order is found on samples that it was
//! not fitted to.

use std::ops::Range;

use nalgebra::{Cholesky, DMatrix, DVector};

/// Orders that are tried. Chosen: from a gust with a memory to what the telemetry does to a reading; the highest looks back 130 ms.
const ORDERS: [usize; 9] = [1, 2, 3, 4, 6, 8, 12, 20, 32];
/// The highest of them.
pub(super) const HIGHEST_ORDER: usize = ORDERS[ORDERS.len() - 1];
/// Samples that go to one half, in turn. Chosen: four seconds, far longer than the noise remembers anything but its slow drift.
const PART: usize = 1000;
/// Added to the diagonal, relative. Derived: the square root of the rounding of a double.
const RIDGE: f64 = 1e-8;

/// Sums of products of a residual with those before it, lag by lag: all that a fit of any order needs.
struct Products {
    matrix: DMatrix<f64>,
    rows: usize,
}

impl Products {
    fn new(residual: &[f64], ranges: &[Range<usize>]) -> Self {
        let size = HIGHEST_ORDER + 1;
        let mut matrix = DMatrix::zeros(size, size);
        let mut rows = 0;
        for range in ranges {
            for k in range.start + HIGHEST_ORDER..range.end {
                rows += 1;
                for i in 0..size {
                    let r = residual[k - i];
                    for j in i..size {
                        matrix[(i, j)] += r * residual[k - j];
                    }
                }
            }
        }
        matrix.fill_lower_triangle_with_upper_triangle();
        Self { matrix, rows }
    }

    fn coefficients(&self, order: usize) -> Option<DVector<f64>> {
        let mut square = self.matrix.view((1, 1), (order, order)).into_owned();
        let ridge = RIDGE * square.diagonal().max();
        (0..order).for_each(|i| square[(i, i)] += ridge);
        Some(Cholesky::new(square)?.solve(&self.matrix.view((1, 0), (order, 1)).column(0).into_owned()))
    }

    /// Mean square of what an autoregression leaves.
    fn mean_square(&self, coefficients: &DVector<f64>) -> f64 {
        let order = coefficients.len();
        let square = self.matrix.view((1, 1), (order, order));
        let right = self.matrix.view((1, 0), (order, 1));
        let sum =
            self.matrix[(0, 0)] - 2.0 * coefficients.dot(&right.column(0)) + coefficients.dot(&(square * coefficients));
        sum / self.rows.max(1) as f64
    }
}

/// Coefficients of an autoregression of this order, by least squares.
pub(super) fn autoregression(residual: &[f64], runs: &[Range<usize>], order: usize) -> Option<Vec<f64>> {
    Some(Products::new(residual, runs).coefficients(order)?.as_slice().to_vec())
}

/// The order whose autoregression, fitted to one half of the samples, leaves the least likelihood of the other unexplained, both ways.
pub(super) fn held_out_order(residual: &[f64], runs: &[Range<usize>]) -> usize {
    let halves = [0, 1].map(|half| Products::new(residual, &parts(runs, half)));
    let [first, second] = &halves;
    let cost = |order: usize| {
        let way = |fitted: &Products, held_out: &Products| {
            fitted
                .coefficients(order)
                .map_or(f64::INFINITY, |found| held_out.rows as f64 * held_out.mean_square(&found).ln())
        };
        way(first, second) + way(second, first)
    };
    ORDERS.into_iter().min_by(|a, b| cost(*a).total_cmp(&cost(*b))).unwrap_or(1)
}

/// Every second part of the runs.
pub(super) fn parts(runs: &[Range<usize>], half: usize) -> Vec<Range<usize>> {
    let in_parts = |run: &Range<usize>| {
        let run = run.clone();
        run.clone().step_by(PART).map(move |start| start..(start + PART).min(run.end))
    };
    let mut of_half: Vec<Range<usize>> =
        runs.iter().flat_map(in_parts).enumerate().filter(|(part, _)| part % 2 == half).map(|(_, part)| part).collect();
    of_half.retain(|part| part.len() > HIGHEST_ORDER);
    of_half
}

/// What the coefficients do not foretell of values, behind the first of each run.
pub(super) fn whitened(values: &[f64], runs: &[Range<usize>], coefficients: &[f64], out: &mut Vec<f64>) {
    let order = coefficients.len();
    out.clear();
    for run in runs {
        for k in run.start + order..run.end {
            let foretold: f64 = coefficients.iter().enumerate().map(|(i, phi)| phi * values[k - 1 - i]).sum();
            out.push(values[k] - foretold);
        }
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;

    #[test]
    fn the_order_of_a_noise_is_found_on_the_other_half() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut noise: Vec<f64> = vec![0.0; 12_000];
        for k in 4..noise.len() {
            let fresh: f64 = StandardNormal.sample(&mut rng);
            noise[k] = 1.6 * noise[k - 1] - 1.1 * noise[k - 2] + 0.6 * noise[k - 3] - 0.3 * noise[k - 4] + fresh;
        }
        let runs = [0..5000, 5100..12_000];
        let order = held_out_order(&noise, &runs);
        assert!((4..=8).contains(&order), "{order}");
        let found = autoregression(&noise, &runs, 4).unwrap();
        for (found, known) in found.iter().zip([1.6, -1.1, 0.6, -0.3]) {
            assert!((found - known).abs() < 0.04, "{found} {known}");
        }
        let mut white = Vec::new();
        whitened(&noise, &runs, &found, &mut white);
        assert_eq!(white.len(), 11_900 - 8);
    }
}
