//! Many logs side by side: how each differs from the others, how a motor changes from month to month, and which stand out.
//!
//! Logs are compared at the commands that they share. With `ln tau` of log `i` at command `j`, the deviation of a log is the mean over
//! `j` of `ln tau_ij - median_i(ln tau_ij)`: a share by which its time constant is longer than usual, whatever the levels are. The same
//! holds of the gain. All that follows are statistics of one such number per log.

mod compare;
mod drift;
mod outlying;
mod ramps;

use rotorlead_plant::Model;

pub use compare::{Comparison, FewLogs, LogFileDeviation, MotorDeviation, compare};
pub use drift::Drift;
pub use outlying::{FEWEST_SCORED, OUTLIER_Z_SCORE};
pub use ramps::{ComparedRamps, FEWEST_RAMPS, RampRanges, compare_ramps};

/// Logs that a command must have for a usual value. Derived: a median of two is one of them, and cannot say which of the two is odd.
pub const FEWEST_LOGS: usize = 3;

/// What is compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FleetParameter {
    /// Seconds.
    TimeConstant,
    /// Newtons or revolutions per minute, per unit of the command.
    Gain,
}

/// One log, identified.
#[derive(Clone, Debug, PartialEq)]
pub struct FleetMember {
    /// Which motor it is of.
    pub motor: String,
    /// Days since any day that all logs share; `None` where nobody knows.
    pub day: Option<f64>,
    /// What was found, by nominal command.
    pub points: Vec<LogFilePoint>,
}

impl FleetMember {
    /// What a model says of a motor.
    #[must_use]
    pub fn new(motor: String, day: Option<f64>, model: &Model) -> Self {
        let with_gain = model.points.iter().filter(|point| point.gain != 0.0);
        let points = with_gain.map(|point| LogFilePoint {
            nominal: point.nominal,
            time_constant_s: point.time_constant_s,
            gain: point.gain,
        });
        Self { motor, day, points: points.collect() }
    }
}

/// A log at one command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LogFilePoint {
    /// From 0 to 1.
    pub nominal: f64,
    /// Above 0.
    pub time_constant_s: f64,
    /// Of any sign but 0.
    pub gain: f64,
}

impl LogFilePoint {
    fn logarithm(&self, quantity: FleetParameter) -> f64 {
        match quantity {
            FleetParameter::TimeConstant => self.time_constant_s.ln(),
            FleetParameter::Gain => self.gain.abs().ln(),
        }
    }
}

/// A share as people say it, of a difference of logarithms: 0.05 is 5 % more.
#[must_use]
pub fn relative_change(logarithm: f64) -> f64 {
    logarithm.exp_m1()
}

#[cfg(test)]
mod tests;
