//! Models judged on experiments whose truth is known.

use std::f64::consts::TAU;

use rotorlead::design::{LeadDesign, LeadParameters};
use rotorlead_identify::error::IdentifyError;
use rotorlead_identify::validate::{Comparison, Domain, RecordValidation, table_2, validate};
use rotorlead_plant::bench::{Plan, PlannedRecord, run};
use rotorlead_plant::{Color, Effect, Lag, Lagged, Model, Noise, Point, Provenance, StaticMap, hold_response};
use rotorlead_records::{Excitation, Experiment, Output, Role};

/// Noise of the stand, newtons.
const SIGMA_N: f64 = 0.02;

fn point(nominal: f64, gain: f64, time_constant_s: f64) -> Point {
    Point::new(nominal, Lag { gain, time_constant_s, delay_s: 0.004 })
}

/// Two points of Table 1 and what lies between.
fn motor() -> Model {
    Model {
        time_constant_curve: None,
        format: 1,
        points: vec![point(0.4, 9.9955, 1.0 / 6.2758), point(0.6, 13.4519, 1.0 / 11.7439)],
        static_map: Some(StaticMap {
            command: vec![0.2, 0.4, 0.6, 0.8],
            response: vec![0.6, 2.4, 4.8, 7.9],
            lagged: Lagged::Response,
            polynomial: None,
        }),
        effects: Vec::new(),
        provenance: None,
    }
}

fn planned(excitation: Excitation) -> PlannedRecord {
    PlannedRecord::new(0.5, excitation)
}

/// A multisine, a square wave that starts at rest, a step and a staircase around 0.5.
fn plan(sigma_n: f64) -> Plan {
    let mut plan = Plan::paper(&motor());
    plan.noise = Noise { sigma_n, ..Noise::default() };
    let multisine = PlannedRecord {
        amplitude: Some(0.05),
        lines: Some(150),
        periods: Some(4),
        role: Some(Role::Validate),
        ..planned(Excitation::Multisine)
    };
    let square = PlannedRecord {
        amplitude: Some(0.05),
        half_period_s: Some(2.5),
        periods: Some(3),
        warm_up_periods: Some(0),
        ..planned(Excitation::Square)
    };
    let step = PlannedRecord { amplitude: Some(-0.1), hold_s: Some(4.0), ..planned(Excitation::Step) };
    let staircase = PlannedRecord {
        levels: Some(vec![0.4, 0.5, 0.6, 0.7, 0.6, 0.45]),
        hold_s: Some(3.0),
        ..planned(Excitation::Staircase)
    };
    plan.records = vec![multisine, square, step, staircase];
    plan
}

fn compensator() -> LeadDesign {
    LeadDesign::new(LeadParameters::from_poles(&[11.7439], TAU * 100.0).unwrap(), 5000.0, None).unwrap()
}

fn experiment(sigma_n: f64) -> Experiment {
    run(&plan(sigma_n), &motor(), None, &|_| {}).unwrap()
}

fn compensated(sigma_n: f64) -> Experiment {
    let mut plan = plan(sigma_n);
    plan.compensator = Some("compensator.toml".into());
    run(&plan, &motor(), Some(&compensator().into()), &|_| {}).unwrap()
}

fn show(found: &[RecordValidation]) {
    for v in found {
        println!("{:26} {:8.4} % of {:?}", v.file, v.fit_percent, v.ceiling_percent);
    }
}

#[test]
fn the_true_model_explains_all_that_has_no_noise() {
    let found = validate(&experiment(0.0), &motor()).unwrap();
    show(&found);
    let domains: Vec<Domain> = found.iter().map(RecordValidation::domain).collect();
    assert_eq!(domains, [Domain::Frequency, Domain::Time, Domain::Time, Domain::Time]);
    assert_eq!(found[0].role, Some(Role::Validate));
    // In frequency the images beyond the sixteenth are left out; in time nothing is.
    assert!(found[0].fit_percent > 99.99);
    // What came before the square wave's first row is not in the record, and acts until the delay is over: 4 ms of 15 s.
    assert!(found[1].fit_percent > 99.95);
    assert!(found[2..].iter().all(|v| v.fit_percent > 99.999));
    for v in &found {
        assert!(v.ceiling_percent.unwrap() > 99.95, "{v:?}");
    }
}

