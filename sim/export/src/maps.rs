//! Steady thrust and steady speed over the command, from the model and from records.

use rotorlead_plant::{MapPolynomial, Model, StaticMap};
use rotorlead_records::{Experiment, Output};

use rotorlead_identify::static_map::{SteadyPoints, SteadySource, fit_static_map};

use super::levels::END;

/// Steady responses where they are known.
#[derive(Debug, Default)]
pub(super) struct Maps {
    pub(super) thrust_n: Option<StaticMap>,
    pub(super) rpm: Option<StaticMap>,
    /// Thrust and rotor speed of the same records, where these have both.
    pub(super) thrust_n_and_rpm: Option<(StaticMap, StaticMap)>,
}

impl Maps {
    /// The model's map, and the records' where the model has none of that response.
    pub(super) fn from_model(model: &Model, experiment: Option<&Experiment>) -> Self {
        let output = model.provenance.as_ref().map(|provenance| provenance.output);
        let [thrust_n, rpm] = [Output::ThrustN, Output::Rpm]
            .map(|wanted| experiment.and_then(|experiment| map_from_records(experiment, wanted)));
        let of = |wanted, of_records: &Option<StaticMap>| {
            let of_model = model.static_map.clone().filter(|_| output == Some(wanted));
            of_model.or_else(|| of_records.clone())
        };
        Self {
            thrust_n: of(Output::ThrustN, &thrust_n),
            rpm: of(Output::Rpm, &rpm),
            thrust_n_and_rpm: thrust_n.zip(rpm),
        }
    }
}

fn map_from_records(experiment: &Experiment, output: Output) -> Option<StaticMap> {
    let mut points = SteadyPoints { running: Vec::new(), still: None, source: SteadySource::Plateaus };
    for record in experiment.records.iter().filter(|record| !record.compensated) {
        // Most records are no staircase, or lack the response.
        if let Ok(found) = SteadyPoints::from_record(record, output, None) {
            points.join(found);
        }
    }
    let polynomial = fit_static_map(&points).ok()?.polynomial();
    Some(StaticMap { polynomial: Some(polynomial), ..points.levels() })
}

/// Commands and responses of a map between two commands.
pub(super) fn between(map: &StaticMap, (low, high): (f64, f64)) -> impl Iterator<Item = (f64, f64)> + '_ {
    let levels = map.command.iter().copied().zip(map.response.iter().copied());
    levels.filter(move |(command, _)| (low - END..=high + END).contains(command))
}

/// All levels of a map, with that of standstill in front where the motor was seen at rest below them.
pub(super) fn with_standstill(map: &StaticMap) -> impl Iterator<Item = (f64, f64)> + '_ {
    let was_at_rest = map.polynomial.as_ref().is_some_and(|polynomial| polynomial.dead_zone.is_some());
    let starts_at_zero = map.command.first().is_none_or(|command| *command <= 0.0);
    let standstill = (was_at_rest && !starts_at_zero).then_some((0.0, 0.0));
    standstill.into_iter().chain(map.command.iter().copied().zip(map.response.iter().copied()))
}

/// Scatter of the levels around the map's polynomial with its degrees of freedom; `None` without as many levels.
pub(super) fn scatter(map: &StaticMap) -> Option<(f64, f64)> {
    let polynomial = map.polynomial.as_ref()?;
    let [low, high] = polynomial.range;
    let misses: Vec<f64> =
        between(map, (low, high)).map(|(command, response)| response - value(polynomial, command)).collect();
    let dof = misses.len().checked_sub(polynomial.coefficients.len()).filter(|dof| *dof > 0)? as f64;
    Some(((misses.iter().map(|miss| miss * miss).sum::<f64>() / dof).sqrt(), dof))
}

fn value(polynomial: &MapPolynomial, command: f64) -> f64 {
    let limited = polynomial.limit.map_or(command, |limit| command.min(limit));
    polynomial.coefficients.iter().rev().fold(0.0, |sum, coefficient| sum * limited + coefficient)
}
