//! One search: a beam over sets of kinds, by their evidence.
//!
//! A member is a set of kinds that are fitted jointly with the lags. Every kind is tried beside each of the best members of one size,
//! and the best sets of the next size go on, whatever way they were reached: a pair is found though neither of its kinds is the best
//! alone. All members are compared under one noise; where what does not repeat is an effect's, the noise is taken once more from what
//! the best member leaves, and all follow.

use rotorlead_plant::effect::Kind;

use super::evidence::evidence;
use crate::data::dataset::Split;
use crate::estimate::fit::{Fit, fit, fit_in};
use crate::estimate::profile::profile_non_smooth;
use crate::model::candidate::Candidate;
use crate::model::hypothesis::Hypothesis;
use crate::select::explain::{Explanation, Found, Search};
use crate::select::policy::{ALIKE, HOPELESS, LEAST_SCORE, MOST_EFFECTS, PART_OF_BEST};
use crate::select::screen::Screened;
use crate::select::tried::{Tried, complexity_penalty};
use crate::select::tries::promising;
use crate::select::weak_evidence;

/// Members of a size that go on to the next, from none on.
const WIDTHS: [usize; MOST_EFFECTS] = [1, 4, 2];
/// Steps of a first joint fit, those of one that goes on, and how many do.
const FIRST: usize = 3;
const NEXT: usize = 12;
const GO_ON: usize = 5;
/// Members of a size that are fitted to the end, and of one kind that are bent.
const FINISHED: usize = 3;
const BENT: usize = 4;
/// What is behind by more than this does not catch up by a better fit.
const APART: f64 = 3.0 * ALIKE;
/// Members that are fitted again when the noise changes.
const KEPT: usize = 10;
/// Noise that changes the chi-square of the best by no more than this part is the same.
const SAME_NOISE: f64 = 0.02;
/// Part of the evidence of the best that a kind has to promise to be fitted, by the size of the set that it makes.
const PARTS_OF_BEST: [f64; MOST_EFFECTS] = [0.0, 0.5, 0.7];
/// A name that explains less than this part of what all explain is the shape of a larger one: where more than noise is left, and
/// where it is not.
const OF_LAW: f64 = 0.1;
const OF_NOISE: f64 = 2e-4;

/// A set of kinds with its fit.
#[derive(Clone, Debug)]
pub(crate) struct Member {
    pub fit: Fit,
    pub evidence: f64,
}

impl Member {
    fn kinds(&self) -> Vec<&'static Kind> {
        let mut kinds: Vec<&'static Kind> = self.fit.hypothesis.effects.iter().map(|effect| effect.kind).collect();
        kinds.sort_by_key(|kind| kind.id);
        kinds
    }

    /// Whether no value lies farther from where its effect vanishes than any actuator is plausible to have it.
    fn is_plausible(&self) -> bool {
        self.fit.hypothesis.effects.iter().all(|effect| effect.beyond_range_square() < 1.0)
    }

    fn size(&self) -> usize {
        self.fit.hypothesis.effects.len()
    }
}

/// The best member of each set.
#[derive(Clone, Debug, Default)]
struct Pool(Vec<Member>);

impl Pool {
    fn add(&mut self, member: Member) {
        let kinds = member.kinds();
        match self.0.iter_mut().find(|other| other.kinds() == kinds) {
            Some(other) if other.evidence < member.evidence => *other = member,
            Some(_) => {}
            None => self.0.push(member),
        }
        self.0.sort_by(|a, b| b.evidence.total_cmp(&a.evidence));
    }

    fn of_size(&self, size: usize) -> impl Iterator<Item = &Member> {
        self.0.iter().filter(move |member| member.size() == size)
    }

    fn of(&self, kinds: &[&'static Kind]) -> Option<&Member> {
        self.0.iter().find(|member| member.kinds() == kinds)
    }
}

impl Search<'_> {
    fn member(&self, fit: Fit) -> Member {
        Member { evidence: evidence(&self.likelihood, &fit), fit }
    }