#[test]
fn behind_a_compensator_the_command_that_the_esc_got_is_what_counts() {
    let found = validate(&compensated(0.0), &motor()).unwrap();
    show(&found);
    assert!(found.iter().all(|v| v.compensated));
    assert!(found[0].fit_percent > 99.99);
    // In time the rows show the compensator's output once a millisecond, five of its ticks.
    assert!(found[1..].iter().all(|v| v.fit_percent > 99.8));
}

#[test]
fn with_noise_the_true_model_reaches_the_ceiling_and_the_ceiling_is_that_of_the_noise() {
    for (experiment, silent) in [(experiment(SIGMA_N), experiment(0.0)), (compensated(SIGMA_N), compensated(0.0))] {
        let found = validate(&experiment, &motor()).unwrap();
        show(&found);
        for (v, clean) in found.iter().zip(&silent.records) {
            let ceiling = v.ceiling_percent.unwrap();
            assert!((v.fit_percent - ceiling).abs() < 0.15, "{v:?}");
            if v.domain() == Domain::Time {
                let y = clean.thrust_n.as_ref().unwrap();
                let mean = y.iter().sum::<f64>() / y.len() as f64;
                let spread = y.iter().map(|y| (y - mean).powi(2)).sum::<f64>() / y.len() as f64;
                let exact = 100.0 * (1.0 - SIGMA_N / (spread + SIGMA_N * SIGMA_N).sqrt());
                assert!((ceiling - exact).abs() < 0.15, "{v:?}, exact {exact}");
            }
        }
    }
}

#[test]
fn a_wrong_model_stays_below_the_ceiling_by_what_it_has_wrong() {
    let experiment = experiment(0.0);
    let mut strong = motor();
    strong.points.iter_mut().for_each(|p| p.gain *= 1.2);
    let found = validate(&experiment, &strong).unwrap();
    // A fifth of the square wave's response is left; its offset does not count.
    assert!((found[1].fit_percent - 80.0).abs() < 0.05, "{:?}", found[1]);
    // Of a single step the free offset and initial state take up a little.
    assert!((80.0..80.5).contains(&found[2].fit_percent), "{:?}", found[2]);
    // In frequency it is a fifth of |G| over the spread of G about its mean.
    let lag = motor().at(0.5).unwrap();
    let response: Vec<_> = (0..150)
        .map(|k| TAU * 0.1 * (2.0 * f64::from(k) + 1.0))
        .map(|omega| lag.frequency_response(omega) * hold_response(5000.0, Some(600.0), omega))
        .collect();
    let mean = response.iter().sum::<num_complex::Complex64>() / 150.0;
    let power: f64 = response.iter().map(|g| g.norm_sqr()).sum();
    let spread: f64 = response.iter().map(|g| (g - mean).norm_sqr()).sum();
    let exact = 100.0 * (1.0 - 0.2 * (power / spread).sqrt());
    assert!((found[0].fit_percent - exact).abs() < 0.01, "{:?}, {exact}", found[0]);
    // The static map was right.
    assert!(found[3].fit_percent > 99.99);

    let mut slow = motor();
    slow.points.iter_mut().for_each(|p| p.time_constant_s *= 1.5);
    let found = validate(&experiment, &slow).unwrap();
    show(&found);
    for v in &found {
        assert!(v.fit_percent < v.ceiling_percent.unwrap() - 3.0, "{v:?}");
    }
}

#[test]
fn without_a_static_map_a_staircase_is_judged_up_to_an_offset() {
    let mut flat = motor();
    flat.static_map = None;
    let mut plan = plan(0.0);
    plan.records.drain(..3);
    let mut staircase = run(&plan, &flat, None, &|_| {}).unwrap();
    for y in staircase.records[0].thrust_n.as_mut().unwrap() {
        *y += 30.0;
    }
    assert!(validate(&staircase, &flat).unwrap()[0].fit_percent > 99.999);
    assert!(validate(&staircase, &motor()).unwrap()[0].fit_percent < 0.0);
}

