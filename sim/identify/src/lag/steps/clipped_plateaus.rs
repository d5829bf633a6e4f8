//! Levels on which the response stands on a limit: the end of a sensor's scale, or of a logger's.
//!
//! Beyond a limit all rows read the same, whatever the motor does. The step to such a level seems to end where the
//! limit is reached, long before the motor has settled, so its time constant comes out far too short, and the step
//! back seems to begin late.
//!
//! A sensor that is coarse reads the same for many rows as well. So a plateau stands on the record's largest (or smallest)
//! reading when it does so in many rows and either
//!
//! - the largest reading comes up several times as often as the commonest one does on plateaus that do not
//!   reach it, which have the sensor's own resolution; or
//! - it is most of what two different commands settle to.

use rotorlead_numerics::sample::median;

use super::plateaus::{Plateau, SAME_LEVEL};
use crate::rows::clipping::{ClippingLimit, FEWEST_ROWS, TIMES_THE_NEXT};

/// Two commands that settle to the same reading have it in at least this share of their settled rows. Chosen: on a limit nearly all rows
/// read it, while noise leaves a motor's largest reading to few.
const MOST: f64 = 0.5;

/// The limits that the response of these plateaus stands on, the upper one first; marks the plateaus that do.
pub(super) fn mark_clipped_plateaus(plateaus: &mut [Plateau], y: &[f64]) -> Vec<ClippingLimit> {
    let mut rows = plateaus.iter().flat_map(|plateau| plateau.rows.clone());
    let first = rows.next().map(|row| y[row]);
    // A response that never moves is no limit's doing.
    if rows.all(|row| Some(y[row]) == first) {
        return Vec::new();
    }
    [1.0, -1.0].into_iter().filter_map(|sign| upper(plateaus, y, sign)).collect()
}

/// The upper limit of `sign * y`.
fn upper(plateaus: &mut [Plateau], y: &[f64], sign: f64) -> Option<ClippingLimit> {
    let all = plateaus.iter().flat_map(|p| p.rows.clone()).map(|row| sign * y[row]);
    let at = sign * all.fold(f64::NEG_INFINITY, f64::max);
    let share = |p: &Plateau| {
        let settled = &y[p.settled()];
        settled.iter().filter(|&&value| value == at).count() as f64 / settled.len().max(1) as f64
    };
    let rows = |p: &Plateau| y[p.rows.clone()].iter().filter(|&&value| value == at).count();
    let shares: Vec<f64> = plateaus.iter().map(share).collect();
    let usual =
        plateaus.iter().zip(&shares).filter(|(_, share)| **share == 0.0).map(|(p, _)| mode_share(&y[p.settled()]));
    let usual = median(usual);
    let settles = |k: usize| shares[k] >= MOST;
    let first = (0..plateaus.len()).find(|&k| settles(k));
    let two = first.is_some_and(|first| {
        let other = |k: usize| (plateaus[k].command - plateaus[first].command).abs() > SAME_LEVEL;
        (first + 1..plateaus.len()).any(|k| settles(k) && other(k))
    });
    let stands = |k: usize| {
        rows(&plateaus[k]) >= FEWEST_ROWS
            && (usual.is_some_and(|usual| shares[k] > TIMES_THE_NEXT as f64 * usual) || two && settles(k))
    };
    let limited: Vec<usize> = (0..plateaus.len()).filter(|&k| stands(k)).collect();
    let on_limit = limited.iter().map(|&k| rows(&plateaus[k])).sum();
    limited.iter().for_each(|&k| plateaus[k].limited = true);
    (!limited.is_empty()).then_some(ClippingLimit { at, rows: on_limit })
}

/// The share of the value that comes up most often.
fn mode_share(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let longest = sorted.chunk_by(|a, b| a == b).map(<[f64]>::len).max().unwrap_or(0);
    longest as f64 / sorted.len().max(1) as f64
}
