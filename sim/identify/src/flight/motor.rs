//! The estimate of one motor.

use rotorlead_records::{Experiment, Record};
use serde::Serialize;

use super::error::FlightError;
use super::fit::MotorFit;
use super::instrument::{self, InstrumentalEstimate};
use super::series::Series;
use crate::error::IdentifyError;

/// The lag of one motor about the command that it flew at.
#[derive(Clone, Debug, Serialize)]
pub struct MotorEstimate {
    /// Its record.
    pub file: String,
    /// The median of the command while the motor ran, 0..1, at the mean supply.
    pub nominal: f64,
    /// Time constant there, s.
    pub time_constant_s: f64,
    /// Its standard error, s: that of the noise alone, by the Cramer-Rao bound.
    pub time_constant_s_std: f64,
    /// Difference of the logarithm of the time constant between the odd and the even parts of the flight.
    pub halves_difference: f64,
    /// Dead time beyond the hold of the command, the age of the telemetry included, s.
    pub delay_s: f64,
    /// Order of the noise.
    pub noise_order: usize,
    /// RMS of the prediction error, rpm.
    pub error_rpm: f64,
    /// Rows of the log that one report of the ESC lasts.
    pub report_rows: usize,
    /// The time constant by instruments; `None` where they move nothing.
    pub instrumental: Option<InstrumentalEstimate>,
}

/// A motor with its fit.
pub(super) struct Motor {
    pub(super) series: Series,
    fit: MotorFit,
    pub(super) estimate: MotorEstimate,
}

impl Motor {
    /// Fits the motor of a record. The other records of the experiment that have the same times are its vehicle's other motors.
    pub(super) fn fit(experiment: &Experiment, record: &Record) -> Result<Self, IdentifyError> {
        let series = Series::from_record(experiment, record)?;
        let nothing = || FlightError::NoFit { file: record.file.clone() };
        let fit = MotorFit::fit(&series).ok_or_else(nothing)?;
        let halves = fit.halves(&series).ok_or_else(nothing)?;
        let (log, log_std) = fit.log_time_constant(&series, series.center);
        // A loop faster than the log holds each command for its own interval, half of which is in the delay of a straight line.
        let held_s = experiment.command_rate_hz.filter(|_| series.is_sampled).map_or(0.0, |rate_hz| 0.5 / rate_hz);
        let estimate = MotorEstimate {
            file: record.file.clone(),
            nominal: series.center,
            time_constant_s: log.exp(),
            time_constant_s_std: log.exp() * log_std,
            halves_difference: halves[1] - halves[0],
            delay_s: 1e-3 * fit.shape.delay_ms - held_s,
            noise_order: fit.noise.len(),
            error_rpm: fit.error_rpm,
            report_rows: series.report_rows,
            instrumental: instrument::estimate(&series, record, &fit),
        };
        Ok(Self { series, fit, estimate })
    }

    /// Logarithm of the time constant at a level, and its standard error of the noise alone.
    pub(super) fn log_time_constant(&self, level: f64) -> (f64, f64) {
        self.fit.log_time_constant(&self.series, level)
    }

    /// Static gain at a level, rpm per unit of command, and its standard error of the noise alone.
    pub(super) fn gain(&self, level: f64) -> (f64, f64) {
        self.fit.gain(&self.series, level)
    }

    /// Standard deviation of the age of a report at its row, s. Derived: that of a uniform distribution over the interval of reports.
    pub(super) fn report_age_std_s(&self) -> f64 {
        self.series.step_s * self.series.report_rows as f64 / 12.0_f64.sqrt()
    }
}
