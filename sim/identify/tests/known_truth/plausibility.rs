//! Records that are not what their experiment says, identified all the same or refused: either way the reason is named.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rotorlead_identify::error::{IdentifyError, with_advice};
use rotorlead_identify::lag::first_order::FirstOrderFit;
use rotorlead_identify::lag::multisine::{IdentifyWarning, PeriodicIdentification, PeriodicOptions, identify_periodic};
use rotorlead_plant::bench::{Plan, PlannedRecord, run};
use rotorlead_plant::{Lag, Model, Noise, Point};
use rotorlead_records::{Excitation, Experiment};

const PERIOD_ROWS: usize = 2000;

fn model(lag: Lag) -> Model {
    Model {
        time_constant_curve: None,
        format: 1,
        points: vec![Point::new(0.5, lag)],
        static_map: None,
        effects: Vec::new(),
        provenance: None,
    }
}

const LAG: Lag = Lag { gain: 10.0, time_constant_s: 0.1, delay_s: 0.0 };

/// Four periods of 10 s of 150 odd lines at 200 rows per second around 0.5.
fn simulated_experiment(lag: Lag, sigma_n: f64, seed: u64) -> Experiment {
    experiment_at(200, lag, sigma_n, seed)
}

fn experiment_at(sample_rate_hz: u32, lag: Lag, sigma_n: f64, seed: u64) -> Experiment {
    let model = model(lag);
    let mut plan = Plan::paper(&model);
    plan.sample_rate_hz = sample_rate_hz;
    plan.seed = seed;
    plan.noise = Noise { sigma_n, ..Noise::default() };
    plan.records = vec![PlannedRecord {
        amplitude: Some(0.05),
        lines: Some(150),
        periods: Some(4),
        ..PlannedRecord::new(0.5, Excitation::Multisine)
    }];
    run(&plan, &model, None, &|_| {}).unwrap()
}

fn good(seed: u64) -> Experiment {
    simulated_experiment(LAG, 0.02, seed)
}

fn thrust(experiment: &mut Experiment) -> &mut Vec<f64> {
    experiment.records[0].thrust_n.as_mut().unwrap()
}

fn identified(experiment: &Experiment) -> Result<PeriodicIdentification, IdentifyError> {
    identify_periodic(experiment, &PeriodicOptions::default())
}

fn found(experiment: &Experiment) -> (FirstOrderFit, Vec<IdentifyWarning>) {
    let found = identified(experiment).unwrap();
    (found.nominals[0].fit.clone(), found.nominals[0].warnings.clone())
}

#[track_caller]
fn warned(experiment: &Experiment, is_it: impl Fn(&IdentifyWarning) -> bool) -> String {
    let (_, warnings) = found(experiment);
    let warning = warnings.iter().find(|warning| is_it(warning));
    with_advice(warning.unwrap_or_else(|| panic!("{warnings:?}")))
}

#[test]
fn nothing_is_said_against_a_good_record() {
    let mut alarms = 0;
    for seed in 1..=100 {
        let (_, warnings) = found(&good(seed));
        // A period is dropped for a transient in one of 20, by that test's level.
        alarms += warnings.iter().filter(|w| !matches!(w, IdentifyWarning::TransientDropped { .. })).count();
    }
    // Two tests at 0.001 each, over 100 records: more than two alarms in one of 900 (Poisson).
    assert!(alarms <= 2, "{alarms}");
}

#[test]
fn a_response_that_has_nothing_to_do_with_the_command_is_refused() {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut refused = 0;
    for seed in 1..=20 {
        let mut experiment = good(seed);
        thrust(&mut experiment).iter_mut().for_each(|y| *y = rng.random_range(-1.0..1.0));
        match identified(&experiment) {
            Err(error) => {
                assert!(matches!(error, IdentifyError::GainMayBeZero { nominal: 0.5, .. }), "{error}");
                assert!(miette::Diagnostic::help(&error).unwrap().to_string().contains("of one run"));
                refused += 1;
            }
            Ok(found) => {
                let warnings = &found.nominals[0].warnings;
                let uncertain = warnings.iter().any(|w| matches!(w, IdentifyWarning::Uncertain { .. }));
                assert!(uncertain, "{warnings:?} {:?}", found.nominals[0].fit);
            }
        }
    }
    assert!(refused >= 16, "{refused} of 20");
}

#[test]
fn a_point_without_a_gain_is_dropped_and_the_others_stay() {
    let mut experiment = good(1);
    let mut other = good(2).records.remove(0);
    other.file = "dead.csv".into();
    other.nominal = 0.7;
    other.command.iter_mut().for_each(|u| *u += 0.2);
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    other.thrust_n.as_mut().unwrap().iter_mut().for_each(|y| *y = rng.random_range(-1.0..1.0));
    experiment.records.push(other);
    let found = identified(&experiment).unwrap();
    assert_eq!(found.nominals.len(), 1);
    let dropped = |w: &IdentifyWarning| matches!(w, IdentifyWarning::GainMayBeZero { nominal: 0.7, .. });
    assert!(found.warnings.iter().any(dropped), "{:?}", found.warnings);
}

