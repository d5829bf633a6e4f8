//! What is named as the cause of what a lag misses, on staircases whose physics is known: the right one, or those that the steps cannot tell
//! apart.

mod map;
mod stand;

use rotorlead_assess::{AssessmentContext, assess};
use rotorlead_diagnose::{Diagnosis, Options, Verdict, diagnose};
use rotorlead_identify::identification::{Identification, IdentifyOptions, identify};
use rotorlead_plant::{Catalog, Judgement, Point, Readiness};
use rotorlead_records::Experiment;
use stand::{EQUAL_STEPS, Stand, case};

fn identified(log: &Experiment) -> Identification {
    identify(log, &IdentifyOptions::default()).unwrap()
}

fn judged(log: &Experiment) -> Judgement {
    assess(log, &identified(log).model, AssessmentContext::default()).judgement
}

fn diagnosed(log: &Experiment) -> Diagnosis {
    diagnose(log, &Options { model: None, catalog: &Catalog::standard(), progress: &|| () }).unwrap()
}

fn names(found: &Diagnosis) -> Vec<&'static str> {
    found.effects.iter().map(|effect| effect.kind.id).collect()
}

fn warned(log: &Experiment) -> String {
    identified(log).warnings.iter().map(|warning| warning.sentence()).collect::<Vec<_>>().join("\n")
}

/// Thrust is the square of a speed that lags alike up and down: no unequal lags, and the time constant of the speed.
#[track_caller]
fn assert_square(log: &Experiment, tau_s: f64) {
    let found = diagnosed(log);
    assert!(names(&found).is_empty() && found.verdict == Verdict::Agrees, "{:?} {:?}", names(&found), found.excess);
    let square = found.square_of_speed.as_ref().unwrap();
    assert!(square.time_constants_s.iter().all(|tau| (tau / tau_s - 1.0).abs() < 0.02), "{square:?}");
    // The improved model can be simulated, and has the square behind its lag.
    found.model.check().unwrap();
    assert_eq!(found.model.effects[0].parameters["behind_lag"], 1.0);
    let said = warned(log);
    let ways = [said.split("lags ").nth(1), said.split(" and ").nth(1)]
        .map(|way| way.and_then(|way| way.split(" ms").next()?.parse::<f64>().ok()));
    assert!(said.contains("the square of a speed") && !said.contains("drag"), "{said}");
    assert!(ways.iter().all(|way| way.is_some_and(|ms| (ms / 1e3 / tau_s - 1.0).abs() < 0.03)), "{said}");
    // What is identified is that speed's lag too, and leaves no more than noise.
    let identified = identified(log);
    let near = |point: &Point| (point.time_constant_s - tau_s).abs() < 3.0 * point.time_constant_s_std.unwrap();
    assert!(identified.model.points.iter().all(near), "{:?}", identified.model.points);
    let judgement = judged(log);
    assert!(!judgement.limits.iter().any(|limit| limit.contains("misses")), "{judgement:?}");
}

#[test]
fn a_thrust_that_is_the_square_of_an_equally_lagging_speed_has_no_unequal_lags() {
    if let Some(log) = case("thrust-square-called-unequal-lags") {
        assert_square(&log, 0.05);
    }
    let quick = Stand {
        tau_s: [0.03; 2],
        thrust_n: Some(20.0),
        noise: 0.02,
        levels: &[0.2, 0.8, 0.2, 0.8, 0.2, 0.5, 0.8, 0.5, 0.2],
        hold_s: 2.0,
        ..Stand::default()
    };
    assert_square(&quick.log(2), 0.03);
    let several =
        Stand { tau_s: [0.07; 2], thrust_n: Some(9.0), noise: 0.01, rate_hz: 400.0, hold_s: 2.0, ..Stand::default() };
    assert_square(&several.log(3), 0.07);
    let slow_rows = Stand {
        tau_s: [0.08; 2],
        thrust_n: Some(5.0),
        noise: 0.004,
        rate_hz: 120.0,
        hold_s: 2.0,
        levels: &[0.15, 0.7, 0.15, 0.7, 0.4, 0.15, 0.4, 0.7],
        ..Stand::default()
    };
    assert_square(&slow_rows.log(4), 0.08);
}

#[test]
fn unequal_lags_behind_the_square_keep_their_name_and_get_the_ratio_of_the_speed() {
    let log = Stand { tau_s: [0.04, 0.07], thrust_n: Some(12.0), noise: 0.02, ..Stand::default() }.log(5);
    let found = diagnosed(&log);
    assert_eq!(names(&found), ["asymmetric_lag"], "{:?}", found.effects);
    let ratio = found.effects[0].parameters[0].1.value;
    assert!(found.square_of_speed.is_some() && (ratio / 1.75 - 1.0).abs() < 0.05, "{ratio}");
    let speed = diagnosed(&Stand { tau_s: [0.04, 0.07], ..Stand::default() }.log(6));
    assert!(names(&speed) == ["asymmetric_lag"] && speed.square_of_speed.is_none(), "{:?}", speed.effects);
}

const EITHER: &str = "of one size or nearly, cannot tell";

/// The one reason that says what the lag is taken for.
#[track_caller]
fn reason(log: &Experiment) -> String {
    let judgement = judged(log);
    assert_eq!(judgement.state, Readiness::NotALag, "{judgement:?}");
    judgement.limits[0].clone()
}

