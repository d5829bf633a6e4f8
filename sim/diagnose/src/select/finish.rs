//! The best sets of a size fitted to the end: with laws that bend where they leave more than noise, and with frames where they lie.

use rayon::prelude::*;
use rotorlead_numerics::statistics::STANDARD_ERRORS_OF_95_PERCENT;

use super::beam::FIRST;
use super::pool::{Member, Pool};
use crate::data::split::Split;
use crate::estimate::fit::{Fit, fit, fit_in};
use crate::estimate::frame_rate;
use crate::likelihood::hold_delay;
use crate::model::candidate::Candidate;
use crate::policy::POLICY;
use crate::propose::frame_rate_scan;
use crate::propose::scan::Scan;
use crate::select::screen::Look;
use crate::select::search::Search;

/// Members of a size that are fitted to the end. Chosen: the best, and two rivals near enough to overtake it. More cost only time.
const FINISHED: usize = 3;
/// Members of one kind that are bent. Chosen: as many as go on to pairs. Fewer may miss a law that bends much; more cost only time.
const BENT: usize = 4;
/// Changes that stand alone and say this of frames, in log likelihood, say that there are none. Standard: odds of 20 to 1 are strong
/// evidence (Kass & Raftery 1995). Lower, frames are searched in vain, which costs time; higher, some are not looked for.
const ALL_ALIKE: f64 = -3.0;
/// By how much a shape has to lower the chi-square where its standard error says nothing, as of one without end. Standard: less is within the
/// 95 % interval of the catalog's law.
const NO_SHAPE: f64 = STANDARD_ERRORS_OF_95_PERCENT * STANDARD_ERRORS_OF_95_PERCENT;
/// Starts of a kind that bends far that are fitted. Chosen: for either end of its shape one; more cost only time.
const STARTS_FAR: usize = 2;
/// Values that are tried with every shape where a response depends in jumps on both, in pieces to either side. Derived: a piece of a dead
/// band is 1 % of its width, so that it goes 20 %; its shape moves the width by 30 % at most at an amplitude of 0.05.
const PIECES_AROUND: u32 = 20;
/// How many of these are looked at on all records. Chosen: fewer may lose the valley that only one record makes look lowest; more cost
/// time.
const SHAPES: usize = 12;
/// How much nearer it is looked around the best of them, in pieces. Derived: each look reaches beyond half the spacing of the one before,
/// which is a piece, and then 0.8 / 3 of one.
const NEARER: [f64; 2] = [0.8, 0.2];
/// In how many steps to either side. Derived: the last ones are 0.07 of a piece apart, and within a piece the response is smooth. More
/// cost time.
const NEARER_STEPS: u32 = 3;

