//! What a fit says of what it has not seen, its numbers known no better than they are.
//!
//! Where a nominal command was fitted to one quiet record, its lag is off by more than a loud one forgives, and any effect that moves
//! the lag there wins by accident. With `r` the white residual of what was not seen, `J` its derivatives by the numbers `p` of the fit
//! and `A` their information, the inverse of their covariance, minus twice the log likelihood of what was not seen is, but for a
//! constant,
//!
//! ```text
//! min over p of  r(p)'r(p) + (p - p0)' A (p - p0),  + ln det (A + J'J) - ln det A
//! ```
//!
//! (Laplace's method; for a linear model it is the predictive density: Bishop, Pattern Recognition and Machine Learning, sec. 3.3.2
//! and 4.4). The numbers may move within their covariance, and the determinants charge for how uncertain they are.

use nalgebra::{Cholesky, DMatrix, DVector};
use num_complex::Complex64;
use rayon::prelude::*;

use crate::data::dataset::PreparedRecord;
use crate::estimate::fit::Fit;
use crate::estimate::linearization::{EFFECT_STEP, columns};
use crate::model::hypothesis::Hypothesis;
use crate::noise::whitening::dot;

/// What is known of every number before: that it is right but for a factor of `e`, or its plausible range. Derived: one over the square of
/// that, in coordinates.
const INFORMATION_BEFORE: f64 = 1.0;
/// Steps to where the numbers move end where one promises less than this. Derived: one number gains as much by chance, the mean of a
/// chi-square of one degree of freedom.
const ENOUGH: f64 = 1.0;

/// Steps in which the numbers are followed to where they move. Chosen: near the end a Gauss-Newton step about doubles the digits, and
/// units are enough. Fewer charge what is not yet followed; more cost only time.
pub(crate) const STEPS: usize = 3;

/// What one record adds.
struct RecordContribution {
    squares: f64,
    slopes: Vec<(usize, f64)>,
    products: Vec<(usize, usize, f64)>,
}