#[test]
fn a_mean_over_readings_is_no_ramp_at_steps_of_several_sizes_and_either_at_equal_ones() {
    let cell = |levels, mean_s, tau_s, rate_hz| Stand {
        levels,
        mean_s,
        tau_s: [tau_s; 2],
        rate_hz,
        thrust_n: Some(12.0),
        noise: 0.02,
        ..Stand::default()
    };
    // HX711 at 80 readings a second, in means of 16 and of 8; a quicker converter.
    for (mean_s, tau_s, rate_hz, seed) in [(0.2, 0.04, 100.0, 1), (0.1, 0.03, 200.0, 2), (0.15, 0.05, 160.0, 3)] {
        let said = reason(&cell(stand::SEVERAL_STEPS, mean_s, tau_s, rate_hz).log(seed));
        assert!(said.starts_with("the sensor seems to take means") && !said.contains("ESC"), "{said}");
        let window_ms: f64 = said.split(' ').nth(7).unwrap().parse().unwrap();
        assert!((window_ms / 1e3 / mean_s - 1.0).abs() < 0.1, "{said}");
        let said = reason(&cell(EQUAL_STEPS, mean_s, tau_s, rate_hz).log(seed + 10));
        assert!(said.contains(EITHER) && said.contains("steps of several sizes"), "{said}");
    }
}

#[test]
fn a_ramp_is_named_as_one_and_no_unequal_lags_beside_it() {
    let is_ramp = |log: &Experiment, rate_per_s: f64, can_be_either: bool| {
        let said = reason(log);
        assert!(said.contains("the ESC seems to ramp its command") || can_be_either && said.contains(EITHER), "{said}");
        let found = diagnosed(log);
        let named = names(&found);
        assert!(!named.contains(&"asymmetric_lag"), "{:?}", found.effects);
        if named == ["slew_limit"] {
            let rate = found.effects[0].parameters[0].1;
            assert!((rate.value / rate_per_s - 1.0).abs() < 0.02, "{rate:?}");
            // It slews alike both ways.
            let down = found.effects[0].parameters.iter().find(|(parameter, _)| parameter.name == "down_ratio");
            assert!(down.is_none_or(|(_, ratio)| (ratio.value - 1.0).abs() < 0.02), "{down:?}");
        } else {
            assert!(
                can_be_either && named == ["moving_average"] && found.effects[0].alternatives[0].id == "slew_limit",
                "{named:?}"
            );
        }
    };
    if let Some(log) = case("ramp-called-usable") {
        is_ramp(&log, 0.8, false);
    }
    let ramp = |ramp_per_s| Stand { ramp_per_s, hold_s: 2.0, ..Stand::default() };
    is_ramp(&Stand { levels: EQUAL_STEPS, tau_s: [0.03; 2], ..ramp(0.8) }.log(8), 0.8, true);
    is_ramp(
        &Stand { thrust_n: Some(12.0), noise: 0.02, tau_s: [0.04; 2], hold_s: 3.0, ..ramp(1.0) }.log(9),
        1.0,
        false,
    );
    is_ramp(
        &Stand { thrust_n: Some(12.0), noise: 0.02, levels: EQUAL_STEPS, tau_s: [0.04; 2], ..ramp(1.0) }.log(10),
        1.0,
        true,
    );
}

/// Counts of 300 and of 1000 rpm, each reading in a row of its own or in ten.
#[test]
fn counts_larger_than_their_noise_are_no_effect() {
    for (rpm, noise, seed) in [(300.0, 0.1, 11), (300.0, 0.3, 12), (1000.0, 0.1, 13)] {
        for (rate_hz, rows_per_reading) in [(100.0, 1), (500.0, 10)] {
            let count = rpm / 25_000.0;
            let counted =
                Stand { count, noise: noise * count, rate_hz, rows_per_reading, tau_s: [0.03; 2], ..Stand::default() };
            let log = counted.log(seed);
            let found = diagnosed(&log);
            // A reading that stands in ten rows may come late.
            let named = names(&found);
            assert!(named.is_empty() || named == ["transport_delay"], "{rpm} rpm, {rows_per_reading} rows: {named:?}");
            let said = warned(&log);
            assert!(!said.contains("as long as steps up") && !said.contains("jump away"), "{said}");
        }
    }
    let unequal = Stand { count: 0.002, noise: 4e-4, rate_hz: 100.0, tau_s: [0.04, 0.07], ..Stand::default() };
    assert_eq!(names(&diagnosed(&unequal.log(14))), ["asymmetric_lag"]);
}

#[test]
fn a_filter_of_the_sensor_is_named_and_what_was_identified_stays_a_lag() {
    for (filter_s, tau_s, levels, seed) in
        [(0.03, 0.05, stand::SEVERAL_STEPS, 21), (0.04, 0.06, EQUAL_STEPS, 22), (0.025, 0.06, stand::SEVERAL_STEPS, 23)]
    {
        let judgement = judged(&Stand { filter_s, tau_s: [tau_s; 2], levels, ..Stand::default() }.log(seed));
        assert_ne!(judgement.state, Readiness::NotALag, "{judgement:?}");
        let said = judgement.limits.iter().find_map(|limit| limit.split_once("; a second lag of "));
        let (missed, said) = said.unwrap_or_else(|| panic!("{judgement:?}"));
        assert!(missed.starts_with("the lag misses"), "{missed}");
        let found_ms: f64 = said.split(' ').next().unwrap().parse().unwrap();
        assert!((found_ms / 1e3 / filter_s - 1.0).abs() < 0.15, "{said}");
    }
}
