//! A stack's law of thrust fitted to a static map.

use nalgebra::DMatrix;
use rotorlead_numerics::least_squares::{Residuals, Solution, StoppingCriteria, minimize};

use super::law::ThrustLaw;
use super::levels::{END, Level};
use rotorlead_identify::estimate::Estimate;

/// A law's parameter as a map tells it.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ThrustLawEstimate {
    /// The parameter. Its standard error is from what the law leaves, which holds noise and what the law cannot follow.
    pub(super) parameter: Estimate,
    /// The commands of the levels that are fitted.
    pub(super) measured: (f64, f64),
    /// The ends of the output range that are between levels.
    pub(super) interpolated: Vec<f64>,
    /// The worst error of the law there, % of the thrust at the highest motor output.
    pub(super) worst_error_percent: f64,
}

/// Levels beyond the parameters that are needed to tell an error. Chosen: a 95 % interval then reaches 4.3 standard errors (Student's t, 2
/// degrees of freedom); with one it reaches 12.7, more refuse short staircases.
const SPARE_LEVELS: usize = 2;

/// Fits `thrust = offset + span law(r)` to levels (command, thrust), where `r` goes from 0 to 1 in the motor's output range.
/// A stack that never stops its motors counts thrust from that at its lowest output, the offset; at a command of 0 it is 0.
/// An end of the range between two levels is interpolated.
pub(super) fn fit(law: ThrustLaw, levels: &[(f64, f64)], (low, high): (f64, f64)) -> Result<ThrustLawEstimate, String> {
    let has_offset = low > 0.0;
    let bottom = has_offset.then(|| Level::at_bottom(levels, low)).transpose()?;
    let ends = bottom.into_iter().chain([Level::at_top(levels, high)?]);
    let interpolated: Vec<Level> = ends.filter(Level::is_interpolated).collect();
    let parameters = if has_offset { 3 } else { 2 };
    // At a command of 0 a law without an offset is 0 whatever its parameter.
    let is_informative = |command: f64| (low - END..=high + END).contains(&command) && (has_offset || command > 0.0);
    let is_within = |(_, level): &(usize, &(f64, f64))| is_informative(level.0);
    let measured: Vec<Level> =
        levels.iter().enumerate().filter(is_within).map(|(index, level)| Level::measured(index, *level)).collect();
    if measured.len() < parameters + SPARE_LEVELS {
        return Err(format!(
            "{} levels are measured between commands of {low} and {high}, and {} are needed: record a staircase with more",
            measured.len(),
            parameters + SPARE_LEVELS
        ));
    }
    let measured_between = (measured[0].command, measured[measured.len() - 1].command);
    let fitted = [measured, interpolated].concat();
    let full = fitted.iter().map(|level| level.response).fold(0.0, f64::max);
    if full <= 0.0 {
        return Err(String::from("no level has a thrust above zero: check the sign of the load cell"));
    }
    let shares: Vec<(f64, f64)> =
        fitted.iter().map(|level| ((level.command - low) / (high - low), level.response / full)).collect();
    let problem = ThrustLawResiduals { law, levels: &shares, has_offset };
    let start = [0.0, 1.0, 0.0];
    let solution =
        minimize(&problem, &start[..parameters], StoppingCriteria::default()).filter(|found| found.converged);
    let (solution, error) = solution
        .and_then(|found| parameter_error(&found, &fitted, levels.len(), full).map(|error| (found, error)))
        .ok_or("the stack's law does not fit the static map: look at it in the report of `rotorlead identify`")?;
    let worst = solution.residuals.iter().fold(0.0_f64, |worst, miss| worst.max(miss.abs()));
    let at_top = solution.parameters[1] + solution.parameters.get(2).unwrap_or(&0.0);
    Ok(ThrustLawEstimate {
        parameter: Estimate { value: solution.parameters[0], std: error.0, dof: error.1 },
        measured: measured_between,
        interpolated: fitted.iter().filter(|level| level.is_interpolated()).map(|level| level.command).collect(),
        worst_error_percent: 100.0 * worst / at_top,
    })
}

/// Standard error of the law's parameter and its degrees of freedom. The levels' errors are alike and independent: an interpolated one has
/// those of the levels that it is from, and that of the interpolation on top. `None` where the levels do not tell the parameter.
fn parameter_error(solution: &Solution, fitted: &[Level], levels: usize, full: f64) -> Option<(f64, f64)> {
    let mut weights = DMatrix::zeros(fitted.len(), levels);
    for (row, level) in fitted.iter().enumerate() {
        for (index, weight) in &level.weights {
            weights[(row, *index)] = *weight;
        }
    }
    // First order: parameters move by `gain` times the errors, and the residuals are what is left of these.
    let gain = solution.unit_covariance.as_ref()? * solution.jacobian.transpose();
    let own = gain.row(0);
    let left = &weights - &solution.jacobian * &gain * &weights;
    // Mean and spread of a sum of squares of correlated residuals (Satterthwaite, An approximate distribution of estimates of variance
    // components, 1946); for levels that were all measured, the levels less the parameters.
    let squares = left.tr_mul(&left);
    let dof = squares.trace().powi(2) / squares.norm_squared();
    let variance = solution.sum_of_squares / squares.trace();
    let of_levels = variance * (own * &weights).norm_squared();
    let of_interpolation = own.iter().zip(fitted).map(|(gain, level)| (gain * level.error / full).powi(2));
    Some(((of_levels + of_interpolation.sum::<f64>()).sqrt(), dof))
}

/// Shares of the highest thrust at shares of the motor output; parameters are the law's, the span and the offset.
struct ThrustLawResiduals<'a> {
    law: ThrustLaw,
    levels: &'a [(f64, f64)],
    has_offset: bool,
}

impl Residuals for ThrustLawResiduals<'_> {
    fn count(&self) -> usize {
        self.levels.len()
    }

    fn evaluate(&self, p: &[f64], out: &mut [f64]) -> bool {
        let offset = if self.has_offset { p[2] } else { 0.0 };
        out.iter_mut().zip(self.levels).all(|(out, (r, share))| {
            self.law.thrust(*r, p[0]).map(|thrust| *out = offset + p[1] * thrust - share).is_some()
        })
    }
}
