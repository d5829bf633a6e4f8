//! The rows about each step, and what each of them weighs.
//!
//! A row is off by the sensor's noise `s`, as the settled rows show it, and by the noise of its time stamp `s_t` times the slope
//! `v` of the response: `s^2 + (s_t v)^2`. `s_t` is one for the record, by moments from what a first fit leaves where the response
//! moves; besides jitter it takes whatever a lag does not explain of the way. It widens the intervals and leaves the weights of
//! the rows as they are: else a response that is no lag would be judged by its tail alone.
//!
//! Readings in counts that stand still have their error in common (`rows::resolution`), of variance `c`. Each of `n` in a row is weighed
//! as of variance `s^2 + (n - 1) c`, so that all together know as much as one. Levels that are whole counts apart, as those of even steps
//! may be, are all off by the same: what that makes of each time constant and of the delay stands in their joint intervals.

use nalgebra::DMatrix;
use rotorlead_numerics::normal_equations::scaled_inverse;

use super::fit::{CURVATURE_KNOWN, FREE_ONSET_STD_S, Fitted, StepRows};
use super::plateaus::Plateau;
use super::problem::{PER_STEP, StepLaw, StepProblem, Window};
use super::step::Step;
use crate::rows::resolution::standing;

/// A reading that is exactly the one before, where the response has moved by more than this many times its noise, was not
/// taken anew. Chosen: noise would have to make up for three standard deviations of motion to the last digit.
const MOVED: f64 = 3.0;

/// The rows about a step, as their noise and resolution weigh them.
pub(super) fn window<'p>(
    data: &StepRows<'_>,
    mut pairs: impl Iterator<Item = &'p [Plateau]>,
    step: &Step,
    after_gaps: &[usize],
    resolution: f64,
) -> Window {
    let says = |row: usize| !data.without_reading[row] && after_gaps.binary_search(&row).is_err();
    let pair = pairs.find(|pair| pair[1].rows.start == step.row).unwrap_or_default();
    // A sensor that reads the same value all the time has some noise still: a thousandth of the step, chosen.
    let noise = pair.last().map_or(0.0, |to| to.noise_std).max(1e-3 * (step.after - step.before).abs());
    let rows: Vec<usize> = step.window.clone().filter(|&row| says(row)).collect();
    let readings: Vec<f64> = rows.iter().map(|&row| data.y[row]).collect();
    let (mut weight, mut common_std) = (vec![0.0; step.window.len()], vec![0.0; step.window.len()]);
    let standing = standing(&readings, resolution);
    let ends = (standing.first().copied().unwrap_or(0), rows.len() - standing.last().copied().unwrap_or(0));
    for (place, (&row, &standing)) in rows.iter().zip(&standing).enumerate() {
        let level = if row < step.row { pair.first() } else { pair.last() };
        let common = level.map_or(0.0, |level| level.common_std);
        weight[row - step.window.start] = noise.hypot(((standing - 1) as f64).sqrt() * common).recip();
        // Readings on the way are each anywhere within a count.
        if place < ends.0 || place >= ends.1 {
            common_std[row - step.window.start] = common;
        }
    }
    Window {
        change_s: step.at_s,
        before: step.before,
        after: step.after,
        time_s: data.time_s[step.window.clone()].to_vec(),
        y: data.y[step.window.clone()].to_vec(),
        weight,
        common_std,
        mean_s: data.mean_s,
        stamp_variance: vec![0.0; step.window.len()],
        excess: 1.0,
    }
}

/// Gives each row the standard deviation that a first fit suggests; the standard deviation of stamps.
pub(super) fn weigh(windows: &mut [Window], batch: usize, rough: &[Fitted], law: StepLaw, row_s: f64) -> f64 {
    let (mut excess, mut scale) = (0.0, 0.0);
    let mut slopes = Vec::with_capacity(windows.len());
    for (steps, fitted) in windows.chunks_mut(batch).zip(rough) {
        let unit = scaled_inverse(&fitted.linearization.matrix, 0.0);
        let own: Vec<Vec<f64>> = {
            let problem = StepProblem { steps, onset_std_s: FREE_ONSET_STD_S, curvature: CURVATURE_KNOWN, law };
            (0..steps.len()).map(|k| problem.slope(k, &fitted.at.parameters, row_s)).collect()
        };
        for (k, (window, slope)) in steps.iter_mut().zip(&own).enumerate() {
            let (block, residuals) = (&fitted.linearization.blocks[k], &fitted.at.residuals[k]);
            let places: Vec<usize> = (0..block.ncols()).map(|local| StepProblem::global_index(k, local)).collect();
            let local =
                unit.as_ref().map(|u| DMatrix::from_fn(places.len(), places.len(), |i, j| u[(places[i], places[j])]));
            for row in 0..window.y.len() {
                let weight = window.weight[row];
                if weight == 0.0 {
                    continue;
                }
                // Leverage: the share by which a row's pull on the fit lowers its squared residual. Chosen: at most 0.9, so that no
                // row counts more than tenfold.
                let j = block.row(row);
                let leverage = local.as_ref().map_or(0.0, |u| (j * u * j.transpose())[(0, 0)]).clamp(0.0, 0.9);
                let (left, steep) = (residuals[row].powi(2) / (1.0 - leverage) - 1.0, (slope[row] * weight).powi(2));
                excess += left * steep;
                scale += steep * steep;
            }
            let repeats = window.y.windows(2).map(|pair| pair[0] == pair[1]);
            for ((weight, slope), repeats) in window.weight[1..].iter_mut().zip(&slope[1..]).zip(repeats) {
                if repeats && slope.abs() * row_s * *weight > MOVED {
                    *weight = 0.0;
                }
            }
        }
        slopes.extend(own);
    }
    let stamp_variance = if scale > 0.0 { (excess / scale).max(0.0) } else { 0.0 };
    let residuals = rough.iter().flat_map(|fitted| &fitted.at.residuals);
    for ((window, slope), residuals) in windows.iter_mut().zip(&slopes).zip(residuals) {
        let (mut sum, mut rows) = (0.0, 0);
        for (row, residual) in residuals.iter().enumerate().filter(|(row, _)| window.weight[*row] > 0.0) {
            window.stamp_variance[row] = stamp_variance * (slope[row] * window.weight[row]).powi(2);
            sum += residual * residual / (1.0 + window.stamp_variance[row]);
            rows += 1;
        }
        // What the fit leaves in its window, where that is more than the noise: levels, onset and a time constant are fitted.
        let excess = (sum / usize::max(rows - PER_STEP.min(rows), 1) as f64).max(1.0);
        window.weight.iter_mut().for_each(|weight| *weight /= excess.sqrt());
        window.excess = excess;
    }
    stamp_variance.sqrt()
}
