//! Whether two delays explain the logs alike.

use rotorlead_numerics::least_squares::Solution;

use super::LEAST_ROWS;
use super::problem::AlignmentProblem;

/// Two delays whose log-likelihoods differ by less than this explain the logs alike. Chosen: a ratio of e^10 = 22 000, where 150 counts as
/// very strong (Kass and Raftery, J. Am. Stat. Assoc. 90, 1995): a delay that is a period off costs more than a refusal.
const SAME_LIKELIHOOD: f64 = 10.0;
/// So do two that leave nearly the same variance, however many rows there are: one lag behind a cubic misses a little of every
/// motor, and by how much depends on the delay. Chosen: less takes what the model misses for evidence, more refuses delays that differ.
const SAME_VARIANCE: f64 = 0.01;
/// Variances of different rows differ by chance: so many standard errors of their ratio's logarithm are no difference. Derived: of a normal
/// distribution one in 30 000 lies above.
const CHANCE: f64 = 4.0;

/// Whether `second` explains the logs as well as `first` or better.
///
/// Over the rows that both have, with the noise's variance at its best for each, the log-likelihoods differ by
/// `n / 2 ln(S_second / S_first)` with the sums of squares `S` of `n` whitened residuals. Rows that only one of them has take no
/// part: by chance alone the mean squares of different rows differ by much more than the likelihoods of two delays that
/// explain the same rows alike. Where they share too few, the ratio of the mean squares has to stand out from that chance.
pub(super) fn alike(first: (&AlignmentProblem<'_>, &Solution), second: (&AlignmentProblem<'_>, &Solution)) -> bool {
    let (a, b) = (whitened_rows(first.0, first.1), whitened_rows(second.0, second.1));
    let mut sums = (0.0, 0.0);
    let mut common = 0;
    let mut others = b.iter().peekable();
    for (t, residual) in &a {
        while others.next_if(|(other, _)| other < t).is_some() {}
        if let Some((_, other)) = others.next_if(|(other, _)| other == t) {
            sums.0 += residual * residual;
            sums.1 += other * other;
            common += 1;
        }
    }
    let (rows, ratio) = if common >= LEAST_ROWS {
        (common as f64, (sums.1 / sums.0).ln())
    } else {
        let mean_square = |rows: &[(f64, f64)]| rows.iter().map(|(_, r)| r * r).sum::<f64>() / rows.len() as f64;
        let (rows_a, rows_b) = (a.len() as f64, b.len() as f64);
        let chance = CHANCE * (2.0 / rows_a + 2.0 / rows_b).sqrt();
        (rows_a.min(rows_b), (mean_square(&b) / mean_square(&a)).ln() - chance)
    };
    ratio < SAME_VARIANCE.max(2.0 * SAME_LIKELIHOOD / rows)
}

/// Times and whitened residuals of the rows for which the noise has enough to look back on.
fn whitened_rows(problem: &AlignmentProblem<'_>, solution: &Solution) -> Vec<(f64, f64)> {
    let order = problem.color.len();
    let rows = problem.runs.iter().flat_map(|run| run.clone().skip(order));
    rows.map(|row| (problem.time_s[row], solution.residuals[row])).collect()
}