    /// Finds the effects.
    pub fn explain_by_beam(&mut self, base: &Hypothesis) -> Option<Explanation> {
        let before = self.settle(base, self.lags)?;
        let mut all = Search {
            likelihood: self.likelihood.of_all(),
            catalog: self.catalog,
            progress: self.progress,
            lags: self.lags,
            engine: self.engine,
        };
        let (pool, screened) = all.beam(&before.hypothesis)?;
        let zero = pool.of(&[])?;
        let chosen = all.choose(&pool, zero);
        let promised = weak_evidence::promised(&zero.fit, &screened);
        let tried: Vec<Tried> = pool.of_size(1).filter_map(|one| tried(zero, one)).collect();
        let weak_evidence = weak_evidence::weak_evidence(promised, &tried);
        let found = all.found(&pool, chosen);
        let after = match found.is_empty() {
            true => before.clone(),
            false => {
                self.likelihood = self.likelihood.weighed(&chosen.fit.hypothesis);
                let settled = self.settle(&chosen.fit.hypothesis, self.lags)?;
                profile_non_smooth(&self.likelihood, settled)?
            }
        };
        Some(Explanation { before, after, found, tried, weak_evidence, decisions: Vec::new() })
    }

    /// The members that were tried, and what was promised beside the lags alone.
    fn beam(&mut self, lags: &Hypothesis) -> Option<(Pool, Vec<Screened>)> {
        let zero = self.member(fit(&self.likelihood, lags, self.lags)?);
        let screened = self.screened(&zero.fit, &[]);
        let (mut pool, mut best) = (Pool::default(), zero.clone());
        pool.add(zero);
        for size in 1..=MOST_EFFECTS {
            let zero = pool.of(&[])?;
            let is_noise = self.is_noise(&best.fit);
            if size == MOST_EFFECTS && (is_noise || self.leaves(&best.fit, &zero.fit) > HOPELESS) {
                break;
            }
            let least = zero.evidence + PART_OF_BEST * (best.evidence - zero.evidence);
            let promising = pool.of_size(size - 1).filter(|one| one.evidence >= least);
            let frontier: Vec<Member> = promising.take(if is_noise { 1 } else { WIDTHS[size - 1] }).cloned().collect();
            for from in frontier {
                let members = match size {
                    1 => self.expand(&from, &screened, PARTS_OF_BEST[0]),
                    _ => self.expand(&from, &self.screened(&from.fit, &from.kinds()), PARTS_OF_BEST[size - 1]),
                };
                members.into_iter().for_each(|member| pool.add(member));
            }
            for better in self.finished(&pool, size) {
                pool.add(better);
            }
            let Some(top) = pool.of_size(size).next().cloned() else { break };
            pool = self.weighed_again(pool, &top)?;
            let (Some(top), Some(before)) = (pool.of_size(size).next(), pool.of_size(size - 1).next()) else { break };
            if top.evidence - before.evidence < LEAST_SCORE {
                break;
            }
            best = top.clone();
        }
        Some((pool, screened))
    }

    /// The best members of a size fitted to the end; bent where the best of them that is plausible leaves more than noise.
    fn finished(&self, pool: &Pool, size: usize) -> Vec<Member> {
        let Some(best) = pool.of_size(size).next() else { return Vec::new() };
        let near = pool.of_size(size).take(FINISHED).filter(|one| best.evidence - one.evidence < APART);
        let to_end = |one: &Member| fit(&self.likelihood, &one.fit.hypothesis, self.lags);
        let mut finished: Vec<Member> = near.filter_map(to_end).map(|fit| self.framed_member(fit)).collect();
        let explains = finished.iter().find(|one| one.is_plausible()).is_some_and(|one| self.is_noise(&one.fit));
        if !explains {
            let zero = pool.of(&[]).map_or(0.0, |zero| zero.evidence);
            let half = 0.5 * (best.evidence + zero);
            let bending = pool.of_size(size).take(if size == 1 { BENT } else { 1 }).filter(|one| one.evidence > half);
            finished.extend(bending.flat_map(|one| self.bent(one)));
        }
        finished
    }

    fn is_noise(&self, fit: &Fit) -> bool {
        self.likelihood.excess(&fit.hypothesis, Split::Train).is_surely_noise()
    }

