//! A first-order lag on a recorded command, exactly.
//!
//! Between the instants at which the actuator's input changes, the lag has a closed solution, so
//! there is no integration error. The input changes at the ESC's frame starts (or rows, without
//! frames), where it takes over the recorded command of the row then in force, and `delay_s` later
//! acts. Changes of the command between two rows are not in the record: it is held over the row.

use super::HoldChain;

/// Response at the rows of `gain e^(-s delay) / (time_constant s + 1)` to `command`, the first row
/// standing at a frame start, from rest at the first command. `time_constant_s` is positive,
/// `delay_s` zero or more.
///
/// Returns the deviation from nothing: `gain * command` in the steady state.
#[must_use]
pub fn simulate_first_order(
    command: &[f64],
    holds: &HoldChain,
    gain: f64,
    time_constant_s: f64,
    delay_s: f64,
) -> Vec<f64> {
    let Some((&first, last_row)) = command.first().zip(command.len().checked_sub(1)) else {
        return Vec::new();
    };
    let row_s = 1.0 / holds.row_rate_hz();
    // Without a frame the command is taken over as the rows know it, however fast the loop is.
    let takeover_s = match holds.esc_frame_hz() {
        Some(rate) => 1.0 / rate,
        None => row_s,
    };
    // Row in force at takeover `m`; a millionth of a row absorbs rounding where both coincide.
    let in_force = |m: f64| ((m * takeover_s / row_s + 1e-6).floor() as usize).min(last_row);
    let mut state = gain * first;
    let mut input = state;
    let mut takeover = 0.0;
    let mut now = 0.0;
    let mut response = Vec::with_capacity(command.len());
    for row in 0..command.len() {
        let row_time = row as f64 * row_s;
        loop {
            let change = takeover * takeover_s + delay_s;
            if change >= row_time - 1e-9 * row_s {
                break;
            }
            state = input + (state - input) * (-(change - now) / time_constant_s).exp();
            now = change;
            input = gain * command[in_force(takeover)];
            takeover += 1.0;
        }
        state = input + (state - input) * (-(row_time - now) / time_constant_s).exp();
        now = row_time;
        response.push(state);
    }
    response
}

/// `model` moved onto `measured` by what a validation may not judge: a static offset and the state
/// from which the record starts, `a + b e^(-t / tau)`, both by least squares.
#[must_use]
pub fn align(measured: &[f64], model: &[f64], row_rate_hz: f64, time_constant_s: f64) -> Vec<f64> {
    let n = measured.len().min(model.len());
    let decay = |row: usize| (-(row as f64) / (row_rate_hz * time_constant_s)).exp();
    let (mut s1, mut s2, mut r0, mut r1) = (0.0, 0.0, 0.0, 0.0);
    for row in 0..n {
        let (error, e) = (measured[row] - model[row], decay(row));
        s1 += e;
        s2 += e * e;
        r0 += error;
        r1 += error * e;
    }
    let determinant = n as f64 * s2 - s1 * s1;
    // Singular when the record is much shorter than the lag: then only an offset can be told.
    let (offset, start) = if determinant > 1e-9 * n as f64 * s2 {
        ((s2 * r0 - s1 * r1) / determinant, (n as f64 * r1 - s1 * r0) / determinant)
    } else {
        (r0 / n.max(1) as f64, 0.0)
    };
    (0..n).map(|row| model[row] + offset + start * decay(row)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_is_the_exponential_after_frame_and_delay() {
        let mut command = vec![0.4; 10];
        command.extend(vec![0.5; 490]);
        let step = |holds: &HoldChain, delay_s: f64, starts_s: f64| {
            let y = simulate_first_order(&command, holds, 20.0, 0.1, delay_s);
            for (row, y) in y.iter().enumerate() {
                let t = (row as f64 * 1e-3 - starts_s).max(0.0);
                let exact = 8.0 + 2.0 * (1.0 - (-t / 0.1).exp());
                assert!((y - exact).abs() < 1e-12, "{row}: {y} {exact}");
            }
        };
        let rows = HoldChain::new(1000.0, None, None).unwrap();
        step(&rows, 0.0, 0.010);
        step(&rows, 0.0123, 0.0223);
        // The command changes at 10 ms, which is a frame start; with 650 Hz the next is the
        // seventh frame, at 10.77 ms.
        step(&HoldChain::new(1000.0, Some(5000.0), Some(600.0)).unwrap(), 0.0, 0.010);
        step(&HoldChain::new(1000.0, None, Some(650.0)).unwrap(), 0.0, 7.0 / 650.0);
        step(&HoldChain::new(1000.0, Some(5000.0), None).unwrap(), 0.0, 0.010);
    }

    #[test]
    fn offset_and_initial_state_are_taken_out() {
        let model: Vec<f64> = (0..1000).map(|row| f64::from(row / 300 % 2)).collect();
        let measured: Vec<f64> =
            model.iter().enumerate().map(|(row, m)| m + 3.0 - 0.7 * (-(row as f64) / 50.0).exp()).collect();
        let aligned = align(&measured, &model, 1000.0, 0.05);
        assert!(aligned.iter().zip(&measured).all(|(a, b)| (a - b).abs() < 1e-9));
    }

    #[test]
    fn nothing_gives_nothing() {
        let rows = HoldChain::new(1000.0, None, None).unwrap();
        assert!(simulate_first_order(&[], &rows, 1.0, 1.0, 0.0).is_empty());
        assert!(align(&[], &[], 1000.0, 1.0).is_empty());
    }
}
