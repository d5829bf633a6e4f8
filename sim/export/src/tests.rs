use std::f64::consts::TAU;

use rand::SeedableRng as _;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use rotorlead_plant::{Lag as PointLag, Lagged, MapPolynomial, Point, Provenance, StaticMap, TimeConstantBand};
use rotorlead_records::{Excitation, Output};

use super::*;
use rotorlead_identify::testing;

mod simulators;

const RANGE: (f64, f64) = (0.15, 0.95);

fn model(output: Output, static_map: Option<StaticMap>) -> Model {
    let point = |nominal, time_constant_s| Point {
        time_constant_s_std: Some(0.001),
        ..Point::new(nominal, PointLag { gain: 10.0, time_constant_s, delay_s: 0.0 })
    };
    Model {
        format: 1,
        points: vec![point(0.4, 0.05), point(0.6, 0.03)],
        static_map,
        time_constant_curve: None,
        effects: Vec::new(),
        provenance: Some(Provenance {
            experiment: None,
            records_crc32: None,
            records: Vec::new(),
            version: String::new(),
            output,
            excitation: None,
            command_rate_hz: None,
            esc_frame_hz: None,
            judgement: None,
        }),
    }
}

/// Levels from 0.05 to 1, and the response at each.
fn map(response: impl Fn(f64) -> f64) -> StaticMap {
    let command: Vec<f64> = (1..=20).map(|level| f64::from(level) / 20.0).collect();
    StaticMap {
        response: command.iter().copied().map(response).collect(),
        command,
        lagged: Lagged::Response,
        polynomial: None,
    }
}

fn thrust_model(response: impl Fn(f64) -> f64) -> Model {
    model(Output::ThrustN, Some(map(response)))
}

#[track_caller]
fn only(stack: Stack, model: &Model, options: StackOptions) -> Parameter {
    let found = stack_parameters(stack, model, None, options);
    assert_eq!(found.refused, []);
    let [parameter] = &found.parameters[..] else { panic!("{found:?}") };
    parameter.clone()
}

#[track_caller]
fn refuses(stack: Stack, model: &Model, name: &str, parts: &[&str]) {
    let found = stack_parameters(stack, model, None, StackOptions::default());
    let refusal = found.refused.iter().find(|refusal| refusal.name == name).unwrap_or_else(|| panic!("{found:?}"));
    for part in parts {
        assert!(refusal.why.contains(part), "no `{part}` in {}", refusal.why);
    }
}

#[track_caller]
fn near(value: f64, expected: f64) {
    assert!((value - expected).abs() <= 1e-6 * expected.abs().max(1e-3), "{value} is not {expected}");
}

#[test]
fn a_motor_that_obeys_a_stacks_law_has_its_parameter_exactly() {
    let px4 = thrust_model(|u| 12.0 * (0.3 * u * u + 0.7 * u));
    let found = only(Stack::Px4, &px4, StackOptions::default());
    near(found.value, 0.3);
    near(found.low.unwrap(), 0.3);
    near(found.high.unwrap(), 0.3);
    near(found.worst_error_percent.unwrap(), 0.0);
    assert_eq!(found.measured, (0.05, 1.0));

    // ArduPilot counts from its lowest output, where the thrust is 1 N here.
    let share = |u: f64| (u - RANGE.0) / (RANGE.1 - RANGE.0);
    for expo in [-0.4, 0.65, 1.0] {
        let ardupilot = thrust_model(|u| 1.0 + 12.0 * (expo * share(u).powi(2) + (1.0 - expo) * share(u)));
        near(only(Stack::Ardupilot, &ardupilot, StackOptions::default()).value, expo);
    }

    let output_range = Some((0.05, 1.0));
    let boost = |u: f64| ThrustLaw::Boost.thrust((u - 0.05) / 0.95, 0.4).unwrap();
    let betaflight = thrust_model(|u| 0.5 + 9.0 * boost(u));
    let options = StackOptions { output_range, ..StackOptions::default() };
    near(stack_parameters(Stack::Betaflight, &betaflight, None, options).parameters[0].value, 40.0);
    let series = |u: f64| ThrustLaw::InverseSeries.thrust((u - 0.05) / 0.95, 0.4).unwrap();
    let betaflight = thrust_model(|u| 0.5 + 9.0 * series(u));
    near(stack_parameters(Stack::Betaflight, &betaflight, None, options).parameters[1].value, 40.0);
}