#[test]
fn a_reading_that_jumps_is_named() {
    let mut experiment = good(1);
    thrust(&mut experiment)[5000] = 1000.0;
    // At this rate one row is so much that no gain is left: the refusal says why.
    let error = identified(&experiment).unwrap_err().to_string();
    assert!(
        error.contains("may as well be zero") && error.contains("one reading jumps away and back, at 25.000 s"),
        "{error}"
    );
    thrust(&mut experiment)[5000] = 50.0;
    let warning = warned(&experiment, |w| matches!(w, IdentifyWarning::Jumps { rows: 1, .. }));
    assert!(warning.contains("one reading jumps away and back, at 25.000 s"), "{warning}");
}

#[test]
fn a_sensor_that_stopped_is_named() {
    let mut experiment = good(1);
    let y = thrust(&mut experiment);
    let last = y[5000];
    y[5000..].fill(last);
    let warning = warned(&experiment, |w| matches!(w, IdentifyWarning::Frozen { rows: 3000, .. }));
    assert!(warning.contains("from 25.000 s on"), "{warning}");
    let warning = warned(&experiment, |w| matches!(w, IdentifyWarning::NoiseTooLarge { .. }));
    assert!(warning.contains("is no noise"), "{warning}");
}

#[test]
fn a_gain_that_drifts_to_a_third_is_no_noise() {
    let mut experiment = good(1);
    let rows = 4.0 * PERIOD_ROWS as f64;
    thrust(&mut experiment).iter_mut().enumerate().for_each(|(row, y)| *y *= 1.0 - row as f64 / rows * 2.0 / 3.0);
    warned(&experiment, |w| matches!(w, IdentifyWarning::NoiseTooLarge { .. }));
}

#[test]
fn a_thrust_that_drifts_to_a_third_is_no_start() {
    let mut experiment = good(1);
    let rows = 4.0 * PERIOD_ROWS as f64;
    let drifts = |(row, y): (usize, &mut f64)| *y = (*y + 5.0) * (1.0 - row as f64 / rows * 2.0 / 3.0);
    thrust(&mut experiment).iter_mut().enumerate().for_each(drifts);
    let (_, warnings) = found(&experiment);
    let named =
        |w: &IdentifyWarning| matches!(w, IdentifyWarning::Drifts { .. } | IdentifyWarning::NoiseTooLarge { .. });
    assert!(warnings.iter().any(named), "{warnings:?}");
}

#[test]
fn a_sign_and_a_nominal_that_are_wrong_are_named() {
    let mut experiment = good(1);
    thrust(&mut experiment).iter_mut().for_each(|y| *y = -*y);
    let warning = warned(&experiment, |w| matches!(w, IdentifyWarning::NegativeGain { .. }));
    assert!(warning.contains("; turn the sensor's sign"), "{warning}");

    let mut experiment = good(1);
    experiment.records[0].nominal = 0.9;
    let warning = warned(&experiment, |w| matches!(w, IdentifyWarning::OtherNominal { .. }));
    assert!(warning.contains("`nominal` is 0.9, and the mean command is 0.500"), "{warning}");
}

#[test]
fn a_time_constant_that_is_hardly_known_is_named() {
    let experiment = simulated_experiment(LAG, 3.0, 1);
    let warning = warned(&experiment, |w| matches!(w, IdentifyWarning::Uncertain { what: "time constant", .. }));
    assert!(warning.contains("raise the amplitude"), "{warning}");
}

#[test]
fn a_dead_time_beyond_the_search_is_named() {
    for delay_s in [0.25, 0.5] {
        let experiment = simulated_experiment(Lag { delay_s, ..LAG }, 0.02, 1);
        let warning = warned(&experiment, |w| matches!(w, IdentifyWarning::DelayBeyondSearch { .. }));
        let (fit, _) = found(&experiment);
        assert!((fit.gain.value - 10.0).abs() < 4.0 * fit.gain.std && fit.gain.std < 0.2, "{fit:?}");
        assert!((fit.delay_s.unwrap().value - delay_s).abs() < 4e-3, "{fit:?}");
        let expected = format!("a dead time of {:.0} ms explains the response, and none beyond 100 ms", 1e3 * delay_s);
        assert!(warning.contains(&expected), "{warning}");
    }
}

#[test]
fn a_period_that_is_wrong_is_named() {
    let error_of = |experiment: &Experiment| identified(experiment).unwrap_err().to_string();
    let mut experiment = good(1);
    experiment.records[0].period_s = Some(5.0);
    assert!(error_of(&experiment).ends_with("nothing of it repeats every 5 s"), "{}", error_of(&experiment));

    let mut experiment = experiment_at(1000, LAG, 0.02, 1);
    experiment.sample_rate_hz = None;
    experiment.records[0].time_s.iter_mut().for_each(|t| *t *= 1e3);
    assert!(error_of(&experiment).ends_with("nothing of it repeats every 10 s"), "{}", error_of(&experiment));

    let mut experiment = good(1);
    experiment.records[0].period_s = Some(1e300);
    assert!(error_of(&experiment).len() < 120, "{}", error_of(&experiment));

    let mut experiment = good(1);
    experiment.records[0].period_s = Some(20.0);
    let warning = warned(&experiment, |w| matches!(w, IdentifyWarning::PeriodTooLong { .. }));
    assert!(warning.contains("the command repeats every 10 s and `period_s` is 20"), "{warning}");
}
