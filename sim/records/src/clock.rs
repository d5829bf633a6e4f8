//! Whether the times of a record are those of a motor's.

use super::{Excitation, Record};
use crate::files::shown;

/// Rows that are usually further apart, in seconds, show no motor: a lag is over in 0.02 to 0.2 s (`docs/ranges.md`)...
pub const SLOWEST_ROWS_S: f64 = 0.5;
/// ...and no logger writes them more densely: the row rate of `docs/ranges.md`, with room for rounded stamps.
const FASTEST_ROWS_S: f64 = 0.9e-6;
/// After so many seconds without a row nothing of what was before shows: the rows behind are another record.
const LONGEST_GAP_S: f64 = 60.0;

/// How far a record's rows are apart, in one go or block by block.
#[derive(Default)]
pub(super) struct Clock {
    rows: usize,
    last_s: f64,
    /// Rows that show no motor, and the first of them.
    slow: (usize, Option<Step>),
    /// Rows that no logger writes, likewise.
    fast: (usize, Option<Step>),
    longest: Option<Step>,
}

/// From one row to the next.
#[derive(Clone, Copy)]
struct Step {
    /// The latter row, counted from one.
    row: usize,
    /// Its time.
    time_s: f64,
    interval_s: f64,
}

/// What the times of a record cannot be.
pub(super) struct WrongClock {
    /// The row that shows it, counted from one.
    pub(super) row: usize,
    pub(super) message: String,
    pub(super) help: String,
}

impl Clock {
    /// Of all rows. Steady points are as far apart as it took to reach them; all other rows follow a motor.
    pub(super) fn from_record(record: &Record) -> Self {
        let mut clock = Self::default();
        if record.excitation != Excitation::Steady {
            clock.add(&record.time_s);
        }
        clock
    }

    /// Takes the next rows.
    pub(super) fn add(&mut self, time_s: &[f64]) {
        for &time_s in time_s {
            self.rows += 1;
            let step = Step { row: self.rows, time_s, interval_s: time_s - self.last_s };
            self.last_s = time_s;
            if step.row == 1 {
                continue;
            }
            if step.interval_s > SLOWEST_ROWS_S {
                self.slow = (self.slow.0 + 1, self.slow.1.or(Some(step)));
            } else if step.interval_s < FASTEST_ROWS_S {
                self.fast = (self.fast.0 + 1, self.fast.1.or(Some(step)));
            }
            if self.longest.is_none_or(|longest| step.interval_s > longest.interval_s) {
                self.longest = Some(step);
            }
        }
    }

    /// What is wrong with the rows so far. The usual distance is the median: half of the rows decide.
    pub(super) fn wrong(&self) -> Option<WrongClock> {
        let intervals = self.rows.saturating_sub(1);
        if let (count, Some(Step { row, interval_s, .. })) = self.slow
            && 2 * count >= intervals
        {
            return Some(WrongClock {
                row,
                message: format!("rows come every {} s, and no motor shows in them", shown(interval_s)),
                help:
                    "give the times in seconds: divide those in milliseconds by 1000, those in microseconds by 1000000"
                        .to_owned(),
            });
        }
        if let (count, Some(Step { row, interval_s, .. })) = self.fast
            && 2 * count > intervals
        {
            return Some(WrongClock {
                row,
                message: format!("rows come every {} s, faster than any logger writes them", shown(interval_s)),
                help: "give the times in seconds, as they were stamped".to_owned(),
            });
        }
        let Step { row, time_s, interval_s } = self.longest.filter(|step| step.interval_s > LONGEST_GAP_S)?;
        Some(WrongClock {
            row,
            message: format!("the clock jumps by {} s, to {}", shown(interval_s), shown(time_s)),
            help: "where the logger paused, make two records of it, up to this row and from it; where its clock was set, correct \
                   the times behind"
                .to_owned(),
        })
    }
}
