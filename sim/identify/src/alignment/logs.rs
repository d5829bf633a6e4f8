//! The two logs as they are, each on its own clock.

use std::ops::Range;

use super::AlignmentError;
use crate::rows::gaps::{rows_after_gaps, usual_interval_s};

/// What was commanded, on the commanding computer's clock.
#[derive(Clone, Copy, Debug)]
pub struct CommandLog<'a> {
    /// What to call it in errors.
    pub name: &'a str,
    /// Times of its rows in seconds, increasing. The log ends with its last row.
    pub time_s: &'a [f64],
    /// Commands, 0..1; each holds until the next row.
    pub command: &'a [f64],
    /// The response of the other log, where it was measured beside the command too; in any unit, with a first-order hold
    /// between rows.
    pub response: Option<&'a [f64]>,
}

/// What both logs show, on the clock of the command log.
#[derive(Clone, Debug)]
pub(super) struct CommandSignal {
    /// Moved and scaled to -1..1.
    pub(super) values: Vec<f64>,
    pub(super) kind: DriveKind,
}

/// How the response log follows what it shares with the command log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum DriveKind {
    /// A command, which holds from row to row: through a lag.
    Command,
    /// The response itself, measured twice: at once.
    Response,
}

/// What was measured, on the logger's clock.
#[derive(Clone, Copy, Debug)]
pub struct ResponseLog<'a> {
    /// What to call it in errors.
    pub name: &'a str,
    /// Times of its rows in seconds, increasing.
    pub time_s: &'a [f64],
    /// Response at those times, in any unit.
    pub response: &'a [f64],
}

impl CommandLog<'_> {
    pub(super) fn check(&self) -> Result<(), AlignmentError> {
        well_formed(self.name, self.time_s, self.command)?;
        if self.command.windows(2).all(|pair| pair[0] == pair[1]) {
            return Err(AlignmentError::ConstantCommand { log: self.name.into() });
        }
        let Some(response) = self.response else { return Ok(()) };
        well_formed(self.name, self.time_s, response)?;
        if response.windows(2).all(|pair| pair[0] == pair[1]) {
            return Err(AlignmentError::ConstantResponse { log: self.name.into() });
        }
        Ok(())
    }

    /// What it shares with the response log: the response where it has that, else its cause.
    pub(super) fn drive(&self) -> CommandSignal {
        let kind = if self.response.is_some() { DriveKind::Response } else { DriveKind::Command };
        let values = self.response.unwrap_or(self.command);
        let low = values.iter().copied().fold(f64::INFINITY, f64::min);
        let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        CommandSignal { values: values.iter().map(|v| (2.0 * v - low - high) / (high - low)).collect(), kind }
    }

    /// First and last time.
    pub(super) fn span_s(&self) -> (f64, f64) {
        ends(self.time_s)
    }

    /// The command that holds at `time_s`; the first one before the log begins.
    pub(super) fn at(&self, time_s: f64) -> f64 {
        let after = self.time_s.partition_point(|&t| t <= time_s);
        self.command[after.saturating_sub(1)]
    }
}

impl ResponseLog<'_> {
    pub(super) fn check(&self) -> Result<(), AlignmentError> {
        well_formed(self.name, self.time_s, self.response)?;
        if self.response.windows(2).all(|pair| pair[0] == pair[1]) {
            return Err(AlignmentError::ConstantResponse { log: self.name.into() });
        }
        Ok(())
    }

    /// First and last time.
    pub(super) fn span_s(&self) -> (f64, f64) {
        ends(self.time_s)
    }

    /// Median time between rows, seconds; the times increase, so there is one.
    pub(super) fn interval_s(&self) -> f64 {
        usual_interval_s(self.time_s).unwrap_or(f64::INFINITY)
    }

    /// The segments of rows without a gap.
    pub(super) fn runs(&self) -> Vec<Range<usize>> {
        let mut starts = vec![0];
        starts.extend(rows_after_gaps(self.time_s));
        let ends = starts[1..].iter().copied().chain([self.time_s.len()]);
        starts.iter().copied().zip(ends).map(|(start, end)| start..end).collect()
    }
}

/// Two rows or more, as [`well_formed`] has seen to.
fn ends(time_s: &[f64]) -> (f64, f64) {
    (time_s[0], time_s[time_s.len() - 1])
}

fn well_formed(name: &str, time_s: &[f64], values: &[f64]) -> Result<(), AlignmentError> {
    let finite = time_s.iter().chain(values).all(|value| value.is_finite());
    let good = time_s.len() == values.len() && finite && time_s.is_sorted_by(|a, b| a < b);
    match (good, time_s.len()) {
        (false, _) => Err(AlignmentError::Malformed { log: name.into() }),
        (true, rows @ 0..2) => Err(AlignmentError::TooShort { log: name.into(), rows, needed: 2 }),
        (true, _) => Ok(()),
    }
}