#[test]
fn a_speed_is_squared_and_that_is_said() {
    let found = only(Stack::Px4, &model(Output::Rpm, Some(map(|u| 20_000.0 * u.sqrt()))), StackOptions::default());
    near(found.value, 0.0);
    assert!(found.notes.iter().any(|note| note.contains("square of the rotor speed")), "{:?}", found.notes);
    assert!(found.notes.iter().any(|note| note.contains("no linearization")), "{:?}", found.notes);
    let found = only(Stack::Px4, &model(Output::Rpm, Some(map(|u| 20_000.0 * u))), StackOptions::default());
    near(found.value, 1.0);
}

/// The measured thrust and the script of an older page of ArduPilot's: ardupilot_wiki, copter/source/docs/motor-thrust-scaling.rst,
/// "MatLab example code". The script holds the thrust at 90 % for exact and fits the exponent alone; here both are fitted.
#[test]
fn the_example_of_ardupilots_own_page_comes_out() {
    let thrust = [0.0, 68.9, 203.1, 441.0, 785.8, 1177.3, 1655.0, 2118.8, 2673.0];
    let command: Vec<f64> = (0..thrust.len()).map(|level| level as f64 / 10.0).collect();
    // Sums of the normal equations of y = a x^2 + b x, and of the script's y - x = e (x^2 - x).
    let (mut xx, mut xxx, mut xxxx, mut xy, mut xxy, mut products, mut squares) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    for (level, measured) in thrust.iter().enumerate() {
        let (x, y) = (level as f64 / 8.0, measured / thrust[8]);
        (xx, xxx, xxxx) = (xx + x.powi(2), xxx + x.powi(3), xxxx + x.powi(4));
        (xy, xxy) = (xy + x * y, xxy + x * x * y);
        products += (x * x - x) * (y - x);
        squares += (x * x - x).powi(2);
    }
    let script: f64 = products / squares;
    let determinant = xxxx * xx - xxx * xxx;
    let (a, b) = ((xxy * xx - xy * xxx) / determinant, (xxxx * xy - xxx * xxy) / determinant);
    let map = StaticMap { command, response: thrust.to_vec(), lagged: Lagged::Response, polynomial: None };
    let options = StackOptions { output_range: Some((0.0, 0.8)), ..StackOptions::default() };
    let found = only(Stack::Ardupilot, &model(Output::ThrustN, Some(map)), options);
    near(found.value, a / (a + b));
    assert!((found.low.unwrap()..=found.high.unwrap()).contains(&script), "{script} {found:?}");
}

#[test]
fn intervals_cover_as_often_as_they_say() {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let runs = 1000;
    // The last ones have an end or both between two levels.
    for (law, truth, range, steps) in [
        (ThrustLaw::Quadratic, 0.5, (0.0, 1.0), 20),
        (ThrustLaw::Boost, 0.6, (0.05, 1.0), 20),
        (ThrustLaw::InverseSeries, 0.6, (0.05, 1.0), 20),
        (ThrustLaw::Quadratic, 0.5, RANGE, 10),
        (ThrustLaw::Quadratic, 0.5, (0.0, 0.95), 10),
    ] {
        let mut covered = 0;
        for _ in 0..runs {
            let levels: Vec<(f64, f64)> = (1..=steps)
                .map(|level| {
                    let command = f64::from(level) / f64::from(steps);
                    let noise: f64 = StandardNormal.sample(&mut rng);
                    let r = (command - range.0) / (range.1 - range.0);
                    (command, 10.0 * law.thrust(r, truth).unwrap() + 0.1 * noise)
                })
                .collect();
            let (low, high) = fit::fit(law, &levels, range).unwrap().parameter.interval(0.95);
            covered += usize::from((low..=high).contains(&truth));
        }
        // 950 with a standard deviation of 7: three of them.
        assert!((929..=971).contains(&covered), "{law:?}: {covered} of {runs}");
    }
}

