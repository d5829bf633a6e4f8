//! How often an ESC reports: a log repeats a report until the next one comes.

use rotorlead_numerics::sample::median;

use super::series::Sample;

/// A change of at least so many of the smallest changes is a motor that moves, and not a reading at the edge of a step. Chosen: at three
/// steps between two reports the reading changes with every report.
const MOVES_STEPS: f64 = 3.0;
/// Changes of that size that say something of the interval. Chosen: the median of fewer is one of chance.
const FEWEST_CHANGES: usize = 50;

/// Rows between two reports; 1 where each row has one of its own.
pub(super) fn report_rows(rpm: &[f64]) -> usize {
    let changes: Vec<usize> = (1..rpm.len()).filter(|&row| rpm[row] != rpm[row - 1]).collect();
    let size = |row: usize| (rpm[row] - rpm[row - 1]).abs();
    let Some(step) = median(changes.iter().map(|&row| size(row))).filter(|step| *step > 0.0) else { return 1 };
    // The smallest change that is usual: a quantizer's step is the least of them.
    let mut sizes: Vec<f64> = changes.iter().map(|&row| size(row)).collect();
    sizes.sort_by(f64::total_cmp);
    let least = sizes[sizes.len() / 20].min(step);
    let between = changes.windows(2).filter(|pair| size(pair[1]) >= MOVES_STEPS * least);
    let intervals: Vec<f64> = between.map(|pair| (pair[1] - pair[0]) as f64).collect();
    if intervals.len() < FEWEST_CHANGES {
        return 1;
    }
    median(intervals).map_or(1, |rows| (rows.round() as usize).max(1))
}

/// One sample for each report of about `held` rows: its first row. A report that is the same as the last one counts too.
pub(super) fn fresh(rpm: &[f64], held: usize, starts: &[usize]) -> Vec<Sample> {
    let ends = starts.iter().skip(1).copied().chain([rpm.len()]);
    let mut samples = Vec::new();
    for (&start, end) in starts.iter().zip(ends) {
        let Some(mut row) = (start + 1..end).find(|&row| rpm[row] != rpm[row - 1]) else { continue };
        while row < end {
            samples.push(Sample { rows: row..row + 1, rpm: rpm[row] });
            let (from, until) = (row + held.div_ceil(2), row + held + held / 2);
            let next = (from..=until.min(end.saturating_sub(1))).find(|&next| rpm[next] != rpm[next - 1]);
            row = next.unwrap_or(row + held);
        }
    }
    samples
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn held_reports_are_told_from_a_coarse_reading() {
        let speed = |row: usize| 9000.0 + 800.0 * (0.02 * row as f64).sin();
        let coarse = |value: f64| (value / 40.0).round() * 40.0;
        let each: Vec<f64> = (0..6000).map(|row| coarse(speed(row))).collect();
        assert_eq!(report_rows(&each), 1);
        let held: Vec<f64> = (0..6000).map(|row| coarse(speed(row - row % 12))).collect();
        assert_eq!(report_rows(&held), 12);
        let samples = fresh(&held, 12, &[0]);
        assert!(samples.iter().all(|sample| sample.rows.start % 12 == 0), "each is the first row of a report");
        assert!((samples.len() as i64 - 500).abs() < 10, "{}", samples.len());
        assert_eq!(report_rows(&vec![5000.0; 100]), 1);
    }
}
