//! Readings that are off at a steady beat: not spikes, which come when they like, but a ripple.

use rotorlead_numerics::sample::median;

/// Beats that are needed to speak of one. Chosen: of random spikes eight intervals are seldom alike.
const LEAST_BEATS: usize = 8;
/// Share of the intervals that is whole beats. Derived: of random intervals less than half is, by [`OFF_BEAT`] to either side of each
/// whole number and more of the shortest.
const ON_THE_BEAT: f64 = 0.8;
/// How far from a whole number of beats an interval may be. Chosen: above the jitter of a row in ten.
const OFF_BEAT: f64 = 0.15;
/// Beats between two of them, at most: the others were lost in what is not off by enough.
const MOST_BEATS: f64 = 4.0;
/// Rows of a beat at the least: with fewer any interval is near a whole number of them.
const LEAST_ROWS: f64 = 4.0;

/// A ripple.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ripple {
    /// How often it comes, hertz.
    pub frequency_hz: f64,
    /// How far its readings are off, in the response's unit: median.
    pub off_by: f64,
}

impl Ripple {
    /// The ripple that the `spike` rows are, `None` where they come at no beat. `clean` is the response without them.
    #[must_use]
    pub fn find(time_s: &[f64], response: &[f64], clean: &[f64], spike: &[bool]) -> Option<Self> {
        let off = |row: usize| response[row] - clean[row];
        let rows: Vec<usize> = (0..spike.len()).filter(|&row| spike[row]).collect();
        let off_by = median(rows.iter().map(|&row| off(row).abs()))?;
        // Those to one side: a ripple may go to both.
        let beats = |is_up: bool| {
            let mut starts = Vec::new();
            let mut before = None;
            for &row in rows.iter().filter(|&&row| (off(row) > 0.0) == is_up) {
                if before.is_none_or(|before| row > before + 1) {
                    starts.push(time_s[row]);
                }
                before = Some(row);
            }
            starts.windows(2).map(|pair| pair[1] - pair[0]).collect::<Vec<f64>>()
        };
        let intervals: Vec<f64> = [beats(true), beats(false)].concat();
        let beat_s = median(intervals.iter().copied())?;
        let row_s = median(time_s.windows(2).map(|pair| pair[1] - pair[0]))?;
        if intervals.len() < LEAST_BEATS || beat_s < LEAST_ROWS * row_s {
            return None;
        }
        let is_on = |interval: &&f64| {
            let count = *interval / beat_s;
            (1.0 - OFF_BEAT..MOST_BEATS + OFF_BEAT).contains(&count) && (count - count.round()).abs() <= OFF_BEAT
        };
        let on: Vec<f64> = intervals.iter().filter(is_on).copied().collect();
        let count: f64 = on.iter().map(|interval| (interval / beat_s).round()).sum();
        (on.len() as f64 >= ON_THE_BEAT * intervals.len() as f64)
            .then(|| Self { frequency_hz: count / on.iter().sum::<f64>(), off_by })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rows::spikes::without_spikes;

    /// A ripple in rows a hundredth of a second apart, of which `is_off` are off by 500 of 8000.
    fn found(is_off: impl Fn(usize) -> bool) -> Option<Ripple> {
        let time_s: Vec<f64> = (0..2000).map(|row| 0.01 * row as f64).collect();
        let noise = |row: usize| ((row * 7919 % 101) as f64 - 50.0) / 5.0;
        let response: Vec<f64> =
            (0..2000).map(|row| 8000.0 + noise(row) + if is_off(row) { 500.0 } else { 0.0 }).collect();
        let (clean, spike) = without_spikes(&response);
        Ripple::find(&time_s, &response, &clean, &spike)
    }

    #[test]
    fn a_steady_beat_is_told_from_spikes() {
        for (rows, hz) in [(13, 7.692), (7, 14.286), (40, 2.5)] {
            let ripple = found(|row| row % rows == 3).unwrap();
            assert!((ripple.frequency_hz - hz).abs() < 0.01, "{rows}: {ripple:?}");
            assert!((ripple.off_by - 500.0).abs() < 20.0, "{ripple:?}");
        }
        // A beat between rows, and one of which each third is missing.
        let ripple = found(|row| (row as f64 / 13.5).fract() < 1.0 / 13.5).unwrap();
        assert!((ripple.frequency_hz - 7.407).abs() < 0.02, "{ripple:?}");
        let ripple = found(|row| row % 13 == 0 && row % 39 != 0).unwrap();
        assert!((ripple.frequency_hz - 7.692).abs() < 0.01, "{ripple:?}");
        // As often, at any time.
        for seed in [12_345_usize, 999, 31_337] {
            let is_off =
                |row: usize| ((row + seed).wrapping_mul(2_654_435_761) % 4_294_967_296 / 1024).is_multiple_of(13);
            assert_eq!(found(is_off), None, "{seed}");
        }
        assert_eq!(found(|row| row == 700), None);
    }
}
