//! Which set of kinds is named, and what would do as well in the place of each.

use rotorlead_plant::effect::{Kind, Site};

use super::auxiliary::auxiliary_gains;
use super::beam::{Member, Pool, without};
use crate::estimate::fit::{Fit, fit};
use crate::estimate::profile::MOVES;
use crate::model::candidate::Candidate;
use crate::policy::POLICY;
use crate::propose;
use crate::select::explain::{Found, Search};

/// A member with its evidence, less what its names cost.
type Weighed<'a> = (f64, &'a Member);

impl Search<'_> {
    /// The member whose effects are named: that of the most evidence, where each name costs what the law of another may be off by.
    pub fn chosen(&self, pool: &Pool) -> Option<(Member, Vec<Found>)> {
        let near = self.near_the_best(pool)?;
        let (own, best) = near.iter().copied().max_by(|a, b| a.0.total_cmp(&b.0))?;
        let (own, chosen) = match self.as_delay(pool, best) {
            Some(delay) => (own + delay.evidence - best.evidence, delay),
            None => (own, best),
        };
        let found = self.found(pool, (own, chosen), &near)?;
        Some((Member { fit: self.with_whole_steps(&chosen.fit), ..chosen.clone() }, found))
    }

    /// The kinds of the chosen member, with what each is worth and what would do as well. `None` where nothing can be said without one.
    fn found(&self, pool: &Pool, (own, chosen): Weighed, near: &[Weighed]) -> Option<Vec<Found>> {
        let kinds = chosen.kinds();
        let of_effect = |(place, effect): (usize, &Candidate)| {
            let rest = without(&kinds, effect.kind);
            let stands_in = |(evidence, other): &&Weighed| {
                other.size() == chosen.size()
                    && own - evidence < POLICY.alike
                    && rest.iter().all(|kind| other.kinds().contains(kind))
            };
            let others = near.iter().filter(stands_in).flat_map(|&(evidence, other)| {
                let is_new = |kind: &&Kind| !kinds.contains(kind);
                other.kinds().into_iter().filter(is_new).map(move |kind| (kind, (own - evidence).exp()))
            });
            let (alternatives, odds) = others.unzip();
            Some(Found { kind: effect.kind, score: self.worth(pool, chosen, place)?.lost, alternatives, odds })
        };
        chosen.fit.hypothesis.effects.iter().enumerate().map(of_effect).collect()
    }

    /// The members within chance of the best that may be named, by all columns.
    fn near_the_best<'a>(&self, pool: &'a Pool) -> Option<Vec<Weighed<'a>>> {
        let may_be = |one: &&Member| self.is_plausible(one) || self.is_noise(&one.fit);
        let most = pool.members().iter().find(may_be)?;
        let cost = self.cost_of_a_name(pool, most);
        let mut all: Vec<Weighed> =
            pool.members().iter().map(|one| (one.evidence - cost * one.size() as f64, one)).collect();
        all.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut near: Vec<Weighed> = Vec::new();
        for (score, one) in all {
            if near.first().is_some_and(|best| score < best.0 - POLICY.least_score) {
                break;
            }
            if may_be(&one) && self.is_borne_out(pool, one) {
                near.push((score, one));
            }
        }
        let fits: Vec<&Fit> = near.iter().map(|one| &one.1.fit).collect();
        let gains = if near.len() > 1 { auxiliary_gains(&self.likelihood, &fits) } else { None };
        for (one, gain) in near.iter_mut().zip(gains.into_iter().flatten()) {
            one.0 += gain;
        }
        let best = near.iter().map(|one| one.0).fold(f64::NEG_INFINITY, f64::max);
        near.retain(|one| one.0 >= best - POLICY.least_score);
        Some(near)
    }

    /// The same with a delay for a hold whose frames do not show: by all that is known it is one.
    fn as_delay<'a>(&self, pool: &'a Pool, chosen: &Member) -> Option<&'a Member> {
        let hold = chosen.fit.hypothesis.effects.iter().find(|one| one.is_hidden_hold())?.kind;
        let delay = self.catalog.kinds().find(|kind| kind.site == Site::Line && *kind != hold)?;
        let mut same = without(&chosen.kinds(), hold);
        same.push(delay);
        same.sort_by_key(|kind| kind.id);
        pool.of(&same).filter(|same| chosen.evidence - same.evidence < POLICY.alike)
    }

    /// `found` with the steps of a grid such that they make a whole range, where that fits as well: what is fitted may not say on
    /// which side of a step a command lies that is held out.
    fn with_whole_steps(&self, found: &Fit) -> Fit {
        let mut whole = found.hypothesis.clone();
        for effect in &mut whole.effects {
            if let Some(rounded) = propose::of(effect.kind).rounded(effect) {
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
