use rotorlead_diagnose::{Options, diagnose};
use rotorlead_identify::identification::{IdentifyOptions, identify};
use rotorlead_plant::bench::{Plan, run};
use rotorlead_records::Role;

use super::*;

const MOTOR: &str = "format = 1\n\
    [[point]]\nnominal = 0.4\ngain = 10.0\ntime_constant_s = 0.1\n\
    [[point]]\nnominal = 0.6\ngain = 13.0\ntime_constant_s = 0.07\n";

/// The paper's experiment on a motor, with these lines more in its model.
fn stand(more: &str) -> Experiment {
    let motor: Model = toml::from_str(&format!("{MOTOR}{more}")).unwrap();
    let plan = Plan { loop_rate_hz: 200, sample_rate_hz: 200, esc_frame_hz: None, ..Plan::paper(&motor) };
    run(&plan, &motor, None, &|_| ()).unwrap()
}

fn judged(experiment: &Experiment) -> Judgement {
    let model = identify(experiment, &IdentifyOptions::default()).unwrap().model;
    assess(experiment, &model, AssessmentContext::default()).judgement
}

fn effect(kind: &str, parameters: &str) -> String {
    format!("[[effect]]\nkind = \"{kind}\"\nparameters = {{ {parameters} }}\n")
}

#[test]
fn a_lag_on_held_out_records_is_ready() {
    let judgement = judged(&stand(""));
    assert_eq!(judgement, Judgement { state: Readiness::Ready, limits: Vec::new(), in_doubt: false });
}

#[test]
fn a_ramp_of_the_esc_is_named_and_no_lag() {
    let judgement = judged(&stand(&effect("slew_limit", "rate_per_s = 0.6")));
    assert_eq!(judgement.state, Readiness::NotALag);
    assert!(judgement.limits[0].contains("ramp its command, by 0.60 of the range"), "{judgement:?}");
}

#[test]
fn what_is_far_from_a_lag_is_none_and_what_is_close_has_a_limit() {
    for (participation, word) in [(0.5, Readiness::NotALag), (0.02, Readiness::ReadyWithinLimits)] {
        let resonance = format!("participation = {participation}, frequency_hz = 8.0, damping = 0.05");
        let judgement = judged(&stand(&effect("stand_resonance", &resonance)));
        assert_eq!(judgement.state, word, "{judgement:?}");
        assert!(judgement.limits[0].starts_with("the lag misses"), "{judgement:?}");
    }
}

#[test]
fn what_a_diagnosis_found_is_said_in_place_of_asking_it() {
    let experiment = stand(&effect("slew_limit", "rate_per_s = 0.6"));
    let model = identify(&experiment, &IdentifyOptions::default()).unwrap().model;
    let before = assess(&experiment, &model, AssessmentContext::default());
    let advice = format!("misses: {}; or see `rotorlead diagnose`", remedy("slew_limit"));
    assert!(before.judgement.limits[0].ends_with(&advice), "{before:?}");
    let catalog = Catalog::standard();
    let mut found = diagnose(&experiment, &Options { model: None, catalog: &catalog, progress: &|| () }).unwrap();
    let judged = |found: &Diagnosis| {
        assess(
            &experiment,
            &model,
            AssessmentContext { diagnosis: Some((found, "the diagnosis is said")), ..AssessmentContext::default() },
        )
        .judgement
    };
    let after = judged(&found);
    assert!(after.limits[0].contains("by 0.60 of the range"), "{after:?}");
    assert!(after.limits[0].ends_with("misses; the diagnosis is said"), "{after:?}");
    assert_eq!((after.state, &after.limits[1..]), (before.judgement.state, &before.judgement.limits[1..]));
    // One that explains little is not what the lag misses.
    let explained = found.gap;
    found.gap.after = 0.9 * found.gap.before;
    assert!(judged(&found).limits[0].starts_with("the lag misses"));
    found.gap = explained;
    // No ramp is looked for once more where a diagnosis has found none.
    found.effects.clear();
    assert!(judged(&found).limits[0].starts_with("the lag misses"));
}

#[test]
fn without_held_out_records_or_a_second_level_nothing_is_ready() {
    let whole = stand("");
    let mut fitted = whole.clone();
    fitted.records.retain(|record| record.role == Some(Role::Fit));
    let mut one_level = whole;
    one_level.records.retain(|record| record.nominal < 0.5);
    for (experiment, part) in [(fitted, "no record was held out"), (one_level, "u_nom 0.4 alone")] {
        let judgement = judged(&experiment);
        assert_eq!(judgement.state, Readiness::MeasureAgain);
        assert!(judgement.limits.iter().any(|reason| reason.contains(part)), "{judgement:?}");
    }
}

#[test]
fn what_cannot_be_compared_is_said() {
    let experiment = stand("");
    let model = identify(&experiment, &IdentifyOptions::default()).unwrap().model;
    let judged = |model: &Model, known| assess(&experiment, model, known).judgement;
    let long = judged(&model, AssessmentContext { long: true, ..AssessmentContext::default() });
    assert!(long.state == Readiness::MeasureAgain && long.limits[0].contains("too long"), "{long:?}");
    let all_long = Experiment { records: Vec::new(), ..experiment.clone() };
    let judgement =
        assess(&all_long, &model, AssessmentContext { long: true, ..AssessmentContext::default() }).judgement;
    assert!(judgement.limits.len() == 1 && judgement.limits[0].contains("too long"), "{judgement:?}");
    let stand = judged(&model, AssessmentContext { stand: true, ..AssessmentContext::default() });
    assert!(
        stand.state == Readiness::ReadyWithinLimits && stand.limits[0].contains("a stand was divided out"),
        "{stand:?}"
    );
    let unknown = judged(&Model { provenance: None, ..model.clone() }, AssessmentContext::default());
    assert!(unknown.limits[0].contains("does not say what it was fitted to"), "{unknown:?}");
}

