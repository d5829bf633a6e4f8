//! Thrust as the square of a speed: the explanation that a difference of directions has to beat.
//!
//! A propeller's thrust goes with the square of its speed. Where the speed follows steps up and down with one time constant, thrust starts
//! more gently than it ends on the way up, and the other way round on the way down:
//!
//! ```text
//! T = k w^2,   w(t) = w1 + (w0 - w1) e^(-t/tau)
//! ```
//!
//! which a lag of thrust imitates by unequal time constants, or one that depends on the operating point. The curvature of the
//! catalog's static map does not say it: the map from command to speed bends the other way ahead of the lag, and both together may well be
//! a straight line. So the square root of thrust is diagnosed as a speed is, with its steady values as measured, and what this names
//! stands where it explains more than the same does of thrust itself: levels that are off say nothing of the square.

use rotorlead_plant::effect::{asymmetric_lag, operating_point_lag, quadratic_thrust};
use rotorlead_plant::{Effect, Model};
use rotorlead_records::{Experiment, Output};
use serde::Serialize;

use crate::assess::gap::Gap;
use crate::assess::verdict::Verdict;
use crate::outcome::Diagnosis;

/// What the square imitates in thrust.
const IMITATED: [&str; 2] = [asymmetric_lag::ID, operating_point_lag::ID];

/// Thrust that is the square of a speed, which was diagnosed in place of thrust.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SquareOfSpeed {
    /// What a lag of thrust explains, with what would be named beside it.
    pub gap_of_thrust: Gap,
    /// Identifiers of these names.
    pub instead_of: Vec<&'static str>,
    /// Time constant of the speed about each nominal command, seconds.
    pub time_constants_s: Vec<f64>,
}

/// Thrust itself, and its square root, as the speeds of `experiment`, where `found` names of it what the square imitates, or does not
/// explain it.
pub(crate) fn as_speeds(experiment: &Experiment, found: &Diagnosis) -> Option<[Experiment; 2]> {
    let is_imitated = found.effects.iter().any(|effect| IMITATED.contains(&effect.kind.id));
    let is_steps = experiment.records.iter().all(|record| !record.excitation.is_periodic());
    let is_open = matches!(found.verdict, Verdict::PartlyNamed | Verdict::Unknown);
    if !(is_imitated || is_open) || !is_steps || experiment.output != Output::ThrustN {
        return None;
    }
    let with_speed = |speed: fn(f64) -> f64| {
        let mut speeds = Experiment { output: Output::Rpm, ..experiment.clone() };
        for record in &mut speeds.records {
            record.rpm = Some(record.thrust_n.take()?.into_iter().map(speed).collect());
        }
        Some(speeds)
    };
    // An offset or noise below zero is no speed.
    Some([with_speed(|thrust| thrust)?, with_speed(|thrust| thrust.max(0.0).sqrt())?])
}

/// The diagnosis of `speeds` as one of thrust, where it explains more than that of thrust does, by `found` and as a speed.
pub(crate) fn explained(
    (found, of_thrust): (&Diagnosis, &Diagnosis),
    speeds: &Experiment,
    mut of_speeds: Diagnosis,
) -> Option<Diagnosis> {
    // What has no name is not to get half of one.
    let is_explained = matches!(of_speeds.verdict, Verdict::Agrees | Verdict::Named);
    if found.verdict == Verdict::Unknown && !is_explained {
        return None;
    }
    if ![found, of_thrust].iter().all(|other| of_speeds.gap.explains_more_than(other.gap)) {
        return None;
    }
    of_speeds.square_of_speed = Some(SquareOfSpeed {
        gap_of_thrust: found.gap,
        instead_of: found.effects.iter().map(|effect| effect.kind.id).collect(),
        time_constants_s: of_speeds.model.points.iter().map(|point| point.time_constant_s).collect(),
    });
    of_speeds.model = squared(&of_speeds.model, speeds)?;
    of_speeds.conditions.output = Output::ThrustN;
    // It is of the square root.
    of_speeds.residual = None;
    Some(of_speeds)
}

/// A model of the square root as one of thrust: `T = (s + g d)^2 = s^2 + 2 s g d + g^2 d^2`, a gain of `2 s g` and behind the lag a
/// curvature of `g / (2 s)`, with `s` the mean of the square root at the nominal command.
fn squared(model: &Model, speeds: &Experiment) -> Option<Model> {
    let mean_at = |nominal: f64| {
        let own =
            speeds.records.iter().filter(|record| (record.nominal - nominal).abs() < rotorlead_records::SAME_NOMINAL);
        let rows: Vec<f64> = own.filter_map(|record| record.rpm.as_deref()).flatten().copied().collect();
        rotorlead_numerics::sample::mean(&rows)
    };
    let mut squared = Model { static_map: None, ..model.clone() };
    let mut curvatures = Vec::new();
    for point in &mut squared.points {
        let root = mean_at(point.nominal);
        curvatures.push(point.gain / (2.0 * root));
        point.gain *= 2.0 * root;
        point.gain_std = point.gain_std.map(|std| std * 2.0 * root);
    }
    let curvature = rotorlead_numerics::sample::mean(&curvatures);
    let parameters = [("curvature_per_duty", curvature), ("behind_lag", 1.0)];
    squared.effects.push(Effect {
        kind: quadratic_thrust::ID.to_owned(),
        parameters: parameters.map(|(name, value)| (name.to_owned(), value)).into(),
        std: [].into(),
    });
    curvature.is_finite().then_some(squared)
}
