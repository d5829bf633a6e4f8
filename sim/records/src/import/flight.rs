//! Whether a log is of a flight, whose commands answer the motors.
//!
//! In flight a controller moves every motor by what its gyroscopes say, and those by what the motors did: a lag that is fitted to
//! such a record is that of the loop. On a bench one motor runs at a time, or all have the same command. So it is looked at those
//! seconds in which the motor's command moves: when in most of them another motor's command moves too, and not as a straight line
//! of this one, a controller shares its output among them.

use std::path::Path;

use super::{ImportError, ImportOptions};
use crate::experiment::Excitation;

/// Seconds, and rows, that are looked at together: at least as many of both.
const WINDOW_S: f64 = 1.0;
const WINDOW_ROWS: usize = 20;
/// RMS up to which a command stands still: two microseconds of a pulse width from 1000 to 2000.
const STILL: f64 = 0.002;
/// Share of the motor's own movement that another's distance from a straight line of it may have.
const SAME_WAY: f64 = 0.1;

/// Refuses a log in which one of the `others` (of a `kind`: their numbers and commands) moves with the command of `motor`, and in its own way. All
/// commands are 0..1 and of the rows at `time_s`, counted from the first row taken. Nothing is refused where the command is said
/// to be driven by anything, or is not taken.
pub(super) fn refuse(
    file: &Path,
    options: &ImportOptions,
    motor: usize,
    time_s: &[f64],
    command: &[f64],
    kind: &str,
    others: &[(usize, Vec<f64>)],
) -> Result<(), ImportError> {
    if matches!(options.excitation, Some(Excitation::Free | Excitation::Flight)) || options.without_command {
        return Ok(());
    }
    let (from_s, to_s) = options.seconds.unwrap_or((0.0, f64::INFINITY));
    let rows = time_s.partition_point(|t| *t < from_s)..time_s.partition_point(|t| *t < to_s);
    if rows.is_empty() {
        return Ok(());
    }
    let windows = windows(&time_s[rows.clone()], rows.start);
    let moves = others.iter().filter(|(_, other)| has_its_own_way(command, other, &windows)).map(|(number, _)| *number);
    let moves: Vec<String> = moves.map(|number| number.to_string()).collect();
    if moves.is_empty() {
        return Ok(());
    }
    Err(ImportError::Flight { file: file.into(), motor, others: format!("{kind} {}", moves.join(", ")) })
}

/// Rows that are looked at together, as places in the log; `first` is that of the first row of `time_s`.
fn windows(time_s: &[f64], first: usize) -> Vec<std::ops::Range<usize>> {
    let mut windows = Vec::new();
    let mut start = 0;
    for row in 0..time_s.len() {
        if row + 1 - start >= WINDOW_ROWS && time_s[row] - time_s[start] >= WINDOW_S {
            windows.push(first + start..first + row + 1);
            start = row + 1;
        }
    }
    // A short log is one.
    if windows.is_empty() && time_s.len() >= WINDOW_ROWS {
        windows.push(first..first + time_s.len());
    }
    windows
}

fn has_its_own_way(command: &[f64], other: &[f64], windows: &[std::ops::Range<usize>]) -> bool {
    let (mut moving, mut own) = (0, 0);
    for window in windows {
        if let Some(is_own) = is_own_in(&command[window.clone()], &other[window.clone()]) {
            moving += 1;
            own += u32::from(is_own);
        }
    }
    2 * own > moving
}

/// Whether `other` moves, off a straight line of `command`; `None` where that stands still or one of the two is not known.
fn is_own_in(command: &[f64], other: &[f64]) -> Option<bool> {
    let count = command.len() as f64;
    let mean = |values: &[f64]| values.iter().sum::<f64>() / count;
    let (command_mean, other_mean) = (mean(command), mean(other));
    let (mut square, mut product, mut other_square) = (0.0, 0.0, 0.0);
    for (u, v) in command.iter().zip(other) {
        let (u, v) = (u - command_mean, v - other_mean);
        square += u * u / count;
        product += u * v / count;
        other_square += v * v / count;
    }
    let is_moving = square.sqrt() > STILL && other_square.is_finite();
    let off_line = (other_square - product * product / square).max(0.0).sqrt();
    is_moving.then(|| off_line > f64::max(STILL, SAME_WAY * square.sqrt()))
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROWS: usize = 3000;

    fn refused(time_s: &[f64], command: &[f64], other: Vec<f64>, options: &ImportOptions) -> bool {
        refuse(Path::new("log"), options, 1, time_s, command, "motor", &[(2, other)]).is_err()
    }

    #[test]
    fn a_flight_is_refused_and_a_bench_run_is_not() {
        let time_s: Vec<f64> = (0..ROWS).map(|row| 0.01 * row as f64).collect();
        let of_time = |command: fn(f64) -> f64| time_s.iter().map(|t| command(*t)).collect::<Vec<_>>();
        let motor = of_time(|t| 0.4 + 0.05 * (7.0 * t).sin() + 0.02 * (31.0 * t).sin());
        let options = ImportOptions::default();
        let is_refused = |other: Vec<f64>| refused(&time_s, &motor, other, &options);
        // What a roll takes from one it gives to the other, on the same throttle.
        assert!(is_refused(of_time(|t| 0.4 + 0.05 * (7.0 * t).sin() - 0.02 * (31.0 * t).sin())));
        // At rest, the same command, or the same from another trim.
        for other in [vec![0.0; ROWS], motor.clone(), motor.iter().map(|u| 0.9 * u + 0.03).collect()] {
            assert!(!is_refused(other));
        }
        // One motor after the other.
        let staircase = of_time(|t| if t < 15.0 { 0.2 + 0.1 * (t / 3.0).floor() } else { 0.0 });
        let next = of_time(|t| if t < 15.0 { 0.0 } else { 0.2 + 0.1 * ((t - 15.0) / 3.0).floor() });
        assert!(!refused(&time_s, &staircase, next, &options));
    }

    #[test]
    fn the_part_that_is_taken_counts_and_a_command_of_anything_passes() {
        let time_s: Vec<f64> = (0..ROWS).map(|row| 0.01 * row as f64).collect();
        let motor: Vec<f64> = time_s.iter().map(|t| 0.4 + 0.05 * (7.0 * t).sin()).collect();
        // It stands still for 10 s, and then has its own way.
        let other: Vec<f64> =
            time_s.iter().map(|t| if *t < 10.0 { 0.0 } else { 0.4 + 0.05 * (9.0 * t).sin() }).collect();
        let bench = ImportOptions { seconds: Some((0.0, 10.0)), ..ImportOptions::default() };
        let free = ImportOptions { excitation: Some(Excitation::Free), ..ImportOptions::default() };
        let apart = ImportOptions { without_command: true, ..ImportOptions::default() };
        assert!(refused(&time_s, &motor, other.clone(), &ImportOptions::default()));
        let flight = ImportOptions { excitation: Some(Excitation::Flight), ..ImportOptions::default() };
        for options in [bench, free, flight, apart] {
            assert!(!refused(&time_s, &motor, other.clone(), &options), "{options:?}");
        }
    }
}
