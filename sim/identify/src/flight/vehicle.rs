//! What the rest of a vehicle makes of a rotor's speed.
//!
//! The thrust of all motors turns and lifts the vehicle, which blows on the rotor and unloads it: a path from command to speed with an
//! integral in it, that a lag alone would take for a longer time constant. And all motors draw on one battery. Both are linear in speeds
//! that are in the log, and get terms of their own beside the lag.

use rotorlead_numerics::sample::mean;
use rotorlead_records::{Excitation, Experiment, Record};

use super::series::Sample;

/// Memory of a vehicle's motion, s. Chosen: a rate loop and a pilot take back within some tenths of a second what a thrust did.
const MOTION_S: f64 = 0.4;

/// The terms, at the samples: leaky integrals of the motor's command and of the other motors' speeds, and the mean of those.
pub(super) fn terms(experiment: &Experiment, record: &Record, samples: &[Sample]) -> Vec<Vec<f64>> {
    let is_other = |other: &&Record| {
        other.excitation == Excitation::Flight && other.file != record.file && other.time_s == record.time_s
    };
    let others = experiment.records.iter().filter(is_other).filter_map(|other| other.response(experiment.output));
    let others: Vec<Vec<f64>> = others.filter(|rpm| rpm.len() == record.time_s.len()).map(about_mean).collect();
    let at_samples =
        |values: &[f64]| -> Vec<f64> { samples.iter().map(|sample| mean(&values[sample.rows.clone()])).collect() };
    let integral = |values: &[f64]| {
        let mut sum = 0.0;
        let of_row = |(row, _): (usize, &f64)| {
            if row > 0 {
                let interval_s = record.time_s[row] - record.time_s[row - 1];
                sum += interval_s * (values[row - 1] - sum / MOTION_S);
            }
            sum
        };
        at_samples(&values.iter().enumerate().map(of_row).collect::<Vec<f64>>())
    };
    let mut terms = vec![integral(&about_mean(&record.command))];
    terms.extend(others.iter().map(|rpm| integral(rpm)));
    if !others.is_empty() {
        let mean_of_others = |row: usize| others.iter().map(|rpm| rpm[row]).sum::<f64>() / others.len() as f64;
        terms.push(at_samples(&(0..record.time_s.len()).map(mean_of_others).collect::<Vec<f64>>()));
    }
    terms
}

/// Values relative to their mean, less one.
fn about_mean(values: &[f64]) -> Vec<f64> {
    let center = mean(values);
    let scale = if center == 0.0 { 1.0 } else { center.recip() };
    values.iter().map(|value| scale * (value - center)).collect()
}
