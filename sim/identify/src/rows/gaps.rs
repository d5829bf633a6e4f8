//! Gaps: intervals between rows in which a log lost some.

use rotorlead_numerics::sample::median;
use rotorlead_records::import::GAP_INTERVALS;

/// The median interval between rows, seconds; `None` for fewer than two rows, or where half of the times or more stand still.
pub(crate) fn usual_interval_s(time_s: &[f64]) -> Option<f64> {
    median(time_s.windows(2).map(|pair| pair[1] - pair[0])).filter(|interval_s| *interval_s > 0.0)
}

/// The rows that come after a gap.
#[must_use]
pub fn rows_after_gaps(time_s: &[f64]) -> Vec<usize> {
    rows_after_intervals(time_s, GAP_INTERVALS)
}

/// The rows that come after an interval of more than `usual_ones` times the usual.
pub(crate) fn rows_after_intervals(time_s: &[f64], usual_ones: f64) -> Vec<usize> {
    let longest_s = usual_ones * usual_interval_s(time_s).unwrap_or(0.0);
    (1..time_s.len()).filter(|&row| time_s[row] - time_s[row - 1] > longest_s).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lost_row_alone_is_no_gap_and_two_are() {
        let mut time_s: Vec<f64> = (0..100).map(f64::from).collect();
        time_s.remove(50);
        assert!(rows_after_gaps(&time_s).is_empty());
        time_s.remove(50);
        assert_eq!((rows_after_gaps(&time_s), usual_interval_s(&time_s)), (vec![50], Some(1.0)));
        assert!(rows_after_intervals(&time_s, 10.0).is_empty());
        assert_eq!((rows_after_gaps(&[0.0]), usual_interval_s(&[0.0])), (vec![], None));
    }
}
