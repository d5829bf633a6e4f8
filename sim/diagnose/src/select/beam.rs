//! One search: a beam over sets of kinds, by their evidence.
//!
//! A member is a set of kinds that are fitted jointly with the lags. Every kind is tried beside each of the best members of one size,
//! and the best sets of the next size go on, whatever way they were reached: a pair is found though neither of its kinds is the best
//! alone. All members are compared under one noise; where what does not repeat is an effect's, the noise is taken once more from what
//! the best member leaves, and all follow.

use super::evidence::evidence;
use super::pool::{Member, Pool};
use crate::data::split::Split;
use crate::estimate::fit::{Fit, fit, fit_behind, fit_in};
use crate::likelihood::Likelihood;
use crate::model::hypothesis::Hypothesis;
use crate::policy::{MOST_EFFECTS, POLICY};
use crate::select::screen::Screened;
use crate::select::search::Search;
use crate::select::weak_evidence::{self, WeakEvidence};

/// Two effects that leave more than this part of the excess chi-square are no explanation, and no third is tried. Chosen: 1.5 times what an
/// explanation may leave, for a third that takes away the rest. Higher costs time; lower loses third effects.
const HOPELESS: f64 = 0.15;
/// What scores less than this part of the best is not followed. Chosen: half of a pair may explain little alone, so that it is far below
/// one. Higher loses pairs; lower costs time.
const PART_OF_BEST: f64 = 0.2;
/// Members of a size that go on to the next, from none on. Chosen: a pair is reached through either of its kinds, so that four of all
/// kinds are enough unless both rank lower; threes cost most, and two go on. Wider costs time in proportion.
const WIDTHS: [usize; MOST_EFFECTS] = [1, 4, 2];
/// Steps of a first joint fit. Chosen: three damped steps show which start leads somewhere. Fewer rank by chance; more cost time for all
/// of them.
pub(crate) const FIRST: usize = 3;
/// Steps of one that goes on. Chosen: half of a full search, which ends sooner where a step gains no more than chance; the best are fitted
/// to the end later.
const NEXT: usize = 12;
/// What a fit that goes on has to catch up with at least, in log evidence. Standard: below odds of 20 to 1 evidence is not strong (Kass &
/// Raftery 1995). Lower costs time on steps that change no order.
const CATCH_UP: f64 = 3.0;
/// What is behind by more than this does not catch up by a better fit. Chosen: three times what counts as alike. Lower loses sets whose
/// first fit was poor; higher costs time.
const APART: f64 = 3.0 * POLICY.alike;
/// Members that are fitted again when the noise changes. Chosen: more than twice as many as go on to the next size. More cost only time.
const KEPT: usize = 10;
/// Noise estimates that change the chi-square of the best member by no more than this part count as the same. Chosen: differences of
/// scores change by about as much. Lower costs fits of all members once more; higher compares scores of different noise.
const SAME_NOISE: f64 = 0.02;
/// Part of the evidence of the best that a kind has to promise to be fitted, by the size of the set that it makes. Chosen: every kind
/// alone, then the more sets there are the fewer. Higher loses a small effect beside a large one; lower costs time.
const PARTS_OF_BEST: [f64; MOST_EFFECTS] = [0.0, 0.5, 0.7];

impl Search<'_> {
    /// A fit with its evidence.
    pub fn member(&self, fit: Fit) -> Member {
        Member { evidence: evidence(&self.likelihood, &fit), fit }
    }

    /// The same on other records.
    pub fn on(&self, likelihood: Likelihood) -> Self {
        Self { likelihood, ..*self }
    }

    /// The members that were tried, and what was promised beside the lags alone.
    pub fn beam(&mut self, lags: &Hypothesis) -> Option<(Pool, Vec<WeakEvidence>)> {
        let zero = self.member(fit(&self.likelihood, lags, self.lags)?);
        let screened = self.screened(&zero.fit, &[]);
        let promised = weak_evidence::linearized_evidence(&zero.fit, &screened);
        let (mut pool, mut best) = (Pool::default(), zero.clone());
        pool.add(zero);
        // The lags alone have no law to bend.
        let mut is_bent = true;
        for size in 1..=MOST_EFFECTS {
            let zero = pool.get(&[])?;
            let is_noise = self.is_noise(&best.fit);
            let hopeless = if self.likelihood.data.has_logs() { POLICY.most_left_of_logs } else { HOPELESS };
            if size == MOST_EFFECTS && (is_noise || self.leaves(&best.fit, &zero.fit) > hopeless) {
                break;
            }
            let least = zero.evidence + PART_OF_BEST * (best.evidence - zero.evidence);
            let promising = pool.with_size(size - 1).filter(|one| one.evidence >= least);
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
                let [top, before] = [size, size - 1].map(|size| pool.with_size(size).next());
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
            best = pool.with_size(size).next()?.clone();
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
        let catch_up = behind.max(0.0) + CATCH_UP;
        fit_behind(&self.likelihood, start, self.lags, catch_up, NEXT).map(|fit| self.member(fit))
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
        let Some(best) = pool.with_size(size).next() else { return Some(pool) };
        let weighed = self.likelihood.weighed(&best.fit.hypothesis);
        let chi_square = weighed.chi_square(&best.fit.hypothesis, Split::Train)?;
        if (chi_square / best.fit.chi_square - 1.0).abs() < SAME_NOISE {
            return Some(pool);
        }
        self.likelihood = weighed;
        let mut again = Pool::default();
        let zero = pool.get(&[]).cloned();
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
