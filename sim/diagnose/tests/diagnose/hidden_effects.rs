//! The diagnosis on simulated actuators. That the chain is the diagnosis' own makes these tests of its bookkeeping, not of
//! its judgment.

use rotorlead_diagnose::{Axis, DiagnoseError, Options, Verdict, diagnose};
use rotorlead_identify::error::IdentifyError;
use rotorlead_plant::Catalog;
use rotorlead_records::{Excitation, Role};

use crate::two_levels::{diagnosed, experiment, motor};

#[test]
fn a_lag_and_noise_agree_with_a_lag() {
    for seed in 1..=3 {
        let found = diagnosed(&experiment(&motor(None), seed), None);
        assert_eq!(found.verdict, Verdict::Agrees, "{seed}: {:?}", found.effects);
        assert!(found.held_out && (found.gap.after / found.gap.noise_floor - 1.0).abs() < 0.05, "{:?}", found.gap);
        assert_eq!(found.next_experiment(), None);
    }
}

#[test]
fn what_is_hidden_is_named_with_its_values_and_the_gap_shrinks_to_the_noise() {
    for (kind, parameters) in [
        ("transport_delay", &[("delay_s", 0.02)][..]),
        ("second_pole", &[("time_constant_s", 0.015)]),
        ("moving_average", &[("window_s", 0.03)]),
        ("saturation", &[("max", 0.62)]),
        ("backlash", &[("half_width", 0.008)]),
        ("gain_drift", &[("drift", -0.06), ("time_s", 20.0)]),
        // A narrow valley among others.
        ("command_quantization", &[("step", 0.0107)]),
        ("command_quantization", &[("step", 1.0 / 183.2)]),
        ("esc_frame_hold", &[("frame_hz", 43.7)]),
        ("dead_band", &[("width", 0.0063)]),
        // What a record begins with is not at rest, and goes back at its own pace.
        ("asymmetric_lag", &[("ratio", 1.5)]),
    ] {
        let found = diagnosed(&experiment(&motor(Some((kind, parameters))), 5), None);
        assert_eq!(found.verdict, Verdict::Named, "{kind}: {:?} {:?}", found.effects, found.excess);
        assert_eq!(found.effects.len(), 1, "{kind}: {:?}", found.effects);
        let effect = &found.effects[0];
        assert!(
            effect.kind.id == kind || effect.alternatives.iter().any(|other| other.id == kind),
            "{kind}: {effect:?}"
        );
        assert!(found.gap.after < 1.05 * found.gap.noise_floor, "{kind}: {:?}", found.gap);
        if effect.kind.id == kind {
            let (name, truth) = parameters[0];
            let (_, estimate) = effect.parameters.iter().find(|(parameter, _)| parameter.name == name).unwrap();
            let off = (estimate.value - truth).abs();
            assert!(off < 4.0 * estimate.std + 1e-3 * truth.abs(), "{kind}: {} +- {}", estimate.value, estimate.std);
        }
        for axis in [Axis::Frequency, Axis::Nominal, Axis::Harmonics, Axis::Time, Axis::Direction] {
            let total: f64 = found.locations.iter().filter(|part| part.axis == axis).map(|part| part.share).sum();
            assert!((total - 1.0).abs() < 1e-9, "{kind} {axis:?}: {total}");
        }
    }
}

#[test]
fn a_model_with_wrong_numbers_has_wrong_numbers_and_nothing_else() {
    let experiment = experiment(&motor(None), 7);
    let mut stale = motor(None);
    for point in &mut stale.points {
        point.gain /= 1.1;
        point.time_constant_s /= 0.8;
    }
    let found = diagnosed(&experiment, Some(&stale));
    assert_eq!(found.verdict, Verdict::Named);
    let kinds: Vec<&str> = found.effects.iter().map(|effect| effect.kind.id).collect();
    assert_eq!(kinds, ["parameter_error"]);
    let [gain, time_constant] = [0, 1].map(|index| found.effects[0].parameters[index].1);
    assert!((gain.value - 0.1).abs() < 4.0 * gain.std, "{gain:?}");
    assert!((time_constant.value + 0.2).abs() < 4.0 * time_constant.std, "{time_constant:?}");
    // The improved model has the right numbers themselves.
    assert!((found.model.points[0].gain / 10.0 - 1.0).abs() < 0.01 && found.model.effects.is_empty());
    assert_eq!(diagnosed(&experiment, Some(&motor(None))).verdict, Verdict::Agrees);
}

#[test]
fn what_cannot_be_compared_is_refused_by_name() {
    let mut constant = experiment(&motor(None), 1);
    constant.records[1].command.fill(0.4);
    let catalog = Catalog::standard();
    let options = Options { model: None, catalog: &catalog, progress: &|| {} };
    assert!(matches!(
        diagnose(&constant, &options),
        Err(DiagnoseError::Identify(IdentifyError::ConstantCommand { .. }))
    ));
    let mut elsewhere = motor(None);
    elsewhere.points.remove(1);
    let options = Options { model: Some(&elsewhere), ..options };
    assert!(matches!(diagnose(&experiment(&motor(None), 1), &options), Err(DiagnoseError::Model(_))));
    let delayed = motor(Some(("transport_delay", &[("delay_s", 0.01)])));
    let options = Options { model: Some(&delayed), ..options };
    let refused = diagnose(&experiment(&motor(None), 1), &options);
    assert!(matches!(refused, Err(DiagnoseError::ModelHasEffects { .. })));
}

