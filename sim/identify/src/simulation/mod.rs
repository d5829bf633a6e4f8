//! A simulated actuator on a recorded command, beside what was recorded.

pub mod periodic;

use rotorlead_plant::{Actuator, CommandSignal, PlantError, Start, simulate_response};
use rotorlead_records::Record;

/// Response at the rows of `actuator` to the recorded `command` (0..1, one value per row of `time_s`, seconds,
/// increasing), put to rest at the command of row `at_rest` (one of the rows) when it gets there.
///
/// A row's command holds until the next row: changes between two rows are not in the record. The ESC's frames count from
/// the first row. Rows before `at_rest` have no meaning.
#[must_use]
pub fn run_actuator(actuator: &mut Actuator, time_s: &[f64], command: &[f64], at_rest: usize) -> Vec<f64> {
    if actuator.has_own_clock() {
        return run_on_own_clock(actuator, time_s, command, at_rest).unwrap_or_default();
    }
    let mut response = Vec::with_capacity(command.len());
    for (row, &level) in command.iter().enumerate() {
        if row == at_rest {
            actuator.settle(level);
            actuator.start_record();
        }
        response.push(actuator.response());
        if let Some(next) = time_s.get(row + 1) {
            actuator.advance(level, next - time_s[0]);
        }
    }
    response
}

/// The same of a record, whose `command` is what the ESC got; by the stamps of the command's changes, where the record has them.
#[must_use]
pub fn run_record(actuator: &mut Actuator, record: &Record, command: &[f64], at_rest: usize) -> Vec<f64> {
    let rows = at_rest..record.time_s.len();
    let Some((time_s, changes)) = record.command_changes(rows.clone()) else {
        return run_actuator(actuator, &record.time_s, command, at_rest);
    };
    let drive = CommandSignal { time_s: &time_s, command: &changes };
    from_rest(actuator, drive, &record.time_s[rows]).map_or_else(|_| Vec::new(), |seen| before_rest(seen, at_rest))
}

/// The rows of a logger with a clock of its own, from rest on; before it there is the level of rest.
fn run_on_own_clock(
    actuator: &mut Actuator,
    time_s: &[f64],
    command: &[f64],
    at_rest: usize,
) -> Result<Vec<f64>, PlantError> {
    let drive = CommandSignal { time_s: &time_s[at_rest..], command: &command[at_rest..] };
    Ok(before_rest(from_rest(actuator, drive, drive.time_s)?, at_rest))
}

fn from_rest(actuator: &mut Actuator, drive: CommandSignal, rows_s: &[f64]) -> Result<Vec<f64>, PlantError> {
    simulate_response(actuator, drive, Start::Rest(drive.command[0]), rows_s)
}

fn before_rest(seen: Vec<f64>, rows: usize) -> Vec<f64> {
    let first = seen.first().copied().unwrap_or_default();
    std::iter::repeat_n(first, rows).chain(seen).collect()
}

/// `model` moved onto `measured` by what a validation may not judge: a static offset and the state
/// from which the record starts, `a + b e^(-t / tau)`, both by least squares.
#[must_use]
pub fn align(time_s: &[f64], measured: &[f64], model: &[f64], time_constant_s: f64) -> Vec<f64> {
    let n = measured.len().min(model.len()).min(time_s.len());
    let decay = |row: usize| (-(time_s[row] - time_s[0]) / time_constant_s).exp();
    let (offset, start) = fit_offset_and_initial_state(time_s, measured, model, time_constant_s);
    (0..n).map(|row| model[row] + offset + start * decay(row)).collect()
}

