//! Evenly spaced rows and whole periods.

use super::{Record, RecordError};

/// How far, in sample intervals, a row's time may be from where an even spacing has it.
///
/// Stamps that are rounded to a tenth of the interval, or finer, stay within it. A missing row, a
/// whole interval, is far outside.
pub const GRID_TOLERANCE: f64 = 0.05;

/// How far, in samples, the whole periods of a record together may be from a whole number of
/// samples.
///
/// At a line of frequency `f` the periods' ends then miss each other by less than `0.1 f / rate` of
/// a cycle: at a twentieth of the sampling rate, half a percent.
pub const PERIOD_TOLERANCE: f64 = 0.1;

/// The whole periods of a record, from its first row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Periods {
    /// Rows per period.
    pub samples: usize,
    /// How many whole periods there are, 1 or more. Rows after them belong to a part of one.
    pub count: usize,
}

impl Record {
    /// Rows per second, from the straight line through all stamps (least squares), so that their
    /// rounding averages out.
    ///
    /// # Errors
    /// When a row is farther than [`GRID_TOLERANCE`] from an even spacing: the error names it.
    pub fn sample_rate_hz(&self) -> Result<f64, RecordError> {
        if self.time_s.len() < 2 {
            return Err(RecordError::TooFewRows { file: self.file.clone(), rows: self.time_s.len() });
        }
        let grid = Grid::fit(&self.time_s);
        match grid.farthest(&self.time_s) {
            (_, offset_s) if offset_s.abs() <= GRID_TOLERANCE * grid.interval_s => Ok(1.0 / grid.interval_s),
            (row, offset_s) => Err(self.uneven(row, offset_s)),
        }
    }

    /// The whole periods of a record of known period.
    ///
    /// # Errors
    /// Those of [`Record::sample_rate_hz`]; no period; a period that is not a whole number of
    /// samples to within [`PERIOD_TOLERANCE`] over all of them; less than one of them.
    pub fn periods(&self) -> Result<Periods, RecordError> {
        let file = || self.file.clone();
        let period_s = self.period_s.ok_or_else(|| RecordError::NoPeriod { file: file() })?;
        let rate_hz = self.sample_rate_hz()?;
        let exact = period_s * rate_hz;
        let rows = self.time_s.len();
        // A float becomes an integer by saturation: an absurd period is too long, not wrapped.
        let samples = exact.round() as usize;
        let count = rows.checked_div(samples).unwrap_or(0);
        let missed = (exact - exact.round()).abs() * count.max(1) as f64;
        if samples == 0 || missed > PERIOD_TOLERANCE {
            return Err(RecordError::PartialSample { file: file(), period_s, samples: exact, rate_hz });
        }
        if count == 0 {
            return Err(RecordError::PartialPeriod { file: file(), rows, samples_per_period: samples });
        }
        Ok(Periods { samples, count })
    }

    /// Whether the command is the same in all rows: a record from which no dynamics can be learned.
    #[must_use]
    pub fn is_constant(&self) -> bool {
        self.command.windows(2).all(|pair| pair[0] == pair[1])
    }

    /// Which row is to blame: the one after the most uneven interval, where one is uneven by
    /// itself, else the one that is farthest from the even spacing.
    fn uneven(&self, row: usize, offset_s: f64) -> RecordError {
        let file = self.file.clone();
        let intervals: Vec<f64> = self.time_s.windows(2).map(|w| w[1] - w[0]).collect();
        let mut sorted = intervals.clone();
        let (_, &mut typical_s, _) = sorted.select_nth_unstable_by(intervals.len() / 2, f64::total_cmp);
        let (before, interval_s) = farthest(&intervals, |interval| interval - typical_s);
        if (interval_s).abs() > GRID_TOLERANCE * typical_s {
            RecordError::Gap { file, row: before + 2, interval_s: intervals[before], typical_s }
        } else {
            RecordError::Drift { file, row: row + 1, offset_s }
        }
    }
}

/// Even times: row `k` at `start_s + k interval_s`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Grid {
    start_s: f64,
    interval_s: f64,
}

impl Grid {
    /// The grid nearest to `time_s` (two rows or more) in the sense of least squares.
    fn fit(time_s: &[f64]) -> Self {
        let middle = (time_s.len() - 1) as f64 / 2.0;
        let (mut weighted, mut squares) = (0.0, 0.0);
        for (k, time) in time_s.iter().enumerate() {
            let from_middle = k as f64 - middle;
            // Relative to the first stamp: stamps may count from 1970.
            weighted += from_middle * (time - time_s[0]);
            squares += from_middle * from_middle;
        }
        Self::through(time_s, weighted / squares)
    }

    /// The grid of known interval that is nearest to `time_s` (one row or more).
    pub(super) fn through(time_s: &[f64], interval_s: f64) -> Self {
        let late = |(k, time): (usize, &f64)| (time - time_s[0]) - k as f64 * interval_s;
        let mean = time_s.iter().enumerate().map(late).sum::<f64>() / time_s.len() as f64;
        Self { start_s: time_s[0] + mean, interval_s }
    }

    /// Whether every row is on it, within [`GRID_TOLERANCE`].
    pub(super) fn holds(&self, time_s: &[f64]) -> bool {
        self.farthest(time_s).1.abs() <= GRID_TOLERANCE * self.interval_s
    }

    /// The row (from zero) that is farthest from it, and how late it is, seconds.
    fn farthest(&self, time_s: &[f64]) -> (usize, f64) {
        let mut row = 0.0;
        farthest(time_s, |time| {
            let late = (time - self.start_s) - row * self.interval_s;
            row += 1.0;
            late
        })
    }
}

/// The value of greatest magnitude among `map(values)`, and where it is.
fn farthest(values: &[f64], mut map: impl FnMut(f64) -> f64) -> (usize, f64) {
    let mut worst = (0, 0.0_f64);
    for (index, value) in values.iter().enumerate() {
        let mapped = map(*value);
        if mapped.abs() > worst.1.abs() {
            worst = (index, mapped);
        }
    }
    worst
}