#[test]
fn what_a_map_does_not_reach_is_refused() {
    let cut = |from: f64, to: f64| {
        let all = map(|u| 12.0 * u * u);
        let kept: Vec<usize> = (0..20).filter(|&k| (from..=to).contains(&all.command[k])).collect();
        let of = |values: &[f64]| kept.iter().map(|&k| values[k]).collect();
        let map =
            StaticMap { command: of(&all.command), response: of(&all.response), lagged: all.lagged, polynomial: None };
        model(Output::ThrustN, Some(map))
    };
    refuses(Stack::Px4, &cut(0.0, 0.96), "THR_MDL_FAC", &["command of 1", "0.950", "output-range"]);
    refuses(Stack::Ardupilot, &cut(0.0, 0.91), "MOT_THST_EXPO", &["command of 0.95", "0.900"]);
    refuses(Stack::Ardupilot, &cut(0.24, 1.0), "MOT_THST_EXPO", &["0.250", "0.15"]);
    refuses(Stack::Px4, &cut(0.86, 1.0), "THR_MDL_FAC", &["3 levels", "4 are needed"]);
    refuses(Stack::Px4, &model(Output::ThrustN, None), "THR_MDL_FAC", &["neither thrust nor rotor speed", "staircase"]);
    refuses(Stack::Px4, &thrust_model(|u| -u), "THR_MDL_FAC", &["sign of the load cell"]);
    let unknown = Model { provenance: None, ..thrust_model(|u| u) };
    refuses(Stack::Px4, &unknown, "THR_MDL_FAC", &["neither thrust nor rotor speed"]);
}

#[test]
fn what_a_stack_does_not_take_is_refused_with_the_value() {
    let falling = |p: f64| thrust_model(move |u| 12.0 * (p * u * u + (1.0 - p) * u));
    refuses(Stack::Px4, &falling(-0.25), "THR_MDL_FAC", &["-0.2500", "0 to 1"]);
    refuses(Stack::Indiflight, &falling(0.85), "indi_act_nonlinearity", &["85.0000", "2.5 to 70"]);
    let options = StackOptions { output_range: Some((0.0, 1.0)), ..StackOptions::default() };
    let strong = thrust_model(|u| ThrustLaw::Boost.thrust(u, 1.8).unwrap());
    let found = stack_parameters(Stack::Betaflight, &strong, None, options);
    assert!(found.refused[0].why.contains("180.0000") && found.refused[0].why.contains("0 to 150"), "{found:?}");
    assert_eq!(found.refused[0].releases, Some("4.2 to 2025.12"));
    let strong = thrust_model(|u| ThrustLaw::InverseSeries.thrust(u, 1.2).unwrap());
    let found = stack_parameters(Stack::Betaflight, &strong, None, options);
    let refused = found.refused.iter().find(|refusal| refusal.releases == Some("2026.6 on")).unwrap();
    assert!(refused.why.contains("120.0000") && refused.why.contains("0 to 100"), "{found:?}");
}

