//! Kinds tried beside a fit: those that the screening promises are searched, the promising ones to the end.

use rotorlead_plant::effect::{Kind, Site};

use super::auxiliary;
use crate::estimate::fit::{Fit, fit_in};
use crate::estimate::prediction::Near;
use crate::model::candidate::Candidate;
use crate::model::hypothesis::Hypothesis;
use crate::select::explain::Search;
use crate::select::policy::{
    ALIKE, FIRST_STEPS, LEAST_SCORE, MOST_FINISHED, MOST_FITTED, MOST_STARTS, PART_OF_BEST, PROMISED,
};
use crate::select::screen::Screened;
use crate::select::tried::{Tried, by_score, complexity_penalty};

impl Search<'_> {
    /// Kinds that improve on `from`, best first.
    pub fn tries(&self, from: &Fit, exclude: &[&'static Kind]) -> Vec<Tried> {
        self.tries_of(from, self.screened(from, exclude), None)
    }

    /// Kinds that improve on `from` of those that were screened, best first; with `own`, which they have to compete with.
    pub fn tries_of(&self, from: &Fit, screened: Vec<Screened>, own: Option<Tried>) -> Vec<Tried> {
        let beside = self.beside(from);
        let mut tried: Vec<Tried> = Vec::new();
        for (start, kind) in promising(from, &screened, own.as_ref(), PART_OF_BEST) {
            let Some(fit) = fit_in(&self.likelihood, &start, self.lags, FIRST_STEPS) else { continue };
            let found = self.tried(&beside, (fit, Near::FirstOrder), kind, complexity_penalty(kind));
            match tried.iter_mut().find(|other| other.kind == kind) {
                Some(other) if found.fitted_gain > other.fitted_gain => *other = found,
                Some(_) => {}
                None => tried.push(found),
            }
            (self.progress)();
        }
        let own_kind = own.as_ref().map(|own| own.kind);
        tried.extend(own);
        tried.sort_by(by_score);
        let best = tried.first().map_or(0.0, Tried::score);
        for (place, tried) in tried.iter_mut().enumerate() {
            let may_be_best = place < MOST_FINISHED && tried.score() > PART_OF_BEST * best;
            if (may_be_best || best - tried.score() < MOST_FINISHED as f64 * ALIKE) && Some(tried.kind) != own_kind {
                let start = tried.fit.hypothesis.clone();
                if let Some(finished) = self.attempt(&beside, &start, tried.kind, best - tried.score()) {
                    *tried = finished;
                }
                (self.progress)();
            }
        }
        self.compare_auxiliary_channels(&mut tried);
        // A hold whose frames do not show is, by all that is known, a delay.
        let hidden = |tried: &Tried| tried.fit.hypothesis.effects.last().is_some_and(Candidate::is_hidden_hold);
        if let Some(delay) = tried.iter().position(|tried| tried.kind.site == Site::Line)
            && tried.first().is_some_and(hidden)
            && tried[0].score() - tried[delay].score() < ALIKE
        {
            tried[..=delay].rotate_right(1);
        }
        tried
    }

    /// Lets the columns beside the response speak where kinds, the best first, are within chance of the best.
    pub fn compare_auxiliary_channels(&self, tried: &mut [Tried]) {
        tried.iter_mut().for_each(|tried| tried.auxiliary_gain = 0.0);
        tried.sort_by(by_score);
        let alike = tried.iter().take_while(|other| tried[0].score() - other.score() < ALIKE).count();
        let fits: Vec<&Fit> = tried[..alike].iter().map(|tried| &tried.fit).collect();
        let Some(gains) = (alike > 1).then(|| auxiliary::auxiliary_gains(&self.likelihood, &fits)).flatten() else {
            return;
        };
        tried[..alike].iter_mut().zip(gains).for_each(|(tried, gain)| tried.auxiliary_gain = gain);
        tried.sort_by(by_score);
    }
}

/// The starts to search from, of those that were screened, the most promising first: of kinds that promise at least this part of the
/// best, and of a few in any case.
pub(crate) fn promising(
    from: &Fit,
    screened: &[Screened],
    own: Option<&Tried>,
    part_of_best: f64,
) -> Vec<(Hypothesis, &'static Kind)> {
    // A gain of log likelihood is half of one of the chi-square.
    let best = screened.first().map_or(0.0, |best| from.chi_square - best.0);
    let best = own.map_or(best, |own| best.max(2.0 * own.fitted_gain));
    // Where there is nothing to compete with, the result says what comes next.
    let fewest = if own.is_some() { 0 } else { MOST_FINISHED };
    let mut chosen: Vec<(Hypothesis, &'static Kind)> = Vec::new();
    let mut kinds: Vec<&'static Kind> = Vec::new();
    for (left, start, kind) in screened {
        let gain = from.chi_square - left;
        let is_new = !kinds.contains(kind);
        let is_behind = is_new && (kinds.len() >= MOST_FITTED || kinds.len() >= fewest && gain < part_of_best * best);
        // What promises much less than has to be there is not searched.
        if gain < 2.0 * PROMISED * LEAST_SCORE || is_behind {
            continue;
        }
        let of_kind = chosen.iter().filter(|(_, other)| other == kind).filter_map(|(other, _)| other.effects.last());
        let is_known = start.effects.last().is_some_and(|start| of_kind.clone().any(|other| start.is_near(other)));
        if of_kind.count() >= MOST_STARTS || is_known {
            continue;
        }
        if is_new {
            kinds.push(kind);
        }
        chosen.push((start.clone(), kind));
    }
    chosen
}