/// The `a` and `b` of [`align`].
pub fn fit_offset_and_initial_state(
    time_s: &[f64],
    measured: &[f64],
    model: &[f64],
    time_constant_s: f64,
) -> (f64, f64) {
    let n = measured.len().min(model.len()).min(time_s.len());
    let decay = |row: usize| (-(time_s[row] - time_s[0]) / time_constant_s).exp();
    let (mut s1, mut s2, mut r0, mut r1) = (0.0, 0.0, 0.0, 0.0);
    for row in 0..n {
        let (error, e) = (measured[row] - model[row], decay(row));
        s1 += e;
        s2 += e * e;
        r0 += error;
        r1 += error * e;
    }
    let determinant = n as f64 * s2 - s1 * s1;
    // Singular when the record is much shorter than the lag: then only an offset can be identified. Derived: at 1e-9 the decay varies by
    // 3e-5 of itself over the rows.
    if determinant > 1e-9 * n as f64 * s2 {
        ((s2 * r0 - s1 * r1) / determinant, (n as f64 * r1 - s1 * r0) / determinant)
    } else {
        (r0 / n.max(1) as f64, 0.0)
    }
}

/// The `b` of [`align`] when there is no offset.
pub fn fit_initial_state(time_s: &[f64], measured: &[f64], model: &[f64], time_constant_s: f64) -> f64 {
    let (mut power, mut product) = (0.0, 0.0);
    for ((t_s, y), m) in time_s.iter().zip(measured).zip(model) {
        let decay = (-(t_s - time_s[0]) / time_constant_s).exp();
        power += decay * decay;
        product += (y - m) * decay;
    }
    if power > 0.0 { product / power } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use rotorlead_plant::testing::model;
    use rotorlead_plant::{EscTiming, Law};

    use super::*;

    fn rows(count: u32) -> Vec<f64> {
        (0..count).map(|row| f64::from(row) * 1e-3).collect()
    }

    #[test]
    fn a_step_is_the_exponential_after_frame_and_delay() {
        let mut command = vec![0.4; 10];
        command.extend(vec![0.5; 490]);
        let step = |frame_hz: Option<f64>, delay_s: f64, starts_s: f64| {
            let lag = model(&[(0.45, 20.0, 0.1, delay_s)]);
            let timing = EscTiming { frame_hz, frame_phase: 0.0 };
            let mut actuator = Actuator::new(&lag, Law::LinearAround(0.45), timing).unwrap();
            let y = run_actuator(&mut actuator, &rows(500), &command, 0);
            for (row, y) in y.iter().enumerate() {
                let t = (row as f64 * 1e-3 - starts_s).max(0.0);
                let exact = -1.0 + 2.0 * (1.0 - (-t / 0.1).exp());
                assert!((y - exact).abs() < 1e-12, "{row}: {y} {exact}");
            }
        };
        step(None, 0.0, 0.010);
        step(None, 0.0123, 0.0223);
        // The command changes at 10 ms, which is a frame start; with 650 Hz the next is the
        // seventh frame, at 10.77 ms.
        step(Some(600.0), 0.0, 0.010);
        step(Some(650.0), 0.0, 7.0 / 650.0);
    }

    #[test]
    fn rest_may_come_later_than_the_first_row() {
        let lag = model(&[(0.5, 20.0, 0.1, 0.0)]);
        let mut actuator = Actuator::new(&lag, Law::LinearAround(0.5), EscTiming::default()).unwrap();
        let command = [0.0, 0.5, 0.5, 0.6, 0.6];
        let y = run_actuator(&mut actuator, &rows(5), &command, 2);
        assert!(y[1] < -0.09, "the motor runs down from the nominal command: {y:?}");
        assert_eq!(y[2..4], [0.0, 0.0]);
        assert!((y[4] - 2.0 * (1.0 - (-0.01f64).exp())).abs() < 1e-14);
    }

    #[test]
    fn offset_and_initial_state_are_taken_out() {
        let model: Vec<f64> = (0..1000).map(|row| f64::from(row / 300 % 2)).collect();
        let measured: Vec<f64> =
            model.iter().enumerate().map(|(row, m)| m + 3.0 - 0.7 * (-(row as f64) / 50.0).exp()).collect();
        let aligned = align(&rows(1000), &measured, &model, 0.05);
        assert!(aligned.iter().zip(&measured).all(|(a, b)| (a - b).abs() < 1e-9));
    }

    #[test]
    fn nothing_gives_nothing() {
        assert!(align(&[], &[], &[], 1.0).is_empty());
    }
}