/// Minus twice the log likelihood of what `white` makes of these records, but for a constant. `None` where the fit is impossible there.
pub(crate) fn white_deviance(
    unseen: &[&PreparedRecord],
    fit: &Fit,
    most_steps: usize,
    white: impl Fn(&PreparedRecord, &Hypothesis) -> Option<Vec<Complex64>> + Sync,
) -> Option<f64> {
    let count = fit.coordinates.len();
    let information = DMatrix::identity(count, count) * INFORMATION_BEFORE + &fit.information;
    let known = Cholesky::new(information.clone())?.ln_determinant();
    let begin = DVector::from_iterator(count, fit.coordinates.iter().map(|one| fit.hypothesis.get(*one)));
    let mut best = f64::INFINITY;
    let mut moved = DVector::zeros(count);
    for _ in 0..most_steps {
        let mut hypothesis = fit.hypothesis.clone();
        for (place, coordinate) in fit.coordinates.iter().enumerate() {
            hypothesis.set(*coordinate, begin[place] + moved[place]);
        }
        let of_record = |record: &&PreparedRecord| {
            let at = white(record, &hypothesis)?;
            let white = |hypothesis: &Hypothesis| white(record, hypothesis);
            let columns = columns(record, &hypothesis, &fit.coordinates, EFFECT_STEP, (&at, || None), white)?;
            let slopes = columns.iter().map(|(i, a)| (*i, dot(a, &at))).collect();
            let products =
                columns.iter().flat_map(|(i, a)| columns.iter().map(move |(j, b)| (*i, *j, dot(a, b)))).collect();
            Some(RecordContribution { squares: dot(&at, &at), slopes, products })
        };
        let parts: Option<Vec<RecordContribution>> = unseen.par_iter().map(of_record).collect();
        // Where the numbers moved to what no actuator has, what the step before promised is all that is known.
        let Some(parts) = parts else { break };
        let away = &information * &moved;
        let (mut squares, mut slope, mut after) = (moved.dot(&away), away, information.clone());
        for part in parts {
            squares += part.squares;
            part.slopes.into_iter().for_each(|(i, value)| slope[i] += value);
            part.products.into_iter().for_each(|(i, j, value)| after[(i, j)] += value);
        }
        let Some(after) = Cholesky::new(after) else { break };
        let step = after.solve(&slope);
        let promised = slope.dot(&step);
        // Nor is a step too far taken.
        if squares > best + ENOUGH {
            break;
        }
        best = squares - promised + after.ln_determinant() - known;
        if promised < ENOUGH {
            break;
        }
        moved -= step;
    }
    best.is_finite().then_some(best)
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicBool, Ordering};

    use rotorlead_records::{Excitation, Role};

    use super::*;
    use crate::data::split::Split;
    use crate::estimate::settle::settle;
    use crate::likelihood::Likelihood;
    use crate::testing::{likelihood, records};

    /// That of what is held out.
    fn deviance(likelihood: &Likelihood, fit: &Fit, most_steps: usize) -> Option<f64> {
        let held_out = likelihood.compared(Split::Holdout);
        let white =
            |record: &PreparedRecord, hypothesis: &Hypothesis| likelihood.residual(record, hypothesis, Split::Holdout);
        white_deviance(&held_out, fit, most_steps, white)
    }

    /// Lags that were fitted to quiet records, beside loud ones that are held out.
    fn of_quiet_records() -> (Likelihood, Fit) {
        let mut records = records("", 0.005, 1);
        for record in &mut records.records {
            let is_loud = record.excitation == Excitation::Square;
            record.role = Some(if is_loud { Role::Validate } else { Role::Fit });
        }
        let (likelihood, base) = likelihood(&records);
        settle(&likelihood, &Hypothesis::from_lags(base), true).unwrap()
    }

    #[test]
    fn what_was_promised_counts_where_the_numbers_cannot_be_followed_farther() {
        let (likelihood, fit) = of_quiet_records();
        let held_out = likelihood.compared(Split::Holdout);
        let near = |hypothesis: &Hypothesis| {
            let lags = hypothesis.base.iter().zip(&fit.hypothesis.base);
            lags.into_iter().all(|(lag, own)| (lag.time_constant_s / own.time_constant_s).ln().abs() < 0.01)
        };
        let was_refused = AtomicBool::new(false);
        let white = |record: &PreparedRecord, hypothesis: &Hypothesis| {
            if !near(hypothesis) {
                was_refused.store(true, Ordering::Relaxed);
                return None;
            }
            likelihood.residual(record, hypothesis, Split::Holdout)
        };
        let promised = deviance(&likelihood, &fit, 1);
        assert!(promised.is_some());
        assert_eq!(white_deviance(&held_out, &fit, STEPS, white), promised);
        assert!(was_refused.into_inner(), "the numbers have to move");
        // What cannot be had at the fit itself cannot be predicted at all.
        assert_eq!(white_deviance(&held_out, &fit, STEPS, |_, _| None), None);
    }

    #[test]
    fn a_lag_that_was_fitted_to_a_quiet_record_is_not_held_against_itself_on_a_loud_one() {
        let (likelihood, fit) = of_quiet_records();
        let mut truth = fit.hypothesis.clone();
        for (point, (gain, time_constant_s)) in truth.base.iter_mut().zip([(10.0, 0.16), (13.5, 0.085)]) {
            (point.gain, point.time_constant_s) = (gain, time_constant_s);
        }
        let plain = |hypothesis: &Hypothesis| likelihood.chi_square(hypothesis, Split::Holdout).unwrap();
        let over_truth = plain(&fit.hypothesis) - plain(&truth);
        assert!(over_truth > 200.0, "{over_truth}");
        // Four numbers that were left open by factors of ten or so cost some units each.
        let predicted = deviance(&likelihood, &fit, STEPS).unwrap() - plain(&truth);
        assert!((0.0..40.0).contains(&predicted), "{predicted}");
    }
}