#[test]
fn a_chirp_is_run_around_its_nominal_command_and_anything_else_over_the_range() {
    let mut experiment = experiment(0.0);
    experiment.records.remove(1);
    experiment.records.remove(1);
    experiment.records[0].excitation = Excitation::Chirp;
    experiment.records[1].excitation = Excitation::Free;
    let found = validate(&experiment, &motor()).unwrap();
    show(&found);
    assert!(found.iter().all(|v| v.domain() == Domain::Time && v.ceiling_percent.is_none()));
    // Between its rows the loop plays four more samples of the multisine.
    assert!((99.0..99.99).contains(&found[0].fit_percent));
    assert!(found[1].fit_percent > 99.999);
}

#[test]
fn start_up_before_the_first_level_is_not_judged() {
    let mut plan = plan(0.0);
    plan.records.drain(..3);
    let mut staircase = run(&plan, &motor(), None, &|_| {}).unwrap();
    let record = &mut staircase.records[0];
    record.command[..3000].fill(0.05);
    for (row, thrust) in record.thrust_n.as_mut().unwrap().iter_mut().take(3000).enumerate() {
        *thrust = if row % 500 < 20 { 1.0 } else { 0.0 };
    }
    let found = validate(&staircase, &motor()).unwrap();
    assert!(found[0].fit_percent > 99.0, "{found:?}");
}

#[test]
fn what_does_not_go_together_is_refused_with_its_remedy() {
    let experiment = experiment(0.0);
    let help = |error: &IdentifyError| miette::Diagnostic::help(error).unwrap().to_string();

    let mut narrow = motor();
    narrow.points.remove(0);
    let error = validate(&experiment, &narrow).unwrap_err();
    for part in ["u050_multisine.csv", "0.5", "0.6"] {
        assert!(error.to_string().contains(part), "{error}");
    }
    assert!(help(&error).contains("identify the motor"));

    let mut rpm = motor();
    rpm.provenance = Some(Provenance {
        experiment: None,
        records_crc32: None,
        records: Vec::new(),
        version: "0".into(),
        output: Output::Rpm,
        excitation: None,
        command_rate_hz: None,
        esc_frame_hz: None,
        judgement: None,
    });
    let error = validate(&experiment, &rpm).unwrap_err();
    assert_eq!(error, IdentifyError::OtherOutput { model: "rpm", experiment: "thrust_n" });

    let mut slewing = motor();
    slewing.effects.push(Effect { kind: "gremlin".into(), parameters: [].into(), std: [].into() });
    let error = validate(&experiment, &slewing).unwrap_err();
    assert!(error.to_string().contains("gremlin") && help(&error).contains("`slew_limit`"), "{error}");

    for record in compensated(0.0).records {
        let file = record.file.clone();
        let mut blind = Experiment { records: vec![record], ..experiment.clone() };
        blind.records[0].esc_command = None;
        let error = validate(&blind, &motor()).unwrap_err();
        assert_eq!(error, IdentifyError::NoEscCommand { file });
        assert!(help(&error).contains("esc_command"));
    }

    for excitation in [Excitation::Square, Excitation::Chirp, Excitation::Free, Excitation::Staircase] {
        let mut idle = experiment.clone();
        idle.records.truncate(1);
        idle.records[0].excitation = excitation;
        idle.records[0].command.fill(0.5);
        let error = validate(&idle, &motor()).unwrap_err();
        assert_eq!(error, IdentifyError::ConstantCommand { file: "u050_multisine.csv".into() });
    }
}

/// The motor's records with fresh noise.
fn noisy(noise: &Noise, seed: u64) -> Experiment {
    let mut plan = plan(0.0);
    plan.sample_rate_hz = 200;
    plan.noise = *noise;
    plan.seed = seed;
    run(&plan, &motor(), None, &|_| {}).unwrap()
}

