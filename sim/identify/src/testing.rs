//! What the tests of several estimators share.

use num_complex::Complex64;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use rotorlead_records::{Excitation, Experiment, Output, Record};

/// A circular complex normal number with `E |z|^2 = 1`.
pub fn noise(rng: &mut ChaCha8Rng) -> Complex64 {
    let (real, imaginary): (f64, f64) = (StandardNormal.sample(rng), StandardNormal.sample(rng));
    Complex64::new(real, imaginary) * 0.5_f64.sqrt()
}

/// An experiment without holds, rows at `row_rate_hz`.
pub fn experiment(row_rate_hz: f64, records: Vec<Record>) -> Experiment {
    Experiment {
        name: String::from("test"),
        output: Output::ThrustN,
        sample_rate_hz: Some(row_rate_hz),
        esc_frame_hz: None,
        command_rate_hz: None,
        records,
    }
}

/// A record of thrust around a command of 0.5, periodic where it has a period.
pub fn record(row_rate_hz: f64, period_s: Option<f64>, command: Vec<f64>, thrust_n: Vec<f64>) -> Record {
    Record {
        file: String::from("test.csv"),
        nominal: 0.5,
        excitation: if period_s.is_some() { Excitation::Multisine } else { Excitation::Free },
        period_s,
        amplitude: None,
        compensated: false,
        compensator: None,
        role: None,
        time_s: (0..command.len()).map(|row| row as f64 / row_rate_hz).collect(),
        command,
        thrust_n: Some(thrust_n),
        rpm: None,
        command_log: None,
        esc_command: None,
        voltage_v: None,
        current_a: None,
        setpoints: rotorlead_records::Setpoints::default(),
    }
}
