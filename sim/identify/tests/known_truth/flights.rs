//! Motors of simulated flights, whose time constants are known. `examples/flights.rs` flies hundreds of them.

use flights::flight::Flight;
use rotorlead_identify::error::IdentifyError;
use rotorlead_identify::flight::error::FlightError;
use rotorlead_identify::flight::identify_flights;
use rotorlead_identify::identification::{IdentifyOptions, identify};
use rotorlead_records::{Excitation, Role};

use crate::flight_records::{experiment, mean_time_constant_s};

/// Seeds of a log of 500 rows a second, which are fast to fit: one flown gently, one wildly with reports that are held.
#[test]
fn a_time_constant_is_found_in_closed_loop() {
    for seed in [3, 4] {
        let flight = Flight::fly(seed);
        let experiment = experiment(&flight);
        let found = identify(&experiment, &IdentifyOptions::default()).unwrap();
        assert_eq!(found.model.provenance.unwrap().excitation, Some(Excitation::Flight));
        for point in &found.model.points {
            let truth = mean_time_constant_s(&flight, point.nominal);
            let (off, std) = ((point.time_constant_s / truth).ln(), point.time_constant_s_std.unwrap() / truth);
            assert!(off.abs() < 2.5 * std && std < 0.1, "{seed}: {} of {truth}, {off} {std}", point.nominal);
        }
        let center = &found.model.points[found.model.points.len() / 2];
        assert!((center.time_constant_s / mean_time_constant_s(&flight, center.nominal) - 1.0).abs() < 0.05, "{seed}");
        assert!((center.delay_s - flight.vehicle.dead_time_s).abs() < 2.0 * center.delay_s_std.unwrap(), "{seed}");
    }
}

/// One motor alone says the same as all, with a wider interval or as wide a one.
#[test]
fn a_motor_without_the_others_is_fitted_too() {
    let flight = Flight::fly(3);
    let mut experiment = experiment(&flight);
    experiment.records[1].role = Some(Role::Validate);
    experiment.records.truncate(2);
    let found = identify_flights(&experiment).unwrap();
    assert_eq!(found.motors.len(), 1, "a record for validation is not fitted");
    let center = &found.points[found.points.len() / 2];
    let truth = flight.vehicle.time_constant_s(0, center.nominal, flight.mean_voltage_v);
    assert!((center.time_constant_s / truth - 1.0).abs() < 0.05);
}

#[test]
fn a_short_flight_is_refused_with_what_is_needed() {
    let mut vehicle = flights::vehicle::Vehicle::draw(3);
    vehicle.lasts_s = 3.0;
    let error = identify_flights(&experiment(&Flight::with(vehicle, 3))).unwrap_err().to_string();
    assert!(error.contains("motor1.csv") && error.contains("are needed"), "{error}");
}

/// The command of a motor whose speed is another's says nothing of it.
#[test]
fn a_speed_that_is_not_of_the_command_is_refused() {
    let (flight, other) = (Flight::fly(3), Flight::fly(4));
    let mut experiment = experiment(&flight);
    experiment.records.truncate(1);
    let record = &mut experiment.records[0];
    let rows = other.rpm[0].len().min(record.time_s.len());
    for column in [&mut record.time_s, &mut record.command] {
        column.truncate(rows);
    }
    record.setpoints = rotorlead_records::Setpoints::default();
    record.voltage_v = None;
    record.rpm = Some(other.rpm[0][..rows].to_vec());
    let error = identify_flights(&experiment).unwrap_err();
    assert!(
        matches!(error, IdentifyError::Flight(FlightError::NoFit { .. } | FlightError::TooLittleMotion { .. })),
        "{error}"
    );
}
