//! The experiment that is proposed: a plan that the bench runs on the same hidden actuator, and that the diagnosis takes.

use rotorlead_diagnose::{Diagnosis, NextExperiment, Verdict};
use rotorlead_plant::bench::{Plan, PlannedRecord, run};
use rotorlead_plant::{Catalog, Model};
use rotorlead_records::Excitation;

use crate::two_levels::{diagnosed, experiment, motor};

/// Of the noise.
const SEED: u64 = 5;

/// What is proposed where `kind` was found on `model`, and `rival` cannot be distinguished from it.
fn proposed(found: &Diagnosis, rival: &str) -> NextExperiment {
    let catalog = Catalog::standard();
    let mut found = found.clone();
    found.effects[0].alternatives = vec![catalog.find(rival).unwrap()];
    found.next_experiment().unwrap()
}

/// The plan as its file has it.
fn read_back(next: &NextExperiment) -> Plan {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("plan.toml");
    std::fs::write(&path, next.file().unwrap()).unwrap();
    let plan = Plan::read(&path).unwrap();
    assert_eq!(plan, next.plan);
    plan
}

#[test]
fn what_is_proposed_runs_on_the_same_actuator_and_names_what_is_hidden() {
    for (kind, parameters, rival, excitations) in [
        ("saturation", &[("max", 0.62)][..], "slew_limit", &[Excitation::Multisine, Excitation::Square][..]),
        ("asymmetric_lag", &[("ratio", 1.5)], "operating_point_lag", &[Excitation::Triangle, Excitation::Square]),
        ("dead_band", &[("width", 0.0063)], "command_quantization", &[Excitation::Multisine, Excitation::Triangle]),
    ] {
        proposal_names(kind, parameters, rival, excitations);
    }
}

fn proposal_names(kind: &str, parameters: &[(&str, f64)], rival: &str, excitations: &[Excitation]) {
    let hidden = motor(Some((kind, parameters)));
    let found = diagnosed(&experiment(&hidden, SEED), None);
    assert_eq!(found.effects[0].kind.id, kind, "{:?}", found.effects);
    let next = proposed(&found, rival);
    let plan = read_back(&next);
    for excitation in excitations {
        assert!(plan.records.iter().any(|record| record.excitation == *excitation), "{kind}: {plan:?}");
    }
    // The controller plays the multisines itself; of the others it says so.
    let amplitudes = next.device.iter().filter(|line| line.contains("excite")).count();
    assert!(amplitudes >= 1 && next.device.iter().any(|line| line.contains("does not play")), "{:?}", next.device);
    names_only(&hidden, None, plan, kind);
}

#[test]
fn each_pair_of_likes_has_a_plan_of_its_own() {
    let hidden = motor(Some(("dead_band", &[("width", 0.0063)])));
    let mut found = diagnosed(&experiment(&hidden, SEED), None);
    let catalog = Catalog::standard();
    let kind = |id: &str| catalog.find(id).unwrap();
    let mut plan = |one: &str, other: &str| {
        found.effects[0].kind = kind(one);
        let next = proposed(&found, other);
        assert_eq!(next.plan.check(), Ok(()), "{one}, {other}");
        assert!(!next.words.is_empty());
        (read_back(&next), next.device.join("\n"))
    };
    let multisines = |plan: &Plan| -> Vec<PlannedRecord> {
        plan.records.iter().filter(|record| record.excitation == Excitation::Multisine).cloned().collect()
    };
    // The rate of the frames, in words; lines up to 45 Hz; longer.
    let (frames, device) = plan("transport_delay", "esc_frame_hold");
    assert!(device.contains("half the rate"), "{device}");
    assert!(multisines(&frames).iter().all(|record| record.lines == Some(225) && record.periods.unwrap() >= 6));
    // Amplitudes.
    let (sweep, device) = plan("slew_limit", "saturation");
    let amplitudes: Vec<f64> =
        multisines(&sweep).iter().filter(|r| r.nominal == 0.4).map(|r| r.amplitude.unwrap()).collect();
    assert_eq!(amplitudes, [0.0125, 0.025, 0.05, 0.1]);
    assert!(device.contains("excite --nominal 0.4,0.6 --amplitude 0.0125 --lines 30hz"), "{device}");
    // Below the limit that may be there.
    let (lowered, _) = plan("saturation", "quadratic_thrust");
    assert!(lowered.records.iter().any(|record| record.nominal == 0.55), "{lowered:?}");
    // Turning points of slow triangles, ten widths apart.
    let (stairs, device) = plan("backlash", "command_quantization");
    let triangles: Vec<&PlannedRecord> =
        stairs.records.iter().filter(|record| record.excitation == Excitation::Triangle).collect();
    assert_eq!(triangles.len(), 4);
    assert!((triangles[1].amplitude.unwrap() / triangles[0].amplitude.unwrap() - 1.37).abs() < 0.01);
    assert!(device.contains("--excitation triangle --nominal 0.4"), "{device}");
    // The other way round, longer, slower.
    let (slow, device) = plan("gain_drift", "supply_sag");
    assert_eq!(slow.records[0].nominal, 0.6);
    assert!(multisines(&slow).iter().all(|record| record.periods.unwrap() >= 9));
    assert!(slow.records.iter().any(|record| record.half_period_s == Some(20.0)));
    assert!(device.contains("voltage"), "{device}");
    // A pole against a delay, or wrong numbers: higher and longer, one amplitude.
    for (one, other) in [("second_pole", "transport_delay"), ("parameter_error", "second_pole")] {
        let (high, _) = plan(one, other);
        assert!(multisines(&high).iter().all(|r| r.lines == Some(225) && r.amplitude == Some(0.05)), "{one}: {high:?}");
    }
    // Nothing named.
    found.verdict = Verdict::Unknown;
    found.effects.clear();
    let unknown = found.next_experiment().unwrap();
    assert_eq!(unknown.plan.check(), Ok(()));
    assert!(unknown.plan.records.len() >= 10, "{:?}", unknown.plan);
    found.verdict = Verdict::Agrees;
    assert!(found.next_experiment().is_none());
}

