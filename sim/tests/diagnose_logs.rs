//! The diagnosis on records that do not repeat, with uneven rows. That the chain is the diagnosis' own makes these tests of its
//! bookkeeping, not of its judgment.

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution as _, StandardNormal};
use rotorlead_sim::diagnose::{Axis, Column, DiagnoseError, Diagnosis, Options, Verdict, diagnose};
use rotorlead_sim::identify::IdentifyError;
use rotorlead_sim::plant::{
    Actuator, Catalog, Drive, Effect, EscTiming, Lag, Law, Model, Point, Start, StaticMap, Trace, simulate,
};
use rotorlead_sim::record::{Excitation, Experiment, Output, Record};

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
        static_map: Some(StaticMap { command: vec![0.0, 1.0], response: vec![-1.0, 11.0], polynomial: None }),
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
    fn of(model: &Model, seed: u64) -> Self {
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
        let drive = Drive { time_s: &time_s, command: &command };
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
        let (speed, voltage) = (self.trace.speed.clone(), self.trace.voltage_v.clone());
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
            esc_command: None,
            voltage_v: columns.contains(&Column::Voltage).then(|| still(voltage, 16.0)),
            current_a: None,
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
    try_to_diagnose(&experiment(vec![Log::of(model, seed).record(columns)]), None).unwrap()
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
    assert!(found.gap.after < 1.1 * found.gap.noise_floor, "{kind}: {:?}", found.gap);
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
fn a_given_model_with_wrong_numbers_has_wrong_numbers() {
    let experiment = experiment(vec![Log::of(&motor(&[]), 8).record(&[])]);
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
    let record = || Log::of(&motor(&[]), 1).record(&[]);
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
