//! Small experiments for tests: a motor at two nominal commands, which begins each record there.

use std::sync::Arc;

use rotorlead_plant::bench::{Plan, PlannedRecord, run};
use rotorlead_plant::{Model, Noise};
use rotorlead_records::{Excitation, Experiment};

use crate::data::dataset::Dataset;
use crate::diagnose::first_model;
use crate::likelihood::Likelihood;
use crate::model::hypothesis::BasePoint;

const MOTOR: &str = "format = 1\npoint = [\n\
                     { nominal = 0.4, gain = 10.0, time_constant_s = 0.16 },\n\
                     { nominal = 0.6, gain = 13.5, time_constant_s = 0.085 },\n]\n";

/// Records of a motor with these effects: at either command a multisine of this amplitude, and so many square waves.
pub(super) fn records(effects: &str, multisine: f64, squares: usize) -> Experiment {
    records_with_command_rate(effects, (multisine, squares), (200, 200))
}

/// The same with so many commands and rows per second.
pub(super) fn records_with_command_rate(
    effects: &str,
    (multisine, squares): (f64, usize),
    (loop_rate_hz, sample_rate_hz): (u32, u32),
) -> Experiment {
    let model: Model = toml::from_str(&format!("{MOTOR}{effects}")).unwrap();
    let mut plan = Plan::paper(&model);
    (plan.loop_rate_hz, plan.sample_rate_hz, plan.esc_frame_hz, plan.seed) = (loop_rate_hz, sample_rate_hz, None, 3);
    plan.noise = Noise { sigma_n: 0.01, ..Noise::default() };
    plan.records.clear();
    for nominal in [0.4, 0.6] {
        let of = |excitation, amplitude| PlannedRecord {
            amplitude: Some(amplitude),
            periods: Some(3),
            warm_up_periods: Some(0),
            ..PlannedRecord::new(nominal, excitation)
        };
        let lines = PlannedRecord { lines: Some(150), realization: Some(1), ..of(Excitation::Multisine, multisine) };
        plan.records.push(lines);
        for _ in 0..squares {
            plan.records.push(PlannedRecord { half_period_s: Some(5.0), ..of(Excitation::Square, 0.05) });
        }
    }
    run(&plan, &model, None, &|_| {}).unwrap()
}

/// What is compared of them, by weights that are not known yet, and the lags to begin with.
pub(super) fn likelihood(records: &Experiment) -> (Likelihood, Vec<BasePoint>) {
    let data = Dataset::new(records, false).unwrap();
    let base = first_model(records, &data, None).unwrap();
    (Likelihood::unit(Arc::new(data)), base)
}
