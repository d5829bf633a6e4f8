//! The parts of a record on which the motor runs steadily.

use std::ops::Range;
use std::sync::Arc;

use rotorlead_records::{Output, Record};

use super::plateaus::{self, Plateau, PlateauState, runs, settled_from};
use super::{StepsError, checked_response, clipped_plateaus, step};
use crate::rows::clipping::ClippingLimit;
use crate::rows::readings::Readings;
use crate::rows::spikes;

/// Plateaus in a row between which the motor runs; start-up and stopping are cut off.
#[derive(Clone, Debug)]
pub struct Run {
    /// The response of the whole record, spikes replaced.
    pub clean: Arc<[f64]>,
    /// Which rows of the record are spikes.
    pub spike: Arc<[bool]>,
    /// The readings of a sensor that is slower than the rows; `None` where each row has one of its own.
    pub readings: Option<Arc<Readings>>,
    /// Two that settle, or more, and those between them that are too short to.
    pub plateaus: Vec<Plateau>,
    /// The limits that the response stands on.
    pub(super) limits: Vec<ClippingLimit>,
}

/// All segments of constant command of a record, running or not; `clean` is its response without spikes.
pub fn find_plateaus(record: &Record, output: Output, clean: &[f64]) -> Vec<Plateau> {
    plateaus::find(record, clean, output)
}

impl Run {
    /// The longest run of a record.
    ///
    /// # Errors
    /// As [`Self::all`].
    pub fn longest(record: &Record, output: Output) -> Result<Self, StepsError> {
        let mut runs = Self::all(record, output)?;
        // The first of those that are equally long.
        let longest = (0..runs.len()).rev().max_by_key(|&k| runs[k].plateaus.len()).unwrap_or(0);
        Ok(runs.swap_remove(longest))
    }

    /// All runs of a record, one or more: stops and idling part them.
    ///
    /// # Errors
    /// [`StepsError`] without a response, without a change of the command, or without two plateaus in a row on which
    /// the motor runs steadily.
    pub fn all(record: &Record, output: Output) -> Result<Vec<Self>, StepsError> {
        let response = checked_response(record, output)?;
        // By the command alone, which is quick: most records have no plateaus.
        let (segments, long) = plateaus::count(&record.time_s, &record.command);
        match (segments, long) {
            (0 | 1, _) => return Err(StepsError::ConstantCommand { record: record.file.clone() }),
            (_, 0 | 1) => return Err(StepsError::NoPlateaus { record: record.file.clone(), segments, long }),
            _ => {}
        }
        let (clean, spike) = spikes::without_spikes(response);
        let all = plateaus::find(record, &clean, output);
        if let Some(lowest) = plateaus::below_zero(&all) {
            let (command, response) = (lowest.command, lowest.mean);
            return Err(StepsError::BelowZero { record: record.file.clone(), command, response });
        }
        let (clean, spike): (Arc<[f64]>, Arc<[bool]>) = (clean.into(), spike.into());
        let readings = Readings::find(&record.time_s, response).map(Arc::new);
        let of = |range: Range<usize>| {
            let mut plateaus = all[range].to_vec();
            plateaus[0].rows.start = settled_from(&plateaus[0], &clean)?;
            let limits = clipped_plateaus::mark_clipped_plateaus(&mut plateaus, &clean);
            let (clean, spike, readings) = (clean.clone(), spike.clone(), readings.clone());
            Some(Self { clean, spike, readings, plateaus, limits })
        };
        let found: Vec<Self> = runs(&all).into_iter().filter_map(of).collect();
        if found.is_empty() {
            let of_state = |state| all.iter().filter(|p| p.state == state).count();
            return Err(StepsError::NotRunning {
                record: record.file.clone(),
                long,
                idle: of_state(PlateauState::Idle),
                not_steady: of_state(PlateauState::NotSteady),
            });
        }
        Ok(found)
    }

    /// Whether the motor's own response shows on plateau `k` from its first row on: neither it nor the one before
    /// stands on a limit.
    pub fn is_unclipped(&self, k: usize) -> bool {
        is_unclipped(&self.plateaus, k)
    }

    /// Whether that is so of each row of [`Self::rows`].
    pub fn unclipped_rows(&self) -> Vec<bool> {
        let rows_of = |(k, p): (usize, &Plateau)| std::iter::repeat_n(self.is_unclipped(k), p.rows.len());
        self.plateaus.iter().enumerate().flat_map(rows_of).collect()
    }

    /// Which rows of the record have no reading of their own: spikes, and repeats of the reading before.
    pub fn rows_without_reading(&self) -> Vec<bool> {
        let mut without =
            self.readings.as_ref().map_or_else(|| vec![false; self.spike.len()], |r| r.repeats(self.spike.len()));
        without.iter_mut().zip(&self.spike[..]).for_each(|(without, spike)| *without |= *spike);
        without
    }

    /// Whether each row of the record says nothing of a lag: those without a reading, and what follows a step that a gap of the log
    /// hides, until it has settled. `time_s` are the stamps of the record.
    pub fn rows_without_lag(&self, time_s: &[f64]) -> Vec<bool> {
        let run = std::slice::from_ref(self);
        step::rows_without_lag(self.rows_without_reading(), run, &step::find_steps(time_s, run))
    }

    /// Its rows in the record.
    pub fn rows(&self) -> Range<usize> {
        self.plateaus[0].rows.start..self.plateaus[self.plateaus.len() - 1].rows.end
    }
}

/// [`Run::is_unclipped`] of any plateaus in a row.
pub(super) fn is_unclipped(plateaus: &[Plateau], k: usize) -> bool {
    !plateaus[k].limited && (k == 0 || !plateaus[k - 1].limited)
}
