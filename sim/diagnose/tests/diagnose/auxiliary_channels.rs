//! The speed and the voltage of records that repeat, where the thrust alone cannot tell.

use rand::SeedableRng as _;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution as _, Normal};
use rotorlead_diagnose::{Column, Diagnosis, Verdict};
use rotorlead_plant::{Actuator, CommandSignal, EscTiming, Law, Model, Start, simulate};
use rotorlead_records::Experiment;

use crate::two_levels::{diagnosed, experiment, motor};

/// Of the noise of a speed, and of a speed at full command.
const NOISE_RPM: f64 = 5.0;
const FULL_RPM: f64 = 9_000.0;

/// With the speed of the rotor in every record, as a counter of revolutions has it: thrust is its square, more or less; and with
/// the voltage of a stiff supply.
fn with_speed(model: &Model, mut experiment: Experiment) -> Experiment {
    let mut random = ChaCha8Rng::seed_from_u64(11);
    let noise = Normal::new(0.0, NOISE_RPM).unwrap();
    for record in &mut experiment.records {
        let mut actuator = Actuator::new(model, Law::LinearAround(record.nominal), EscTiming::default()).unwrap();
        let drive = CommandSignal { time_s: &record.time_s, command: &record.command };
        let trace = simulate(&mut actuator, drive, Start::Rest(record.nominal), &record.time_s).unwrap();
        let rpm = trace.speed.iter().map(|speed| FULL_RPM * speed.sqrt() + noise.sample(&mut random));
        record.rpm = Some(rpm.collect());
        record.voltage_v = Some(record.time_s.iter().map(|_| 16.0 + 1e-3 * noise.sample(&mut random)).collect());
    }
    experiment
}

/// The only effect and its alternatives, in the order of their names.
fn names(found: &Diagnosis) -> Vec<&'static str> {
    assert_eq!((found.verdict, found.effects.len()), (Verdict::Named, 1), "{:?}", found.effects);
    let effect = &found.effects[0];
    let mut names: Vec<&str> = effect.alternatives.iter().chain([&effect.kind]).map(|kind| kind.id).collect();
    names.sort_unstable();
    names
}

/// What a short delay looks like.
const LATE: [&str; 3] = ["moving_average", "second_pole", "transport_delay"];

#[test]
fn the_speed_tells_a_late_command_from_a_slow_sensor() {
    // Frames would hold back each edge of the square waves for another while: that excludes them.
    let late = ("transport_delay", "delay_s", &LATE[2..]);
    let slow = ("second_pole", "time_constant_s", &LATE[..2]);
    for (kind, name, expected) in [late, slow] {
        let hidden = motor(Some((kind, &[(name, 0.002)])));
        let thrust = experiment(&hidden, 5);
        let by_thrust = names(&diagnosed(&thrust, None));
        assert_eq!(by_thrust, LATE, "{kind}: two milliseconds of thrust at 200 rows a second tells none of them");

        let found = diagnosed(&with_speed(&hidden, thrust), None);
        assert_eq!(found.columns, [Column::Speed, Column::Voltage]);
        assert_eq!(names(&found), expected, "{kind}");
    }
}

#[test]
fn a_speed_that_is_nothing_but_noise_tells_nothing() {
    let hidden = motor(Some(("second_pole", &[("time_constant_s", 0.002)])));
    let mut deaf = with_speed(&hidden, experiment(&hidden, 5));
    let noise = Normal::new(6_000.0, 300.0).unwrap();
    let mut random = ChaCha8Rng::seed_from_u64(12);
    for record in &mut deaf.records {
        record.rpm = Some(record.time_s.iter().map(|_| noise.sample(&mut random)).collect());
    }
    assert_eq!(names(&diagnosed(&deaf, None)), LATE);
}
