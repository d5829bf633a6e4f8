//! The part of a record on which the motor runs steadily.

use std::ops::Range;

use super::plateaus::{self, Plateau, longest_run, settled_from};
use super::{StepsError, checked_response, spikes};
use crate::record::{Output, Record};

/// The longest run of plateaus on which the motor runs steadily; start-up and stopping are cut off.
#[derive(Clone, Debug)]
pub(crate) struct Run {
    /// The response of the whole record, spikes replaced.
    pub(crate) clean: Vec<f64>,
    /// Which rows of the record are spikes.
    pub(crate) spike: Vec<bool>,
    /// Two plateaus or more.
    pub(crate) plateaus: Vec<Plateau>,
}

/// All stretches of constant command of a record, running or not; `clean` is its response without spikes.
pub(crate) fn plateaus_of(record: &Record, output: Output, clean: &[f64]) -> Vec<Plateau> {
    plateaus::find(&record.time_s, &record.command, clean, output)
}

impl Run {
    /// The run of a record.
    ///
    /// # Errors
    /// [`StepsError`] without a response, without a change of the command, or without two plateaus in a row on which
    /// the motor runs steadily.
    pub(crate) fn of(record: &Record, output: Output) -> Result<Self, StepsError> {
        let response = checked_response(record, output)?;
        let not_running = || StepsError::NotRunning { record: record.file.clone() };
        // By the command alone, which is soon told: most records have no plateaus.
        match plateaus::count(&record.time_s, &record.command) {
            (0 | 1, _) => return Err(StepsError::ConstantCommand { record: record.file.clone() }),
            (_, 0 | 1) => return Err(not_running()),
            _ => {}
        }
        let (clean, spike) = spikes::without_spikes(response);
        let all = plateaus::find(&record.time_s, &record.command, &clean, output);
        let run = longest_run(&all);
        if run.len() < 2 {
            return Err(not_running());
        }
        let mut plateaus = all[run].to_vec();
        plateaus[0].rows.start = settled_from(&plateaus[0], &clean).ok_or_else(not_running)?;
        Ok(Self { clean, spike, plateaus })
    }

    /// Its rows in the record.
    pub(crate) fn rows(&self) -> Range<usize> {
        self.plateaus[0].rows.start..self.plateaus[self.plateaus.len() - 1].rows.end
    }
}
