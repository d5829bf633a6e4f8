//! The diagnosis on records that do not repeat, with uneven rows. That the chain is the diagnosis' own makes these tests of its
//! bookkeeping, not of its judgment.

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution as _, StandardNormal};
use rotorlead_diagnose::{Axis, Column, DiagnoseError, Diagnosis, Options, Verdict, diagnose};
use rotorlead_identify::error::IdentifyError;
use rotorlead_plant::effect::Kind;
use rotorlead_plant::{
    Actuator, Catalog, CommandSignal, Effect, EscTiming, Lag, Lagged, Law, Model, Point, Start, StaticMap, Trace,
    simulate,
};
use rotorlead_records::{Excitation, Experiment, Output, Record};

const NOMINAL: f64 = 0.5;
const LEVELS: [f64; 13] = [0.3, 0.36, 0.42, 0.48, 0.54, 0.6, 0.66, 0.7, 0.5, 0.3, 0.58, 0.4, 0.64];

fn motor(effects: &[(&str, &[(&str, f64)])]) -> Model {
    let effect = |(kind, parameters): &(&str, &[(&str, f64)])| Effect {
        kind: (*kind).to_owned(),
        parameters: parameters.iter().map(|(name, value)| ((*name).to_owned(), *value)).collect(),
        std: [].into(),
    };
    let lag = Lag { gain: 12.0, time_constant_s: 0.06, delay_s: 0.0 };
    Model {
        format: 1,
        points: vec![Point::new(NOMINAL, lag)],
        static_map: Some(StaticMap {
            command: vec![0.0, 1.0],
            response: vec![-1.0, 11.0],
            lagged: Lagged::Response,
            polynomial: None,
        }),
        time_constant_curve: None,
        effects: effects.iter().map(effect).collect(),
        provenance: None,
    }
}

/// A staircase with large steps down, rows 6 to 16 ms apart; a standstill before it and after it.
struct Log {
    time_s: Vec<f64>,
    command: Vec<f64>,
    trace: Trace,
    random: ChaCha8Rng,
}

impl Log {
    fn simulated(model: &Model, seed: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let (mut time_s, mut command) = (Vec::new(), Vec::new());
        let mut now_s = 0.0;
        for level in LEVELS {
            let length = random.random_range(0.8..1.1);
            let end_s = now_s + length;
            while now_s < end_s {
                time_s.push(now_s);
                command.push(level);
                now_s += random.random_range(0.006..0.016);
            }
        }
        let mut actuator = Actuator::new(model, Law::LinearAround(NOMINAL), EscTiming::default()).unwrap();
        let drive = CommandSignal { time_s: &time_s, command: &command };
        let trace = simulate(&mut actuator, drive, Start::Rest(LEVELS[0]), &time_s).unwrap();
        Self { time_s, command, trace, random }
    }

    fn noisy(&mut self, values: &[f64], std: f64) -> Vec<f64> {
        let noise: Vec<f64> = values.iter().map(|_| StandardNormal.sample(&mut self.random)).collect();
        values.iter().zip(noise).map(|(value, noise)| value + std * noise).collect()
    }

    fn record(mut self, columns: &[Column]) -> Record {
        let response = self.trace.response.clone();
        let mut thrust = vec![0.0; 60];
        thrust.extend(self.noisy(&response, 0.015));
        let (speed, mut voltage) = (self.trace.speed.clone(), self.trace.voltage_v.clone());
        // A stiff supply.
        voltage.resize(speed.len(), 16.4);
        let rpm: Vec<f64> = speed.iter().map(|x| 12_000.0 * x + 500.0).collect();
        let (rpm, voltage) = (self.noisy(&rpm, 10.0), self.noisy(&voltage, 0.02));
        // Standing still for 60 rows first.
        let still = |values: Vec<f64>, level: f64| [vec![level; 60], values].concat();
        let begin_s = 60.0 * 0.01;
        let mut time_s: Vec<f64> = (0..60).map(|row| f64::from(row) * 0.01).collect();
        time_s.extend(self.time_s.iter().map(|t| t + begin_s));
        Record {
            file: "staircase.csv".to_owned(),
            nominal: NOMINAL,
            excitation: Excitation::Staircase,
            period_s: None,
            amplitude: None,
            compensated: false,
            compensator: None,
            role: None,
            time_s,
            command: still(self.command, 0.0),
            thrust_n: Some(thrust),
            rpm: columns.contains(&Column::Speed).then(|| still(rpm, 0.0)),
            command_log: None,
            esc_command: None,
            voltage_v: columns.contains(&Column::Voltage).then(|| still(voltage, 16.0)),
            current_a: None,
            setpoints: rotorlead_records::Setpoints::default(),
        }
    }
}