#[test]
fn a_value_beyond_a_stacks_range_whose_interval_reaches_it_is_the_end_of_the_range() {
    // Linear but for a scatter of alternating sign.
    let scattered = |bent: f64| {
        thrust_model(move |u| {
            let sign = if (20.0 * u).round() % 2.0 == 0.0 { 1.0 } else { -1.0 };
            12.0 * (bent * u * u + (1.0 - bent) * u) + 0.8 * sign * u * (1.0 - u)
        })
    };
    let found = only(Stack::Px4, &scattered(-0.02), StackOptions::default());
    assert_eq!(found.value, 0.0);
    assert!(found.low.unwrap() < 0.0 && found.high.unwrap() > 0.0, "{found:?}");
    assert!(found.notes.iter().any(|note| note.contains("beyond the 0 to 1")), "{:?}", found.notes);
    refuses(Stack::Px4, &scattered(-0.25), "THR_MDL_FAC", &["0 to 1"]);
}

#[test]
fn a_corner_frequency_is_the_inverse_of_the_time_constant() {
    let found = only(Stack::Paparazzi, &model(Output::ThrustN, None), StackOptions::default());
    // In the middle of 0.4 and 0.6, 0.05 s and 0.03 s.
    near(found.value, 25.0);
    assert_eq!(found.at, Some(0.5));
    let reach = (1.959_964 * 0.001 / 0.04_f64).exp();
    near(found.low.unwrap(), 25.0 / reach);
    near(found.high.unwrap(), 25.0 * reach);
    // As the firmware's warning converts older values: -ln(1 - old) PERIODIC_FREQUENCY, of a lag stepped at 512 Hz.
    let old = 1.0 - (-25.0_f64 / 512.0).exp();
    near(-(1.0 - old).ln() * 512.0, found.value);

    let at = StackOptions { at: Some(0.6), ..StackOptions::default() };
    near(only(Stack::Paparazzi, &model(Output::ThrustN, None), at).value, 1.0 / 0.03);
    let outside = StackOptions { at: Some(0.7), ..StackOptions::default() };
    let found = stack_parameters(Stack::Paparazzi, &model(Output::ThrustN, None), None, outside);
    assert!(found.refused[0].why.contains("0.4 to 0.6, and not at 0.7"), "{found:?}");
}

#[test]
fn a_lag_without_standard_errors_has_no_interval_and_its_dead_time_is_said() {
    let mut bare = model(Output::ThrustN, None);
    bare.points[0].time_constant_s_std = None;
    bare.points[1].delay_s = 0.004;
    let found = only(Stack::Paparazzi, &bare, StackOptions::default());
    assert_eq!((found.low, found.high), (None, None));
    assert!(found.notes.iter().any(|note| note.contains("dead time of 2.0 ms")), "{:?}", found.notes);
}

#[test]
fn gazebo_has_a_time_constant_for_each_direction_where_steps_tell_them_apart() {
    refuses(Stack::Gazebo, &model(Output::Rpm, None), "timeConstantUp", &["one time constant for both", "staircase"]);
    let mut stepped = model(Output::Rpm, Some(map(|u| 20_000.0 * u)));
    stepped.time_constant_curve = Some(TimeConstantBand {
        nominal: vec![0.4, 0.6],
        time_constant_s: vec![0.04, 0.04],
        low_s: vec![0.03, 0.03],
        high_s: vec![0.05, 0.05],
        down_over_up: Some(2.0),
    });
    let found = stack_parameters(Stack::Gazebo, &stepped, None, StackOptions::default());
    let of = |name: &str| found.parameters.iter().find(|parameter| parameter.definition.name == name).unwrap();
    let (up, down) = (of("timeConstantUp"), of("timeConstantDown"));
    near(down.value / up.value, 2.0);
    // The mean of the two rates is that of the curve.
    near(0.5 * (1.0 / up.value + 1.0 / down.value), 1.0 / 0.04);
    near(up.low.unwrap() / up.value, 0.75);
    near(of("maxRotVelocity").value, 20_000.0 * TAU / 60.0);
    assert!(
        found
            .refused
            .iter()
            .any(|refusal| refusal.name == "motorConstant" && refusal.why.contains("on the same levels"))
    );
}