/// The lags are the given ones to the last digit, and not what some records make of them.
#[test]
fn a_given_lag_stays_where_the_records_do_not_improve_on_it() {
    let model = motor(None);
    let found = diagnosed(&experiment(&motor(Some(("transport_delay", &[("delay_s", 0.02)]))), 5), Some(&model));
    assert_eq!(found.effects.iter().map(|effect| effect.kind.id).collect::<Vec<_>>(), ["transport_delay"]);
    for (improved, given) in found.model.points.iter().zip(&model.points) {
        assert_eq!((improved.gain, improved.time_constant_s), (given.gain, given.time_constant_s));
    }
}

/// A motor that loses step now and then does so at other times in each period: nothing that repeats shows it.
#[test]
fn what_comes_and_goes_is_not_taken_for_noise() {
    let model = motor(None);
    let mut experiment = experiment(&model, 5);
    let steady = diagnosed(&experiment, Some(&model));
    assert_eq!(steady.verdict, Verdict::Agrees);
    assert!(steady.steadiness.is_noise(), "{:?}", steady.steadiness);
    for (place, record) in experiment.records.iter_mut().enumerate() {
        let thrust = record.thrust_n.as_mut().unwrap();
        // 0.2 s of a loss that decays, three times a record, at odd times.
        for event in 0..3 {
            let from = 731 + 1511 * event + 97 * place;
            let force = thrust[from];
            for (row, value) in thrust[from..].iter_mut().take(200).enumerate() {
                *value -= 0.3 * force * (-(row as f64) / 40.0).exp();
            }
        }
    }
    let found = diagnosed(&experiment, Some(&model));
    assert_eq!(found.verdict, Verdict::Unknown, "{:?}", found.effects);
    assert!(found.effects.is_empty() && found.steadiness.significance > 20.0, "{:?}", found.steadiness);
}

/// A delay of 60 ms is none that digital commands and ESCs have.
#[test]
fn what_explains_all_and_is_larger_than_any_is_named_with_its_reservation() {
    let catalog = Catalog::standard();
    let kind = catalog.find("transport_delay").unwrap();
    let beyond = 1.5 * kind.parameters[0].plausible.1;
    let found =
        diagnosed(&experiment(&motor(Some(("transport_delay", &[("delay_s", beyond)]))), 6), Some(&motor(None)));
    assert_eq!((found.verdict, found.effects.len()), (Verdict::Named, 1), "{:?}", found.effects);
    let delay = &found.effects[0];
    assert!(delay.kind.id == "transport_delay" && delay.reservation.is_some(), "{delay:?}");
}

/// Square waves alone say a limit and a smaller gain alike; the multisine that is held out does not, and the given gain is right there.
#[test]
fn a_limit_that_only_square_waves_were_fitted_to_is_no_wrong_number() {
    let given = motor(None);
    let mut experiment = experiment(&motor(Some(("saturation", &[("max", 0.63)]))), 8);
    for record in &mut experiment.records {
        let is_high_multisine = record.nominal > 0.5 && record.excitation == Excitation::Multisine;
        record.role = Some(if is_high_multisine { Role::Validate } else { Role::Fit });
    }
    let found = diagnosed(&experiment, Some(&given));
    assert_eq!(found.effects.iter().map(|effect| effect.kind.id).collect::<Vec<_>>(), ["saturation"]);
    let max = found.effects[0].parameters[0].1;
    assert!((max.value - 0.63).abs() < 4.0 * max.std, "{max:?}");
    assert!(found.gap.after < 1.1 * found.gap.noise_floor, "{:?}", found.gap);
}

/// A resonance damped as no stand is does better than a pole or a stiff mode alone, and is neither.
#[test]
fn two_effects_that_look_like_a_shape_of_neither_are_found_by_way_of_either() {
    let mut both = motor(Some(("second_pole", &[("time_constant_s", 0.011)])));
    let mode = [("frequency_hz", 24.0), ("damping", 0.07), ("participation", 1.2)];
    both.effects.extend(motor(Some(("stand_resonance", &mode))).effects);
    let found = diagnosed(&experiment(&both, 9), None);
    let mut kinds: Vec<&str> = found.effects.iter().map(|effect| effect.kind.id).collect();
    kinds.sort_unstable();
    assert_eq!((found.verdict, kinds), (Verdict::Named, vec!["second_pole", "stand_resonance"]));
}

#[test]
fn a_delay_that_wanders_has_no_name_and_its_spread_is_said() {
    let mut records = experiment(&motor(None), 4);
    // From none to 40 ms and back in some seconds, another phase in each record.
    for (index, record) in records.records.iter_mut().enumerate() {
        let thrust_n = record.thrust_n.as_ref().unwrap().clone();
        let late = |time_s: f64| 0.02 * (1.0 + (1.7 * time_s + 2.0 * index as f64).sin());
        let moved = record.time_s.iter().map(|time_s| {
            let place = ((time_s - late(*time_s)).max(0.0) * 200.0).min(thrust_n.len() as f64 - 1.001);
            let (row, part) = (place as usize, place.fract());
            (1.0 - part) * thrust_n[row] + part * thrust_n[row + 1]
        });
        record.thrust_n = Some(moved.collect());
    }
    let found = diagnosed(&records, None);
    assert_eq!(found.verdict, Verdict::Unknown, "{:?}", found.effects);
    assert!(!found.timing.is_steady(), "{:?}", found.timing);
    // Of 14 ms: waits of a fifth of the lag are said to be at least so long, a lower bound by what the best wrong name leaves.
    let most_s = 0.02 / 2.0_f64.sqrt();
    assert!((0.24 * most_s..1.05 * most_s).contains(&found.timing.scatter_s), "{:?}", found.timing);
    assert!(found.next_experiment().unwrap().words.contains("when each command is sent"));
}