/// Each of a pair of likes, hidden in turn: what the proposal for the two brings is named, and nothing beside it.
#[test]
fn of_two_likes_the_proposed_experiment_names_the_right_one() {
    let sag = [("polarization_drop", 0.06), ("polarization_s", 1.2), ("resistive_drop", 0.03)];
    let drift = [("drift", -0.06), ("time_s", 15.0)];
    let inflow = [("lead_ratio", 1.5), ("time_constant_s", 0.012)];
    let wrong = [("gain_error", 0.1), ("time_constant_error", -0.15)];
    type Hidden<'a> = (&'a str, &'a [(&'a str, f64)], &'a [&'a str]);
    let pairs: [Hidden; 14] = [
        ("transport_delay", &[("delay_s", 0.004)], &["esc_frame_hold", "second_pole"]),
        ("second_pole", &[("time_constant_s", 0.01)], &["transport_delay"]),
        ("moving_average", &[("window_s", 0.02)], &["transport_delay", "second_pole"]),
        ("dead_band", &[("width", 0.0063)], &["backlash"]),
        ("command_quantization", &[("step", 0.0071)], &["dead_band"]),
        ("backlash", &[("half_width", 0.0032)], &["dead_band"]),
        ("slew_limit", &[("rate_per_s", 0.4)], &["saturation"]),
        ("operating_point_lag", &[("exponent", 1.3)], &["asymmetric_lag"]),
        ("quadratic_thrust", &[("curvature_per_duty", 2.0)], &["asymmetric_lag"]),
        ("supply_sag", &sag, &["gain_drift"]),
        ("gain_drift", &drift, &["supply_sag"]),
        ("inflow_lead", &inflow, &["supply_sag"]),
        ("parameter_error", &wrong, &["second_pole"]),
        ("asymmetric_lag", &[("ratio", 1.5)], &["quadratic_thrust"]),
    ];
    for (kind, parameters, rivals) in pairs {
        told_apart(kind, parameters, rivals);
    }
}

#[test]
#[ignore = "in 80 s of frames phase and rate are not found well enough yet: what is left passes for a limit of the slew rate"]
fn the_proposed_experiment_names_frames_and_no_delay() {
    told_apart("esc_frame_hold", &[("frame_hz", 57.3)], &["transport_delay"]);
}

fn told_apart(kind: &str, parameters: &[(&str, f64)], rivals: &[&str]) {
    let hidden = motor(Some((kind, parameters)));
    // Other numbers are other only beside given ones.
    let given = (kind == "parameter_error").then(|| motor(None));
    let found = diagnosed(&experiment(&hidden, SEED), given.as_ref());
    let first = found.effects.first().map(|effect| effect.kind.id);
    assert_eq!(first, Some(kind), "{:?}: {:?} {:?}", found.verdict, found.effects, found.tried);
    for rival in rivals {
        names_only(&hidden, given.as_ref(), read_back(&proposed(&found, rival)), kind);
    }
}

#[test]
fn what_has_weak_evidence_is_found_once_it_is_recorded_for_longer() {
    let hidden = motor(Some(("slew_limit", &[("rate_per_s", 160.0)])));
    let found = diagnosed(&experiment(&hidden, SEED), None);
    assert_eq!(found.verdict, Verdict::Agrees, "{:?}", found.effects);
    let weak: Vec<&str> = found.weak_evidence.iter().map(|kind| kind.kind.id).collect();
    assert_eq!(weak, ["slew_limit"], "{:?}", found.weak_evidence);
    let next = found.next_experiment().unwrap();
    assert!(
        next.words.contains("The evidence for slew-rate limit is weak: record 2 times as many periods"),
        "{}",
        next.words
    );
    let plan = read_back(&next);
    let again = diagnosed(&run(&plan, &hidden, None, &|_| {}).unwrap(), None);
    // It makes no difference to whoever uses the model.
    let minor: Vec<&str> = again.minor.iter().map(|minor| minor.kind.id).collect();
    assert_eq!((again.verdict, again.effects.len(), &minor[..]), (Verdict::Agrees, 0, &["slew_limit"][..]));
}

/// Runs a plan on the hidden actuator: the diagnosis names `kind` and nothing else.
fn names_only(hidden: &Model, given: Option<&Model>, mut plan: Plan, kind: &str) {
    // One of the two nominal commands is enough, and quick.
    plan.records.retain(|record| record.nominal >= 0.5);
    let again = diagnosed(&run(&plan, hidden, None, &|_| {}).unwrap(), given);
    let names: Vec<&str> = again.effects.iter().map(|effect| effect.kind.id).collect();
    assert_eq!((again.verdict, &names[..]), (Verdict::Named, &[kind][..]), "{:?}", again.effects);
    assert!(again.effects[0].alternatives.is_empty(), "{kind}: {:?}", again.effects);
}
