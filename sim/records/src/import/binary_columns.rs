//! Columns of a binary log, whose places are numbers of samples and not lines of text.

use std::path::Path;

use super::stamps::typical_and_longest;
use super::{ImportError, Timing};
use crate::files::{AcceptedRange, shown};

/// Distance from the even grid, in intervals, up to which rows count as evenly spaced.
const EVEN_WITHIN_INTERVALS: f64 = 1e-3;

/// `values` with `range` put on 0..1. `rows` are their places in the log, for the message.
pub(super) fn normalized(
    file: &Path,
    name: &str,
    rows: &[usize],
    mut values: Vec<f64>,
    (low, high): (f64, f64),
) -> Result<Vec<f64>, ImportError> {
    for (value, &row) in values.iter_mut().zip(rows) {
        if !(low..=high).contains(value) {
            return Err(ImportError::value(
                file,
                format!("`{name}`, sample {}", row + 1),
                format!("{} is outside {low}..{high}", shown(*value)),
                "state the ESC's range where the command is a pulse width; a vector's unit is taken from its name: `command` is \
                 0..1, `command_percent` 0..100, `command_us` a pulse width",
            ));
        }
        *value = (*value - low) / (high - low);
    }
    Ok(values)
}

/// The log's own stamps from zero, which have to increase; the rate where they are even; and what to
/// say of them. At least two stamps.
pub(super) fn zero_based_stamps(
    file: &Path,
    name: &str,
    rows: &[usize],
    mut time_s: Vec<f64>,
) -> Result<(Vec<f64>, Option<f64>, Timing), ImportError> {
    let origin = time_s.first().copied().unwrap_or(0.0);
    time_s.iter_mut().for_each(|t| *t -= origin);
    if let Some(at) = time_s.windows(2).position(|w| w[1] <= w[0]) {
        return Err(ImportError::value(
            file,
            format!("`{name}`, sample {}", rows[at + 1] + 1),
            format!("{}: time does not increase", shown(time_s[at + 1] + origin)),
            "cut the log there and import the parts one by one, or correct the sample",
        ));
    }
    let span = time_s.last().copied().unwrap_or(0.0);
    let interval = span / (time_s.len() - 1) as f64;
    if interval.recip() > AcceptedRange::SAMPLE_RATE_HZ.greatest {
        return Err(ImportError::value(
            file,
            format!("variable `{name}`"),
            format!("rows come every {} s, faster than any logger writes them", shown(interval)),
            "give the times in seconds, as they were stamped",
        ));
    }
    let even = |(k, &t): (usize, &f64)| (t - k as f64 * interval).abs() <= EVEN_WITHIN_INTERVALS * interval;
    let is_even = time_s.iter().enumerate().all(even);
    let (typical, longest) = typical_and_longest(&time_s);
    let timing = Timing {
        method: format!(
            "stamps of the log; intervals of {:.3} ms (median) to {:.3} ms (longest)",
            typical * 1e3,
            longest * 1e3
        ),
        rate_hz: interval.recip(),
        rows_reordered: 0,
        rows_missing: 0,
        residual_rms_s: None,
        residual_max_s: None,
    };
    Ok((time_s, is_even.then(|| interval.recip()), timing))
}
