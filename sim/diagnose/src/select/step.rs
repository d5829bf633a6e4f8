//! Which of the kinds that were tried is taken as the next effect.
//!
//! The most valuable one, if its values are those of an actuator. Two things make them look as if they were not. The noise that a
//! poor fit leaves is more than noise, and hides a part of the effect: its values are evaluated once more by the noise that is left
//! with it. And where two effects act, a kind that can take any shape may do better in their place than either of them alone:
//! the most valuable one of an actuator's values is taken then, and believed if in the end nothing but noise is left.

use crate::estimate::fit::Fit;
use crate::select::explain::Search;
use crate::select::policy::ALIKE;
use crate::select::tried::Tried;

/// An effect that is taken.
pub(crate) struct Step {
    /// What it was worth.
    pub tried: Tried,
    /// The fit with it, by the noise that it leaves.
    pub fit: Fit,
    /// Whether another kind scored higher by more than chance.
    pub is_backtracking: bool,
}

impl Search<'_> {
    /// The next effect among kinds that were tried, the best first. Backtracking only as `is_first`. `None` where none may be named.
    pub fn next_effect(&mut self, tried: &[Tried], is_first: bool) -> Option<Step> {
        let best = tried.first()?;
        for tried in tried.iter().filter(|tried| tried.scores_enough()) {
            let is_backtracking = best.score() - tried.score() >= ALIKE;
            let is_best = tried.kind == best.kind;
            if (is_backtracking && !is_first) || !(is_best || tried.is_plausible()) {
                continue;
            }
            let weights = self.likelihood.clone();
            let fit = self.settle(&tried.fit.hypothesis, self.lags);
            if let Some(fit) = fit.filter(Fit::is_plausible) {
                return Some(Step { tried: tried.clone(), fit, is_backtracking });
            }
            self.likelihood = weights;
        }
        None
    }
}
