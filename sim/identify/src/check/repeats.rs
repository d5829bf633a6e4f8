//! A sensor that is slower than the rows, so that each of its readings stands in several of them.

use rotorlead_records::Record;

use super::RecordFault;
use crate::rows::gaps::usual_interval_s;

/// Changes of the response that it takes to tell. Chosen: readings that stand still at random, of which 51 % are regular at most, pass for
/// regular once in 350 times with 20 (19 runs, binomial), and less often with more.
const FEWEST_CHANGES: usize = 20;
/// Rows per reading from which on a sensor is slower than its rows. Derived: with a reading in one row it is as fast.
const LEAST_ROWS: usize = 2;
/// The share of readings that stand in as many rows as the others, give or take one. Chosen: a sensor's clock gives nearly all, readings
/// that stand still at random (geometric) half at most.
const REGULAR: f64 = 0.8;
/// The share of changes by one and the same step from which on it is a coarse sensor: it stands still because it cannot show less.
/// Chosen: a fine sensor changes by its smallest step a few times at most.
const COARSE: f64 = 0.5;

/// Whether readings are repeated: the response changes at regular rows only, and by steps of any size.
pub(super) fn check_repeats(record: &Record, response: &[f64], column: &'static str) -> Option<RecordFault> {
    let changes: Vec<usize> = (1..response.len()).filter(|&row| response[row] != response[row - 1]).collect();
    let (first, last) = (*changes.first()?, *changes.last()?);
    if changes.len() < FEWEST_CHANGES {
        return None;
    }
    let mut runs: Vec<usize> = changes.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let middle = runs.len() / 2;
    let usual = *runs.select_nth_unstable(middle).1;
    // Where two readings in a row are the same by chance they stand in twice as many rows.
    let is_regular = |rows: usize| rows.abs_diff(usual) <= usize::from(usual > 2) || rows == 2 * usual;
    let regular = runs.iter().filter(|rows| is_regular(**rows)).count();
    if usual < LEAST_ROWS || (regular as f64) < REGULAR * runs.len() as f64 {
        return None;
    }
    let step = |row: &usize| (response[*row] - response[row - 1]).abs();
    let smallest = changes.iter().map(step).fold(f64::INFINITY, f64::min);
    // Derived: 1.5 is nearer to one step than to two.
    let coarse = changes.iter().filter(|row| step(row) < 1.5 * smallest).count();
    if coarse as f64 > COARSE * changes.len() as f64 {
        return None;
    }
    let single = runs.iter().filter(|rows| rows.abs_diff(usual) <= 1).count().max(1);
    let rows_in_single: usize = runs.iter().filter(|rows| rows.abs_diff(usual) <= 1).sum();
    let rows_per_reading = rows_in_single as f64 / single as f64;
    let rate_hz = 1.0 / usual_interval_s(&record.time_s[first..=last])?;
    let readings_hz = rate_hz / rows_per_reading;
    Some(RecordFault::Repeats { file: record.file.clone(), column, rows_per_reading, readings_hz })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Readings per second that are found of a response at 1000 rows a second.
    fn found(response: impl Fn(usize) -> f64) -> Option<f64> {
        let response: Vec<f64> = (0..4000).map(response).collect();
        let record = crate::testing::record(1000.0, None, vec![0.5; response.len()], response.clone());
        match check_repeats(&record, &response, "thrust_n") {
            Some(RecordFault::Repeats { readings_hz, .. }) => Some(readings_hz),
            other => other.map(|fault| panic!("{fault}")),
        }
    }

    /// A motor that moves, with a noise that is no sensor's step.
    fn smooth(row: usize) -> f64 {
        let noise = (row as f64 * 12.9898).sin() * 43_758.545_3;
        (row as f64 * 0.005).sin() + 0.01 * noise.fract()
    }

    #[test]
    fn a_held_reading_is_told_from_a_coarse_sensor() {
        assert_eq!(found(smooth), None);
        for held in [2, 4, 12, 100] {
            let readings_hz = found(|row| smooth(row / held * held)).unwrap();
            assert!((readings_hz * held as f64 / 1000.0 - 1.0).abs() < 0.02, "{held}: {readings_hz}");
        }
        // 80 readings a second are in 12 or 13 rows each.
        let readings_hz = found(|row| smooth((row as f64 * 0.08) as usize * 12)).unwrap();
        assert!((readings_hz - 80.0).abs() < 1.0, "{readings_hz}");
        for step in [0.05, 0.3] {
            assert_eq!(found(|row| (smooth(row) / step).round() * step), None, "{step}");
            // A slope that a coarse sensor shows as even stairs.
            assert_eq!(found(|row| (row as f64 * 0.004 / step).floor() * step), None, "{step}");
        }
    }
}
