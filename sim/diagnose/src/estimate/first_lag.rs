//! The lag to begin with.

use rotorlead_plant::{Actuator, CommandSignal, EscTiming, Lag, OperatingPoint, Start, simulate_response};

use crate::data::dataset::PreparedRecord;

/// Shortest time constant that is tried, seconds. Chosen: below any propeller's; a search goes on from it.
const FROM_S: f64 = 0.004;
/// And longest. Chosen: above any propeller's.
const TO_S: f64 = 4.0;
/// The factor between two. Chosen: 18 lags, of which one is off by a fifth of itself at most, well within what a search finds. Less costs
/// only time.
const FACTOR: f64 = 1.5;

/// The lag with offset that fits a log best, rows independent: good enough to begin a search with.
pub(crate) fn first_lag(record: &PreparedRecord) -> Option<Lag> {
    let log = record.log.as_ref()?;
    let count: f64 = log.scatter.iter().map(|(rows, _)| rows).sum();
    let mean =
        |values: &[f64]| values.iter().zip(&log.scatter).map(|(value, (rows, _))| rows * value).sum::<f64>() / count;
    let mut best: Option<(f64, Lag)> = None;
    let mut time_constant_s = FROM_S;
    while time_constant_s < TO_S {
        let lag = Lag { gain: 1.0, time_constant_s, delay_s: 0.0 };
        let point = OperatingPoint { nominal: record.nominal, lag, response: 0.0 };
        let mut actuator = Actuator::linear(point, EscTiming::default()).ok()?;
        let drive = CommandSignal { time_s: &record.command_s, command: &record.command };
        let unit = simulate_response(&mut actuator, drive, Start::Rest(record.command[0]), &record.time_s).ok()?;
        let (x_mean, y_mean) = (mean(&unit), mean(&record.measured));
        let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
        for (row, (rows, _)) in log.scatter.iter().enumerate() {
            let (x, y) = (unit[row] - x_mean, record.measured[row] - y_mean);
            xx += rows * x * x;
            xy += rows * x * y;
            yy += rows * y * y;
        }
        let squares = yy - xy * xy / xx;
        if xx > 0.0 && xy != 0.0 && best.as_ref().is_none_or(|best| squares < best.0) {
            best = Some((squares, Lag { gain: xy / xx, time_constant_s, delay_s: 0.0 }));
        }
        time_constant_s *= FACTOR;
    }
    best.map(|(_, lag)| lag)
}