fn experiment(records: Vec<Record>) -> Experiment {
    Experiment {
        name: "stand".to_owned(),
        output: Output::ThrustN,
        sample_rate_hz: None,
        esc_frame_hz: None,
        command_rate_hz: None,
        records,
    }
}

fn try_to_diagnose(experiment: &Experiment, model: Option<&Model>) -> Result<Diagnosis, DiagnoseError> {
    let catalog = Catalog::standard();
    diagnose(experiment, &Options { model, catalog: &catalog, progress: &|| {} })
}

fn diagnosed(model: &Model, seed: u64, columns: &[Column]) -> Diagnosis {
    try_to_diagnose(&experiment(vec![Log::simulated(model, seed).record(columns)]), None).unwrap()
}

#[test]
fn a_lag_and_noise_agree_with_a_lag_and_what_was_cut_is_said() {
    for seed in 1..=3 {
        let found = diagnosed(&motor(&[]), seed, &[]);
        assert_eq!(found.verdict, Verdict::Agrees, "{seed}: {:?} {:?}", found.effects, found.excess);
        assert!(found.held_out && (found.gap.after / found.gap.noise_floor - 1.0).abs() < 0.1, "{:?}", found.gap);
        assert_eq!(found.splits.len(), 4);
        assert_eq!((found.cut[0].start, found.cut[0].end), (60, 0));
        let point = &found.model.points[0];
        assert!(
            (point.gain / 12.0 - 1.0).abs() < 0.01 && (point.time_constant_s / 0.06 - 1.0).abs() < 0.03,
            "{point:?}"
        );
    }
}

fn check_named(kind: &str, parameters: &[(&str, f64)]) {
    let found = diagnosed(&motor(&[(kind, parameters)]), 5, &[]);
    assert_eq!(found.verdict, Verdict::Named, "{kind}: {:?} {:?}", found.effects, found.excess);
    assert_eq!(found.effects.len(), 1, "{kind}: {:?}", found.effects);
    let effect = &found.effects[0];
    assert!(effect.kind.id == kind || effect.alternatives.iter().any(|other| other.id == kind), "{kind}: {effect:?}");
    assert!(found.gap.after < 1.1 * found.gap.noise_floor, "{kind}: {:?} {:?}", found.gap, found.splits);
    for split in &found.splits {
        assert!(split.gap.after < split.gap.before, "{kind}: {split:?}");
    }
    if effect.kind.id == kind {
        let (name, truth) = parameters[0];
        let (_, estimate) = effect.parameters.iter().find(|(parameter, _)| parameter.name == name).unwrap();
        let off = (estimate.value - truth).abs();
        assert!(off < 4.0 * estimate.std + 1e-3 * truth.abs(), "{kind}: {} +- {}", estimate.value, estimate.std);
    }
    for axis in [Axis::Nominal, Axis::Amplitude, Axis::Time, Axis::Direction] {
        let total: f64 = found.locations.iter().filter(|part| part.axis == axis).map(|part| part.share).sum();
        assert!((total - 1.0).abs() < 1e-9, "{kind} {axis:?}: {total}");
    }
}

#[test]
fn a_lag_that_depends_on_the_speed_is_named() {
    check_named("operating_point_lag", &[("exponent", 1.0)]);
}

#[test]
fn curvature_of_the_static_map_is_named_either_way() {
    check_named("quadratic_thrust", &[("curvature_per_duty", 1.5), ("behind_lag", 1.0)]);
    check_named("quadratic_thrust", &[("curvature_per_duty", -0.7)]);
}

