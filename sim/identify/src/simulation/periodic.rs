//! The lines that a model with effects gives a periodic record: it is simulated, as effects may have no frequency response.

use rotorlead_fourier as fourier;
use rotorlead_plant::{Actuator, CommandSignal, PlantError, Start, simulate_response};

/// Commands between two rows, at most: more of them are a continuous command to whatever the rows show. Derived: a hold of 1 / 256 row
/// lowers half the row rate by 6e-6.
const MOST_PER_ROW: f64 = 256.0;

/// Periods that run before the record, from rest. Chosen: of the transient `e^(-2 T / tau)` is left, 2e-9 where a period lasts ten time
/// constants and 2 % where it lasts two.
const WARM_UP_PERIODS: u32 = 2;

/// How often there is a row, and a command.
#[derive(Clone, Copy)]
pub(crate) struct Rates {
    pub row_hz: f64,
    /// Of the loop, where it is known; else commands change with the rows.
    pub command_hz: Option<f64>,
}

/// The noise-free response at the rows of `periods` periods, from periodic steady state. The command at the rows of the first
/// period, of `length` rows, is what repeats.
pub(crate) fn simulated_periods(
    mut actuator: Actuator,
    command: &[f64],
    length: usize,
    periods: usize,
    rates: Rates,
) -> Result<Vec<f64>, PlantError> {
    // A loop of a whole multiple of the rows' rate has commands between them: the lines of the period say which.
    let factor = rates.command_hz.map_or(1, |command_hz| commands_per_row(command_hz, rates.row_hz));
    let period = if factor > 1 { upsampled(&command[..length], factor) } else { command[..length].to_vec() };
    let command_hz = rates.row_hz * factor as f64;
    // One period more than there are rows: a slow logger takes its last rows behind the last period.
    let (commands, rows) = (period.len() * (periods + 1), length * periods);
    let time_s: Vec<f64> = (0..commands).map(|tick| tick as f64 / command_hz).collect();
    let command: Vec<f64> = period.iter().copied().cycle().take(commands).collect();
    let rows_s: Vec<f64> = (0..rows).map(|row| row as f64 / rates.row_hz).collect();
    let start = Start::WholePeriods { period_s: length as f64 / rates.row_hz, periods: WARM_UP_PERIODS };
    simulate_response(&mut actuator, CommandSignal { time_s: &time_s, command: &command }, start, &rows_s)
}

/// How many commands there are between two rows: 1 where they change with the rows, and no more than shows.
#[must_use]
pub fn commands_per_row(command_hz: f64, row_hz: f64) -> usize {
    // A number from 1 to MOST_PER_ROW, so the cast is exact.
    (command_hz / row_hz).round().clamp(1.0, MOST_PER_ROW) as usize
}

/// `period` with `factor` values for each of its own, by its Fourier series.
pub fn upsampled(period: &[f64], factor: usize) -> Vec<f64> {
    let forward = fourier::real_forward(period.len());
    let mut lines = forward.make_output_vec();
    let mut fine = vec![0.0; period.len() * factor];
    let inverse = fourier::real_inverse(fine.len());
    let mut padded = inverse.make_input_vec();
    let mut values = period.to_vec();
    // The lengths are those that the plans ask for, so neither can fail.
    if forward.process(&mut values, &mut lines).is_ok() {
        padded[..lines.len()].copy_from_slice(&lines);
        if period.len().is_multiple_of(2) {
            // The line at half the rate stands for itself and its mirror image.
            padded[lines.len() - 1] *= 0.5;
        }
        let _ = inverse.process(&mut padded, &mut fine);
    }
    fine.iter_mut().for_each(|value| *value /= period.len() as f64);
    fine
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;

    #[test]
    fn a_period_is_filled_in_by_its_lines() {
        let at = |turn: f64| 0.5 + 0.1 * (TAU * 3.0 * turn + 0.3).sin() - 0.05 * (TAU * 7.0 * turn).cos();
        for length in [40_usize, 41] {
            let rows: Vec<f64> = (0..length).map(|row| at(row as f64 / length as f64)).collect();
            for (tick, value) in upsampled(&rows, 5).iter().enumerate() {
                assert!((value - at(tick as f64 / (5 * length) as f64)).abs() < 1e-14);
            }
        }
    }
}
