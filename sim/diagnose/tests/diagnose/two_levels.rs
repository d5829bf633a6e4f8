//! A simulated motor with two nominal commands, and its records.

use rotorlead_diagnose::{Diagnosis, Options, diagnose};
use rotorlead_plant::bench::{Plan, PlannedRecord, run};
use rotorlead_plant::{Catalog, Effect, Lag, Model, Noise, Point};
use rotorlead_records::{Excitation, Experiment};

/// A motor with an effect, or without.
pub fn motor(effect: Option<(&str, &[(&str, f64)])>) -> Model {
    let point = |nominal, gain, time_constant_s| Point::new(nominal, Lag { gain, time_constant_s, delay_s: 0.0 });
    let effect = effect.map(|(kind, parameters)| Effect {
        kind: kind.to_owned(),
        parameters: parameters.iter().map(|(name, value)| ((*name).to_owned(), *value)).collect(),
        std: [].into(),
    });
    Model {
        time_constant_curve: None,
        format: 1,
        points: vec![point(0.4, 10.0, 0.16), point(0.6, 13.5, 0.085)],
        static_map: None,
        effects: effect.into_iter().collect(),
        provenance: None,
    }
}

/// Two nominal commands, a multisine and a square wave at each, 200 rows a second.
pub fn experiment(model: &Model, seed: u64) -> Experiment {
    let mut plan = Plan::paper(model);
    (plan.loop_rate_hz, plan.sample_rate_hz, plan.esc_frame_hz, plan.seed) = (200, 200, None, seed);
    plan.noise = Noise { sigma_n: 0.01, ..Noise::default() };
    plan.records.clear();
    for nominal in [0.4, 0.6] {
        let record = PlannedRecord { amplitude: Some(0.05), ..PlannedRecord::new(nominal, Excitation::Multisine) };
        let multisine = PlannedRecord { lines: Some(150), realization: Some(1), periods: Some(3), ..record.clone() };
        let square =
            PlannedRecord { excitation: Excitation::Square, half_period_s: Some(5.0), periods: Some(3), ..record };
        plan.records.extend([multisine, square]);
    }
    run(&plan, model, None, &|_| {}).unwrap()
}

/// What the whole catalog makes of an experiment.
pub fn diagnosed(experiment: &Experiment, model: Option<&Model>) -> Diagnosis {
    let catalog = Catalog::standard();
    diagnose(experiment, &Options { model, catalog: &catalog, progress: &|| {} }).unwrap()
}
