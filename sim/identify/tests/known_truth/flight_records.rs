//! A simulated flight as an experiment, and its truth.

use flights::flight::{Flight, LOOP_RATE_HZ};
use rotorlead_records::{Excitation, Experiment, Output, Record, Setpoints};

/// The experiment of a flight, with a record for each motor.
pub fn experiment(flight: &Flight) -> Experiment {
    let record = |motor: usize| Record {
        file: format!("motor{}.csv", motor + 1),
        nominal: flight.vehicle.hover,
        excitation: Excitation::Flight,
        period_s: None,
        amplitude: None,
        compensated: false,
        compensator: None,
        role: None,
        time_s: flight.time_s.clone(),
        command: flight.commands[motor].clone(),
        command_log: None,
        thrust_n: None,
        rpm: Some(flight.rpm[motor].clone()),
        esc_command: None,
        voltage_v: flight.voltage_v.clone(),
        current_a: None,
        setpoints: Setpoints {
            roll_rad_s: Some(flight.rates[0].clone()),
            pitch_rad_s: Some(flight.rates[1].clone()),
            yaw_rad_s: Some(flight.rates[2].clone()),
            throttle: Some(flight.throttle.clone()),
        },
    };
    Experiment {
        name: "flight".into(),
        output: Output::Rpm,
        sample_rate_hz: None,
        esc_frame_hz: None,
        command_rate_hz: Some(LOOP_RATE_HZ),
        records: (0..4).map(record).collect(),
    }
}

/// The geometric mean of the motors' time constants at a command, s.
pub fn mean_time_constant_s(flight: &Flight, command: f64) -> f64 {
    let log = |motor: usize| flight.vehicle.time_constant_s(motor, command, flight.mean_voltage_v).ln();
    ((0..4).map(log).sum::<f64>() / 4.0).exp()
}
