//! Where the chi-square of a log lies.
//!
//! The square of each row's residual over the variance of the noise there is 1 on average where only noise is left. Rows of
//! correlated noise count as fewer.

use crate::assess::locate::{Excess, LogParts, excitation_number};
use crate::data::dataset::{Record, Split};
use crate::data::plateaus::Group;
use crate::likelihood::Likelihood;
use crate::model::hypothesis::Hypothesis;

/// Parts of the time of a record.
const TIMES: f64 = 10.0;
/// Levels are put together to this many ranges.
const LEVELS: f64 = 5.0;

/// What each row leaves: its place, how many rows of the record it is, and the sum of squares of what these leave over noise.
fn rows<'a>(
    likelihood: &'a Likelihood,
    record: &'a Record,
    hypothesis: &Hypothesis,
    split: Split,
) -> Option<Vec<(usize, &'a Group, Excess)>> {
    let plateaus = likelihood.plateaus(record)?;
    let (log, left) = (plateaus.log(), plateaus.left(hypothesis)?);
    let unit = log.rows_per_sample.recip();
    let excess = |row: usize, noise: f64| {
        let (rows, scatter) = log.scatter[row];
        let square = rows * left[row].powi(2) + scatter;
        Excess { sum: unit * square / (noise * noise), expected: unit * rows }
    };
    Some(plateaus.rows(split).map(|(row, group)| (row, group, excess(row, group.noise))).collect())
}

/// What a hypothesis leaves of a log.
pub(crate) fn excess(
    likelihood: &Likelihood,
    record: &Record,
    hypothesis: &Hypothesis,
    split: Split,
) -> Option<Excess> {
    let rows = rows(likelihood, record, hypothesis, split)?;
    let sum = |part: fn(&Excess) -> f64| rows.iter().map(|(_, _, excess)| part(excess)).sum();
    Some(Excess { sum: sum(|excess| excess.sum), expected: sum(|excess| excess.expected) })
}

/// Shares the chi-square of a log out.
pub(crate) fn add(likelihood: &Likelihood, record: &Record, hypothesis: &Hypothesis, parts: &mut LogParts) {
    let Some(rows) = rows(likelihood, record, hypothesis, Split::Train) else { return };
    let Some(log) = &record.log else { return };
    let kind = excitation_number(record.excitation);
    let (begin_s, end_s) = (record.time_s[0], record.time_s[record.time_s.len() - 1]);
    let length_s = end_s - begin_s;
    let commands = || log.groups.iter().map(|group| group.command);
    let (low, high) = (commands().fold(f64::INFINITY, f64::min), commands().fold(f64::NEG_INFINITY, f64::max));
    let bin = |value: f64, low: f64, high: f64, count: f64| {
        let width = (high - low) / count;
        let index = if width > 0.0 { ((value - low) / width).floor().clamp(0.0, count - 1.0) } else { 0.0 };
        (low + index * width, low + (index + 1.0) * width)
    };
    for (row, group, excess) in rows {
        parts.time.add(bin(record.time_s[row] - begin_s, 0.0, length_s, TIMES), excess);
        parts.nominal.add(bin(group.command, low, high, LEVELS), excess);
        parts.excitation.add((kind, kind), excess);
        if group.step != 0.0 {
            parts.direction.add((group.step.signum(), group.step.signum()), excess);
            // Steps of a staircase are alike or much larger: whole hundredths of the command.
            let size = (100.0 * group.step.abs()).round() / 100.0;
            parts.amplitude.add((size, size), excess);
        }
    }
}