    /// Joint fits of the kinds that promise enough beside `from`.
    fn expand(&self, from: &Member, screened: &[Screened], part: f64) -> Vec<Member> {
        let fitted = |start: &Hypothesis, steps: usize| {
            (self.progress)();
            fit_in(&self.likelihood, start, self.lags, steps).map(|fit| self.member(fit))
        };
        let starts = promising(&from.fit, screened, None, part);
        let mut members: Vec<Member> = starts.iter().filter_map(|(start, _)| fitted(start, FIRST)).collect();
        members.sort_by(|a, b| b.evidence.total_cmp(&a.evidence));
        let best = members.first().map_or(0.0, |best| best.evidence);
        for (place, member) in members.iter_mut().enumerate() {
            if (place < GO_ON || best - member.evidence < APART)
                && let Some(further) = fitted(&member.fit.hypothesis, NEXT)
            {
                *member = further;
            }
        }
        members
    }

    /// Joint fits with one of the effects bent.
    fn bent(&self, member: &Member) -> Vec<Member> {
        let effects = &member.fit.hypothesis.effects;
        let starts = effects
            .iter()
            .enumerate()
            .flat_map(|(place, effect)| effect.bent().into_iter().map(move |bent| (place, bent)));
        starts
            .filter_map(|(place, bent)| {
                let mut start = member.fit.hypothesis.clone();
                start.effects[place] = bent;
                (self.progress)();
                fit_in(&self.likelihood, &start, self.lags, NEXT).map(|fit| self.member(fit))
            })
            .collect()
    }

    /// The better of a fit and the same with the frames of its hold where the records show them.
    fn framed_member(&self, fit: Fit) -> Member {
        let mean = self.member(fit);
        let hidden = mean.fit.hypothesis.effects.iter().position(Candidate::is_hidden_hold);
        let framed = hidden.and_then(|hold| self.framed(&mean.fit, hold, 0.0)).map(|fit| self.member(fit));
        framed.filter(|framed| framed.evidence > mean.evidence).unwrap_or(mean)
    }

    /// The members under the noise that `best` leaves.
    fn weighed_again(&mut self, pool: Pool, best: &Member) -> Option<Pool> {
        let weighed = self.likelihood.weighed(&best.fit.hypothesis);
        let chi_square = weighed.chi_square(&best.fit.hypothesis, Split::Train)?;
        if (chi_square / best.fit.chi_square - 1.0).abs() < SAME_NOISE {
            return Some(pool);
        }
        self.likelihood = weighed;
        let mut again = Pool::default();
        let zero = pool.of(&[]).cloned();
        let kept = pool.0.into_iter().take(KEPT).filter(|member| member.size() > 0);
        for member in kept.chain(zero) {
            if let Some(fit) = fit_in(&self.likelihood, &member.fit.hypothesis, self.lags, FIRST) {
                again.add(self.member(fit));
            }
        }
        Some(again)
    }

    /// The fewest names within chance of the best, each of which explains more than what another's law may be off by.
    fn choose<'a>(&self, pool: &'a Pool, zero: &'a Member) -> &'a Member {
        let plausible = || pool.0.iter().filter(|one| one.is_plausible());
        let top = plausible().next().map_or(zero.evidence, |best| best.evidence);
        let mut near: Vec<&Member> = plausible().filter(|one| one.evidence >= top - LEAST_SCORE).collect();
        near.sort_by_key(|one| one.size());
        let mut best = near.first().copied().unwrap_or(zero);
        while best.size() > 1 {
            let kinds = best.kinds();
            let lost = kinds.iter().filter_map(|kind| {
                let rest: Vec<&'static Kind> = kinds.iter().copied().filter(|other| other != kind).collect();
                let rest = pool.of(&rest)?;
                Some((best.evidence - rest.evidence, rest))
            });
            let Some((lost, rest)) = lost.min_by(|a, b| a.0.total_cmp(&b.0)) else { break };
            let whole = best.evidence - zero.evidence;
            let least = if self.is_noise(&best.fit) { LEAST_SCORE + OF_NOISE * whole } else { OF_LAW * whole };
            if lost >= least {
                break;
            }
            best = rest;
        }
        // A hold whose frames do not show is, by all that is known, a delay.
        let delay = self.catalog.find("transport_delay");
        if let (Some(hold), Some(delay)) = (best.fit.hypothesis.effects.iter().find(|one| one.is_hidden_hold()), delay)
        {
            let mut same: Vec<&'static Kind> =
                best.kinds().into_iter().map(|kind| if kind == hold.kind { delay } else { kind }).collect();
            same.sort_by_key(|kind| kind.id);
            if let Some(same) = pool.of(&same).filter(|same| best.evidence - same.evidence < ALIKE) {
                return same;
            }
        }
        best
    }

