//! What simulators get, and records replayed through their laws.

use std::collections::BTreeMap;

use rotorlead_plant::Effect;
use rotorlead_records::{Record, Role};

use super::*;
use crate::replay::ReplayRecords;

/// Time constants of 30 ms up and 60 ms down, 20 000 rpm at full command.
fn stepped() -> Model {
    let mut stepped = model(Output::Rpm, Some(map(|u| 20_000.0 * u)));
    for point in &mut stepped.points {
        point.time_constant_s = 0.04;
    }
    stepped.time_constant_curve = Some(TimeConstantBand {
        nominal: vec![0.4, 0.6],
        time_constant_s: vec![0.04; 2],
        low_s: vec![0.03; 2],
        high_s: vec![0.05; 2],
        down_over_up: Some(2.0),
    });
    stepped
}

/// Levels of thrust and speed: 8.54858e-6 N/(rad/s)^2.
fn levels() -> Experiment {
    let command: Vec<f64> = (1..=10).map(|level| f64::from(level) / 10.0).collect();
    let thrust_n = command.iter().map(|u| 8.548_58e-6 * (20_000.0 * TAU / 60.0 * u).powi(2)).collect();
    let mut record = testing::record(1.0, None, command.clone(), thrust_n);
    record.excitation = Excitation::Steady;
    record.rpm = Some(command.iter().map(|u| 20_000.0 * u).collect());
    testing::experiment(1.0, vec![record])
}

#[track_caller]
fn value(stack: Stack, model: &Model, name: &str) -> Parameter {
    let found = stack_parameters(stack, model, Some(&levels()), StackOptions::default());
    found
        .parameters
        .iter()
        .find(|parameter| parameter.definition.name == name)
        .unwrap_or_else(|| panic!("{found:?}"))
        .clone()
}

#[test]
fn each_simulator_has_the_motor_in_its_own_units() {
    let stepped = stepped();
    let k = 8.548_58e-6;
    let top_rad_s = 20_000.0 * TAU / 60.0;
    for (stack, name, expected) in [
        (Stack::IsaacLab, "thrust_const_range", k * TAU * TAU),
        (Stack::IsaacLab, "tau_inc_range", 0.03),
        (Stack::IsaacLab, "tau_dec_range", 0.06),
        (Stack::IsaacLab, "thrust_range", k * top_rad_s * top_rad_s),
        (Stack::AerialGym, "motor_thrust_constant", k * TAU * TAU),
        (Stack::AerialGym, "motor_time_constant_increasing", 0.03),
        (Stack::AerialGym, "motor_time_constant_decreasing", 0.06),
        (Stack::AerialGym, "max_thrust", k * top_rad_s * top_rad_s),
        (Stack::Crazyflow, "rotor_dyn_coef[0]", 1.0 / 0.03),
        (Stack::Crazyflow, "rotor_dyn_coef[2]", 1.0 / 0.06),
        (Stack::Crazyflow, "rpm2thrust[2]", k * (TAU / 60.0).powi(2)),
        (Stack::Rotorpy, "tau_m", 0.04),
        (Stack::Rotorpy, "k_eta", k),
        (Stack::Rotorpy, "rotor_speed_max", top_rad_s),
        (Stack::GymPybulletDrones, "kf", k * (TAU / 60.0).powi(2)),
        (Stack::Px4Sih, "SIH_T_TAU", 0.04),
        (Stack::Px4Sih, "SIH_T_MAX", k * top_rad_s * top_rad_s),
        (Stack::Mujoco, "dynprm", 0.04),
        (Stack::Mujoco, "gainprm", k * top_rad_s * top_rad_s),
        (Stack::Flightmare, "motor_tau", 0.04),
        (Stack::Flightmare, "motor_omega_max", top_rad_s),
        (Stack::Flightmare, "thrust_map", k),
    ] {
        near(value(stack, &stepped, name).value / expected, 1.0);
    }
    // The ranges of Isaac Lab are the intervals.
    let up = value(Stack::IsaacLab, &stepped, "tau_inc_range");
    near(up.low.unwrap(), 0.0225);
    near(up.high.unwrap(), 0.0375);
    let rate = value(Stack::Crazyflow, &stepped, "rotor_dyn_coef[0]");
    near(rate.low.unwrap(), 1.0 / 0.0375);
}

