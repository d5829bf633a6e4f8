//! A record of uneven rows, put on even ones.
//!
//! A script that logs as often as it comes round stamps its rows unevenly. A row's command holds until the next row, so it is
//! known at every moment: an even row gets its mean from that row to the next. The response is known at the rows alone: between
//! them it is the cubic through the four nearest. Both are exact up to a factor of the frequency `w`, with `T` the interval of the
//! log's rows and `h` that of the even ones:
//!
//! ```text
//! command   the mean, held: 1 - (w h)^2 / 12        response   within 3/128 (w T)^4 of one
//! ```
//!
//! Even rows are four times as dense, and what is above [`HIGHEST_OF_UNEVEN_RATE`] is left to nobody: together under 3 %, and that
//! at the top alone.

use rotorlead_records::{Output, Record};

use super::gaps::{rows_after_intervals, usual_interval_s};
use crate::error::IdentifyError;
use crate::rows::columns;

/// Even rows per row of the log. Chosen: the held command is off by 0.5 % at the highest frequency then; twice as dense, by 0.1 %, with the
/// response off by 1.8 % all the same.
const DENSER: usize = 4;
/// Rows that a cubic goes through.
const NODES: usize = 4;
/// An interval this many times the usual one is a gap, in which rows were lost and the command is not known. A script that was kept
/// waiting for a moment held it meanwhile. Chosen: scripts often wait for less, and through more the response is
/// unknown too.
const LONGEST_WAIT: f64 = 10.0;
/// The highest frequency that even rows show as it was, as a share of the log's rows per second. Derived: up to it command and response are
/// off by under 3 % together, by the formulas above; the response's part goes with the fourth power.
pub(crate) const HIGHEST_OF_UNEVEN_RATE: f64 = 0.15;

/// Rows that come after a gap.
pub(crate) fn gaps(times: &[f64]) -> Vec<usize> {
    rows_after_intervals(times, LONGEST_WAIT)
}

/// Even rows, and the rate of the log's own.
pub(crate) struct EvenRows {
    /// Of command and response alone.
    pub(crate) record: Record,
    pub(crate) log_rate_hz: f64,
}

impl EvenRows {
    /// `None` where the rows are even, or are said to be by `stated_hz`.
    ///
    /// # Errors
    /// [`IdentifyError::Gap`], and what is wrong with the columns.
    pub(crate) fn resample(
        record: &Record,
        output: Output,
        stated_hz: Option<f64>,
    ) -> Result<Option<Self>, IdentifyError> {
        let response = columns::response_column(record, output)?;
        if stated_hz.is_some() || columns::row_rate_hz(record, None).is_ok() || record.time_s.len() < NODES {
            return Ok(None);
        }
        let times = &record.time_s;
        if let Some(&row) = gaps(times).first() {
            let (interval_s, usual_s) = (times[row] - times[row - 1], usual_interval_s(times).unwrap_or(0.0));
            return Err(IdentifyError::Gap { file: record.file.clone(), row, interval_s, usual_s });
        }
        let (first_s, rows) = (times[0], times.len());
        let log_rate_hz = (rows - 1) as f64 / (times[rows - 1] - first_s);
        let step_s = 1.0 / (log_rate_hz * DENSER as f64);
        let count = (rows - 1) * DENSER;
        let time_s: Vec<f64> = (0..count).map(|row| first_s + step_s * row as f64).collect();
        let command = held_means(times, &record.command, &time_s, step_s);
        let even = cubic(times, response, &time_s);
        let (thrust_n, rpm) = match output {
            Output::ThrustN => (Some(even), None),
            Output::Rpm => (None, Some(even)),
        };
        let optional = Record {
            command_log: None,
            esc_command: None,
            voltage_v: None,
            current_a: None,
            setpoints: rotorlead_records::Setpoints::default(),
            ..record.clone()
        };
        let record = Record { time_s, command, thrust_n, rpm, ..optional };
        Ok(Some(Self { record, log_rate_hz }))
    }
}

/// Means over `step_s` from each of `from_s` on, of a command that holds from one of `times` to the next.
fn held_means(times: &[f64], command: &[f64], from_s: &[f64], step_s: f64) -> Vec<f64> {
    let mut row = 0;
    let mean = |&from: &f64| {
        let end = from + step_s;
        while times.get(row + 1).is_some_and(|next| *next <= from) {
            row += 1;
        }
        let (mut at, mut sum, mut held) = (from, 0.0, row);
        while at < end {
            let until = times.get(held + 1).map_or(end, |next| next.min(end));
            sum += command[held] * (until - at);
            (at, held) = (until, held + 1);
        }
        sum / step_s
    };
    from_s.iter().map(mean).collect()
}

/// The values at `at_s` of cubics through the four nearest of `times`, four or more; `at_s` increases.
fn cubic(times: &[f64], values: &[f64], at_s: &[f64]) -> Vec<f64> {
    let mut row = 0;
    let value = |&at: &f64| {
        while row + 2 < times.len() && times[row + 1] <= at {
            row += 1;
        }
        let first = row.saturating_sub(1).min(times.len() - NODES);
        let nodes = &times[first..first + NODES];
        let weight = |k: usize| -> f64 {
            (0..NODES)
                .filter(|&other| other != k)
                .map(|other| (at - nodes[other]) / (nodes[k] - nodes[other]))
                .product()
        };
        (0..NODES).map(|k| weight(k) * values[first + k]).sum()
    };
    at_s.iter().map(value).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_held_command_keeps_its_integral_and_a_cubic_itself() {
        let times: Vec<f64> = (0..50).map(|row| 0.01 * f64::from(row) + 0.003 * f64::from(row * 7 % 5)).collect();
        let command: Vec<f64> = (0..50).map(|row| f64::from(row * row % 11)).collect();
        let step_s = 0.0023;
        let at: Vec<f64> = (0..200).map(|row| times[0] + step_s * f64::from(row)).collect();
        let means = held_means(&times, &command, &at, step_s);
        let until = at[199] + step_s;
        let held = times.iter().zip(times.iter().skip(1)).zip(&command);
        let exact: f64 = held.map(|((from, to), u)| u * (to.min(until) - from.min(until))).sum();
        assert!((means.iter().sum::<f64>() * step_s - exact).abs() < 1e-12);
        // Between two rows it is the row's command.
        assert_eq!(means[1], command[0]);

        let curve = |t: f64| 1.0 + 3.0 * t - 40.0 * t * t + 90.0 * t * t * t;
        let values: Vec<f64> = times.iter().map(|t| curve(*t)).collect();
        for (at, found) in at.iter().zip(cubic(&times, &values, &at)) {
            assert!((found - curve(*at)).abs() < 1e-11, "{at}");
        }
    }
}
