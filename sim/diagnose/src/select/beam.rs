//! One search: a beam over sets of kinds, by their evidence.
//!
//! A member is a set of kinds that are fitted jointly with the lags. Every kind is tried beside each of the best members of one size,
//! and the best sets of the next size go on, whatever way they were reached: a pair is found though neither of its kinds is the best
//! alone. All members are compared under one noise; where what does not repeat is an effect's, the noise is taken once more from what
//! the best member leaves, and all follow.

use rotorlead_plant::effect::Kind;

use super::evidence::evidence;
use crate::data::dataset::Split;
use crate::estimate::fit::{Fit, fit, fit_behind, fit_in};
use crate::estimate::profile::profile_non_smooth;
use crate::likelihood::{InitialCondition, Likelihood};
use crate::model::hypothesis::Hypothesis;
use crate::policy::{MOST_EFFECTS, POLICY};
use crate::select::explain::{Explanation, Search};
use crate::select::screen::Screened;
use crate::select::weak_evidence::{self, WeakEvidence};

/// Two effects that leave more than this part of the chi-square are no explanation, and no third is looked for.
const HOPELESS: f64 = 0.15;
/// The same where periods do not repeat: levels are off for more reasons than have a name.
const HOPELESS_IN_LOGS: f64 = 0.5;
/// What scores less than this part of the best is not followed.
const PART_OF_BEST: f64 = 0.2;
/// Members of a size that go on to the next, from none on.
const WIDTHS: [usize; MOST_EFFECTS] = [1, 4, 2];
/// Steps of a first joint fit, and those of one that goes on.
pub(crate) const FIRST: usize = 3;
const NEXT: usize = 12;
/// What a fit that goes on has to catch up with at least, in log evidence: less makes no difference.
const CATCH_UP: f64 = 3.0;
/// What is behind by more than this does not catch up by a better fit.
const APART: f64 = 3.0 * POLICY.alike;
/// Members that are fitted again when the noise changes.
const KEPT: usize = 10;
/// Noise that changes the chi-square of the best by no more than this part is the same.
const SAME_NOISE: f64 = 0.02;
/// Part of the evidence of the best that a kind has to promise to be fitted, by the size of the set that it makes.
const PARTS_OF_BEST: [f64; MOST_EFFECTS] = [0.0, 0.5, 0.7];

/// A set of kinds with its fit.
#[derive(Clone, Debug)]
pub(crate) struct Member {
    pub fit: Fit,
    pub evidence: f64,
}

impl Member {
    /// Its kinds, sorted.
    pub fn kinds(&self) -> Vec<&'static Kind> {
        let mut kinds: Vec<&'static Kind> = self.fit.hypothesis.effects.iter().map(|effect| effect.kind).collect();
        kinds.sort_by_key(|kind| kind.id);
        kinds
    }

    /// Whether the records do not exclude it.
    pub fn is_possible(&self) -> bool {
        self.evidence.is_finite()
    }

    /// How many.
    pub fn size(&self) -> usize {
        self.fit.hypothesis.effects.len()
    }
}

/// The best member of each set.
#[derive(Clone, Debug, Default)]
pub(crate) struct Pool(Vec<Member>);

impl Pool {
    /// Puts a member in the place of that of the same kinds.
    pub fn replace(&mut self, member: Member) {
        let kinds = member.kinds();
        self.0.retain(|other| other.kinds() != kinds);
        self.add(member);
    }

    /// Adds a member, unless there is a better one of the same kinds.
    pub fn add(&mut self, member: Member) {
        let kinds = member.kinds();
        match self.0.iter_mut().find(|other| other.kinds() == kinds) {
            Some(other) if other.evidence < member.evidence => *other = member,
            Some(_) => {}
            None => self.0.push(member),
        }
        self.0.sort_by(|a, b| b.evidence.total_cmp(&a.evidence));
    }

    /// All of them, the best first.
    pub fn members(&self) -> &[Member] {
        &self.0
    }

