//! Whether levels miss a static map because they drift, or because it is another curve.
//!
//! Visits of one level differ by their own scatter and by drift, whatever the curve is; what all visits of a level miss by alike is the
//! curve's (the pure error and the lack of fit of Draper and Smith, Applied Regression Analysis, section 2.1). Where nothing drifts, the
//! curve is chosen by how well it predicts each level from the others, which needs no degrees of freedom beside those of its terms.

use rotorlead_numerics::least_squares::Solution;

use super::points::SteadyPoint;
use super::shape::{self, MapTerms};
use crate::lag::steps::Direction;

/// Points by increasing command that are one level, as ranges of them: within `same` of the first.
fn levels(points: &[SteadyPoint], same: f64) -> impl Iterator<Item = std::ops::Range<usize>> {
    let mut start = 0;
    (1..=points.len()).filter_map(move |end| {
        let ends = end == points.len() || points[end].command - points[start].command > same;
        ends.then(|| std::mem::replace(&mut start, end)..end)
    })
}

/// Standard deviation of what visits of the same level differ by beside hysteresis, in units of their own standard errors; `None` where no
/// level was visited twice, or the hysteresis takes all that they differ by.
///
/// The width of the hysteresis is the one by which the visits themselves differ least: that of a curve that misses levels bends to them.
pub(super) fn excess_between_visits(
    shape: &MapTerms,
    parameters: &[f64],
    (points, std): (&[SteadyPoint], &[f64]),
    same: f64,
) -> Option<f64> {
    // Both about the middle of their level: what is left of the curve without hysteresis, and what a hysteresis of one adds to it.
    let (mut left, mut added) = (Vec::new(), Vec::new());
    let mut dof = 0;
    for level in levels(points, same) {
        // One for all visits: what the curve misses the level by is none of their differences.
        let level_std = (level.clone().map(|k| std[k] * std[k]).sum::<f64>() / level.len() as f64).sqrt();
        let own_left =
            |k: usize| (points[k].response - shape.response(parameters, points[k].command, None)) / level_std;
        let own_added = |k: usize| {
            let at = |moved: f64| shape.response(parameters, points[k].command + moved, None);
            // Derived: a difference over a thousandth of the range is off by its square, 1e-6 of a curve's bend.
            let step = 1e-3 * shape.half_range;
            let sign = if points[k].direction == Direction::Up { -0.5 } else { 0.5 };
            sign * (at(step) - at(-step)) / (2.0 * step) / level_std
        };
        let mean = |of: &dyn Fn(usize) -> f64| level.clone().map(of).sum::<f64>() / level.len() as f64;
        let (mean_left, mean_added) = (mean(&own_left), mean(&own_added));
        left.extend(level.clone().map(|k| own_left(k) - mean_left));
        added.extend(level.clone().map(|k| own_added(k) - mean_added));
        dof += level.len() - 1;
    }
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let by_hysteresis = if shape.hysteresis { dot(&left, &added).powi(2) / dot(&added, &added) } else { 0.0 };
    let dof = dof.checked_sub(usize::from(shape.hysteresis)).filter(|dof| *dof > 0)?;
    // Visits in one direction alone leave hysteresis nothing: 0 / 0.
    let by_hysteresis = if by_hysteresis.is_finite() { by_hysteresis } else { 0.0 };
    Some(((dot(&left, &left) - by_hysteresis).max(0.0) / dof as f64).sqrt())
}

/// The shape that predicts each level best from the others, fitted to all: the least sum of squares of what predictions miss by. One that
/// some of the levels are needed for is no candidate. `None` where none is left.
pub(super) fn cross_validated(
    shapes: impl Iterator<Item = MapTerms>,
    (points, std): (&[SteadyPoint], &[f64]),
    same: f64,
) -> Option<(MapTerms, Solution)> {
    let missed = |shape: &MapTerms| -> Option<f64> {
        let mut sum = 0.0;
        for level in levels(points, same) {
            let others = |k: &usize| !level.contains(k);
            let (rest, rest_std): (Vec<SteadyPoint>, Vec<f64>) =
                (0..points.len()).filter(others).map(|k| (points[k], std[k])).unzip();
            let fitted = shape::fit(*shape, &rest, &rest_std, 0)?;
            let miss = |k: usize| {
                let point = &points[k];
                let predicted = shape.response(&fitted.parameters, point.command, Some(point.direction));
                ((point.response - predicted) / std[k]).powi(2)
            };
            sum += level.clone().map(miss).sum::<f64>();
        }
        Some(sum)
    };
    let scored = shapes.filter_map(|shape| Some((missed(&shape)?, shape)));
    let (_, shape) = scored.min_by(|a, b| a.0.total_cmp(&b.0))?;
    // One degree of freedom, which the intervals need.
    Some((shape, shape::fit(shape, points, std, 1)?))
}
