//! Whether one of two delays explains the logs better.

use super::LEAST_ROWS;
use super::problem::Problem;
use crate::identify::least_squares::Solution;

/// Variances of different rows differ by chance: so many standard errors of their ratio's logarithm are no difference.
const CHANCE: f64 = 4.0;

/// By how much the log-likelihood of `first` is above that of `second`.
///
/// Over the rows that both have, with the noise's variance at its best for each: `n / 2 ln(S_second / S_first)` with the sums
/// of squares `S` of `n` whitened residuals. Rows that only one of them has take no part: by chance alone the mean squares of
/// different rows differ by much more than the likelihoods of two delays that explain the same rows alike. Where they share
/// too few, the ratio of the mean squares has to stand out from that chance.
pub(super) fn gain(first: (&Problem<'_>, &Solution), second: (&Problem<'_>, &Solution)) -> f64 {
    let (a, b) = (whitened_rows(first.0, first.1), whitened_rows(second.0, second.1));
    let square = |rows: &[(f64, f64)]| rows.iter().map(|(_, r)| r * r).sum::<f64>();
    let mut sums = (0.0, 0.0);
    let mut count = 0;
    let mut others = b.iter().peekable();
    for (t, residual) in &a {
        while others.next_if(|(other, _)| other < t).is_some() {}
        if let Some((_, other)) = others.next_if(|(other, _)| other == t) {
            sums.0 += residual * residual;
            sums.1 += other * other;
            count += 1;
        }
    }
    if count >= LEAST_ROWS {
        return 0.5 * count as f64 * (sums.1 / sums.0).ln();
    }
    let (rows_a, rows_b) = (a.len() as f64, b.len() as f64);
    let ratio = ((square(&b) / rows_b) / (square(&a) / rows_a)).ln() - CHANCE * (2.0 / rows_a + 2.0 / rows_b).sqrt();
    0.5 * rows_a.min(rows_b) * ratio
}

/// Times and whitened residuals of the rows for which the noise has enough to look back on.
fn whitened_rows(problem: &Problem<'_>, solution: &Solution) -> Vec<(f64, f64)> {
    let order = problem.color.len();
    let rows = problem.runs.iter().flat_map(|run| run.clone().skip(order));
    rows.map(|row| (problem.time_s[row], solution.residuals[row])).collect()
}
