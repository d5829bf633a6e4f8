//! What must not change what the diagnosis says: how records are written, ordered, cut, repeated and held out, in which units, at which
//! rate, in which noise. None of these tests asks whether the answer is right.

use std::sync::LazyLock;

use rotorlead_diagnose::Diagnosis;
use rotorlead_identify::estimate::Estimate;
use rotorlead_plant::bench::{Plan, PlannedRecord, run};
use rotorlead_plant::effect::Parameter;
use rotorlead_plant::{Color, Lagged, Model, Noise, StaticMap};
use rotorlead_records::{Excitation, Experiment, Record, Role};

use crate::two_levels::{diagnosed, motor};

/// Rows per second.
const RATE_HZ: u32 = 200;
const WHITE: Noise = Noise { sigma_n: 0.01, color: Color::White, pole: None, hum_n: None, hum_hz: None };
/// Standard errors between two answers to the same data.
const SAME: f64 = 0.1;
/// The same where the noise is another one.
const ALIKE: f64 = 3.0;

/// Something to be diagnosed.
struct Case {
    measure: fn(&Model, u32, Noise) -> Experiment,
    model: Model,
    experiment: Experiment,
    found: Diagnosis,
}

/// Nothing and one effect, in records that repeat and in records that do not.
static CASES: LazyLock<Vec<Case>> = LazyLock::new(|| {
    let case = |measure: fn(&Model, u32, Noise) -> Experiment, model: Model| {
        let experiment = measure(&model, RATE_HZ, WHITE);
        let found = diagnosed(&experiment, None);
        assert_eq!(found.effects.len(), model.effects.len(), "{:?}", model.effects);
        Case { measure, model, experiment, found }
    };
    let delay = |delay_s| motor(Some(("transport_delay", &[("delay_s", delay_s)])));
    let pole = |time_constant_s| motor(Some(("second_pole", &[("time_constant_s", time_constant_s)])));
    vec![
        case(periodic, motor(None)),
        case(periodic, delay(0.009)),
        case(periodic, pole(0.009)),
        case(periodic, motor(Some(("slew_limit", &[("rate_per_s", 0.8)])))),
        case(staircases, along_a_line(motor(None))),
        case(staircases, along_a_line(delay(0.018))),
        case(staircases, along_a_line(pole(0.015))),
    ]
});

/// The paper's plan: at either command a multisine that is fitted and a square wave that is held out, four periods each.
fn periodic(model: &Model, rate_hz: u32, noise: Noise) -> Experiment {
    measured(model, Plan::paper(model), rate_hz, noise)
}

/// Two staircases.
fn staircases(model: &Model, rate_hz: u32, noise: Noise) -> Experiment {
    let of = |levels: [f64; 10]| PlannedRecord {
        hold_s: Some(1.2),
        levels: Some(levels.to_vec()),
        ..PlannedRecord::new(0.6, Excitation::Staircase)
    };
    let records = vec![
        of([0.5, 0.55, 0.62, 0.53, 0.7, 0.5, 0.66, 0.58, 0.64, 0.54]),
        of([0.52, 0.6, 0.68, 0.56, 0.51, 0.63, 0.57, 0.69, 0.53, 0.65]),
    ];
    measured(model, Plan { records, ..Plan::paper(model) }, rate_hz, noise)
}

fn measured(model: &Model, plan: Plan, rate_hz: u32, noise: Noise) -> Experiment {
    let plan = Plan { loop_rate_hz: rate_hz, sample_rate_hz: rate_hz, esc_frame_hz: None, seed: 11, noise, ..plan };
    run(&plan, model, None, &|_| {}).unwrap()
}

/// The motor at its upper command, with the same gain at all others.
fn along_a_line(mut model: Model) -> Model {
    model.points.remove(0);
    let gain = model.points[0].gain;
    model.static_map = Some(StaticMap {
        command: vec![0.0, 1.0],
        response: vec![-1.0, gain - 1.0],
        lagged: Lagged::Response,
        polynomial: None,
    });
    model
}

/// How many seconds are in the power of a unit.
fn power_of_time(unit: &str) -> i32 {
    i32::from(unit == "s") - i32::from(unit.ends_with("/s") || unit == "Hz")
}

impl Case {
    /// That the same is found in other records, whose time runs `slower` than that of the case's.
    fn expect(&self, experiment: &Experiment, slower: f64, apart: f64) -> Diagnosis {
        let what = || format!("{} {:?}", self.experiment.records[0].file, self.model.effects);
        let found = diagnosed(experiment, None);
        let kinds = |found: &Diagnosis| found.effects.iter().map(|effect| effect.kind.id).collect::<Vec<_>>();
        assert_eq!((found.verdict, kinds(&found)), (self.found.verdict, kinds(&self.found)), "{}", what());
        for ((parameter, here), (_, there)) in values(&self.found).zip(values(&found)) {
            let scale = slower.powi(power_of_time(parameter.unit));
            let off = (there.value - scale * here.value).abs();
            assert!(off < apart * there.std.hypot(scale * here.std), "{}: {here:?}, then {there:?}", what());
        }
        found
    }

