//! A column that was cut off at the end of a range.
//!
//! Under a multisine no value is special. Where a sensor or a command is cut off, the rows beyond the limit all stand on it:
//! the largest value, or the smallest, comes up far more often than the next one to it. A peak that a coarse sensor rounds
//! does not look like that. Near the top `y = y_max - a t^2`, so the time spent in the uppermost step of a
//! resolution `q` goes with `sqrt(q)`, and in the one below with `sqrt(2 q) - sqrt(q)`: 2.4 times less ([`limits`]).
//!
//! A blow is over in a few rows, too few to count. But a peak that is cut off is flat and ends steeply, where one that is rounded
//! is flat and ends by a step of the resolution ([`cut_peak`]).

use rotorlead_numerics::sample::{extent, median};

/// Fewest rows on a limit. Chosen: fewer come of chance, more leave limits unseen that are met for a moment.
pub(crate) const FEWEST_ROWS: usize = 10;
/// How many times as often as the next value the limit comes up, at least. Derived: twice the 2.4 times that rounding makes at a peak.
pub(crate) const TIMES_THE_NEXT: usize = 5;
/// Fewest rows in a row on the same extreme value. Derived: a peak between two rows gives two alike; three need a cut or a coarse sensor.
const FEWEST_ROWS_OF_A_PEAK: usize = 3;
/// A cut peak falls by at least this share of its height within two rows of its flat part. Chosen: five steps of a sensor of 8 bits; with
/// less, rounding looks like a cut, with more, a slow blow that is cut passes.
const STEEP: f64 = 0.02;

/// A limit that a column stands on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ClippingLimit {
    /// The value.
    pub at: f64,
    /// Rows on it.
    pub rows: usize,
}

/// The limits of `column`, the upper one first.
pub(crate) fn limits(column: &[f64]) -> Vec<ClippingLimit> {
    [1.0, -1.0].into_iter().filter_map(|sign| upper_limit(column, sign)).collect()
}

/// The upper limit of `sign * column`.
fn upper_limit(column: &[f64], sign: f64) -> Option<ClippingLimit> {
    let highest = |below: f64| {
        let values = column.iter().map(|value| sign * value);
        values.filter(|&value| value < below).fold(f64::NEG_INFINITY, f64::max)
    };
    let top = highest(f64::INFINITY);
    let next = highest(top);
    let rows = |at: f64| column.iter().filter(|&&value| sign * value == at).count();
    let on_top = rows(top);
    (on_top >= FEWEST_ROWS && next.is_finite() && on_top >= TIMES_THE_NEXT * rows(next))
        .then_some(ClippingLimit { at: sign * top, rows: on_top })
}

/// The value at which `column` was cut off, and for how many rows in a row.
pub(crate) fn cut_peak(column: &[f64]) -> Option<(f64, usize)> {
    // At rest in all but a few rows.
    let rest = median(column.iter().copied())?;
    let (low, high) = extent(column);
    let extreme = if high - rest >= rest - low { high } else { low };
    let height = (extreme - rest).abs();
    let mut start = 0;
    let mut longest = 0;
    for run in column.chunk_by(|a, b| a == b) {
        let end = start + run.len();
        // The row next to the flat part may be barely below it.
        let falls = |neighbor: Option<&f64>| neighbor.is_some_and(|y| (extreme - y).abs() > STEEP * height);
        if run[0] == extreme && (falls(start.checked_sub(2).map(|at| &column[at])) || falls(column.get(end + 1))) {
            longest = longest.max(run.len());
        }
        start = end;
    }
    (height > 0.0 && longest >= FEWEST_ROWS_OF_A_PEAK).then_some((extreme, longest))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two sines over 4000 rows, and something of the size of `noise`.
    fn wave(noise: f64) -> Vec<f64> {
        let mut state = 1_u64;
        (0..4000)
            .map(|row| {
                let t = f64::from(row) * 1e-3;
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                5.0 + (7.0 * t).sin() + 0.5 * (23.0 * t).sin() + noise * ((state >> 33) as f64 / 2f64.powi(31) - 0.5)
            })
            .collect()
    }

    #[test]
    fn a_cut_is_seen_at_either_end_and_a_peak_is_none() {
        for noise in [0.0, 0.1] {
            assert!(limits(&wave(noise)).is_empty());
            let cut: Vec<f64> = wave(noise).into_iter().map(|y| y.min(6.0)).collect();
            let rows = wave(noise).iter().filter(|&&y| y >= 6.0).count();
            assert_eq!(limits(&cut), [ClippingLimit { at: 6.0, rows }]);
            let cut: Vec<f64> = wave(noise).into_iter().map(|y| y.clamp(4.0, 6.0)).collect();
            assert_eq!(limits(&cut).iter().map(|limit| limit.at).collect::<Vec<_>>(), [6.0, 4.0]);
        }
    }

    #[test]
    fn rounding_is_no_limit() {
        for resolution in [0.001, 0.01, 0.05, 0.2] {
            for noise in [0.0, 0.1] {
                let rounded: Vec<f64> =
                    wave(noise).into_iter().map(|y| (y / resolution).round() * resolution).collect();
                assert!(limits(&rounded).is_empty(), "{resolution} {noise}");
            }
        }
        assert!(limits(&[1.0; 50]).is_empty() && limits(&[]).is_empty());
    }

    /// A blow of 20 N of this width in rows, in steps of this size.
    fn blow(width: f64, resolution: f64) -> Vec<f64> {
        let at = |row: u32| 20.0 * (-0.5 * ((f64::from(row) - 200.3) / width).powi(2)).exp();
        (0..1000).map(|row| (at(row) / resolution).round() * resolution).collect()
    }

    #[test]
    fn a_cut_blow_is_told_from_one_of_a_coarse_or_a_quick_sensor() {
        for (width, resolution) in [(2.0, 1e-6), (2.0, 0.01), (40.0, 0.005), (40.0, 0.1), (1.0, 0.5)] {
            assert_eq!(cut_peak(&blow(width, resolution)), None, "{width} {resolution}");
        }
        for width in [2.0, 5.0, 40.0] {
            let cut: Vec<f64> = blow(width, 1e-6).into_iter().map(|y| y.min(8.0)).collect();
            let (at, rows) = cut_peak(&cut).unwrap();
            assert!(at == 8.0 && rows >= 3, "{width} {rows}");
            let down: Vec<f64> = cut.iter().map(|y| 3.0 - y).collect();
            assert_eq!(cut_peak(&down), Some((-5.0, rows)));
        }
        assert_eq!(cut_peak(&[1.0; 50]), None);
        assert_eq!(cut_peak(&[]), None);
    }
}