#[test]
fn a_delay_is_named() {
    check_named("transport_delay", &[("delay_s", 0.03)]);
}

#[test]
fn the_speed_tells_a_filter_of_the_sensor_from_a_slower_motor() {
    let found = diagnosed(&motor(&[("second_pole", &[("time_constant_s", 0.02)])]), 6, &[Column::Speed]);
    assert_eq!(found.columns, [Column::Speed]);
    let kinds: Vec<&str> = found.effects.iter().map(|effect| effect.kind.id).collect();
    assert_eq!((found.verdict, &kinds[..]), (Verdict::Named, &["second_pole"][..]), "{:?}", found.effects);
}

#[test]
fn the_voltage_tells_a_sag_of_the_supply() {
    let sag = [("polarization_drop", 0.08), ("polarization_s", 0.6), ("open_circuit_v", 16.4)];
    let found = diagnosed(&motor(&[("supply_sag", &sag)]), 7, &[Column::Voltage]);
    assert_eq!(found.columns, [Column::Voltage]);
    let kinds: Vec<&str> = found.effects.iter().map(|effect| effect.kind.id).collect();
    assert_eq!((found.verdict, &kinds[..]), (Verdict::Named, &["supply_sag"][..]), "{:?}", found.effects);
    let drop = found.effects[0].parameters[0].1;
    assert!((drop.value - 0.08).abs() < 4.0 * drop.std, "{drop:?}");
}

#[test]
fn windings_that_heat_are_named_and_the_voltage_tells_them_from_a_sag() {
    let heating = [("heat_drop", 0.02), ("heat_s", 1.5)];
    let is_it = |kind: &Kind| kind.id == "winding_heating";
    let alone = diagnosed(&motor(&[("winding_heating", &heating)]), 5, &[]);
    assert_eq!((alone.verdict, alone.effects.len()), (Verdict::Named, 1), "{:?}", alone.effects);
    let named = &alone.effects[0];
    assert!(is_it(named.kind) || named.alternatives.iter().any(|kind| is_it(kind)), "{named:?}");
    let found = diagnosed(&motor(&[("winding_heating", &heating)]), 9, &[Column::Voltage]);
    for (parameter, estimate) in &found.effects[0].parameters {
        let truth = heating.iter().find(|(name, _)| *name == parameter.name).unwrap().1;
        assert!((estimate.value - truth).abs() < 4.0 * estimate.std, "{} {estimate:?}", parameter.name);
    }
    // Five levels that are reached from above say least of how long the heat takes.
    for split in &found.splits {
        assert!(split.gap.after < 0.5 * split.gap.before, "{split:?}");
    }
    let kinds: Vec<&str> = found.effects.iter().map(|effect| effect.kind.id).collect();
    assert_eq!((found.verdict, &kinds[..]), (Verdict::Named, &["winding_heating"][..]), "{:?}", found.effects);
    assert!(found.effects[0].alternatives.is_empty(), "{:?}", found.effects);
}

#[test]
fn a_curved_map_a_delay_and_heat_are_named_together_the_most_valuable_first() {
    let map = [("curvature_per_duty", -0.6)];
    let heating = [("heat_drop", 0.02), ("heat_s", 1.5)];
    let model =
        motor(&[("winding_heating", &heating), ("quadratic_thrust", &map), ("transport_delay", &[("delay_s", 0.03)])]);
    let found = diagnosed(&model, 10, &[Column::Voltage]);
    assert!(found.effects.is_sorted_by(|a, b| a.evidence >= b.evidence), "{:?}", found.effects);
    let mut kinds: Vec<&str> = found.effects.iter().map(|effect| effect.kind.id).collect();
    kinds.sort_unstable();
    let expected = ["quadratic_thrust", "transport_delay", "winding_heating"];
    assert_eq!((found.verdict, &kinds[..]), (Verdict::Named, &expected[..]), "{:?}", found.effects);
}

/// What no kind of the catalog does to levels.
#[derive(Clone, Copy, Debug)]
enum Trouble {
    /// Each level is off by its own 1.5 %, one standard deviation.
    EachLevel,
    /// Levels that are reached from above are 3 % lower.
    FromAbove,
    /// Three levels in the middle of the range are 4 % higher.
    Middle,
}