    /// Those of so many kinds, the best first.
    pub fn of_size(&self, size: usize) -> impl Iterator<Item = &Member> {
        self.0.iter().filter(move |member| member.size() == size)
    }

    /// That of these kinds, sorted as [`Member::kinds`].
    pub fn of(&self, kinds: &[&'static Kind]) -> Option<&Member> {
        self.0.iter().find(|member| member.kinds() == kinds)
    }
}

impl Search<'_> {
    /// A fit with its evidence.
    pub fn member(&self, fit: Fit) -> Member {
        Member { evidence: evidence(&self.likelihood, &fit), fit }
    }

    /// The same on other records.
    pub fn on(&self, likelihood: Likelihood) -> Self {
        Self { likelihood, ..*self }
    }

    /// Finds the effects: in all records, and then their values in what is fitted alone, so that what is held out judges them.
    pub fn explain(&mut self, base: &Hypothesis) -> Option<Explanation> {
        let before = self.settle(&base.clone().of_what_shows(&self.likelihood.data), self.lags)?;
        let mut all = self.on(self.likelihood.of_all());
        let (pool, promised) = all.beam(&before.hypothesis)?;
        let tried = all.tried(&pool);
        let (mut chosen, mut found) = all.chosen(&pool)?;
        let decisions =
            if self.likelihood.data.has_logs() { all.decisions(&pool, &chosen, &promised) } else { Vec::new() };
        let weak_evidence = weak_evidence::weak_evidence(promised, &tried);
        if found.is_empty()
            && let Some((member, named)) = all.explain_starts(&chosen.fit)
        {
            (chosen, found) = (member, named);
            self.likelihood.initial_condition = InitialCondition::Steady;
        }
        let after = match found.is_empty() {
            true => before.clone(),
            false => {
                self.likelihood = self.likelihood.weighed(&chosen.fit.hypothesis);
                let settled = self.settle(&chosen.fit.hypothesis, self.lags)?;
                profile_non_smooth(&self.likelihood, settled)?
            }
        };
        Some(Explanation { before, after, found, tried, weak_evidence, decisions })
    }