#[test]
fn the_true_model_is_called_wrong_as_seldom_as_the_level_says_and_a_wrong_one_always() {
    let repeats = 40;
    let mut wrong = motor();
    wrong.points.iter_mut().for_each(|p| p.time_constant_s *= 1.5);
    for (color, pole) in [(Color::White, None), (Color::Ar1, Some(0.8))] {
        let noise = Noise { sigma_n: SIGMA_N, color, pole, ..Noise::default() };
        let mut alarms = [0; 4];
        for seed in 1..=repeats {
            let experiment = noisy(&noise, seed);
            for (k, found) in validate(&experiment, &motor()).unwrap().iter().enumerate() {
                alarms[k] += u32::from(found.residual_power.unwrap().p_value < 0.05);
            }
            for found in validate(&experiment, &wrong).unwrap() {
                assert!(
                    found.residual_power.unwrap().p_value < 1e-3,
                    "{seed} {color:?} {} {:?}",
                    found.file,
                    found.residual_power
                );
                assert!(found.model_error_percent().unwrap() > 0.5, "{}", found.file);
            }
        }
        println!("{color:?}: {alarms:?} of {repeats}");
        // 40 at 0.05: 2 expected; 9 or more in one of 5000 (binomial).
        assert!(alarms.iter().all(|&alarms| alarms < 9), "{color:?}: {alarms:?}");
    }
}

#[test]
fn a_record_whose_noise_does_not_show_has_no_power_over_noise() {
    let mut wrong = motor();
    wrong.points.iter_mut().for_each(|p| p.time_constant_s *= 1.5);
    let found = validate(&experiment(0.0), &wrong).unwrap();
    let in_frequency: Vec<_> = found.iter().filter(|found| found.domain() == Domain::Frequency).collect();
    assert!(
        !in_frequency.is_empty() && in_frequency.iter().all(|found| found.residual_power.is_none()),
        "{in_frequency:?}"
    );
    // The least noise that a good sensor has still shows: a hundred-thousandth of the thrust.
    let noise = Noise { sigma_n: 1e-5, ..Noise::default() };
    assert!(validate(&noisy(&noise, 1), &wrong).unwrap().iter().all(|found| found.residual_power.is_some()));
}

/// A staircase whose first level is left, and whose first rows are cut off so that the response is still on its way.
fn cut_start(noise: &Noise, seed: u64, after_s: f64) -> Experiment {
    let mut plan = plan(0.0);
    plan.sample_rate_hz = 200;
    plan.noise = *noise;
    plan.seed = seed;
    plan.records.drain(..3);
    plan.records[0].levels = Some(vec![0.7, 0.4, 0.5, 0.6, 0.7, 0.6, 0.45]);
    let mut experiment = run(&plan, &motor(), None, &|_| {}).unwrap();
    let record = &mut experiment.records[0];
    let cut = ((3.0 + after_s) * 200.0).round() as usize;
    for column in [&mut record.time_s, &mut record.command, record.thrust_n.as_mut().unwrap()] {
        column.drain(..cut);
    }
    experiment
}

#[test]
fn the_true_model_is_not_called_wrong_for_what_came_before_the_record() {
    let repeats = 40;
    for (color, pole) in [(Color::White, None), (Color::Ar1, Some(0.8))] {
        let noise = Noise { sigma_n: SIGMA_N, color, pole, ..Noise::default() };
        for after_s in [0.05, 0.3, 0.6] {
            let p_value = |seed| {
                let found = validate(&cut_start(&noise, seed, after_s), &motor()).unwrap();
                found[0].residual_power.unwrap().p_value
            };
            let alarms = (1..=repeats).filter(|&seed| p_value(seed) < 0.05).count();
            println!("{color:?}, cut {after_s} s after the step: {alarms} of {repeats}");
            // 40 at 0.05: 2 expected; 9 or more in one of 5000 (binomial).
            assert!(alarms < 9, "{color:?} {after_s}: {alarms}");
        }
    }
}

#[test]
fn levels_on_a_sensors_limit_are_not_judged() {
    let mut experiment = noisy(&Noise { sigma_n: SIGMA_N, ..Noise::default() }, 1);
    experiment.records.drain(..3);
    let thrust = experiment.records[0].thrust_n.as_mut().unwrap();
    // Between the levels of 0.6 and 0.7.
    thrust.iter_mut().for_each(|thrust| *thrust = thrust.min(5.4));
    let found = validate(&experiment, &motor()).unwrap();
    assert!(found[0].residual_power.unwrap().p_value > 1e-3, "{:?}", found[0].residual_power);
}