#[test]
fn points_that_know_both_directions_give_each() {
    let mut stepped = model(Output::Rpm, None);
    for point in &mut stepped.points {
        (point.time_constant_up_s, point.time_constant_down_s) = (Some(0.03), Some(0.06));
    }
    let found = stack_parameters(Stack::Gazebo, &stepped, None, StackOptions::default());
    let of = |name: &str| found.parameters.iter().find(|parameter| parameter.definition.name == name).unwrap().value;
    let at = StackOptions { at: Some(0.4), ..StackOptions::default() };
    let there = stack_parameters(Stack::Gazebo, &stepped, None, at);
    near(there.parameters[0].value, 0.03);
    near(of("timeConstantDown") / of("timeConstantUp"), 2.0);
}

/// Thrust and speed on the same plateaus: the constant of gz-sim's own default motor, 8.54858e-6 N/(rad/s)^2 and 838 rad/s.
#[test]
fn the_constant_of_gazebos_default_motor_is_found_in_records_of_thrust_and_speed() {
    let command: Vec<f64> = (1..=10).map(|level| f64::from(level) / 10.0).collect();
    let rpm: Vec<f64> = command.iter().map(|u| 838.0 * 60.0 / TAU * u).collect();
    let thrust_n = command.iter().map(|u| 8.548_58e-6 * (838.0 * u).powi(2)).collect();
    let mut record = testing::record(1.0, None, command, thrust_n);
    record.excitation = Excitation::Steady;
    record.rpm = Some(rpm);
    let experiment = testing::experiment(1.0, vec![record]);
    let bare = model(Output::ThrustN, None);
    let found = stack_parameters(Stack::Gazebo, &bare, Some(&experiment), StackOptions::default());
    let of = |name: &str| found.parameters.iter().find(|parameter| parameter.definition.name == name).unwrap();
    near(of("motorConstant").value, 8.548_58e-6);
    near(of("maxRotVelocity").value, 838.0);
    let px4 = stack_parameters(Stack::Px4, &bare, Some(&experiment), StackOptions::default());
    near(px4.parameters[0].value, 1.0);
}

#[test]
fn indiflight_takes_whole_numbers() {
    let found = stack_parameters(
        Stack::Indiflight,
        &model(Output::Rpm, Some(map(|u| 20_000.4 * (0.4567 * u * u + (1.0 - 0.4567) * u).sqrt()))),
        None,
        StackOptions { at: Some(0.41), ..StackOptions::default() },
    );
    let of = |name: &str| found.parameters.iter().find(|parameter| parameter.definition.name == name).unwrap();
    assert_eq!(of("indi_act_time_constant_ms").value, 49.0);
    assert_eq!(of("indi_act_max_rpm").value, 20_000.0);
    let nonlinearity = of("indi_act_nonlinearity");
    assert_eq!(nonlinearity.value, 46.0);
    assert!(nonlinearity.notes.iter().any(|note| note.contains("rounded from")), "{:?}", nonlinearity.notes);
}

/// The thrust of a law without an end, for what a map has beyond the output range.
fn endless(law: ThrustLaw, r: f64, p: f64) -> f64 {
    let output = |y: f64| match law {
        ThrustLaw::Quadratic => unreachable!(),
        ThrustLaw::Boost => y * (1.0 + p * (1.0 - y) * (1.0 - y)),
        ThrustLaw::InverseSeries => y * (1.0 + p * (1.0 - y) * (1.0 + p * (1.0 - 2.0 * y))),
    };
    if law == ThrustLaw::Quadratic {
        return p * r * r + (1.0 - p) * r;
    }
    let (mut low, mut high) = (-1.0, 2.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if output(middle) < r { low = middle } else { high = middle }
    }
    low
}

