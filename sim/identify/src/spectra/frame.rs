//! Where the periods of a record lie in its rows.

use std::f64::consts::TAU;

use rotorlead_records::Record;

use super::estimate::{Estimated, Periods, estimate};
use super::{Spectrum, SpectrumOptions};
use crate::error::IdentifyError;
use crate::rows::columns::period_rows;

/// Where the whole periods of a record lie.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame {
    pub(super) row_rate_hz: f64,
    pub(super) period_s: f64,
    /// Rows in a period.
    pub(super) length: usize,
    /// Whole periods.
    pub(super) periods: usize,
    /// Rows before the first of them. The rest that makes no period is left out at the start, where the transient is.
    pub(super) rows_left_out: usize,
}

impl Frame {
    /// Of a record of so many rows.
    ///
    /// # Errors
    /// Those of [`period_rows`]; [`IdentifyError::TooShort`] for less than a period.
    pub(super) fn new(record: &Record, row_rate_hz: f64, rows: usize) -> Result<Self, IdentifyError> {
        let (period_s, length) = period_rows(record, row_rate_hz)?;
        let periods = rows / length;
        if periods == 0 {
            return Err(IdentifyError::TooShort { file: record.file.clone(), rows, period_rows: length });
        }
        Ok(Self { row_rate_hz, period_s, length, periods, rows_left_out: rows - periods * length })
    }

    /// Distance of two bins of a period's spectrum.
    pub(super) fn bin_rad_s(&self) -> f64 {
        TAU * self.row_rate_hz / self.length as f64
    }

    /// The spectrum of the record from its periods.
    pub(super) fn spectrum(
        &self,
        periods: &Periods,
        options: &SpectrumOptions,
        file: &str,
    ) -> Result<Spectrum, IdentifyError> {
        let Estimated { lines, unexcited, disturbed, removed, transient, periods_used, noise } =
            estimate(periods, options, file)?;
        Ok(Spectrum {
            file: file.to_owned(),
            row_rate_hz: self.row_rate_hz,
            period_s: self.period_s,
            periods: self.periods,
            periods_used,
            rows_left_out: self.rows_left_out,
            transient,
            noise,
            lines,
            unexcited,
            disturbed,
            removed,
        })
    }
}
