//! The time constant of a motor from a flight, in closed loop: the estimator of one motor.
//!
//! In units of the command, `tau(w) dw/dt = v(t - delay) - w`, `y = F(w) + vehicle + noise`: `v` is the command times the slow part of the
//! supply, `ln tau` a parabola in `ln w`, `F` the static map, `vehicle` what the thrust of all motors does to the speed by way of the
//! vehicle and its battery, and `noise` an autoregression whose order has the highest likelihood of samples that it was not fitted to. Any
//! motor `dy/dt = a v - h(y)` is of this kind, with `w = h(y) / a` and `tau = 1 / h'(y)`.
//!
//! All of it is fitted together by the prediction error. The command is known as the ESC got it, so that the fit is consistent in a closed
//! loop where the noise model is rich enough (Ljung, *System Identification*, 2nd ed., chapter 13), and where nothing moves command and
//! noise alike. Gusts do: an estimate by instruments ([`InstrumentalEstimate`]) stands beside the fit, and tells.
//!
//! Assumed are a first-order lag, a dead time that does not change, and a log that repeats no report unseen. No command calls this yet: the
//! standard errors are those of the noise alone, and on simulated flights the time constant was off by up to 3 % where they say 0.5 %.

pub mod error;
mod fit;
mod instrument;
mod noise;
mod response;
mod series;
mod telemetry;
mod vehicle;

pub use instrument::InstrumentalEstimate;

use rotorlead_records::{Experiment, Record};

use crate::error::IdentifyError;
use error::FlightError;
use fit::MotorFit;
use series::Series;

/// The lag of one motor about the command that it flew at.
#[derive(Clone, Debug)]
pub struct MotorEstimate {
    /// The median of the command while the motor ran, 0..1, at the mean supply.
    pub nominal: f64,
    /// Time constant there, s.
    pub time_constant_s: f64,
    /// Its standard error, s: that of the noise alone, by the Cramer-Rao bound.
    pub time_constant_s_std: f64,
    /// Static gain there, rpm per unit of command.
    pub gain: f64,
    /// Its standard error, of the noise alone.
    pub gain_std: f64,
    /// Dead time beyond the hold of the command, the age of the telemetry included, s.
    pub delay_s: f64,
    /// Change of the logarithm of the time constant with that of the command, and its bend.
    pub slope: (f64, f64),
    /// Order of the noise.
    pub noise_order: usize,
    /// RMS of the prediction error, rpm.
    pub error_rpm: f64,
    /// Rows of the log that one report of the ESC lasts.
    pub report_rows: usize,
    /// The time constant by instruments; `None` where they move nothing.
    pub instrumental: Option<InstrumentalEstimate>,
}

/// Estimates the lag of the motor of a `record` of `excitation = "flight"`. The other records of the experiment that have the same times are
/// its vehicle's other motors.
///
/// # Errors
/// [`IdentifyError::NoResponse`] without the experiment's output, [`FlightError::TooShort`] where little of the flight can be used, and
/// [`FlightError::NoFit`] where the search finds no lag.
pub fn estimate_motor(experiment: &Experiment, record: &Record) -> Result<MotorEstimate, IdentifyError> {
    let series = Series::from_record(experiment, record)?;
    let fit = MotorFit::fit(&series).ok_or_else(|| FlightError::NoFit { file: record.file.clone() })?;
    let (log, log_std) = fit.log_time_constant(&series, series.center);
    let (gain, gain_std) = fit.gain(&series, series.center);
    // A loop faster than the log holds each command for its own interval, half of which is in the delay of a straight line.
    let held_s = experiment.command_rate_hz.filter(|_| series.is_sampled).map_or(0.0, |rate_hz| 0.5 / rate_hz);
    Ok(MotorEstimate {
        nominal: series.center,
        time_constant_s: log.exp(),
        time_constant_s_std: log.exp() * log_std,
        gain,
        gain_std,
        delay_s: 1e-3 * fit.shape.delay_ms - held_s,
        slope: (fit.shape.slope, fit.shape.curve),
        noise_order: fit.noise.len(),
        error_rpm: fit.error_rpm,
        report_rows: series.report_rows,
        instrumental: instrument::estimate(&series, record, &fit),
    })
}
