//! The zero of a stand's load cell, from the rows in which the motor is at rest.

use super::{ImportError, ImportOptions, Taken};
use crate::experiment::Excitation;

/// Rows whose mean is a zero.
const LEAST_ROWS: usize = 10;
/// Steady points at rest, each of which is a mean already.
const LEAST_POINTS: usize = 1;
/// A rotor has come to rest this long after its command has gone to zero, seconds.
const COMES_TO_REST_S: f64 = 2.0;
/// Share of the greatest thrust from which on a thrust at rest is mentioned.
const SHARE: f64 = 0.01;
/// Standard errors of a mean at rest within which it may be zero.
const ERRORS: f64 = 4.0;

/// Thrust of the motor at rest.
struct Rest {
    rows: usize,
    mean_n: f64,
    /// Standard error of the mean; zero of one row.
    error_n: f64,
}

impl Taken {
    /// Subtracts the mean thrust at rest where that is asked for, and mentions one that is not zero otherwise.
    pub(super) fn tare(&mut self, options: &ImportOptions) -> Result<(), ImportError> {
        let refuse = |problem: String| {
            let needed = "rows at zero command before the run, or after it";
            let remedy = "leave --tare out, or record with the motor at rest for a second before the run";
            Err(ImportError::missing(&self.summary.file, format!(": --tare needs {needed}, and {problem}"), remedy))
        };
        let is_steady = options.excitation.or(self.usual) == Some(Excitation::Steady);
        let Some(thrust_n) = &self.thrust_n else {
            return if options.tare { refuse(String::from("no thrust was taken")) } else { Ok(()) };
        };
        let rest = self.rows_at_rest(is_steady);
        let least = if is_steady { LEAST_POINTS } else { LEAST_ROWS };
        if rest.len() < least {
            return if options.tare { refuse(format!("there are {}", rest.len())) } else { Ok(()) };
        }
        let rest = Rest::from_thrust(rest.iter().map(|row| thrust_n[*row]));
        let most_n = thrust_n.iter().fold(0.0, |most: f64, thrust| most.max((thrust - rest.mean_n).abs()));
        if options.tare {
            self.thrust_n.iter_mut().flatten().for_each(|thrust| *thrust -= rest.mean_n);
            let note =
                format!("{:.4} N subtracted from the thrust: its mean over {} rows at rest", rest.mean_n, rest.rows);
            self.summary.notes.push(note);
        } else if rest.mean_n.abs() > f64::max(SHARE * most_n, ERRORS * rest.error_n) {
            self.summary.notes.push(format!(
                "thrust at rest is {:.4} N, and not zero, over {} rows at zero command: `--tare` subtracts that",
                rest.mean_n, rest.rows
            ));
        }
        Ok(())
    }

    /// The rows before the first command, or else those after the last from when the rotor has come to rest. Each steady point at
    /// zero command is at rest.
    fn rows_at_rest(&self, is_steady: bool) -> Vec<usize> {
        let is_on = |command: &f64| *command > 0.0;
        let rows = 0..self.command.len();
        if is_steady {
            return rows.filter(|row| !is_on(&self.command[*row])).collect();
        }
        let first = self.command.iter().position(is_on).unwrap_or(rows.end);
        if first >= LEAST_ROWS {
            return (0..first).collect();
        }
        let Some(last) = self.command.iter().rposition(is_on) else { return Vec::new() };
        let from_s = self.time_s[last] + COMES_TO_REST_S;
        rows.filter(|row| self.time_s[*row] > from_s).collect()
    }
}

impl Rest {
    fn from_thrust(thrust_n: impl Iterator<Item = f64>) -> Self {
        let values: Vec<f64> = thrust_n.collect();
        let rows = values.len();
        let mean_n = values.iter().sum::<f64>() / rows as f64;
        let squares: f64 = values.iter().map(|value| (value - mean_n).powi(2)).sum();
        let error_n = (squares / rows.saturating_sub(1).max(1) as f64 / rows as f64).sqrt();
        Self { rows, mean_n, error_n }
    }
}