#[test]
fn what_was_compared_and_the_papers_table_go_with_the_fit() {
    let experiment = experiment(SIGMA_N);
    let mut model = motor();
    model.provenance = Some(Provenance {
        experiment: None,
        records_crc32: None,
        records: vec!["u050_multisine.csv".into()],
        version: "0".into(),
        output: Output::ThrustN,
        excitation: None,
        command_rate_hz: None,
        esc_frame_hz: None,
        judgement: None,
    });
    let found = validate(&experiment, &model).unwrap();
    let fitted: Vec<Option<bool>> = found.iter().map(|v| v.fitted).collect();
    assert_eq!(fitted, [Some(true), Some(false), Some(false), Some(false)]);
    assert!(validate(&experiment, &motor()).unwrap().iter().all(|v| v.fitted.is_none()));

    let Comparison::Frequency(lines) = &found[0].comparison else { panic!("{}", found[0].file) };
    assert_eq!((lines.raw.len(), lines.smoothed.lines.len(), lines.model.len()), (150, 150, 150));
    let lag = motor().at(0.5).unwrap();
    for (line, model) in lines.smoothed.lines.iter().zip(&lines.model) {
        assert!((lag.frequency_response(line.omega_rad_s) - model).norm() < 1e-9);
        assert!((line.response - model).norm() < 6.0 * line.variance.sqrt(), "{line:?}");
    }
    for v in &found[1..] {
        let Comparison::Time(rows) = &v.comparison else { panic!("{}", v.file) };
        let mean = rows.iter().map(|row| row.measured).sum::<f64>() / rows.len() as f64;
        let spread: f64 = rows.iter().map(|row| (row.measured - mean).powi(2)).sum();
        let left: f64 = rows.iter().map(|row| (row.measured - row.model).powi(2)).sum();
        assert!((100.0 * (1.0 - (left / spread).sqrt()) - v.fit_percent).abs() < 1e-9);
    }

    let table = table_2(&found);
    assert_eq!(table.len(), 1, "the step and the staircase are no part of it: {table:?}");
    let (frequency, square) = (table[0].frequency.unwrap(), table[0].square.unwrap());
    assert_eq!((frequency.fit_percent, frequency.ceiling_percent), (found[0].fit_percent, found[0].ceiling_percent));
    assert_eq!((square.fit_percent, square.ceiling_percent), (found[1].fit_percent, found[1].ceiling_percent));
}

#[test]
fn a_model_with_its_effects_explains_what_its_lag_alone_does_not() {
    for (kind, parameters, step_percent) in [
        ("slew_limit", &[("rate_per_s", 0.15)][..], 99.9),
        ("backlash", &[("half_width", 0.015)], 99.9),
        ("transport_delay", &[("delay_s", 0.021)], 99.9),
        ("asymmetric_lag", &[("ratio", 1.8)], 99.9),
        ("quadratic_thrust", &[("curvature_per_duty", 4.0)], 99.9),
        ("second_pole", &[("time_constant_s", 0.02)], 99.9),
        ("supply_sag", &[("polarization_drop", 0.12), ("polarization_s", 0.5)], 99.9),
        ("gain_drift", &[("drift", -0.1), ("time_s", 10.0)], 99.9),
        ("clock_skew", &[("skew_ppm", 2000.0)], 99.9),
    ] {
        let mut model = motor();
        let parameters = parameters.iter().map(|(name, value)| ((*name).to_owned(), *value)).collect();
        model.effects = vec![Effect { kind: kind.into(), parameters, std: [].into() }];
        let mut plan = plan(0.0);
        // A staircase follows the level; around its points an effect is another.
        plan.records.truncate(3);
        let experiment = run(&plan, &model, None, &|_| {}).unwrap();
        let (with, without) = (validate(&experiment, &model).unwrap(), validate(&experiment, &motor()).unwrap());
        println!("{kind}");
        show(&with);
        show(&without);
        // Rows of 1 ms, and the lines of a command that the ticks between them are filled in from.
        assert!(with[0].fit_percent > 99.9, "{kind}: {}", with[0].fit_percent);
        assert!(with[2].fit_percent > step_percent, "{kind}: {}", with[2].fit_percent);
        assert!((0..3).any(|r| without[r].fit_percent < 99.5), "{kind}");
        assert!((0..3).all(|r| without[r].fit_percent < with[r].fit_percent + 0.05), "{kind}");
    }
}
