//! The readings of a sensor that is slower than the rows of its log: each stands in several of them.
//!
//! A held response changes only in rows that are a multiple of the rows per reading apart. A coarse sensor without a hold shows the same
//! number twice as well, but changes in any row. So what is counted is the changes that keep the multiples; where a reading repeats the
//! number of the one before, as coarse ones do, it is in the rows between.

use super::gaps::usual_interval_s;

/// Changes of the response that it takes to tell. Chosen: of changes in any row half keep multiples of two, and all of 20 do so once in
/// a million times; fewer are not needed by a log of steps.
const FEWEST_CHANGES: usize = 20;
/// The share of changes that keep the multiples. Chosen: a sensor's clock gives nearly all, and a lost row of the log spoils one.
const REGULAR: f64 = 0.95;

/// What is known of a sensor's readings.
#[derive(Clone, Debug, PartialEq)]
pub struct Readings {
    /// From one reading to the next, on average.
    pub rows_per_reading: f64,
    /// The same in seconds.
    pub interval_s: f64,
    /// The smallest change from a reading to the next, response units.
    pub step: f64,
    /// The row of each reading in which it is new.
    new_rows: Vec<usize>,
}

impl Readings {
    /// The readings of a response; `None` where each row has one of its own, or nobody can tell.
    #[must_use]
    pub fn find(time_s: &[f64], response: &[f64]) -> Option<Self> {
        let changes: Vec<usize> = (1..response.len()).filter(|&row| response[row] != response[row - 1]).collect();
        if changes.len() <= FEWEST_CHANGES {
            return None;
        }
        let (first, last) = (changes[0], changes[changes.len() - 1]);
        let sizes: Vec<f64> = changes.iter().map(|&row| (response[row] - response[row - 1]).abs()).collect();
        let step = sizes.iter().copied().fold(f64::INFINITY, f64::min);
        let runs: Vec<usize> = changes.windows(2).map(|pair| pair[1] - pair[0]).collect();
        // A steady slope of a coarse sensor makes even stairs of one step, and so does a ripple: a run that is as long as the one before
        // tells nothing there. Derived: 1.5 is nearer to one step than to two.
        let is_stair = |k: usize| {
            sizes[k + 1] < 1.5 * step && k > 0 && sizes[k] < 1.5 * step && runs[k].abs_diff(runs[k - 1]) <= 1
        };
        let telling: Vec<usize> = (0..runs.len()).filter(|&k| !is_stair(k)).map(|k| runs[k]).collect();
        let rows_per_reading = rows_per_reading(&telling)?;
        let interval_s = rows_per_reading * usual_interval_s(&time_s[first..=last])?;
        Some(Self {
            rows_per_reading,
            interval_s,
            step,
            new_rows: new_rows(&changes, rows_per_reading, response.len()),
        })
    }

    /// Which of some rows repeat the reading of the row before.
    #[must_use]
    pub fn repeats(&self, rows: usize) -> Vec<bool> {
        let mut repeats = vec![true; rows];
        self.new_rows.iter().for_each(|&row| repeats[row] = false);
        repeats
    }
}

/// The rows per reading that the runs between changes are multiples of.
fn rows_per_reading(runs: &[usize]) -> Option<f64> {
    if runs.len() < FEWEST_CHANGES {
        return None;
    }
    let mut sorted = runs.to_vec();
    sorted.sort_unstable();
    // All but the runs that a lost row spoils are as long as a reading or longer.
    let shortest = sorted[((1.0 - REGULAR) * sorted.len() as f64) as usize];
    let is_regular = |keeps: &dyn Fn(usize) -> bool| {
        runs.iter().filter(|run| keeps(**run)).count() as f64 >= REGULAR * runs.len() as f64
    };
    let whole = (2..=shortest).rev().find(|&rows| is_regular(&|run| run % rows == 0));
    whole.map(|rows| rows as f64).or_else(|| {
        // A sensor with a clock of its own: its readings are in one row more, or one less.
        let mut rows = shortest as f64 + 0.5;
        for most in [1.0, 1.0, 4.0, 16.0, 64.0] {
            let (mut sum, mut squares) = (0.0, 0.0);
            for (&run, readings) in runs.iter().map(|run| (run, (*run as f64 / rows).round())) {
                if (1.0..=most).contains(&readings) {
                    sum += readings * run as f64;
                    squares += readings * readings;
                }
            }
            rows = sum / squares;
        }
        let keeps = |run: usize| {
            let readings = (run as f64 / rows).round().max(1.0);
            (run as f64 - readings * rows).abs() < 1.0
        };
        // Of changes in any row, two in `rows` keep them: so many have to that all do as seldom as of whole numbers of rows.
        let needed = FEWEST_CHANGES as f64 * std::f64::consts::LN_2 / (0.5 * rows).ln();
        (rows > 2.0 && runs.len() as f64 >= needed && is_regular(&keeps)).then_some(rows)
    })
}

