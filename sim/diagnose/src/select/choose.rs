//! Which set of kinds is named, and what would do as well in the place of each.

use rotorlead_plant::effect::{Kind, Site};

use super::auxiliary::auxiliary_gains;
use super::pool::{Member, Pool, without};
use crate::estimate::fit::{Fit, fit};
use crate::estimate::profile::MOVES;
use crate::model::candidate::Candidate;
use crate::policy::POLICY;
use crate::propose;
use crate::select::explanation::FoundEffect;
use crate::select::search::Search;

/// A member that may be.
#[derive(Clone, Copy)]
struct Near<'a> {
    /// Its evidence by all columns, less what its names cost.
    score: f64,
    member: &'a Member,
    /// Whether each of its effects passes every test.
    is_borne_out: bool,
}

impl Search<'_> {
    /// The member whose effects are named: that of the most evidence, where each name costs what the law of another may be off by.
    pub fn chosen(&self, pool: &Pool) -> Option<(Member, Vec<FoundEffect>)> {
        let near = self.near_the_best(pool)?;
        let best = near.iter().filter(|one| one.is_borne_out).max_by(|a, b| a.score.total_cmp(&b.score))?;
        let (own, chosen) = match self.as_delay(pool, best.member) {
            Some(delay) => (best.score + delay.evidence - best.member.evidence, delay),
            None => (best.score, best.member),
        };
        let found = self.found(pool, (own, chosen), &near)?;
        Some((Member { fit: self.with_whole_steps(&chosen.fit), ..chosen.clone() }, found))
    }

    /// The kinds of the chosen member, with what each is worth and what would do as well. `None` where nothing can be said without one.
    fn found(&self, pool: &Pool, (own, chosen): (f64, &Member), near: &[Near]) -> Option<Vec<FoundEffect>> {
        let kinds = chosen.kinds();
        let of_effect = |(place, effect): (usize, &Candidate)| {
            let rest = without(&kinds, effect.kind);
            // What fails a test by a little is no less alike.
            let stands_in = |other: &&Near| {
                other.member.size() == chosen.size()
                    && (own - other.score).abs() < POLICY.alike
                    && rest.iter().all(|kind| other.member.kinds().contains(kind))
            };
            let others = near.iter().filter(stands_in).flat_map(|&Near { score, member, .. }| {
                let is_new = |kind: &&Kind| !kinds.contains(kind);
                member.kinds().into_iter().filter(is_new).map(move |kind| (kind, (own - score).exp()))
            });
            let (alternatives, odds) = others.unzip();
            Some(FoundEffect { kind: effect.kind, score: self.worth(pool, chosen, place)?.lost, alternatives, odds })
        };
        chosen.fit.hypothesis.effects.iter().enumerate().map(of_effect).collect()
    }

    /// The members that may be, down to what chance makes of the best that is borne out.
    fn near_the_best<'a>(&self, pool: &'a Pool) -> Option<Vec<Near<'a>>> {
        let may_be = |one: &&Member| self.is_plausible(one) || self.is_noise(&one.fit);
        let most = pool.members().iter().find(may_be)?;
        let cost = self.cost_of_a_name(pool, most);
        let mut all: Vec<(f64, &Member)> =
            pool.members().iter().map(|one| (one.evidence - cost * one.size() as f64, one)).collect();
        all.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut near: Vec<Near> = Vec::new();
        let mut least = f64::NEG_INFINITY;
        for (score, member) in all {
            if score < least {
                break;
            }
            if may_be(&member) {
                let is_borne_out = self.is_borne_out(pool, member);
                if is_borne_out {
                    least = least.max(score - POLICY.least_score);
                }
                near.push(Near { score, member, is_borne_out });
            }
        }
        let fits: Vec<&Fit> = near.iter().map(|one| &one.member.fit).collect();
        let gains = if near.len() > 1 { auxiliary_gains(&self.likelihood, &fits) } else { None };
        for (one, gain) in near.iter_mut().zip(gains.into_iter().flatten()) {
            one.score += gain;
        }
        Some(near)
    }

    /// The same with a delay for what by all that is known is one: a hold whose frames do not show, and of readings that stand still on a
    /// count, which show no corners, whatever explains them no better.
    fn as_delay<'a>(&self, pool: &'a Pool, chosen: &Member) -> Option<&'a Member> {
        let delay = self.catalog.kinds().find(|kind| kind.site == Site::Line)?;
        let stands_still = self.likelihood.data.stands_still();
        let effects = chosen.fit.hypothesis.effects.iter().filter(|one| one.kind != delay);
        let hidden = effects.filter(|one| one.is_hidden_hold() || stands_still);
        let same = hidden.filter_map(|one| {
            let mut same = without(&chosen.kinds(), one.kind);
            same.push(delay);
            same.sort_by_key(|kind| kind.id);
            pool.get(&same).filter(|same| chosen.evidence - same.evidence < POLICY.alike)
        });
        same.max_by(|a, b| a.evidence.total_cmp(&b.evidence))
    }

    /// `found` with the steps of a grid such that they make a whole range, where that fits as well: what is fitted may not say on
    /// which side of a step a command lies that is held out.
    fn with_whole_steps(&self, found: &Fit) -> Fit {
        let mut whole = found.hypothesis.clone();
        for effect in &mut whole.effects {
            if let Some(rounded) = propose::proposal_for(effect.kind).rounded(effect) {
                *effect = rounded;
            }
        }
        let is_same = |(one, other): (&Candidate, &Candidate)| one.values == other.values;
        if whole.effects.iter().zip(&found.hypothesis.effects).all(is_same) {
            return found.clone();
        }
        let whole = fit(&self.likelihood, &whole, self.lags);
        whole.filter(|whole| whole.chi_square < found.chi_square + MOVES).unwrap_or_else(|| found.clone())
    }
}