impl Search<'_> {
    /// Fits the best members of a size to the end.
    pub fn finish(&self, pool: &mut Pool, size: usize) {
        let Some(best) = pool.with_size(size).next() else { return };
        let near = pool.with_size(size).take(FINISHED).filter(|one| best.evidence - one.evidence < POLICY.alike);
        let to_end = |one: &Member| fit(&self.likelihood, &one.fit.hypothesis, self.lags);
        let finished: Vec<Member> = near.filter_map(to_end).map(|fit| self.finished_member(fit)).collect();
        finished.into_iter().for_each(|member| pool.replace(member));
    }

    /// Whether the best of a size that is plausible leaves nothing but noise.
    pub fn explains(&self, pool: &Pool, size: usize) -> bool {
        pool.with_size(size).find(|one| self.is_plausible(one)).is_some_and(|one| self.is_noise(&one.fit))
    }

    /// Bends the laws of the best of a size. Chosen: only of those with half of the best's gain or more. Lower costs time; higher loses
    /// kinds that the catalog's law of them fits badly; what bends so far that this law may explain nothing is bent in any case.
    pub fn bend(&self, pool: &mut Pool, size: usize) {
        let Some(best) = pool.with_size(size).next() else { return };
        let zero = pool.get(&[]).map_or(0.0, |zero| zero.evidence);
        let half = 0.5 * (best.evidence + zero);
        let bending = pool.with_size(size).take(if size == 1 { BENT } else { 1 }).filter(|one| one.evidence > half);
        let bent: Vec<Member> = bending
            .flat_map(|one| {
                let behind = best.evidence - one.evidence;
                let in_jumps = (0..size).filter_map(move |place| self.bent_in_jumps(one, place, behind));
                self.bent(one, behind).into_iter().chain(in_jumps)
            })
            .collect();
        let far = if size == 1 { self.bent_far(pool, best) } else { Vec::new() };
        bent.into_iter().chain(far).for_each(|member| pool.add(member));
    }

    /// Fits of the kinds that bend so far from the catalog's law that this may explain nothing, beside the lags alone.
    fn bent_far(&self, pool: &Pool, best: &Member) -> Vec<Member> {
        let Some(zero) = pool.get(&[]) else { return Vec::new() };
        let Some(look) = Look::new(&self.likelihood, &zero.fit) else { return Vec::new() };
        let is_misaligned = zero.fit.has_time_offset(&self.likelihood);
        let kinds = self.catalog.kinds().filter(|kind| self.likelihood.data.can_show(kind));
        let fits = kinds.flat_map(|kind| {
            let straight = pool.get(&[kind]).map_or(f64::INFINITY, |straight| straight.fit.chi_square);
            let starts: Vec<Candidate> = Candidate::starts_bent_far(kind);
            let looked = starts.into_par_iter().filter_map(|start| look.at(start, is_misaligned));
            let mut looked: Vec<_> = looked.collect();
            looked.sort_by(|a, b| a.0.total_cmp(&b.0));
            looked.into_iter().take(STARTS_FAR).filter_map(move |(.., start)| {
                let bent = self.further(&start, best.evidence - zero.evidence)?;
                (straight - bent.fit.chi_square > NO_SHAPE).then_some(bent)
            })
        });
        fits.collect()
    }

    /// Joint fits with one of the effects bent.
    fn bent(&self, member: &Member, behind: f64) -> Vec<Member> {
        let effects = &member.fit.hypothesis.effects;
        let starts = effects
            .iter()
            .enumerate()
            .flat_map(|(place, effect)| effect.bent().into_iter().map(move |bent| (place, bent)));
        starts
            .filter_map(|(place, bent)| {
                let mut start = member.fit.hypothesis.clone();
                start.effects[place] = bent;
                // A shape that may as well be the catalog's bends nothing.
                self.further(&start, behind).filter(|member| member.fit.excludes_shape(place))
            })
            .collect()
    }

    /// The best fit with an effect bent on which the response depends in jumps: of all shapes, each with the values near its own, those
    /// that one record speaks for, and then nearer and nearer on all of them.
    fn bent_in_jumps(&self, member: &Member, place: usize, behind: f64) -> Option<Member> {
        let hypothesis = &member.fit.hypothesis;
        let bent = hypothesis.effects[place].bent_in_jumps(f64::from(PIECES_AROUND), PIECES_AROUND);
        if bent.is_empty() {
            return None;
        }
        let rest = fit_in(&self.likelihood, &hypothesis.without(place), self.lags, FIRST)?;
        let scan = Scan::new(&self.likelihood, &rest)?;
        let look = Look::new(&self.likelihood, &rest)?;
        (self.progress)();
        let best_of = |candidates: Vec<Candidate>| {
            let looked = candidates.into_par_iter().filter_map(|candidate| look.at(candidate, false));
            looked.min_by(|a, b| a.0.total_cmp(&b.0))
        };
        let mut best = best_of(scan.least(&bent, SHAPES))?;
        for share in NEARER {
            (self.progress)();
            best = best_of(best.1.bent_in_jumps(share, NEARER_STEPS))?;
        }
        self.further(&best.2, behind)
    }

    /// A member fitted to the end: with the frames of its hold where the records show them, and impossible where they would show them and
    /// do not.
    fn finished_member(&self, fit: Fit) -> Member {
        let mean = self.member(fit);
        let Some(hold) = mean.fit.hypothesis.effects.iter().position(Candidate::is_hidden_hold) else { return mean };
        let waits = hold_delay::evidence(&self.likelihood, &mean.fit.hypothesis, Split::Train);
        // Where single changes wait alike there are no frames to be found.
        let framed = if waits > ALL_ALIKE { self.framed(&mean.fit, hold) } else { None }.map(|fit| self.member(fit));
        let found = framed.as_ref().map(|framed| framed.fit.chi_square);
        let is_missed = frame_rate_scan::is_predicted_gain_unrealized(&self.likelihood, &mean.fit, hold, found);
        let best = framed.filter(|framed| framed.evidence > mean.evidence).unwrap_or(mean);
        if is_missed { Member { evidence: f64::NEG_INFINITY, ..best } } else { best }
    }

    /// `mean` with the rate and the phases of the frames of its `effect`, searched to the end. `None` where the records do not show them.
    fn framed(&self, mean: &Fit, effect: usize) -> Option<Fit> {
        let framed = frame_rate_scan::find_frame_rate(&self.likelihood, mean, effect)?;
        let framed = fit(&self.likelihood, &framed, self.lags)?;
        fit(&self.likelihood, &frame_rate::polish(&self.likelihood, &framed, effect)?, self.lags)
    }
}
