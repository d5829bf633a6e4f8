//! What the columns beside the response say for one fit over another.

use crate::data::dataset::PreparedRecord;
use crate::estimate::fit::Fit;
use crate::estimate::prediction::{STEPS, white_deviance};
use crate::likelihood::Likelihood;
use crate::model::hypothesis::Hypothesis;

/// What each fit is worth by the columns, less than the best of them. `None` where there are no columns.
///
/// The numbers of a fit are known as well as the response tells them, and a column may tell them better: see [`prediction`].
pub(crate) fn auxiliary_gains(likelihood: &Likelihood, fits: &[&Fit]) -> Option<Vec<f64>> {
    let records: Vec<&PreparedRecord> =
        likelihood.data.records.iter().filter(|record| record.columns().next().is_some()).collect();
    let beside = |record: &PreparedRecord, hypothesis: &Hypothesis| {
        // A trace is of all commands.
        if hypothesis.in_rows {
            return None;
        }
        likelihood.for_record(record).auxiliary_residuals(&hypothesis.trace(&likelihood.data, record)?)
    };
    let white = |record: &PreparedRecord, hypothesis: &Hypothesis| {
        Some(beside(record, hypothesis)?.into_iter().flat_map(|column| column.white).collect())
    };
    let of_record = |record: &&PreparedRecord| beside(record, &fits.first()?.hypothesis);
    let numbers: f64 = records.iter().filter_map(of_record).flatten().map(|column| column.numbers).sum();
    let squares: Option<Vec<f64>> = fits.iter().map(|fit| white_deviance(&records, fit, STEPS, white)).collect();
    (!records.is_empty()).then(|| Some(gains(&squares?, numbers))).flatten()
}

/// What each is worth by the squares of `numbers` numbers that the columns have left with it, the best 0.
fn gains(squares: &[f64], numbers: f64) -> Vec<f64> {
    let least = squares.iter().copied().fold(f64::INFINITY, f64::min);
    let known = (least / numbers.max(1.0)).max(1.0);
    squares.iter().map(|squares| 0.5 * (least - squares) / known).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_best_leaves_over_the_noise_makes_the_others_no_more_certain() {
        assert_eq!(gains(&[100.0, 120.0], 100.0), [0.0, -10.0]);
        // Nobody explains the column: a tenth more is little.
        assert_eq!(gains(&[1100.0, 1000.0], 100.0), [-5.0, 0.0]);
    }
}