/// A table in steps of a tenth, from standstill on: no stack's output range but 0 to 1 starts and ends at its levels.
#[test]
fn a_table_in_steps_of_a_tenth_has_the_parameter_of_any_stack_within_its_interval() {
    for (law, stack, range, place) in [
        (ThrustLaw::Quadratic, Stack::Px4, (0.0, 1.0), 0),
        (ThrustLaw::Quadratic, Stack::Px4, (0.0, 0.97), 0),
        (ThrustLaw::Quadratic, Stack::Ardupilot, RANGE, 0),
        (ThrustLaw::Boost, Stack::Betaflight, (0.055, 1.0), 0),
        (ThrustLaw::Boost, Stack::Betaflight, (0.055, 0.95), 0),
        (ThrustLaw::InverseSeries, Stack::Betaflight, (0.055, 1.0), 1),
        (ThrustLaw::InverseSeries, Stack::Betaflight, (0.055, 0.95), 1),
    ] {
        for tenth in 1..=9 {
            let truth = f64::from(tenth) / 10.0;
            let share = |u: f64| endless(law, (u - range.0) / (range.1 - range.0), truth);
            let command: Vec<f64> = (1..=10).map(|level| f64::from(level) / 10.0).collect();
            let map = StaticMap {
                response: command.iter().map(|u| 12.0 * (share(*u) - share(0.0))).collect(),
                command,
                lagged: Lagged::Response,
                polynomial: Some(MapPolynomial { range: [0.1, 1.0], dead_zone: Some(0.1), ..MapPolynomial::default() }),
            };
            let options = StackOptions { output_range: Some(range), ..StackOptions::default() };
            let found = stack_parameters(stack, &model(Output::ThrustN, Some(map)), None, options);
            let parameter = found.parameters.iter().find(|p| p.definition == &stack.definitions()[place]);
            let parameter = parameter.unwrap_or_else(|| panic!("{law:?} {truth} {found:?}"));
            let truth = truth * parameter.definition.scale;
            let (low, high) = (parameter.low.unwrap(), parameter.high.unwrap());
            let rounding = 1e-6 * truth;
            assert!((low - rounding..=high + rounding).contains(&truth), "{law:?} {range:?} {truth}: {parameter:?}");
            assert!(high - low < 0.1 * parameter.definition.scale, "{law:?} {range:?} {truth}: {low} to {high}");
        }
    }
}

#[test]
fn a_table_that_ends_within_a_stacks_range_is_refused_with_the_remedy() {
    let tenths = |from: i32, to: i32, dead_zone| {
        let command: Vec<f64> = (from..=to).map(|level| f64::from(level) / 10.0).collect();
        let response = command.iter().map(|u| 12.0 * u * u).collect();
        let polynomial = Some(MapPolynomial { range: [0.1, 1.0], dead_zone, ..MapPolynomial::default() });
        model(Output::ThrustN, Some(StaticMap { command, response, lagged: Lagged::Response, polynomial }))
    };
    refuses(
        Stack::Ardupilot,
        &tenths(1, 9, Some(0.1)),
        "MOT_THST_EXPO",
        &["command of 0.95", "0.900", "`--output-range`"],
    );
    refuses(
        Stack::Betaflight,
        &tenths(1, 9, Some(0.1)),
        "thrust_linear",
        &["command of 1", "0.900", "`--output-range`"],
    );
    // Nobody saw it at rest.
    refuses(Stack::Betaflight, &tenths(1, 10, None), "thrust_linear", &["0.100", "0.055", "`--output-range`"]);
    refuses(Stack::Ardupilot, &tenths(2, 10, None), "MOT_THST_EXPO", &["0.200", "0.15", "`--output-range`"]);
}

#[test]
fn a_highest_speed_between_two_levels_is_interpolated() {
    let options = StackOptions { output_range: Some((0.0, 0.93)), ..StackOptions::default() };
    let found = stack_parameters(Stack::Gazebo, &model(Output::Rpm, Some(map(|u| 20_000.0 * u))), None, options);
    let top = found.parameters.iter().find(|parameter| parameter.definition.name == "maxRotVelocity").unwrap();
    near(top.value, 0.93 * 20_000.0 * TAU / 60.0);
    assert_eq!(top.at, Some(0.93));
}