#[test]
fn a_model_that_has_the_ramp_is_no_lag_that_lacks_it() {
    let experiment = stand(&effect("slew_limit", "rate_per_s = 0.6"));
    let with: Model = toml::from_str(&format!("{MOTOR}{}", effect("slew_limit", "rate_per_s = 0.7"))).unwrap();
    let judgement = assess(&experiment, &with, AssessmentContext::default()).judgement;
    assert!(!judgement.limits.iter().any(|reason| reason.contains("ramp its command")), "{judgement:?}");
}

#[test]
fn a_dead_time_that_takes_the_gain_is_a_limit() {
    let late = MOTOR.replace("time_constant_s", "delay_s = 0.05\ntime_constant_s");
    let motor: Model = toml::from_str(&late).unwrap();
    let plan = Plan { loop_rate_hz: 200, sample_rate_hz: 200, esc_frame_hz: None, ..Plan::paper(&motor) };
    let judgement = judged(&run(&plan, &motor, None, &|_| ()).unwrap());
    assert_eq!(judgement.state, Readiness::ReadyWithinLimits, "{judgement:?}");
    let reason = &judgement.limits[0];
    assert!(reason.starts_with("a dead time of") && reason.contains(remedy("transport_delay")), "{reason}");
}

#[test]
fn a_model_that_is_compared_with_nothing_is_to_be_measured_again() {
    let mut other = stand("");
    other.records.iter_mut().for_each(|record| record.nominal = 0.9);
    let model: Model = toml::from_str(MOTOR).unwrap();
    let Assessment { judgement, records, .. } = assess(&other, &model, AssessmentContext::default());
    assert!(records.is_err() && judgement.state == Readiness::MeasureAgain, "{judgement:?}");
    let no_lag = Model { points: Vec::new(), ..model };
    assert!(assess(&other, &no_lag, AssessmentContext::default()).judgement.limits[0].contains("static map alone"));
}

#[test]
fn a_sensor_that_repeats_its_readings_is_a_limit() {
    let mut experiment = stand("");
    for record in &mut experiment.records {
        let thrust_n = record.thrust_n.as_mut().unwrap();
        (0..thrust_n.len()).for_each(|row| thrust_n[row] = thrust_n[row / 4 * 4]);
    }
    let judgement = judged(&experiment);
    assert_ne!(judgement.state, Readiness::Ready, "{judgement:?}");
    assert!(judgement.limits.iter().any(|limit| limit.contains("50 readings a second")), "{judgement:?}");
}

/// A staircase of a motor of 50 ms, whose thrust, the square of its speed, passes a filter of `filter_s`.
fn staircase(filter_s: f64) -> Experiment {
    const ROWS_PER_S: f64 = 1000.0;
    let levels = [0.3, 0.45, 0.6, 0.45, 0.3];
    let noise = |row: usize| ((row as f64 * 12.9898).sin() * 43_758.545_3).fract() - 0.5;
    let command: Vec<f64> = levels.iter().flat_map(|level| vec![*level; 1000]).collect();
    let follow = |input: &[f64], time_constant_s: f64| -> Vec<f64> {
        let mut state = input[0];
        let share = (1.0 / (ROWS_PER_S * time_constant_s)).min(1.0);
        input
            .iter()
            .map(|value| {
                state += share * (value - state);
                state
            })
            .collect()
    };
    let speed = follow(&command, 0.05);
    let square: Vec<f64> = speed.iter().map(|speed| speed * speed).collect();
    let thrust = follow(&square, filter_s);
    let mut experiment = stand("");
    let mut record = experiment.records.swap_remove(0);
    record.file = "stairs.csv".to_owned();
    record.excitation = rotorlead_records::Excitation::Staircase;
    (record.period_s, record.amplitude, record.role, record.nominal) = (None, None, None, 0.45);
    record.time_s = (0..command.len()).map(|row| row as f64 / ROWS_PER_S).collect();
    record.rpm = Some(speed.iter().enumerate().map(|(row, value)| 1e4 * value + noise(row)).collect());
    record.thrust_n = Some(thrust.iter().enumerate().map(|(row, value)| 10.0 * value + 1e-3 * noise(row)).collect());
    record.command = command;
    Experiment { records: vec![record], sample_rate_hz: Some(ROWS_PER_S), ..experiment }
}

#[test]
fn a_thrust_that_lags_behind_its_speed_is_a_limit() {
    let says =
        |filter_s| judged(&staircase(filter_s)).limits.into_iter().find(|limit| limit.contains("behind its speed"));
    // A filter of 20 ms behind a motor of 50 ms.
    let limit = says(0.02).unwrap();
    assert!(limit.starts_with("thrust comes 2") || limit.starts_with("thrust comes 1"), "{limit}");
    assert_eq!(says(0.001), None);
}

#[test]
fn a_command_that_is_stamped_late_is_no_good_lag() {
    const LATE_ROWS: usize = 8;
    let missed = |late_rows: usize| {
        let mut experiment = Experiment { output: rotorlead_records::Output::Rpm, ..staircase(0.001) };
        let command = &mut experiment.records[0].command;
        command.rotate_right(late_rows);
        let first = command[late_rows];
        command[..late_rows].fill(first);
        judged(&experiment).limits.into_iter().find(|limit| limit.contains("the lag misses"))
    };
    assert_eq!(missed(0), None);
    assert!(missed(LATE_ROWS).is_some(), "8 ms of 50 are not seen");
}
