//! Two effects that are seen together only.
//!
//! Where two effects act, the kind that does most in their place alone may be neither of them, and what it leaves leads nowhere.
//! Then every kind that does a good part alone is a beginning, and what a second one promises beside it decides between them. The
//! two are believed where they leave nothing but noise: among so many pairs one always does better than the rest.

use rotorlead_plant::effect::Kind;

use crate::estimate::fit::{Fit, fit_in};
use crate::model::candidate::Candidate;
use crate::model::hypothesis::Hypothesis;
use crate::select::explain::{Found, Search};
use crate::select::policy::{FIRST_STEPS, MOST_BEGINNINGS, MOST_FINISHED, PART_OF_BEST};
use crate::select::tried::Tried;

/// Two kinds with what they promise to leave of the chi-square.
struct Pair {
    left: f64,
    start: Hypothesis,
    kinds: [&'static Kind; 2],
}

impl Pair {
    fn is(&self, kinds: &[&'static Kind; 2]) -> bool {
        kinds.iter().all(|kind| self.kinds.contains(kind))
    }
}

impl Search<'_> {
    /// The two effects that explain all, of which one is among those that were `tried` beside the lags alone.
    pub fn two_at_once(&mut self, tried: &[Tried]) -> Option<(Fit, Vec<Found>)> {
        let noise = self.likelihood.clone();
        for pair in self.pairs(tried).into_iter().take(MOST_FINISHED) {
            self.likelihood.clone_from(&noise);
            let both = fit_in(&self.likelihood, &pair.start, self.lags, FIRST_STEPS)
                .and_then(|both| self.settle(&both.hypothesis, self.lags))
                .and_then(|both| self.with_frames(both))
                .filter(|both| both.is_plausible() && self.explains_all(both));
            let Some(both) = both else { continue };
            if let Some(reviewed) = self.review(both, None).filter(|(reviewed, _)| self.explains_all(reviewed)) {
                return Some(reviewed);
            }
        }
        None
    }

    /// `both` with the frames of a hold where the records show them: where they are leaves more than what a further effect does.
    fn with_frames(&mut self, both: Fit) -> Option<Fit> {
        let hidden = both.hypothesis.effects.iter().position(Candidate::is_hidden_hold);
        match hidden.and_then(|hold| self.framed(&both, hold, 0.0)) {
            Some(framed) => self.settle(&framed.hypothesis, self.lags),
            None => Some(both),
        }
    }

    /// Pairs of kinds, the most promising first.
    fn pairs(&self, tried: &[Tried]) -> Vec<Pair> {
        let best = tried.first().map_or(0.0, Tried::score);
        let beginnings = tried.iter().filter(|tried| tried.may_be_named() && tried.score() > PART_OF_BEST * best);
        let mut pairs: Vec<Pair> = Vec::new();
        for first in beginnings.take(MOST_BEGINNINGS) {
            // The best start of a kind comes first.
            for (left, start, second) in self.screened(&first.fit, &[first.kind]).into_iter().take(MOST_FINISHED) {
                let kinds = [first.kind, second];
                match pairs.iter_mut().find(|pair| pair.is(&kinds)) {
                    Some(pair) if left < pair.left => *pair = Pair { left, start, kinds },
                    Some(_) => {}
                    None => pairs.push(Pair { left, start, kinds }),
                }
            }
        }
        pairs.sort_by(|a, b| a.left.total_cmp(&b.left));
        pairs
    }
}

#[cfg(test)]
mod tests {
    use rotorlead_plant::Catalog;

    use super::*;
    use crate::select::explain::Engine;
    use crate::testing::{likelihood, records};

    /// What is found at once in records of a motor with these effects.
    fn found_at_once(effects: &str) -> (Vec<&'static str>, Option<Vec<&'static str>>) {
        let (likelihood, base) = likelihood(&records(effects, 0.05, 1));
        let catalog = Catalog::standard();
        let mut search =
            Search { likelihood, catalog: &catalog, progress: &|| {}, lags: true, engine: Engine::default() };
        let before = search.settle(&Hypothesis::of_lags(base), true).unwrap();
        let tried = search.tries(&before, &[]);
        let alone = tried.iter().map(|tried| tried.kind.id).collect();
        let both = search.two_at_once(&tried).map(|(_, found)| {
            let mut kinds: Vec<&str> = found.iter().map(|found| found.kind.id).collect();
            kinds.sort_unstable();
            kinds
        });
        (alone, both)
    }

    const DELAY: &str = "[[effect]]\nkind = \"transport_delay\"\nparameters = { delay_s = 0.0075 }\n";
    const AIR: &str =
        "[[effect]]\nkind = \"inflow_lead\"\nparameters = { lead_ratio = 2.2, time_constant_s = 0.012 }\n";
    const SLOW: &str = "[[effect]]\nkind = \"asymmetric_lag\"\nparameters = { ratio = 1.6 }\n";

    #[test]
    fn two_effects_that_look_like_a_third_are_found_by_what_they_promise_together() {
        let (alone, both) = found_at_once(&[DELAY, AIR].concat());
        assert_eq!(alone[0], "stand_resonance");
        assert_eq!(both, Some(vec!["inflow_lead", "transport_delay"]));
    }

    #[test]
    fn no_two_effects_are_believed_where_three_act() {
        assert_eq!(found_at_once(&[DELAY, AIR, SLOW].concat()).1, None);
    }
}