    /// The same with each record changed.
    fn expect_with(&self, change: impl Fn(&mut Record)) {
        let mut experiment = self.experiment.clone();
        experiment.records.iter_mut().for_each(change);
        self.expect(&experiment, 1.0, ALIKE);
    }
}

fn values(found: &Diagnosis) -> impl Iterator<Item = (&'static Parameter, Estimate)> {
    found.effects.iter().flat_map(|effect| effect.parameters.iter().copied())
}

/// The rows of a record that `keep` keeps.
fn part(record: &Record, keep: impl Fn(usize) -> bool) -> Record {
    let kept = |values: &[f64]| (0..values.len()).filter(|row| keep(*row)).map(|row| values[row]).collect::<Vec<f64>>();
    Record {
        time_s: kept(&record.time_s),
        command: kept(&record.command),
        thrust_n: record.thrust_n.as_deref().map(kept),
        ..record.clone()
    }
}

#[test]
fn the_response_may_have_another_unit_and_another_zero() {
    for case in CASES.iter() {
        let mut experiment = case.experiment.clone();
        for thrust_n in experiment.records.iter_mut().flat_map(|record| record.thrust_n.iter_mut().flatten()) {
            *thrust_n = 1000.0 * (*thrust_n + 5.0);
        }
        case.expect(&experiment, 1.0, SAME);
    }
}

#[test]
fn records_may_come_in_any_order() {
    for case in CASES.iter() {
        let mut experiment = case.experiment.clone();
        experiment.records.reverse();
        case.expect(&experiment, 1.0, SAME);
    }
}

#[test]
fn a_record_may_be_cut_in_two() {
    for case in CASES.iter() {
        let mut experiment = case.experiment.clone();
        let record = experiment.records.remove(0);
        // Whole periods, or where a level has settled.
        let rows = record.time_s.len();
        let cut = if record.excitation.is_periodic() { rows / 2 } else { rows / 2 - rows / 40 };
        let second = Record { file: "second.csv".to_owned(), ..part(&record, |row| row >= cut) };
        experiment.records.extend([part(&record, |row| row < cut), second]);
        case.expect(&experiment, 1.0, ALIKE);
    }
}

#[test]
fn records_that_are_given_twice_say_the_same_and_no_more_than_twice_as_much() {
    for case in CASES.iter() {
        let mut experiment = case.experiment.clone();
        for record in &case.experiment.records {
            experiment.records.push(Record { file: format!("again_{}", record.file), ..record.clone() });
        }
        let twice = case.expect(&experiment, 1.0, ALIKE);
        for ((parameter, once), (_, twice)) in values(&case.found).zip(values(&twice)) {
            assert!(2.1 * twice.std.powi(2) > once.std.powi(2), "{}: {once:?}, then {twice:?}", parameter.name);
        }
    }
}

#[test]
fn another_record_may_be_held_out() {
    for case in CASES.iter() {
        for held_out in [0, case.experiment.records.len() - 1] {
            let file = &case.experiment.records[held_out].file;
            case.expect_with(|record| {
                record.role = Some(if record.file == *file { Role::Validate } else { Role::Fit });
            });
        }
    }
}

#[test]
fn rows_may_be_fewer_or_more() {
    for case in CASES.iter() {
        case.expect(&(case.measure)(&case.model, RATE_HZ / 2, WHITE), 1.0, ALIKE);
        if case.experiment.records.iter().all(|record| record.excitation == Excitation::Staircase) {
            case.expect(&(case.measure)(&case.model, 2 * RATE_HZ, WHITE), 1.0, ALIKE);
            // Of a command that rests every other row says all.
            let mut experiment = case.experiment.clone();
            experiment.records.iter_mut().for_each(|record| *record = part(record, |row| row.is_multiple_of(2)));
            (experiment.sample_rate_hz, experiment.command_rate_hz) = (Some(f64::from(RATE_HZ / 2)), None);
            case.expect(&experiment, 1.0, ALIKE);
        }
    }
}

#[test]
fn noise_may_be_colored() {
    let noise = Noise { color: Color::Ar1, pole: Some(0.8), ..WHITE };
    for case in CASES.iter() {
        case.expect(&(case.measure)(&case.model, RATE_HZ, noise), 1.0, ALIKE);
    }
}

#[test]
fn time_may_run_faster_or_slower() {
    for case in CASES.iter() {
        for slower in [0.25_f64, 2.0, 4.0] {
            // Beyond what actuators have an effect is another one. How slow a lag may be depends on the rotor's.
            let is_plausible = |(parameter, value): (&Parameter, Estimate)| {
                parameter.is_lag || slower.powi(power_of_time(parameter.unit)) * value.value < parameter.plausible.1
            };
            if !values(&case.found).all(is_plausible) {
                continue;
            }
            let mut experiment = case.experiment.clone();
            for record in &mut experiment.records {
                record.time_s.iter_mut().for_each(|time_s| *time_s *= slower);
                record.period_s = record.period_s.map(|period_s| slower * period_s);
            }
            for rate_hz in [&mut experiment.sample_rate_hz, &mut experiment.command_rate_hz] {
                *rate_hz = rate_hz.map(|rate_hz| rate_hz / slower);
            }
            case.expect(&experiment, slower, SAME);
        }
    }
}
