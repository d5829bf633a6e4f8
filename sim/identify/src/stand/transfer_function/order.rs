//! How many poles and zeros: by the likelihood of lines that the fit has not seen.
//!
//! The lines are split in two, every other one; each half is predicted by a fit to the other. The score of a structure is
//!
//! ```text
//! 2 sum over all lines of |G_k - prediction|^2 / s_k^2  +  p ln(2 N)
//! ```
//!
//! with `p` its parameters and `N` the lines: minus twice the held-out log-likelihood, and the penalty of the Bayesian
//! information criterion (Schwarz, 1978). The held-out part alone settles on too high an order about once in ten times, since it
//! punishes an idle parameter by no more than what the noise may win by chance.
//!
//! The number of poles is chosen first, with one zero less than poles; then the number of zeros.

use std::ops::RangeInclusive;

use super::data::WeightedLines;
use super::{MOST_POLES, ParametricError, ParametricFit, Structure, fit, search};
use crate::estimate::uncertainty::NoiseKnowledge;
use crate::frequency_response::FrequencyResponse;

/// How well a structure predicts lines that it was not fitted to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OrderScore {
    /// The structure.
    pub structure: Structure,
    /// Held-out chi-square per real number predicted: one for a right model. Infinite where no fit was found.
    pub held_out: f64,
    /// The score that is compared, penalty included; lower is better.
    pub score: f64,
}

/// The structure chosen, and what it was chosen from.
#[derive(Clone, Debug, PartialEq)]
pub struct OrderSelection {
    /// The fit of the chosen structure to all lines.
    pub fit: ParametricFit,
    /// All structures tried, in the order of trial.
    pub scores: Vec<OrderScore>,
}

/// Chooses the number of poles within `poles`, and that of zeros, and fits it to all lines.
///
/// # Errors
/// Those of [`super::fit_parametric`]; [`ParametricError::NoFit`] when no order can be fitted.
pub fn select_order(
    response: &FrequencyResponse,
    poles: RangeInclusive<usize>,
) -> Result<OrderSelection, ParametricError> {
    if poles.is_empty() || *poles.start() < 1 || *poles.end() > MOST_POLES {
        return Err(ParametricError::Structure { poles: *poles.end(), zeros: 0, most: MOST_POLES });
    }
    let data = WeightedLines::new(response)?;
    let noise = response.noise_knowledge();
    let mut trials = Trials { halves: [data.half(0), data.half(1)], noise, scores: Vec::new() };
    for poles in poles {
        trials.run(poles, poles - 1);
    }
    let too_few = ParametricError::TooFewLines { lines: data.len(), parameters: 3 };
    let poles = trials.best().ok_or(too_few)?.structure.poles;
    for zeros in (0..=poles).filter(|zeros| zeros + 1 != poles) {
        trials.run(poles, zeros);
    }
    let scores = trials.scores;
    let mut ranked = scores.clone();
    ranked.sort_by(|a, b| a.score.total_cmp(&b.score));
    let mut failure = ParametricError::NoFit { poles, zeros: poles - 1, reason: "no order can be fitted" };
    for candidate in ranked.iter().filter(|candidate| candidate.score.is_finite()) {
        match fit(&data, candidate.structure, noise) {
            Ok(fit) => return Ok(OrderSelection { fit, scores }),
            Err(error) => failure = error,
        }
    }
    Err(failure)
}

/// The structures tried so far.
struct Trials {
    halves: [WeightedLines; 2],
    noise: NoiseKnowledge,
    scores: Vec<OrderScore>,
}

impl Trials {
    fn best(&self) -> Option<OrderScore> {
        self.scores.iter().copied().min_by(|a, b| a.score.total_cmp(&b.score))
    }

    /// Scores a structure, where the lines suffice for it.
    fn run(&mut self, poles: usize, zeros: usize) {
        let structure = Structure::new(poles, zeros);
        let [a, b] = &self.halves;
        if structure.check(b.len()).is_err() {
            return;
        }
        let chi_square = match (self.predict(structure, a, b), self.predict(structure, b, a)) {
            (Some(ab), Some(ba)) => ab + ba,
            _ => f64::INFINITY,
        };
        let parts = 2.0 * (a.len() + b.len()) as f64;
        let penalty = structure.parameters() as f64 * parts.ln();
        self.scores.push(OrderScore { structure, held_out: chi_square / parts, score: chi_square + penalty });
    }

    /// Chi-square of the lines `to` about the fit to the lines `from`.
    fn predict(&self, structure: Structure, from: &WeightedLines, to: &WeightedLines) -> Option<f64> {
        let found = search::search(from, structure).ok()?;
        let chi_square = (0..to.len()).map(|k| {
            let model = found.sections.response(&found.solution.parameters, to.omega_rad_s[k]);
            2.0 * (model - to.response[k]).norm_sqr() * to.weight[k].powi(2)
        });
        Some(chi_square.sum::<f64>() / self.noise.residual_inflation())
    }
}
