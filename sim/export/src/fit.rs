//! A stack's law of thrust fitted to a static map.

use rotorlead_numerics::least_squares::{Residuals, StoppingCriteria, minimize};

use super::law::ThrustLaw;
use rotorlead_identify::estimate::Estimate;

/// A law's parameter as a map tells it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ThrustLawEstimate {
    /// The parameter. Its standard error is from what the law leaves, which holds noise and what the law cannot follow.
    pub(super) parameter: Estimate,
    /// The commands of the levels that are fitted.
    pub(super) measured: (f64, f64),
    /// The worst error of the law there, % of the thrust at the highest motor output.
    pub(super) worst_error_percent: f64,
}

/// Levels beyond the parameters that are needed to tell an error. Chosen: a 95 % interval then reaches 4.3 standard errors (Student's t, 2
/// degrees of freedom); with one it reaches 12.7, more refuse short staircases.
const SPARE_LEVELS: usize = 2;

/// Fits `thrust = offset + span law(r)` to levels (command, thrust), where `r` goes from 0 to 1 in the motor's output range.
/// A stack that never stops its motors counts thrust from that at its lowest output, the offset; at a command of 0 it is 0.
pub(super) fn fit(law: ThrustLaw, levels: &[(f64, f64)], (low, high): (f64, f64)) -> Result<ThrustLawEstimate, String> {
    let has_offset = low > 0.0;
    let parameters = if has_offset { 3 } else { 2 };
    if levels.len() < parameters + SPARE_LEVELS {
        return Err(format!(
            "{} levels are measured between commands of {low} and {high}, and {} are needed: record a staircase with more",
            levels.len(),
            parameters + SPARE_LEVELS
        ));
    }
    let full = levels.iter().map(|(_, thrust)| *thrust).fold(0.0, f64::max);
    if full <= 0.0 {
        return Err(String::from("no level has a thrust above zero: check the sign of the load cell"));
    }
    let shares: Vec<(f64, f64)> =
        levels.iter().map(|(command, thrust)| ((command - low) / (high - low), thrust / full)).collect();
    let problem = ThrustLawResiduals { law, levels: &shares, has_offset };
    let start = [0.0, 1.0, 0.0];
    let solution =
        minimize(&problem, &start[..parameters], StoppingCriteria::default()).filter(|found| found.converged);
    let (solution, covariance) = solution
        .and_then(|found| found.unit_covariance.clone().map(|covariance| (found, covariance)))
        .ok_or("the stack's law does not fit the static map: look at it in the report of `rotorlead identify`")?;
    let dof = (levels.len() - parameters) as f64;
    let std = (solution.sum_of_squares / dof * covariance[(0, 0)]).sqrt();
    let worst = solution.residuals.iter().fold(0.0_f64, |worst, miss| worst.max(miss.abs()));
    let at_top = solution.parameters[1] + solution.parameters.get(2).unwrap_or(&0.0);
    Ok(ThrustLawEstimate {
        parameter: Estimate { value: solution.parameters[0], std, dof },
        measured: (levels[0].0, levels[levels.len() - 1].0),
        worst_error_percent: 100.0 * worst / at_top,
    })
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