#[test]
fn every_definition_names_its_source_and_every_simulator_its_law() {
    for stack in Stack::ALL {
        assert!(!stack.definitions().is_empty());
        assert!(stack.definitions().iter().all(|definition| definition.source.contains('/')), "{stack:?}");
        assert!(stack.steppings().iter().all(|stepping| stepping.step_s > 0.0 && !stepping.name.is_empty()));
    }
}

#[test]
fn without_directions_thrust_or_a_slew_limit_these_are_refused() {
    let bare = model(Output::Rpm, Some(map(|u| 20_000.0 * u)));
    for stack in [Stack::IsaacLab, Stack::AerialGym, Stack::Crazyflow] {
        let found = stack_parameters(stack, &bare, None, StackOptions::default());
        assert_eq!(found.parameters, [], "{stack:?}");
    }
    refuses(Stack::IsaacLab, &bare, "tau_inc_range", &["both directions"]);
    refuses(Stack::IsaacLab, &bare, "max_thrust_rate", &["no slew limit"]);
    refuses(Stack::Mujoco, &bare, "gainprm", &["no thrust is known"]);
    refuses(Stack::Mujoco, &bare, "delay", &["no dead time"]);
}

#[test]
fn a_rate_limit_is_that_of_the_speed_in_rps_per_second() {
    let mut limited = stepped();
    limited.effects.push(Effect {
        kind: "slew_limit".into(),
        parameters: BTreeMap::from([("rate_per_s".into(), 2.0)]),
        std: BTreeMap::from([("rate_per_s".into(), 0.1)]),
    });
    for stack in [Stack::IsaacLab, Stack::AerialGym] {
        let found = value(stack, &limited, "max_thrust_rate");
        // 2 duty/s times 20 000 rpm a duty.
        near(found.value, 40_000.0 / 60.0);
        near(found.high.unwrap() / found.value, 1.0 + 0.05 * 1.959_964);
    }
}

#[test]
fn mujoco_gets_a_dead_time_in_whole_steps() {
    let mut late = stepped();
    for point in &mut late.points {
        point.delay_s = 0.0047;
    }
    near(value(Stack::Mujoco, &late, "delay").value, 0.004);
    assert_eq!(value(Stack::Mujoco, &late, "nsample").value, 2.0);
    let coarse = StackOptions { step_s: Some(0.01), ..StackOptions::default() };
    let found = stack_parameters(Stack::Mujoco, &late, None, coarse);
    assert!(found.refused.iter().any(|refusal| refusal.why.contains("less than half a step of 10.00 ms")), "{found:?}");
}

#[test]
fn a_constant_that_isaac_lab_would_raise_in_silence_is_refused() {
    let mut small = levels();
    for record in &mut small.records {
        for thrust_n in record.thrust_n.as_mut().unwrap() {
            *thrust_n *= 1e-3;
        }
    }
    let found = stack_parameters(Stack::IsaacLab, &stepped(), Some(&small), StackOptions::default());
    assert!(found.refused.iter().any(|refusal| refusal.name == "thrust_const_range"), "{found:?}");
    assert!(found.parameters.iter().all(|parameter| parameter.definition.name != "thrust_const_range"));
}

const ROW_HZ: f64 = 1000.0;

/// Steps between commands of 0.4 and 0.6 with 0.2 s between, `dead_s` later the speed that lags by `up_s` and `down_s`.
fn steps(up_s: f64, down_s: f64, dead_s: f64) -> Experiment {
    let level = |t_s: f64| if (t_s / 0.2 + 1e-9).floor() % 2.0 == 0.0 { 0.4 } else { 0.6 };
    let rows: Vec<f64> = (0..1000).map(|row| f64::from(row) / ROW_HZ).collect();
    let mut speed = 0.4;
    let rpm = rows
        .iter()
        .map(|t_s| {
            let now = 20_000.0 * speed;
            let target = if *t_s < dead_s { 0.4 } else { level(t_s - dead_s) };
            let tau_s = if target > speed { up_s } else { down_s };
            speed += (target - speed) * (1.0 - (-1.0 / ROW_HZ / tau_s).exp());
            now
        })
        .collect();
    let mut record = testing::record(ROW_HZ, None, rows.iter().map(|t_s| level(*t_s)).collect(), Vec::new());
    (record.thrust_n, record.rpm) = (None, Some(rpm));
    Experiment { output: Output::Rpm, ..testing::experiment(ROW_HZ, vec![record]) }
}

