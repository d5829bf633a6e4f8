use rand::SeedableRng as _;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution as _, Normal};

use super::*;

/// Motors with so many logs each, one in 30 days; `tau_share` of motor, log and noise is put on the time constants.
fn fleet(motors: usize, logs: usize, seed: u64, tau_share: impl Fn(usize, usize) -> f64) -> Vec<FleetMember> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let noise = Normal::new(0.0, 0.02).unwrap();
    let mut all = Vec::new();
    for motor in 0..motors {
        for log in 0..logs {
            let factor = (tau_share(motor, log) + noise.sample(&mut random)).exp();
            let point = |nominal: f64, time_constant_s: f64| LogFilePoint {
                nominal,
                time_constant_s: factor * time_constant_s,
                gain: 10.0,
            };
            all.push(FleetMember {
                motor: format!("M{motor:02}"),
                day: Some(30.0 * log as f64),
                points: vec![point(0.4, 0.12), point(0.5, 0.1), point(0.6, 0.08)],
            });
        }
    }
    all
}

#[test]
fn a_motor_that_is_slower_a_log_that_is_wrong_and_a_drift_are_found_and_nothing_else() {
    let logs = fleet(20, 10, 1, |motor, log| match (motor, log) {
        (3, _) => 0.3,
        (5, 7) => -0.5,
        (8, log) => 0.02 * log as f64,
        _ => 0.0,
    });
    let found = compare(&logs, FleetParameter::TimeConstant).unwrap();
    assert_eq!(found.levels.len(), 3);
    let (nominal, usual) = found.levels[1];
    assert!((nominal - 0.5).abs() < 1e-12 && (usual - 0.1).abs() < 0.002, "{usual}");
    let outlying: Vec<usize> =
        (0..logs.len()).filter(|index| found.logs[*index].is_some_and(|log| log.stands_out())).collect();
    assert_eq!(outlying, [57]);
    let motors = |wanted: fn(&MotorDeviation) -> bool| -> Vec<&str> {
        found.motors.iter().filter(|(_, motor)| wanted(motor)).map(|(name, _)| name.as_str()).collect()
    };
    assert_eq!(motors(|motor| motor.drifts), ["M08"]);
    assert!(motors(MotorDeviation::stands_out).contains(&"M03"));
    let drift = found.motors["M08"].drift.unwrap();
    let truth = relative_change(0.02 * 365.25 / 12.0 / 30.0);
    assert!(drift.interval[0] < truth && truth < drift.interval[1], "{drift:?}");
    let gain = compare(&logs, FleetParameter::Gain).unwrap();
    assert!(gain.logs.iter().all(|log| log.is_some_and(|log| log.score.is_none() && log.deviation == 0.0)));
}

/// Rates of false alarms, and of intervals that hold the truth, over many fleets.
#[test]
fn where_nothing_is_wrong_little_is_said_to_be() {
    let (mut logs_called, mut motors_called, mut fleets_with_drift, mut covered) = (0, 0, 0, 0);
    let (fleets, motors, logs) = (5000, 10, 6);
    for seed in 0..fleets {
        let found = compare(&fleet(motors, logs, 1000 + seed, |_, _| 0.0), FleetParameter::TimeConstant).unwrap();
        logs_called += found.logs.iter().filter(|log| log.is_some_and(|log| log.stands_out())).count();
        motors_called += found.motors.values().filter(|motor| motor.stands_out()).count();
        fleets_with_drift += usize::from(found.motors.values().any(|motor| motor.drifts));
        let holds = |motor: &&MotorDeviation| motor.drift.is_some_and(|d| d.interval[0] < 0.0 && 0.0 < d.interval[1]);
        covered += found.motors.values().filter(holds).count();
    }
    let all = fleets as f64 * motors as f64;
    let [of_logs, of_motors] = [logs_called as f64 / (all * logs as f64), motors_called as f64 / all];
    let [of_fleets, coverage] = [fleets_with_drift as f64 / fleets as f64, covered as f64 / all];
    println!("false: logs {of_logs:.4}, motors {of_motors:.4}, drifts {of_fleets:.3} of fleets; covered {coverage:.3}");
    assert!(of_logs < 0.005 && of_motors < 0.02, "{of_logs} {of_motors}");
    // 5000 fleets at 5 %, and 50 000 intervals at 95 %: within three standard deviations.
    assert!(of_fleets < 0.05 + 3.0 * 0.0031, "{of_fleets}");
    assert!((coverage - 0.95).abs() < 3.0 * 0.001, "{coverage}");
}

#[test]
fn logs_at_different_commands_are_not_compared() {
    let log = |nominal: f64| FleetMember {
        motor: "M".into(),
        day: None,
        points: vec![LogFilePoint { nominal, time_constant_s: 0.1, gain: 1.0 }],
    };
    assert_eq!(compare(&[log(0.3), log(0.4), log(0.5)], FleetParameter::TimeConstant), Err(FewLogs));
    let found = compare(&[log(0.3), log(0.301), log(0.302), log(0.5)], FleetParameter::TimeConstant).unwrap();
    assert_eq!((found.logs[0].map(|log| log.deviation), found.logs[3]), (Some(0.0), None));
    assert_eq!(found.motors["M"].drift, None);
}
