//! Motors of simulated flights, whose time constants are known.

use flights::flight::{Flight, LOOP_RATE_HZ};
use rotorlead_identify::flight::estimate_motor;
use rotorlead_records::{Excitation, Experiment, Output, Record, Setpoints};

fn experiment(flight: &Flight) -> Experiment {
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

/// Seeds of a log of 500 rows a second, which are fast to fit: one flown gently, one wildly with reports that are held.
#[test]
fn a_time_constant_is_found_in_closed_loop() {
    for seed in [3, 4] {
        let flight = Flight::fly(seed);
        let experiment = experiment(&flight);
        let found = estimate_motor(&experiment, &experiment.records[0]).unwrap();
        let truth = flight.vehicle.time_constant_s(0, found.nominal, flight.mean_voltage_v);
        let off = found.time_constant_s / truth - 1.0;
        assert!(off.abs() < 0.05, "{seed}: {} of {truth}", found.time_constant_s);
        assert!((found.delay_s - flight.vehicle.dead_time_s).abs() < 0.001, "{seed}: {}", found.delay_s);
        assert!(found.instrumental.unwrap().difference.abs() < 0.05, "{seed}");
    }
}

#[test]
fn a_short_flight_is_refused_with_what_is_needed() {
    let mut vehicle = flights::vehicle::Vehicle::draw(3);
    vehicle.lasts_s = 3.0;
    let experiment = experiment(&Flight::with(vehicle, 3));
    let error = estimate_motor(&experiment, &experiment.records[0]).unwrap_err().to_string();
    assert!(error.contains("motor1.csv") && error.contains("are needed"), "{error}");
}
