//! Static maps of few levels, what moves them, and readings that stand still.

use rotorlead_identify::lag::steps::{Run, fit_staircase};
use rotorlead_identify::static_map::{DegreeRule, MapLimit, StaticMapFit};
use rotorlead_records::Experiment;

use crate::stand::{Map, Stand, case};
use crate::{identified, warned};

const DRIFT: &str = "heat or the supply";

fn map(log: &Experiment) -> StaticMapFit {
    identified(log).static_map.unwrap().1
}

/// The command of half the response between two levels.
fn half(map: &StaticMapFit) -> f64 {
    map.linearization(3).unwrap()[1].1
}

/// The same of the truth, by halves.
fn half_of(truth: Map, (from, to): (f64, f64)) -> f64 {
    let (mut low, mut high) = (from, to);
    for _ in 0..50 {
        let middle = 0.5 * (low + high);
        if truth(middle) < 0.5 * (truth(from) + truth(to)) { low = middle } else { high = middle }
    }
    low
}

#[test]
fn a_curved_map_of_few_levels_is_curved_and_no_drift() {
    let assert_curved = |log: &Experiment, half_right: f64, rule: DegreeRule| {
        let fit = map(log);
        assert!(fit.degree() > 1 && fit.degree_by == rule, "{fit:?}");
        assert!((half(&fit) - half_right).abs() < 0.003, "{} for {half_right}", half(&fit));
        assert!(
            !warned(log).contains(DRIFT) && !matches!(fit.limit, Some(MapLimit::Saturates { .. })),
            "{}",
            warned(log)
        );
    };
    if let Some(log) = case("curved-map-blamed-on-heat") {
        assert_curved(&log, 0.378, DegreeRule::CrossValidation);
    }
    let up = |map, levels| Stand { map, levels, hold_s: 2.0, noise: 3e-4, rate_hz: 200.0, ..Stand::default() };
    // Nine points on five levels are enough for the F-test.
    const RULES: [DegreeRule; 3] = [DegreeRule::CrossValidation, DegreeRule::CrossValidation, DegreeRule::FTest];
    let maps: [(Map, &'static [f64]); 3] = [
        (|u| 1.1 * u.sqrt() - 0.2, &[0.2, 0.4, 0.6, 0.8]),
        (|u| 1.0 - (-2.2 * u).exp(), &[0.9, 0.75, 0.6, 0.45, 0.3, 0.15]),
        (|u| 1.2 * u / (0.3 + u), &[0.2, 0.35, 0.5, 0.65, 0.8, 0.65, 0.5, 0.35, 0.2]),
    ];
    for ((truth, levels), rule) in maps.into_iter().zip(RULES) {
        let low = levels.iter().copied().fold(1.0, f64::min);
        let high = levels.iter().copied().fold(0.0, f64::max);
        assert_curved(&up(truth, levels).log(7), half_of(truth, (low, high)), rule);
    }
}

#[test]
fn a_drift_that_visits_of_one_level_show_is_said() {
    for (levels, drift, seed) in [
        (&[0.2, 0.4, 0.6, 0.8, 0.4, 0.6, 0.2, 0.8, 0.6, 0.4, 0.2][..], 0.04, 1),
        (&[0.3, 0.5, 0.7, 0.9, 0.3, 0.5, 0.7, 0.9][..], 0.06, 2),
        (&[0.2, 0.5, 0.3, 0.6, 0.2, 0.5, 0.3, 0.6, 0.2][..], -0.05, 3),
    ] {
        let straight =
            Stand { map: |u| u + 0.1, levels, drift, hold_s: 2.0, noise: 3e-4, rate_hz: 100.0, ..Stand::default() };
        let said = warned(&straight.log(seed));
        assert!(said.contains(DRIFT), "{said}");
        assert!(!warned(&Stand { drift: 0.0, ..straight }.log(seed)).contains(DRIFT));
    }
}

#[test]
fn readings_that_stand_still_while_the_command_is_zero_are_left_out_and_said() {
    let jump: fn(f64) -> f64 = |u| if u > 0.0 { 0.8 * u + 0.06 } else { 0.0 };
    for (levels, rate_hz, tau_s, seed) in [
        (&[0.3, 0.5, 0.7, 0.0, 0.3, 0.5, 0.7, 0.9, 0.5, 0.0][..], 100.0, 0.05, 1),
        (&[0.3, 0.5, 0.3, 0.0, 0.7, 0.5, 0.7, 0.0, 0.5, 0.3][..], 50.0, 0.08, 2),
        (&[0.4, 0.8, 0.0, 0.6, 0.4, 0.6, 0.8][..], 200.0, 0.04, 3),
    ] {
        let log =
            Stand { map: jump, levels, rate_hz, tau_s: [tau_s; 2], hold_s: 2.0, freezes: true, ..Stand::default() }
                .log(seed);
        let said = warned(&log);
        assert!(said.contains("repeats its last value") && !said.contains(DRIFT), "{said}");
        let (record, output) = (&log.records[0], log.output);
        let runs = Run::all(record, output).unwrap();
        assert!(runs.iter().flat_map(|run| &run.plateaus).all(|plateau| plateau.command > 0.0));
        let fit = fit_staircase(record, output, None).unwrap();
        let taus: Vec<f64> = fit.steps.iter().filter_map(|step| Some(step.time_constant_s()?.value)).collect();
        assert!(taus.len() == fit.steps.len() && taus.iter().all(|tau| (tau / tau_s - 1.0).abs() < 0.06), "{taus:?}");
        // With readings that go on, there is nothing to say.
        let live = Stand { map: jump, levels, rate_hz, tau_s: [tau_s; 2], hold_s: 2.0, ..Stand::default() }.log(seed);
        assert!(!warned(&live).contains("repeats its last value"));
    }
}