impl Log {
    /// With levels that are off; the way there is as slow as the motor.
    fn troubled(mut self, trouble: Trouble) -> Self {
        let (mut off, mut now, mut before) = (Vec::new(), 0.0, (-1.0, 0.0));
        for (row, level) in self.command.iter().enumerate() {
            if *level != before.0 {
                let random: f64 = StandardNormal.sample(&mut self.random);
                let part = match trouble {
                    Trouble::EachLevel => 0.015 * random,
                    Trouble::FromAbove if *level < before.0 => -0.03,
                    Trouble::Middle if (0.47..0.59).contains(level) => 0.04,
                    _ => 0.0,
                };
                before = (*level, part);
            }
            let lasted_s = if row > 0 { self.time_s[row] - self.time_s[row - 1] } else { 1.0 };
            now += (before.1 - now) * (1.0 - (-lasted_s / 0.06_f64).exp());
            off.push(1.0 + now);
        }
        self.trace.response.iter_mut().zip(off).for_each(|(response, off)| *response *= off);
        self
    }
}

/// How often something is named beside trouble that has no name: with nothing else, and with one effect. Counts of cases, of cases
/// with the effect's name (or it among the alternatives), of cases with another one, and of `unknown` ones.
fn named_in_trouble(effect: Option<(&str, &[(&str, f64)])>, seeds: std::ops::Range<u64>) -> [usize; 4] {
    let mut counts = [0; 4];
    for seed in seeds {
        for trouble in [Trouble::EachLevel, Trouble::FromAbove, Trouble::Middle] {
            let model = effect.map_or_else(|| motor(&[]), |effect| motor(&[effect]));
            let record = Log::simulated(&model, 100 + seed).troubled(trouble).record(&[]);
            let found = try_to_diagnose(&experiment(vec![record]), None).unwrap();
            let is_it = |named: &rotorlead_diagnose::NamedEffect, id: &str| {
                named.kind.id == id || named.alternatives.iter().any(|other| other.id == id)
            };
            let right = |id: &str| found.effects.iter().any(|named| is_it(named, id));
            let wrong = found.effects.iter().any(|named| effect.is_none_or(|(id, _)| !is_it(named, id)));
            counts[0] += 1;
            counts[1] += usize::from(effect.is_some_and(|(id, _)| right(id)));
            counts[2] += usize::from(wrong);
            counts[3] += usize::from(found.verdict == Verdict::Unknown);
            let power = |gap: f64| gap.powi(2) - found.gap.noise_floor.powi(2);
            let kinds: Vec<&str> = found.effects.iter().map(|named| named.kind.id).collect();
            println!(
                "{seed} {trouble:?} {:?}: {} {kinds:?}, left {:.3} of what was fitted, {:.3} of what was held out",
                effect.map(|effect| effect.0),
                found.verdict.name(),
                found.excess.1.over() / found.excess.0.over(),
                power(found.gap.after) / power(found.gap.before)
            );
        }
    }
    counts
}

const IN_TROUBLE: [(&str, &[(&str, f64)]); 3] = [
    ("quadratic_thrust", &[("curvature_per_duty", -0.8)]),
    ("transport_delay", &[("delay_s", 0.03)]),
    ("operating_point_lag", &[("exponent", 1.5)]),
];

#[test]
fn levels_that_are_off_have_no_name_and_hide_none() {
    assert_eq!(named_in_trouble(None, 0..1)[2..], [0, 3]);
    let [cases, right, wrong, _] = named_in_trouble(Some(IN_TROUBLE[0]), 0..1);
    assert_eq!((cases, right, wrong), (3, 3, 0));
}

/// The full count behind the share of a log's gap that a name has to explain.
#[test]
#[ignore = "takes minutes"]
fn how_often_something_is_named_where_levels_are_off() {
    println!("nothing: {:?}", named_in_trouble(None, 0..10));
    for effect in IN_TROUBLE {
        println!("{}: {:?}", effect.0, named_in_trouble(Some(effect), 0..10));
    }
}

