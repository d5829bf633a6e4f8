//! The times of rows, from stamps that are not to be taken at their word.

use rotorlead_numerics::sample::median;

/// Rows on an even grid.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct EvenGrid {
    /// Times in seconds from the first row.
    pub(super) time_s: Vec<f64>,
    /// Spacing of the grid in seconds.
    pub(super) interval_s: f64,
    /// Rows that never arrived, summed over all gaps.
    pub(super) rows_missing: usize,
    /// RMS distance of the stamps from the grid, in seconds.
    pub(super) residual_rms_s: f64,
    /// Largest distance of a stamp from the grid, in seconds.
    pub(super) residual_max_s: f64,
}

/// An interval longer than this many usual ones is a gap. Derived: two lost rows make three of them; one makes two, which a clock that
/// jitters does too.
pub const GAP_INTERVALS: f64 = 2.5;

/// Rows on each side of a gap whose least lateness decides whether rows were lost there. Long enough
/// for a reader to work off what piled up while it waited.
const GAP_WINDOW: usize = 300;

/// Intervals of which a median is known as well as of more.
const MOST_INTERVALS: usize = 1 << 17;

/// Puts rows that were *sent* evenly spaced, but stamped when the host came round to reading them,
/// back on their grid.
///
/// Row `k` was sent at `t0 + interval (k + lost_k)` and stamped later by however long it waited. A
/// wait changes some stamps; a lost row delays all that follow. A stamp is never early, so the least
/// lateness among many rows is that of one that did not wait: at every long gap the least of the
/// [`GAP_WINDOW`] rows after it is compared with the least of those before it, and the difference, in
/// whole intervals, is the number of rows lost. `t0` and `interval` are then the
/// least-squares line through the stamps, and both steps are repeated with the new interval. The
/// mean wait is not observable; it shifts all columns of a row alike, so it does no harm.
///
/// `stamps` in seconds, never decreasing; fewer than three give them back as they are.
pub(super) fn even_grid(stamps: &[f64]) -> EvenGrid {
    let n = stamps.len();
    let lag = (n / 4).clamp(1, 500);
    let slopes = stamps.windows(lag + 1).map(|w| (w[lag] - w[0]) / lag as f64);
    let mut interval = median(slopes).unwrap_or(0.0);
    let mut lost = vec![0usize; n];
    let mut start = stamps.first().copied().unwrap_or(0.0);
    for _ in 0..4 {
        lost = lost_rows(stamps, interval);
        let (a, b) = line(stamps, &lost);
        let settled = (b - interval).abs() < 1e-12;
        (start, interval) = (a, b);
        if settled {
            break;
        }
    }
    let grid = |k: usize| interval * (k + lost[k]) as f64;
    let residuals = (0..n).map(|k| stamps[k] - start - grid(k));
    let (mut sum, mut max) = (0.0, 0.0f64);
    for r in residuals {
        sum += r * r;
        max = max.max(r.abs());
    }
    EvenGrid {
        time_s: (0..n).map(grid).collect(),
        interval_s: interval,
        rows_missing: lost.last().copied().unwrap_or(0),
        residual_rms_s: (sum / n.max(1) as f64).sqrt(),
        residual_max_s: max,
    }
}

/// An interval below this share of the usual one is within a burst.
const BURST_SHARE: f64 = 0.25;
/// Stamps come in bursts where this share of the intervals is within one.
const MOSTLY_BURSTS: f64 = 0.4;

/// The times of rows whose stamps come in bursts, as of a host that reads several rows at a time, on an even grid. `None` where
/// they do not, or run back.
#[must_use]
pub fn spread_bursts(stamps_s: &[f64]) -> Option<Vec<f64>> {
    if stamps_s.len() < 3 || !stamps_s.is_sorted() {
        return None;
    }
    let usual_s = (stamps_s[stamps_s.len() - 1] - stamps_s[0]) / (stamps_s.len() - 1) as f64;
    let within = stamps_s.windows(2).filter(|pair| pair[1] - pair[0] < BURST_SHARE * usual_s).count();
    if (within as f64) < MOSTLY_BURSTS * (stamps_s.len() - 1) as f64 {
        return None;
    }
    let grid = even_grid(stamps_s);
    (grid.interval_s > 0.0).then_some(grid.time_s)
}

/// For every row, how many rows were lost before it.
fn lost_rows(stamps: &[f64], interval: f64) -> Vec<usize> {
    let n = stamps.len();
    let mut lost = vec![0usize; n];
    if interval <= 0.0 {
        return lost;
    }
    let late = |k: usize| stamps[k] - interval * k as f64;
    let mut before = 0usize;
    let mut from = 0;
    for k in 1..n {
        if stamps[k] - stamps[k - 1] > GAP_INTERVALS * interval {
            let left = k.saturating_sub(GAP_WINDOW).max(from);
            let head = (left..k).map(late).fold(f64::INFINITY, f64::min);
            let tail = (k..(k + GAP_WINDOW).min(n)).map(late).fold(f64::INFINITY, f64::min);
            let rows = ((tail - head) / interval).round();
            if rows >= 1.0 {
                // Stamps of different ages may be farther apart than rows can be counted.
                before = before.saturating_add(rows as usize).min(u32::MAX as usize);
                from = k;
            }
        }
        lost[k] = before;
    }
    lost
}

/// Least-squares line `start + interval (k + lost[k])` through the stamps.
fn line(stamps: &[f64], lost: &[usize]) -> (f64, f64) {
    let n = stamps.len() as f64;
    let index = |k: usize| (k + lost[k]) as f64;
    let mean_x = (0..stamps.len()).map(index).sum::<f64>() / n;
    let mean_y = stamps.iter().sum::<f64>() / n;
    let (mut xy, mut xx) = (0.0, 0.0);
    for (k, stamp) in stamps.iter().enumerate() {
        let x = index(k) - mean_x;
        xy += x * (stamp - mean_y);
        xx += x * x;
    }
    let interval = if xx > 0.0 { xy / xx } else { 0.0 };
    (mean_y - interval * mean_x, interval)
}

/// The median and the longest interval between stamps; zero of fewer than two. Of more than [`MOST_INTERVALS`] the median is that
/// of every second, third and so on.
pub(super) fn typical_and_longest(time_s: &[f64]) -> (f64, f64) {
    let intervals = || time_s.windows(2).map(|pair| pair[1] - pair[0]);
    let every = time_s.len().div_ceil(MOST_INTERVALS).max(1);
    (median(intervals().step_by(every)).unwrap_or(0.0), intervals().fold(0.0, f64::max))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows sent every 10 ms and read every 16.7 ms, with one wait of 70 ms and 17 rows lost.
    #[test]
    fn bursts_and_waits_are_removed_and_losses_kept() {
        let mut stamps = Vec::new();
        let mut truth = Vec::new();
        for k in 0..4000usize {
            let sent = 0.01 * (k + if k >= 1500 { 17 } else { 0 }) as f64;
            let polled = (sent * 60.0).ceil() / 60.0;
            let stamp: f64 = if (2500..2507).contains(&k) { 25.24 } else { polled };
            truth.push(sent);
            stamps.push((stamp * 1e3).round() / 1e3);
        }
        let grid = even_grid(&stamps);
        assert_eq!(grid.rows_missing, 17);
        assert!((grid.interval_s - 0.01).abs() < 2e-7, "{grid:?}");
        let worst = grid.time_s.iter().zip(&truth).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(worst < 4e-4, "{worst}");
        assert!(grid.residual_rms_s < 0.007 && grid.residual_max_s > 0.05);
    }
}
