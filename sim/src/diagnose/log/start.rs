//! The lag to begin with.

use crate::diagnose::trial::Trial;
use crate::plant::{Actuator, Drive, EscTiming, Lag, OperatingPoint, Start, simulate_response};

/// Time constants that are tried, seconds: from, to, and the factor between two.
const FROM_S: f64 = 0.004;
const TO_S: f64 = 4.0;
const FACTOR: f64 = 1.5;

/// The lag with offset that fits a log best, rows independent: good enough to begin a search with.
pub(in crate::diagnose) fn first_lag(trial: &Trial) -> Option<Lag> {
    let log = trial.log.as_ref()?;
    let rows: Vec<usize> = (0..trial.time_s.len()).filter(|&row| log.kept[row]).collect();
    let mean = |values: &[f64]| rows.iter().map(|&row| values[row]).sum::<f64>() / rows.len() as f64;
    let mut best: Option<(f64, Lag)> = None;
    let mut time_constant_s = FROM_S;
    while time_constant_s < TO_S {
        let lag = Lag { gain: 1.0, time_constant_s, delay_s: 0.0 };
        let point = OperatingPoint { nominal: trial.nominal, lag, response: 0.0 };
        let mut actuator = Actuator::linear(point, EscTiming::default()).ok()?;
        let drive = Drive { time_s: &trial.told_s, command: &trial.told };
        let unit = simulate_response(&mut actuator, drive, Start::Rest(trial.told[0]), &trial.time_s).ok()?;
        let (x_mean, y_mean) = (mean(&unit), mean(&trial.measured));
        let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
        for &row in &rows {
            let (x, y) = (unit[row] - x_mean, trial.measured[row] - y_mean);
            xx += x * x;
            xy += x * y;
            yy += y * y;
        }
        let left = yy - xy * xy / xx;
        if xx > 0.0 && xy != 0.0 && best.as_ref().is_none_or(|best| left < best.0) {
            best = Some((left, Lag { gain: xy / xx, time_constant_s, delay_s: 0.0 }));
        }
        time_constant_s *= FACTOR;
    }
    best.map(|(_, lag)| lag)
}