#[track_caller]
fn replays(stack: Stack, model: &Model, experiment: &Experiment, step_s: Option<f64>) -> Vec<Replay> {
    let records = ReplayRecords::new(model, experiment).unwrap().expect("it moves its command");
    records.replays(stack, StackOptions { step_s, ..StackOptions::default() }).unwrap()
}

#[test]
fn a_motor_that_obeys_a_simulators_law_is_explained_by_it() {
    let unequal = steps(0.03, 0.06, 0.0);
    // Gazebo's thrust is a step late.
    let late = steps(0.03, 0.06, 0.001);
    for (stack, records, least) in [
        (Stack::Gazebo, &late, 99.99),
        (Stack::IsaacLab, &unequal, 99.9),
        (Stack::AerialGym, &unequal, 99.9),
        (Stack::Crazyflow, &unequal, 98.0),
    ] {
        for replay in replays(stack, &stepped(), records, Some(0.001)) {
            assert!(replay.records[0].fit_percent > least, "{replay:?}");
            assert_eq!(replay.not_held, Vec::<String>::new());
        }
    }
    // One time constant for both directions is not this motor's.
    let [rotorpy] = &replays(Stack::Rotorpy, &stepped(), &unequal, Some(0.001))[..] else { panic!() };
    assert!(rotorpy.records[0].fit_percent < 95.0, "{rotorpy:?}");
    assert_eq!(rotorpy.not_held, ["time constants of 30.0 ms up and 60.0 ms down"]);
    let equal = steps(0.04, 0.04, 0.0);
    for stack in [Stack::Rotorpy, Stack::Flightmare] {
        let [replay] = &replays(stack, &stepped(), &equal, Some(0.001))[..] else { panic!() };
        assert!(replay.records[0].fit_percent > 99.99, "{replay:?}");
        assert!((replay.records[0].model_fit_percent - 100.0).abs() < 0.01, "{replay:?}");
    }
}

#[test]
fn a_simulator_without_a_lag_fits_worst_and_one_with_a_dead_time_best() {
    let mut late = stepped();
    late.time_constant_curve.as_mut().unwrap().down_over_up = None;
    for point in &mut late.points {
        (point.gain, point.delay_s) = (20_000.0, 0.006);
    }
    // Thrust lags in MuJoCo, and speed in RotorPy: where no map says where zero is, they are the same.
    late.static_map = None;
    let records = steps(0.04, 0.04, 0.006);
    let fit = |stack: Stack| {
        let [replay] = &replays(stack, &late, &records, None)[..] else { panic!() };
        (replay.records[0].fit_percent, replay.not_held.clone())
    };
    let (mujoco, rotorpy, pybullet) = (fit(Stack::Mujoco), fit(Stack::Rotorpy), fit(Stack::GymPybulletDrones));
    assert!(mujoco.0 > 99.0 && mujoco.1.is_empty(), "{mujoco:?}");
    assert!(rotorpy.0 < 95.0 && rotorpy.1 == ["a dead time of 6.0 ms"], "{rotorpy:?}");
    assert!(pybullet.0 < rotorpy.0 && pybullet.1.contains(&String::from("the lag itself")), "{pybullet:?}");
}

#[test]
fn a_step_that_is_too_long_diverges_and_that_is_no_fit() {
    let [sih] = &replays(Stack::Px4Sih, &stepped(), &steps(0.04, 0.04, 0.0), Some(0.1))[..] else { panic!() };
    assert_eq!((sih.records.len(), sih.effective_time_constant_s), (0, [None; 2]));
}

#[test]
fn held_out_records_alone_are_replayed_where_there_are_any() {
    let mut both = steps(0.04, 0.04, 0.0);
    both.records.push(Record { file: "held.csv".into(), role: Some(Role::Validate), ..both.records[0].clone() });
    let model = stepped();
    let records = ReplayRecords::new(&model, &both).unwrap().unwrap();
    assert!(records.held_out);
    let replay = &records.replays(Stack::Rotorpy, StackOptions::default()).unwrap()[0];
    assert_eq!(replay.records.iter().map(|record| record.file.as_str()).collect::<Vec<_>>(), ["held.csv"]);
    assert!(ReplayRecords::new(&model, &levels()).unwrap().is_none());
}
