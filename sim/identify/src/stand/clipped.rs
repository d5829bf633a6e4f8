//! A column that was cut off at its peak.
//!
//! A blow is over in a few rows, too few to tell a limit by how often it comes up. But a peak that a sensor cuts off is flat and
//! ends steeply, where one that it rounds to its resolution is flat and ends by a step of that resolution.

use rotorlead_numerics::sample::{extent, median};

/// Rows in a row on the same extreme value.
const FEWEST_ROWS: usize = 3;
/// A cut peak falls by at least this share of its height within two rows of its flat part.
const STEEP: f64 = 0.02;

/// The value at which `column` was cut off, and for how many rows in a row.
pub(super) fn peak(column: &[f64]) -> Option<(f64, usize)> {
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
    (height > 0.0 && longest >= FEWEST_ROWS).then_some((extreme, longest))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A blow of 20 N of this width in rows, in steps of this size.
    fn blow(width: f64, resolution: f64) -> Vec<f64> {
        let at = |row: u32| 20.0 * (-0.5 * ((f64::from(row) - 200.3) / width).powi(2)).exp();
        (0..1000).map(|row| (at(row) / resolution).round() * resolution).collect()
    }

    #[test]
    fn a_cut_blow_is_told_from_one_of_a_coarse_or_a_quick_sensor() {
        for (width, resolution) in [(2.0, 1e-6), (2.0, 0.01), (40.0, 0.005), (40.0, 0.1), (1.0, 0.5)] {
            assert_eq!(peak(&blow(width, resolution)), None, "{width} {resolution}");
        }
        for width in [2.0, 5.0, 40.0] {
            let cut: Vec<f64> = blow(width, 1e-6).into_iter().map(|y| y.min(8.0)).collect();
            let (at, rows) = peak(&cut).unwrap();
            assert!(at == 8.0 && rows >= 3, "{width} {rows}");
            let down: Vec<f64> = cut.iter().map(|y| 3.0 - y).collect();
            assert_eq!(peak(&down), Some((-5.0, rows)));
        }
        assert_eq!(peak(&[1.0; 50]), None);
        assert_eq!(peak(&[]), None);
    }
}