    /// The kinds of the chosen member, with what each is worth and what would do as well.
    fn found(&self, pool: &Pool, chosen: &Member) -> Vec<Found> {
        let kinds = chosen.kinds();
        chosen
            .fit
            .hypothesis
            .effects
            .iter()
            .map(|effect| {
                let rest: Vec<&'static Kind> = kinds.iter().copied().filter(|other| *other != effect.kind).collect();
                let without = pool.of(&rest).map_or(f64::NEG_INFINITY, |rest| rest.evidence);
                let stands_in = |other: &&Member| {
                    other.size() == chosen.size()
                        && chosen.evidence - other.evidence < ALIKE
                        && rest.iter().all(|kind| other.kinds().contains(kind))
                };
                let others = pool.0.iter().filter(stands_in).flat_map(|other| {
                    other.kinds().into_iter().filter(|kind| !kinds.contains(kind)).collect::<Vec<_>>()
                });
                Found {
                    kind: effect.kind,
                    score: (chosen.evidence - without).min(1e12),
                    alternatives: others.collect(),
                }
            })
            .collect()
    }
}

/// A kind that was tried beside the lags alone.
fn tried(zero: &Member, one: &Member) -> Option<Tried> {
    let kind = one.fit.hypothesis.effects.first()?.kind;
    Some(Tried {
        kind,
        fit: one.fit.clone(),
        fitted_gain: 0.5 * (zero.fit.chi_square - one.fit.chi_square),
        held_out_gain: 0.0,
        complexity_penalty: complexity_penalty(kind),
        auxiliary_gain: 0.0,
    })
}

#[cfg(test)]
mod tests {
    use rotorlead_plant::Catalog;

    use super::*;
    use crate::select::explain::Engine;
    use crate::testing::{likelihood, records};

    /// What is found in records of a motor with these effects.
    fn found(effects: &str) -> Vec<Candidate> {
        let (likelihood, base) = likelihood(&records(effects, 0.05, 1));
        let catalog = Catalog::standard();
        let mut search = Search { likelihood, catalog: &catalog, progress: &|| {}, lags: true, engine: Engine::Beam };
        let explanation = search.explain(&Hypothesis::of_lags(base)).unwrap();
        assert_eq!(explanation.found.len(), explanation.after.hypothesis.effects.len());
        explanation.after.hypothesis.effects
    }

    fn effect(kind: &str, parameters: &str) -> String {
        format!("[[effect]]\nkind = \"{kind}\"\nparameters = {{ {parameters} }}\n")
    }

    fn names(found: &[Candidate]) -> Vec<&'static str> {
        let mut names: Vec<&str> = found.iter().map(|effect| effect.kind.id).collect();
        names.sort_unstable();
        names
    }

    #[test]
    fn where_nothing_is_hidden_nothing_is_found() {
        assert_eq!(names(&found("")), Vec::<&str>::new());
    }

    #[test]
    fn two_effects_that_look_like_a_third_are_found_together() {
        let delay = effect("transport_delay", "delay_s = 0.0075");
        let air = effect("inflow_lead", "lead_ratio = 2.2, time_constant_s = 0.012");
        assert_eq!(names(&found(&[delay, air].concat())), ["inflow_lead", "transport_delay"]);
    }

    #[test]
    fn a_law_that_is_bent_keeps_its_name_and_says_its_shape() {
        let found = found(&effect("second_pole", "time_constant_s = 0.015, third_ratio = 0.4"));
        assert_eq!(names(&found), ["second_pole"]);
        let (place, _) = found[0].kind.shape().unwrap();
        assert!(found[0].bends && (found[0].values[place] - 0.4).abs() < 0.1, "{found:?}");
    }
}
