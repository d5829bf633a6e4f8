//! Which set of kinds is named, and what would do as well in the place of each.

use rotorlead_plant::effect::{Kind, Site};

use super::auxiliary::auxiliary_gains;
use super::beam::{Member, Pool};
use crate::estimate::fit::{Fit, fit};
use crate::estimate::profile::MOVES;
use crate::model::candidate::Candidate;
use crate::propose;
use crate::select::explain::{Found, Search};
use crate::select::policy::{ALIKE, LEAST_SCORE, OF_LAW, OF_NOISE};

/// A member with its evidence by all columns.
type Weighed<'a> = (f64, &'a Member);

impl Search<'_> {
    /// The effects that are named, and the fit with them.
    pub fn chosen(&self, pool: &Pool) -> Option<(Fit, Vec<Found>)> {
        let near = self.near_the_best(pool);
        let chosen = self.choose(pool, &near)?;
        let found = self.found(pool, &near, &chosen)?;
        Some((self.with_whole_steps(&chosen.fit), found))
    }

    /// The fewest names within chance of the best, each of which explains more than what another's law may be off by.
    fn choose(&self, pool: &Pool, near: &[Weighed]) -> Option<Member> {
        let zero = pool.of(&[])?;
        let fewest = near.iter().map(|near| near.1.size()).min().unwrap_or(0);
        let of_fewest = near.iter().filter(|near| near.1.size() == fewest);
        let mut best = of_fewest.max_by(|a, b| a.0.total_cmp(&b.0)).map_or(zero, |near| near.1).clone();
        while best.size() > 1 {
            let lost = (0..best.size()).filter_map(|effect| {
                let rest = self.without(pool, &best, effect)?;
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
        Some(self.as_delay(pool, &best).cloned().unwrap_or(best))
    }

    /// A member without one of its effects.
    fn without(&self, pool: &Pool, member: &Member, effect: usize) -> Option<Member> {
        let hypothesis = &member.fit.hypothesis;
        let rest = without(&member.kinds(), hypothesis.effects[effect].kind);
        let fitted = || fit(&self.likelihood, &hypothesis.without(effect), self.lags).map(|fit| self.member(fit));
        pool.of(&rest).filter(|rest| rest.is_possible()).cloned().or_else(fitted)
    }

    /// The kinds of the chosen member, with what each is worth and what would do as well. `None` where nothing can be said without one.
    fn found(&self, pool: &Pool, near: &[Weighed], chosen: &Member) -> Option<Vec<Found>> {
        let kinds = chosen.kinds();
        let own = near.iter().find(|near| near.1.kinds() == kinds).map_or(chosen.evidence, |near| near.0);
        let of_effect = |(place, effect): (usize, &Candidate)| {
            let rest = without(&kinds, effect.kind);
            let stands_in = |(evidence, other): &&Weighed| {
                other.size() == chosen.size()
                    && own - evidence < ALIKE
                    && rest.iter().all(|kind| other.kinds().contains(kind))
            };
            let others = near.iter().filter(stands_in).flat_map(|near| near.1.kinds());
            Some(Found {
                kind: effect.kind,
                score: chosen.evidence - self.without(pool, chosen, place)?.evidence,
                alternatives: others.filter(|kind| !kinds.contains(kind)).collect(),
            })
        };
        chosen.fit.hypothesis.effects.iter().enumerate().map(of_effect).collect()
    }

    /// The members within chance of the best: those that an actuator may be, or that leave nothing but noise, since its law may be a
    /// little other than the catalog's.
    fn near_the_best<'a>(&self, pool: &'a Pool) -> Vec<Weighed<'a>> {
        let may_be = |one: &&Member| one.is_plausible() || self.is_noise(&one.fit);
        let Some(top) = pool.members().iter().find(may_be).map(|best| best.evidence) else { return Vec::new() };
        let near = pool.members().iter().take_while(|one| one.evidence >= top - LEAST_SCORE).filter(may_be);
        let near: Vec<&Member> = near.collect();
        let fits: Vec<&Fit> = near.iter().map(|one| &one.fit).collect();
        let gains = if near.len() > 1 { auxiliary_gains(&self.likelihood, &fits) } else { None };
        let gains = gains.unwrap_or_else(|| vec![0.0; near.len()]);
        let weighed: Vec<Weighed> = near.iter().zip(gains).map(|(one, gain)| (one.evidence + gain, *one)).collect();
        let best = weighed.iter().map(|one| one.0).fold(f64::NEG_INFINITY, f64::max);
        weighed.into_iter().filter(|one| one.0 >= best - LEAST_SCORE).collect()
    }

    /// The same with a delay for a hold whose frames do not show: by all that is known it is one.
    fn as_delay<'a>(&self, pool: &'a Pool, chosen: &Member) -> Option<&'a Member> {
        let hold = chosen.fit.hypothesis.effects.iter().find(|one| one.is_hidden_hold())?.kind;
        let delay = self.catalog.kinds().find(|kind| kind.site == Site::Line && *kind != hold)?;
        let mut same = without(&chosen.kinds(), hold);
        same.push(delay);
        same.sort_by_key(|kind| kind.id);
        pool.of(&same).filter(|same| chosen.evidence - same.evidence < ALIKE)
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

/// The kinds but one.
fn without(kinds: &[&'static Kind], one: &Kind) -> Vec<&'static Kind> {
    kinds.iter().copied().filter(|kind| kind.id != one.id).collect()
}
