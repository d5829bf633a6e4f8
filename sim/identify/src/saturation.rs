//! A column that ran into a limit.
//!
//! Under a multisine no value is special. Where a sensor or a command is cut off, the rows beyond the limit all stand on it:
//! the largest value, or the smallest, comes up far more often than the next one to it. A peak that a coarse sensor rounds
//! does not look like that. Near the top `y = y_max - a t^2`, so the time spent in the uppermost step of a
//! resolution `q` goes with `sqrt(q)`, and in the one below with `sqrt(2 q) - sqrt(q)`: 2.4 times less.

/// Rows on a limit; fewer are chance.
pub(super) const FEWEST_ROWS: usize = 10;
/// How many times as often as the next value the limit comes up.
pub(super) const TIMES_THE_NEXT: usize = 5;

/// A limit that a column stands on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Limit {
    /// The value.
    pub at: f64,
    /// Rows on it.
    pub rows: usize,
}

/// The limits of `column`, the upper one first.
pub(super) fn limits(column: &[f64]) -> Vec<Limit> {
    [1.0, -1.0].into_iter().filter_map(|sign| upper_limit(column, sign)).collect()
}

/// The upper limit of `sign * column`.
fn upper_limit(column: &[f64], sign: f64) -> Option<Limit> {
    let highest = |below: f64| {
        let values = column.iter().map(|value| sign * value);
        values.filter(|&value| value < below).fold(f64::NEG_INFINITY, f64::max)
    };
    let top = highest(f64::INFINITY);
    let next = highest(top);
    let rows = |at: f64| column.iter().filter(|&&value| sign * value == at).count();
    let on_top = rows(top);
    (on_top >= FEWEST_ROWS && next.is_finite() && on_top >= TIMES_THE_NEXT * rows(next))
        .then_some(Limit { at: sign * top, rows: on_top })
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
            assert_eq!(limits(&cut), [Limit { at: 6.0, rows }]);
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
}