#[test]
fn a_given_model_with_wrong_numbers_has_wrong_numbers() {
    let experiment = experiment(vec![Log::simulated(&motor(&[]), 8).record(&[])]);
    let mut stale = motor(&[]);
    stale.points[0].time_constant_s *= 1.3;
    // The map is the model's, and so is the gain.
    let found = try_to_diagnose(&experiment, Some(&stale)).unwrap();
    let kinds: Vec<&str> = found.effects.iter().map(|effect| effect.kind.id).collect();
    assert_eq!((found.verdict, &kinds[..]), (Verdict::Named, &["parameter_error"][..]), "{:?}", found.effects);
    assert!((found.model.points[0].time_constant_s / 0.06 - 1.0).abs() < 0.03, "{:?}", found.model.points);
    assert_eq!(try_to_diagnose(&experiment, Some(&motor(&[]))).unwrap().verdict, Verdict::Agrees);
    let mut elsewhere = motor(&[]);
    elsewhere.points[0].nominal = 0.2;
    assert!(matches!(try_to_diagnose(&experiment, Some(&elsewhere)), Err(DiagnoseError::Model(_))));
}

#[test]
fn what_cannot_be_compared_is_refused_by_name() {
    let record = || Log::simulated(&motor(&[]), 1).record(&[]);
    let mut constant = record();
    constant.command.fill(0.4);
    let refused = try_to_diagnose(&experiment(vec![constant]), None);
    assert!(matches!(refused, Err(DiagnoseError::Identify(IdentifyError::ConstantCommand { .. }))));
    // A command that never rests is no staircase.
    let mut restless = record();
    restless.command.iter_mut().enumerate().for_each(|(row, command)| *command += 1e-3 * (row % 7) as f64);
    let refused = try_to_diagnose(&experiment(vec![restless.clone()]), None);
    assert!(matches!(refused, Err(DiagnoseError::NothingToCompare { .. })));
    // Beside one that can be compared it is left out by name.
    restless.file = "restless.csv".to_owned();
    let found = try_to_diagnose(&experiment(vec![record(), restless]), None).unwrap();
    assert_eq!((found.verdict, &*found.left_out[0].file), (Verdict::Agrees, "restless.csv"));
}

impl Log {
    /// A log of the speed, whose map is the model's, with rows after the logger stood still for 90 ms during every other step.
    fn into_speed(self, stalls: bool) -> Experiment {
        let scale = 1000.0;
        let mut record = self.record(&[]);
        record.rpm = record.thrust_n.take().map(|thrust| thrust.iter().map(|thrust| scale * thrust).collect());
        if stalls {
            let steps: Vec<f64> = (61..record.command.len())
                .filter(|k| record.command[*k] != record.command[k - 1])
                .map(|k| record.time_s[k])
                .collect();
            let is_stalled = |t: f64| steps.iter().step_by(2).any(|step_s| (0.01..0.1).contains(&(t - step_s)));
            // What it reads when it goes on is from when it stopped.
            let late = |t: f64| {
                if steps.iter().step_by(2).any(|step_s| (0.1..0.13).contains(&(t - step_s))) { 0.06 } else { 0.0 }
            };
            let rpm = record.rpm.clone().unwrap();
            let read_at = |t: f64| rpm[record.time_s.partition_point(|other| *other < t).min(rpm.len() - 1)];
            let read: Vec<f64> = record.time_s.iter().map(|t| read_at(t - late(*t))).collect();
            let kept: Vec<usize> = (0..read.len()).filter(|k| !is_stalled(record.time_s[*k])).collect();
            let of_kept = |values: &[f64]| kept.iter().map(|k| values[*k]).collect::<Vec<f64>>();
            record.rpm = Some(of_kept(&read));
            (record.time_s, record.command) = (of_kept(&record.time_s), of_kept(&record.command));
        }
        Experiment { output: Output::Rpm, ..experiment(vec![record]) }
    }
}

const DELAYED: (&str, &[(&str, f64)]) = ("transport_delay", &[("delay_s", 0.03)]);