    /// The members that were tried, and what was promised beside the lags alone.
    pub fn beam(&mut self, lags: &Hypothesis) -> Option<(Pool, Vec<WeakEvidence>)> {
        let zero = self.member(fit(&self.likelihood, lags, self.lags)?);
        let screened = self.screened(&zero.fit, &[]);
        let promised = weak_evidence::promised(&zero.fit, &screened);
        let (mut pool, mut best) = (Pool::default(), zero.clone());
        pool.add(zero);
        // The lags alone have no law to bend.
        let mut is_bent = true;
        for size in 1..=MOST_EFFECTS {
            let zero = pool.of(&[])?;
            let is_noise = self.is_noise(&best.fit);
            let hopeless = if self.likelihood.data.has_logs() { HOPELESS_IN_LOGS } else { HOPELESS };
            if size == MOST_EFFECTS && (is_noise || self.leaves(&best.fit, &zero.fit) > hopeless) {
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
            // Noise that is an effect's hides what the law of another is off by.
            pool = self.weighed_by_best(pool, size)?;
            self.finish(&mut pool, size);
            // Where one more name gains, a law that bends may gain as much; where nothing is left, it is asked no sooner.
            let gains = |pool: &Pool| {
                let [top, before] = [size, size - 1].map(|size| pool.of_size(size).next());
                top.zip(before).is_some_and(|(top, before)| top.evidence - before.evidence >= POLICY.least_score)
            };
            if !is_bent && gains(&pool) {
                self.bend(&mut pool, size - 1);
            }
            is_bent = !self.explains(&pool, size);
            if is_bent {
                self.bend(&mut pool, size);
            }
            pool = self.weighed_by_best(pool, size)?;
            if !gains(&pool) {
                break;
            }
            best = pool.of_size(size).next()?.clone();
        }
        Some((pool, promised))
    }

    /// Whether a fit leaves nothing but noise.
    pub fn is_noise(&self, fit: &Fit) -> bool {
        self.likelihood.excess(&fit.hypothesis, Split::Train).is_surely_noise()
    }

    /// A joint fit that goes on, for what is `behind` the best.
    pub fn further(&self, start: &Hypothesis, behind: f64) -> Option<Member> {
        (self.progress)();
        let pace = (behind.max(0.0) + CATCH_UP, NEXT);
        fit_behind(&self.likelihood, start, self.lags, pace).map(|fit| self.member(fit))
    }

    /// Joint fits of the kinds that promise enough beside `from`.
    fn expand(&self, from: &Member, screened: &[Screened], part: f64) -> Vec<Member> {
        let first = |start: &Hypothesis| {
            (self.progress)();
            fit_in(&self.likelihood, start, self.lags, FIRST).map(|fit| self.member(fit))
        };
        let starts = self.starts(&from.fit, screened, part);
        let mut members: Vec<Member> = starts.iter().filter_map(first).collect();
        members.sort_by(|a, b| b.evidence.total_cmp(&a.evidence));
        let go_on = WIDTHS.get(from.size() + 1).copied().unwrap_or(1);
        let mut best = members.first().map_or(0.0, |best| best.evidence);
        for (place, member) in members.iter_mut().enumerate() {
            let behind = best - member.evidence;
            if (place < go_on || behind < APART)
                && let Some(further) = self.further(&member.fit.hypothesis, behind)
            {
                *member = further;
                best = best.max(member.evidence);
            }
        }
        members
    }

    /// The members under the noise that the best of a size leaves.
    fn weighed_by_best(&mut self, pool: Pool, size: usize) -> Option<Pool> {
        let Some(best) = pool.of_size(size).next() else { return Some(pool) };
        let weighed = self.likelihood.weighed(&best.fit.hypothesis);
        let chi_square = weighed.chi_square(&best.fit.hypothesis, Split::Train)?;
        if (chi_square / best.fit.chi_square - 1.0).abs() < SAME_NOISE {
            return Some(pool);
        }
        self.likelihood = weighed;
        let mut again = Pool::default();
        let zero = pool.of(&[]).cloned();
        // What logs leave is not known before, and changes by much.
        let (kept, steps) = if self.likelihood.data.has_logs() { (pool.0.len(), NEXT) } else { (KEPT, FIRST) };
        let kept = pool.0.into_iter().take(kept).filter(|member| member.size() > 0 && member.is_possible());
        for member in kept.chain(zero) {
            if let Some(fit) = fit_in(&self.likelihood, &member.fit.hypothesis, self.lags, steps) {
                again.add(self.member(fit));
            }
        }
        Some(again)
    }
}

/// The kinds but one.
pub(crate) fn without(kinds: &[&'static Kind], one: &Kind) -> Vec<&'static Kind> {
    kinds.iter().copied().filter(|kind| kind.id != one.id).collect()
}

#[cfg(test)]
mod tests {
    use rotorlead_plant::Catalog;

    use super::*;
    use crate::model::candidate::Candidate;
    use crate::testing::{likelihood, records};

    /// What is found in records of a motor with these effects.
    fn found(effects: &str) -> Vec<Candidate> {
        let (likelihood, base) = likelihood(&records(effects, 0.05, 1));
        let catalog = Catalog::standard();
        let mut search = Search { likelihood, catalog: &catalog, progress: &|| {}, lags: true };
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

    #[test]
    fn a_dead_band_that_grows_with_the_command_keeps_its_name_and_says_its_shape() {
        let found = found(&effect("dead_band", "width = 0.006, width_growth_per_duty = 4.0"));
        assert_eq!(names(&found), ["dead_band"]);
        let (place, _) = found[0].kind.shape().unwrap();
        let (width, growth) = (found[0].values[0], found[0].values[place]);
        assert!((width / 0.006 - 1.0).abs() < 0.01 && (growth - 4.0).abs() < 0.3, "{found:?}");
    }
}