/// The rows of new readings: each change, and those between that a reading like the one before has.
fn new_rows(changes: &[usize], rows_per_reading: f64, rows: usize) -> Vec<usize> {
    let before = |row: usize| (row as f64 / rows_per_reading) as usize;
    let first = changes[0];
    let mut new: Vec<usize> =
        (1..=before(first)).rev().map(|k| (first as f64 - k as f64 * rows_per_reading).round() as usize).collect();
    for (k, &row) in changes.iter().enumerate() {
        let end = changes.get(k + 1).copied().unwrap_or(rows);
        let length = (end - row) as f64;
        let readings = (length / rows_per_reading).round().max(1.0);
        // Behind the last change the row of the next is not known.
        let each = if end == rows { rows_per_reading } else { length / readings };
        new.extend((0..readings as usize).map(|j| row + (j as f64 * each).round() as usize).filter(|row| *row < end));
    }
    new
}

/// The mean of a response over the `window_s` before each row, the response straight between its rows and constant before the first.
#[must_use]
pub fn mean_over(time_s: &[f64], response: &[f64], window_s: f64) -> Vec<f64> {
    let mut areas = vec![0.0];
    for (t, y) in time_s.windows(2).zip(response.windows(2)) {
        areas.push(areas[areas.len() - 1] + 0.5 * (t[1] - t[0]) * (y[0] + y[1]));
    }
    let mut next = 0;
    let mut mean = |row: usize| {
        let from = time_s[row] - window_s;
        while time_s[next] <= from {
            next += 1;
        }
        let area = match next.checked_sub(1) {
            None => (from - time_s[0]) * response[0],
            Some(last) => {
                let (span, part) = (time_s[next] - time_s[last], from - time_s[last]);
                let slope = (response[next] - response[last]) / span;
                areas[last] + part * (response[last] + 0.5 * slope * part)
            }
        };
        (areas[row] - area) / window_s
    };
    (0..time_s.len()).map(&mut mean).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows per reading that are found of a response.
    fn found(response: impl Fn(usize) -> f64) -> Option<f64> {
        let response: Vec<f64> = (0..4000).map(response).collect();
        let time_s: Vec<f64> = (0..4000).map(|row| row as f64 * 1e-3).collect();
        Readings::find(&time_s, &response).map(|readings| readings.rows_per_reading)
    }

    /// A motor that moves, with a noise that is no sensor's step.
    fn smooth(row: usize) -> f64 {
        let noise = (row as f64 * 12.9898).sin() * 43_758.545_3;
        (row as f64 * 0.005).sin() + 0.01 * noise.fract()
    }

    fn coarse(value: f64, step: f64) -> f64 {
        (value / step).round() * step
    }

    #[test]
    fn a_held_reading_is_distinguished_from_a_coarse_sensor() {
        assert_eq!(found(smooth), None);
        for held in [2, 4, 12, 100] {
            assert_eq!(found(|row| smooth(row / held * held)), Some(held as f64));
        }
        // 80 readings a second are in 12 or 13 rows each.
        let rows = found(|row| smooth((row as f64 * 0.08) as usize * 12)).unwrap();
        assert!((rows - 12.5).abs() < 0.05, "{rows}");
        for step in [0.005, 0.05, 0.3] {
            assert_eq!(found(|row| coarse(smooth(row), step)), None, "{step}");
            // A slope that a coarse sensor shows as even stairs.
            assert_eq!(found(|row| (row as f64 * 0.004 / step).floor() * step), None, "{step}");
        }
    }

    #[test]
    fn a_held_reading_of_a_coarse_sensor_is_seen() {
        for held in [2, 3, 10, 25] {
            for step in [0.02, 0.1] {
                assert_eq!(found(|row| coarse(smooth(row / held * held), step)), Some(held as f64), "{held}, {step}");
            }
        }
        let rows = found(|row| coarse(smooth((row as f64 * 0.08) as usize * 12), 0.05)).unwrap();
        assert!((rows - 12.5).abs() < 0.05, "{rows}");
    }

    #[test]
    fn readings_that_are_like_the_one_before_are_new_in_their_own_rows() {
        let value = |row: usize| coarse(smooth(row / 10 * 10), 0.1);
        let response: Vec<f64> = (3..4000).map(value).collect();
        let time_s: Vec<f64> = (0..response.len()).map(|row| row as f64 * 1e-3).collect();
        let readings = Readings::find(&time_s, &response).unwrap();
        assert_eq!(readings.new_rows, (7..response.len()).step_by(10).collect::<Vec<usize>>());
        assert_eq!(
            readings.repeats(response.len()).iter().filter(|repeats| !**repeats).count(),
            readings.new_rows.len()
        );
    }

    #[test]
    fn the_mean_of_a_line_is_its_middle() {
        let time_s = [0.0, 0.1, 0.3, 0.4, 0.6];
        let mean = mean_over(&time_s, &time_s, 0.2);
        for (found, right) in mean.iter().zip([0.0, 0.025, 0.2, 0.3, 0.5]) {
            assert!((found - right).abs() < 1e-12, "{mean:?}");
        }
    }
}
