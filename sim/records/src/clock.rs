//! Whether the times of a record are those of a motor's.

use super::{Excitation, Record};
use crate::files::shown;

/// Rows that are usually further apart, in seconds, show no motor...
const SLOWEST_ROWS_S: f64 = 0.5;
/// ...and no logger writes them more densely: the row rate of `docs/ranges.md`, with room for rounded stamps.
const FASTEST_ROWS_S: f64 = 0.9e-6;
/// After so many seconds without a row nothing of what was before shows: the rows behind are another record.
const LONGEST_GAP_S: f64 = 60.0;

/// What the times of a record cannot be.
pub(super) struct WrongClock {
    /// The row that shows it, counted from one.
    pub(super) row: usize,
    pub(super) message: String,
    pub(super) help: String,
}

impl WrongClock {
    /// Steady points are as far apart as it took to reach them; all other rows follow a motor.
    pub(super) fn of(record: &Record) -> Option<Self> {
        if record.excitation == Excitation::Steady {
            return None;
        }
        let mut intervals: Vec<f64> = record.time_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let longest = (0..intervals.len()).max_by(|a, b| intervals[*a].total_cmp(&intervals[*b]))?;
        let (longest_s, middle) = (intervals[longest], intervals.len() / 2);
        let (_, &mut usual_s, _) = intervals.select_nth_unstable_by(middle, f64::total_cmp);
        if usual_s > SLOWEST_ROWS_S {
            return Some(Self {
                row: 2,
                message: format!("rows come every {} s, and no motor shows in them", shown(usual_s)),
                help:
                    "give the times in seconds: divide those in milliseconds by 1000, those in microseconds by 1000000"
                        .to_owned(),
            });
        }
        if usual_s < FASTEST_ROWS_S {
            return Some(Self {
                row: 2,
                message: format!("rows come every {} s, faster than any logger writes them", shown(usual_s)),
                help: "give the times in seconds, as they were stamped".to_owned(),
            });
        }
        (longest_s > LONGEST_GAP_S).then(|| Self {
            row: longest + 2,
            message: format!("the clock jumps by {} s, to {}", shown(longest_s), shown(record.time_s[longest + 1])),
            help: "where the logger paused, make two records of it, up to this row and from it; where its clock was set, correct \
                   the times behind"
                .to_owned(),
        })
    }
}
