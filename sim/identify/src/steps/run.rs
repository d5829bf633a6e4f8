//! The part of a record on which the motor runs steadily.

use std::ops::Range;

use rotorlead_records::{Output, Record};

use super::plateaus::{self, Plateau, State, longest_run, settled_from};
use super::{LeftOut, StepsError, checked_response, limits, spikes};
use crate::saturation::Limit;

/// The longest run of plateaus on which the motor runs steadily; start-up and stopping are cut off.
#[derive(Clone, Debug)]
pub struct Run {
    /// The response of the whole record, spikes replaced.
    pub clean: Vec<f64>,
    /// Which rows of the record are spikes.
    pub spike: Vec<bool>,
    /// Two plateaus or more.
    pub plateaus: Vec<Plateau>,
    /// The limits that the response stands on.
    pub(super) limits: Vec<Limit>,
    /// Why it does not begin with the record, or does not end with it.
    pub(super) left_out: LeftOut,
}

/// All segments of constant command of a record, running or not; `clean` is its response without spikes.
pub fn plateaus_of(record: &Record, output: Output, clean: &[f64]) -> Vec<Plateau> {
    plateaus::find(&record.time_s, &record.command, clean, output)
}

impl Run {
    /// The run of a record.
    ///
    /// # Errors
    /// [`StepsError`] without a response, without a change of the command, or without two plateaus in a row on which
    /// the motor runs steadily.
    pub fn of(record: &Record, output: Output) -> Result<Self, StepsError> {
        let response = checked_response(record, output)?;
        let not_running = || StepsError::NotRunning { record: record.file.clone() };
        // By the command alone, which is quick: most records have no plateaus.
        match plateaus::count(&record.time_s, &record.command) {
            (0 | 1, _) => return Err(StepsError::ConstantCommand { record: record.file.clone() }),
            (_, 0 | 1) => return Err(not_running()),
            _ => {}
        }
        let (clean, spike) = spikes::without_spikes(response);
        let all = plateaus::find(&record.time_s, &record.command, &clean, output);
        if let Some(lowest) = plateaus::below_zero(&all) {
            let (command, response) = (lowest.command, lowest.mean);
            return Err(StepsError::BelowZero { record: record.file.clone(), command, response });
        }
        let run = longest_run(&all);
        if run.len() < 2 {
            return Err(not_running());
        }
        let others = all[..run.start].iter().chain(&all[run.end..]);
        let left_out = match others.clone().any(|p| p.state == State::NotAboveZero) {
            true => LeftOut::NotAboveZero,
            false => LeftOut::NotSteady,
        };
        let mut plateaus = all[run].to_vec();
        plateaus[0].rows.start = settled_from(&plateaus[0], &clean).ok_or_else(not_running)?;
        let limits = limits::mark(&mut plateaus, &clean);
        Ok(Self { clean, spike, plateaus, limits, left_out })
    }

    /// Whether the motor's own response shows on plateau `k` from its first row on: neither it nor the one before
    /// stands on a limit.
    pub fn shows(&self, k: usize) -> bool {
        shows(&self.plateaus, k)
    }

    /// Whether that is so of each row of [`Self::rows`].
    pub fn rows_that_show(&self) -> Vec<bool> {
        let rows_of = |(k, p): (usize, &Plateau)| std::iter::repeat_n(self.shows(k), p.rows.len());
        self.plateaus.iter().enumerate().flat_map(rows_of).collect()
    }

    /// Its rows in the record.
    pub fn rows(&self) -> Range<usize> {
        self.plateaus[0].rows.start..self.plateaus[self.plateaus.len() - 1].rows.end
    }
}

/// [`Run::shows`] of any plateaus in a row.
pub(super) fn shows(plateaus: &[Plateau], k: usize) -> bool {
    !plateaus[k].limited && (k == 0 || !plateaus[k - 1].limited)
}