#[test]
fn the_map_of_a_speed_is_measured_and_no_effect_and_its_delay_is_named() {
    let map = ("quadratic_thrust", &[("curvature_per_duty", -0.7)][..]);
    let found = try_to_diagnose(&Log::simulated(&motor(&[map, DELAYED]), 21).into_speed(false), None).unwrap();
    let kinds: Vec<&str> = found.effects.iter().map(|effect| effect.kind.id).collect();
    assert_eq!((found.verdict, &kinds[..]), (Verdict::Named, &["transport_delay"][..]), "{:?}", found.decisions);
    assert!((found.effects[0].parameters[0].1.value - 0.03).abs() < 0.002, "{:?}", found.effects);
    assert!((found.model.points[0].time_constant_s / 0.06 - 1.0).abs() < 0.05, "{:?}", found.model.points);
    let alone = try_to_diagnose(&Log::simulated(&motor(&[map]), 22).into_speed(false), None).unwrap();
    assert_eq!(alone.verdict, Verdict::Agrees, "{:?} {:?}", alone.effects, alone.decisions);
}

#[test]
fn steps_during_which_the_log_stands_still_do_not_make_the_delay_longer() {
    let found = try_to_diagnose(&Log::simulated(&motor(&[DELAYED]), 23).into_speed(true), None).unwrap();
    assert!(found.effects.len() == 1 && found.effects[0].kind.id == "transport_delay", "{:?}", found.decisions);
    assert!((found.effects[0].parameters[0].1.value - 0.03).abs() < 0.003, "{:?}", found.effects);
    assert_eq!((found.cut[0].stalled_steps, found.cut[0].steps), (6, 12));
    let lateness = found.lateness.unwrap();
    assert!(lateness.stalled_steps == 6 && lateness.scatter_s < 0.006, "{lateness:?}");
    assert!(lateness.to_string().contains("stands still during 6 more steps"), "{lateness}");
}

#[test]
fn every_kind_that_was_tried_says_what_it_failed() {
    let found = try_to_diagnose(&Log::simulated(&motor(&[DELAYED]), 24).into_speed(false), None).unwrap();
    assert!(found.decisions.len() > 5, "{:?}", found.decisions);
    for decision in &found.decisions {
        assert_eq!(decision.is_added, decision.failed.is_empty(), "{decision:?}");
        assert_eq!(decision.is_added, decision.kind.id == "transport_delay", "{decision:?}");
    }
}

#[test]
fn after_a_staircase_other_staircases_are_asked_for_and_no_column_that_is_there() {
    let mut experiment = Log::simulated(&motor(&[DELAYED]), 25).into_speed(false);
    let rows = experiment.records[0].time_s.len();
    let found = try_to_diagnose(&experiment, None).unwrap();
    let next = found.next_experiment().unwrap();
    assert!(next.words.contains("at half and at twice the") && next.device.is_empty(), "{}", next.words);
    assert!(next.plan.records.iter().all(|record| record.excitation == Excitation::Staircase));
    next.plan.check().unwrap();
    // A part of the levels is off, so that something stays open.
    for (k, rpm) in experiment.records[0].rpm.as_mut().unwrap().iter_mut().enumerate() {
        *rpm *= 1.0 + 0.03 * (k as f64 / rows as f64 * 40.0).sin();
    }
    let open = |experiment: &Experiment| try_to_diagnose(experiment, None).unwrap().next_experiment().unwrap().words;
    assert!(open(&experiment).contains("Log the voltage and the current too."), "{}", open(&experiment));
    experiment.records[0].voltage_v = Some((0..rows).map(|k| 16.0 + 0.01 * (k % 3) as f64).collect());
    assert!(open(&experiment).contains("Log the current too."), "{}", open(&experiment));
}

#[test]
fn a_model_that_cannot_be_of_these_records_is_refused_with_what_to_check() {
    let experiment = experiment(vec![Log::simulated(&motor(&[]), 26).record(&[])]);
    let mut absurd = motor(&[]);
    absurd.points[0].gain *= 1e26;
    absurd.static_map = None;
    let refused = try_to_diagnose(&experiment, Some(&absurd)).unwrap_err();
    assert!(matches!(refused, DiagnoseError::NoComparison { percent } if percent > 1e20), "{refused}");
}
