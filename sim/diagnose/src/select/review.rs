//! Each effect once more beside the others: what makes it redundant, what serves better in its place, and what would do as well.

use rotorlead_plant::effect::Kind;

use crate::estimate::fit::{Fit, fit};
use crate::select::explain::{Found, Search};
use crate::select::policy::{ALIKE, MOST_EFFECTS, MOST_FINISHED, PART_OF_BEST};
use crate::select::tried::Tried;

impl Search<'_> {
    /// Kinds that were tried beside `from`, as it was found then, by the noise of now: those that may be the best, and `own`.
    fn again(&self, from: &Fit, tried: &[Tried], own: Option<Tried>) -> Vec<Tried> {
        let best = tried.first().map_or(0.0, Tried::score);
        let own_kind = own.as_ref().map(|own| own.kind);
        let is_near = |other: &&Tried| other.score() > PART_OF_BEST * best && Some(other.kind) != own_kind;
        let near = tried.iter().filter(is_near).take(MOST_FINISHED);
        let beside = self.beside(from);
        let mut again: Vec<Tried> = near
            .filter_map(|tried| self.attempt(&beside, &tried.fit.hypothesis, tried.kind, best - tried.score()))
            .chain(own)
            .collect();
        self.compare_auxiliary_channels(&mut again);
        again
    }

    /// Tries each effect again beside the others: drops it, exchanges it, or keeps it with what would do as well. Beside the last
    /// one nothing has changed since `last_tried`, as long as the others stay.
    pub fn review(&mut self, mut current: Fit, mut last_tried: Option<Vec<Tried>>) -> Option<(Fit, Vec<Found>)> {
        let mut found: Vec<Option<Found>> = vec![None; current.hypothesis.effects.len()];
        let mut effect = 0;
        let mut exchanges = 0;
        while effect < current.hypothesis.effects.len() {
            let kind = current.hypothesis.effects[effect].kind;
            let rest = fit(&self.likelihood, &current.hypothesis.without(effect), self.lags)?;
            let named: Vec<&'static Kind> = current.hypothesis.effects.iter().map(|other| other.kind).collect();
            let is_last = effect + 1 == current.hypothesis.effects.len();
            // From the fit that it has. Its effect is the last one as far as that is asked for.
            let own = self.attempt(&self.beside(&rest), &current.hypothesis.with_last(effect), kind, 0.0);
            let tried = match last_tried.take_if(|_| is_last) {
                Some(tried) => self.again(&rest, &tried, own),
                None => self.tries_of(&rest, self.screened(&rest, &named), own),
            };
            let most = tried.first().map_or(0.0, Tried::score);
            let Some(best) = tried.iter().find(|best| best.may_be_named() && most - best.score() < ALIKE) else {
                current = rest;
                found.remove(effect);
                last_tried = None;
                continue;
            };
            if best.kind != kind && exchanges < MOST_EFFECTS {
                exchanges += 1;
                last_tried = None;
                current = self.settle(&best.fit.hypothesis.clone(), self.lags)?;
                // The new one is the last; all are evaluated beside it.
                found = vec![None; current.hypothesis.effects.len()];
                effect = 0;
                continue;
            }
            let others = tried.iter().filter(|other| other.kind != kind && other.may_be_named());
            let alternatives =
                others.filter(|other| best.score() - other.score() < ALIKE).map(|other| other.kind).collect();
            found[effect] = Some(Found { kind, score: best.score(), alternatives });
            effect += 1;
        }
        let mut order: Vec<usize> = (0..found.len()).collect();
        let score = |effect: usize| found[effect].as_ref().map_or(0.0, |found| found.score);
        order.sort_by(|a, b| score(*b).total_cmp(&score(*a)));
        let mut sorted = current.hypothesis.clone();
        sorted.effects = order.iter().map(|&effect| current.hypothesis.effects[effect].clone()).collect();
        let after = fit(&self.likelihood, &sorted, self.lags)?;
        Some((after, order.into_iter().filter_map(|effect| found[effect].clone()).collect()))
    }
}
