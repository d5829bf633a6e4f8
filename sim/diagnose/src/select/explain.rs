//! Explain: which effects of the catalog the chi-square asks for.
//!
//! Every kind is tried at its starts, with the lags moved along to first order; the promising ones are fitted jointly with
//! the lags on the fitted segments. What a kind is worth is its gain of log likelihood there, less what the search would gain
//! by chance ([`complexity_penalty`]), plus its gain on the held-out segments, where parameters cannot help themselves. Effects are added one
//! at a time; each is then tried again in the presence of the others, exchanged where another kind serves better there, and
//! dropped where the others make it redundant.

use std::sync::Arc;

use rayon::prelude::*;
use rotorlead_plant::Catalog;
use rotorlead_plant::effect::{Kind, Linearity, Shows, Site};

use super::auxiliary;
use super::plateau_search::Decision;
use crate::assess::minor::MINOR;
use crate::assess::steadiness::steadiness;
use crate::data::dataset::{Dataset, Split};
use crate::estimate::fit::{Fit, fit_in};
use crate::estimate::prediction::Near;
use crate::estimate::prepare::prepared;
use crate::estimate::profile::profile_non_smooth;
use crate::estimate::score_test::ScoreTest;
use crate::estimate::settle::settle;
use crate::likelihood::Likelihood;
use crate::model::candidate::Candidate;
use crate::model::hypothesis::Hypothesis;
use crate::propose::scan::Scan;
use crate::propose::{self, collapsed};
use crate::select::tried::{ALIKE, LEAST_SCORE, Tried, by_score, complexity_penalty};
use crate::select::weak_evidence::{self, WeakEvidence};

/// Most effects that are named.
pub(crate) const MOST_EFFECTS: usize = 3;
/// So many effects that leave more than this part of the chi-square are no explanation, and none is looked for.
const ENOUGH_EFFECTS: usize = 2;
const HOPELESS: f64 = 0.15;
/// What leaves less than this part of the chi-square is believed though a kind that fits no actuator leaves less alone: the law of an
/// actuator may be a little other than the catalog's.
const ALL_BUT_LITTLE: f64 = 0.05;
/// How many kinds are fitted after the screening, and from which share of the best gain on.
const MOST_FITTED: usize = 7;
const PROMISING: f64 = 0.2;
/// Share of the least score that the screening has to promise.
const PROMISED: f64 = 0.7;
/// Starts of a kind that are looked at on all records.
const MOST_LOOKED_AT_AGAIN: usize = 3;
/// Starts that are followed of one kind.
const MOST_STARTS: usize = 2;
/// Steps after which the kinds are compared; after these so many go on, and all that are close.
pub(crate) const FIRST_STEPS: usize = 3;
/// How often the screening halves the distance to the neighbors of the best start.
const CLOSER_LOOKS: usize = 3;
pub(crate) const MOST_FINISHED: usize = 3;
/// What scores less than this part of the best is not searched to the end.
pub(crate) const AGAIN: f64 = 0.2;
/// How often the screening looks around in a narrow valley, in how many steps to either side, and how much nearer each time.
const VALLEY_LOOKS: i32 = 5;
const VALLEY_STEPS: u32 = 4;
const VALLEY_NARROWING: f64 = 0.25;

/// What a start of a kind would leave of the chi-square, and the hypothesis that it leads to.
pub(crate) type Screened = (f64, Hypothesis, &'static Kind);

/// An effect that was found.
#[derive(Clone, Debug)]
pub(crate) struct Found {
    /// The kind.
    pub kind: &'static Kind,
    /// Its score beside the others that were found.
    pub score: f64,
    /// Others that would do as well in its place.
    pub alternatives: Vec<&'static Kind>,
}

/// What was found, with the fit of all of it.
#[derive(Clone, Debug)]
pub(crate) struct Explanation {
    /// The lags alone.
    pub before: Fit,
    /// With the effects, in the order of `found`.
    pub after: Fit,
    /// The effects, the most valuable first.
    pub found: Vec<Found>,
    /// What was tried beside the lags alone, best first.
    pub tried: Vec<Tried>,
    /// Effects with weak evidence beside the lags alone.
    pub weak_evidence: Vec<WeakEvidence>,
    /// What became of each kind, in records that do not repeat.
    pub decisions: Vec<Decision>,
}

impl Explanation {
    /// That nothing explains what `before` leaves.
    fn of_nothing(before: Fit, tried: Vec<Tried>, weak_evidence: Vec<WeakEvidence>) -> Self {
        Self { after: before.clone(), before, found: Vec::new(), tried, weak_evidence, decisions: Vec::new() }
    }
}

/// What came of adding effects.
pub(crate) enum Built {
    /// A fit with effects, or with none.
    Explained(Box<Fit>, Vec<Found>),
    /// Too much is left by so many effects, or more than noise by some that were accepted provisionally.
    Hopeless,
}

impl Built {
    /// The fit with effects, or with none; `None` where there was no hope.
    pub fn explained(self) -> Option<(Fit, Vec<Found>)> {
        match self {
            Self::Explained(fit, found) => Some((*fit, found)),
            Self::Hopeless => None,
        }
    }
}

/// A part of the records, and a score test on it.
pub(crate) struct FirstLook<'a> {
    likelihood: Likelihood,
    score_test: ScoreTest<'a>,
}

/// Everything that may be tried, and on what.
pub(crate) struct Search<'a> {
    /// The records, by the weights of now.
    pub likelihood: Likelihood,
    /// The kinds.
    pub catalog: &'a Catalog,
    /// Told whenever a step is done.
    pub progress: &'a dyn Fn(),
    /// Whether the lags are fitted along.
    pub lags: bool,
}

impl<'a> Search<'a> {
    /// Of records in which nothing is known yet, `base` being about their lags; these are fitted along where `lags` says so. `None`
    /// where they cannot be.
    pub fn prepared(
        data: &Dataset,
        base: &Hypothesis,
        (catalog, progress): (&'a Catalog, &'a dyn Fn()),
        lags: bool,
    ) -> Option<Self> {
        let data = prepared(data.clone(), base, lags)?;
        Some(Self { likelihood: Likelihood::unit(Arc::new(data)), catalog, progress, lags })
    }
}

impl Search<'_> {
    /// [`settle()`], and goes on by the noise that it leaves.
    pub fn settle(&mut self, start: &Hypothesis, lags: bool) -> Option<Fit> {
        let (likelihood, fit) = settle(&self.likelihood, start, lags)?;
        self.likelihood = likelihood;
        Some(fit)
    }

    /// Starts of all kinds but those to `exclude`, with what they would leave beside `from` as far as the linearization holds, best first.
    pub fn screened(&self, from: &Fit, exclude: &[&'static Kind]) -> Vec<Screened> {
        let lifted = self.lags.then(|| collapsed::lifted(&self.likelihood, from)).flatten();
        let mut screened = Vec::new();
        for near in std::iter::once(from).chain(&lifted) {
            let Some(score_test) = ScoreTest::new(&self.likelihood, near) else { continue };
            let Some(scan) = Scan::new(&self.likelihood, near) else { continue };
            let first_look = self.likelihood.for_first_look().and_then(|likelihood| {
                let score_test = ScoreTest::new(&likelihood, near)?;
                Some(FirstLook { likelihood, score_test })
            });
            let kinds = self.catalog.kinds().filter(|kind| kind.site != Site::Base && !exclude.contains(kind));
            for kind in kinds.filter(|kind| kind.shows != Shows::OverLevels) {
                screened.extend(self.screen((&score_test, first_look.as_ref()), &scan, near, kind));
                (self.progress)();
            }
        }
        screened.sort_by(|a: &Screened, b| a.0.total_cmp(&b.0));
        screened
    }

    /// Kinds that improve on `from`, best first.
    pub fn tries(&self, from: &Fit, exclude: &[&'static Kind]) -> Vec<Tried> {
        self.tries_of(from, self.screened(from, exclude), None)
    }

    /// Kinds that improve on `from` of those that were screened, best first; with `own`, which they have to compete with.
    pub fn tries_of(&self, from: &Fit, screened: Vec<Screened>, own: Option<Tried>) -> Vec<Tried> {
        let best = screened.first().map_or(0.0, |best| from.chi_square - best.0);
        let best = own.as_ref().map_or(best, |own| best.max(2.0 * own.fitted_gain));
        let fewest = if own.is_some() { 0 } else { MOST_FINISHED };
        let beside = self.beside(from);
        let mut kinds: Vec<(&'static Kind, Vec<Candidate>)> = Vec::new();
        let mut tried: Vec<Tried> = Vec::new();
        for (left, start, kind) in screened {
            let place = kinds.iter().position(|(other, _)| *other == kind);
            let gain = from.chi_square - left;
            // What promises much less than has to be there is not worth a search; a gain of log likelihood is half of this.
            if gain < 2.0 * PROMISED * LEAST_SCORE
                || (gain < PROMISING * best && place.is_none() && kinds.len() >= fewest)
            {
                continue;
            }
            let place = match place {
                Some(place) => place,
                None if kinds.len() < MOST_FITTED => {
                    kinds.push((kind, Vec::new()));
                    kinds.len() - 1
                }
                None => continue,
            };
            let followed = &mut kinds[place].1;
            let is_known = start.effects.last().is_some_and(|start| followed.iter().any(|other| start.is_near(other)));
            if followed.len() >= MOST_STARTS || is_known {
                continue;
            }
            followed.extend(start.effects.last().cloned());
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
            let may_be_best = place < MOST_FINISHED && tried.score() > AGAIN * best;
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

    /// Starts of a kind with what they would leave. Around the best of a single value it looks closer: a limit is felt only
    /// where the commands are.
    ///
    /// All that is looked at by `first_look`, where there is one, which is quick; what is best there by `score_test`.
    pub fn screen(
        &self,
        (score_test, first_look): (&ScoreTest, Option<&FirstLook>),
        scan: &Scan,
        from: &Fit,
        kind: &'static Kind,
    ) -> Vec<Screened> {
        // Where the alignment has taken over much of a delay, a start that brings its own is evaluated without it too: so far the
        // linearization does not hold.
        let has_time_offset = from.has_time_offset(&self.likelihood);
        // What is slow shows over all of a record.
        let first_look = first_look.filter(|_| kind.linearity != Linearity::Absent || kind.site <= Site::Rotor);
        let evaluate = |(likelihood, score_test): (&Likelihood, &ScoreTest), start: &Candidate| {
            let with = score_test.predict(likelihood, start, false);
            let without = has_time_offset.then(|| score_test.predict(likelihood, start, true)).flatten();
            [with, without].into_iter().flatten().min_by(|a, b| a.0.total_cmp(&b.0))
        };
        let by_all = (&self.likelihood, score_test);
        let by = first_look.map_or(by_all, |look| (&look.likelihood, &look.score_test));
        let mut evaluated: Vec<(f64, Candidate, Hypothesis)> = Vec::new();
        let look = |evaluated: &mut Vec<(f64, Candidate, Hypothesis)>, starts: Vec<Candidate>| {
            let looked = |start: Candidate| evaluate(by, &start).map(|(left, moved)| (left, start, moved));
            evaluated.par_extend(starts.into_par_iter().filter_map(looked));
            evaluated.sort_by(|a, b| a.0.total_cmp(&b.0));
        };
        let starts = propose::of(kind).starts(&self.likelihood, from, scan, kind);
        look(&mut evaluated, starts.candidates);
        if starts.is_in_valley {
            // Down into the lowest.
            for round in 0..VALLEY_LOOKS {
                let Some(best) = evaluated.first().map(|best| best.1.clone()) else { break };
                look(&mut evaluated, best.around(VALLEY_NARROWING.powi(round), VALLEY_STEPS));
            }
        } else if Candidate::searched(kind).count() == 1 {
            for _ in 0..CLOSER_LOOKS {
                let between = Candidate::around_best(&evaluated);
                look(&mut evaluated, between);
            }
            let vertex = Candidate::vertex(&evaluated);
            look(&mut evaluated, vertex.into_iter().collect());
        }
        if first_look.is_some() {
            evaluated.truncate(MOST_LOOKED_AT_AGAIN);
            let starts = evaluated.into_iter().map(|(_, start, _)| start);
            evaluated =
                starts.filter_map(|start| evaluate(by_all, &start).map(|(left, moved)| (left, start, moved))).collect();
            evaluated.sort_by(|a, b| a.0.total_cmp(&b.0));
        }
        evaluated.into_iter().map(|(left, _, moved)| (left, moved, kind)).collect()
    }

    /// The part of the chi-square of `before` that `fit` leaves; 0 where it leaves no more than noise.
    fn leaves(&self, fit: &Fit, before: &Fit) -> f64 {
        let left = |fit: &Fit| self.likelihood.excess(&fit.hypothesis, Split::Train);
        if left(fit).is_noise() { 0.0 } else { left(fit).over() / left(before).over() }
    }

    /// Finds the effects.
    pub fn explain(&mut self, base: &Hypothesis) -> Option<Explanation> {
        if self.likelihood.data.has_logs() {
            return self.explain_logs(base);
        }
        let before = self.settle(base, self.lags)?;
        let noise = self.likelihood.clone();
        let screened = self.screened(&before, &[]);
        let promised = weak_evidence::promised(&before, &screened);
        let tried = self.tries_of(&before, screened, None);
        let weak_evidence = weak_evidence::weak_evidence(promised, &tried);
        let (after, found) = match self.one_at_a_time(&before, &tried)? {
            Built::Explained(after, found) if found.is_empty() => {
                let of_starts = self.in_noise_of(noise.clone(), |search| search.explain_starts(&before));
                let beyond = || self.in_noise_of(noise, |search| search.beyond_its_range(&tried));
                of_starts.or_else(beyond).unwrap_or((*after, found))
            }
            // Two that leave a little may stand in for two others.
            Built::Explained(after, found) if found.len() >= ENOUGH_EFFECTS && !self.is_surely_noise(&after) => {
                let others = self.in_noise_of(noise, |search| {
                    search.two_at_once(&tried).filter(|(others, _)| search.is_surely_noise(others))
                });
                others.unwrap_or((*after, found))
            }
            Built::Explained(after, found) => (*after, found),
            Built::Hopeless => {
                self.likelihood.clone_from(&noise);
                match self.two_at_once(&tried) {
                    Some(explained) => explained,
                    None => {
                        self.likelihood = noise;
                        return Some(Explanation::of_nothing(before, tried, weak_evidence));
                    }
                }
            }
        };
        let after = profile_non_smooth(&self.likelihood, after)?;
        Some(Explanation { before, after, found, tried, weak_evidence, decisions: Vec::new() })
    }

    /// Adds the effect that scores highest, beginning with one of those that were tried beside the lags alone, `first_tried`, until
    /// nothing scores enough.
    pub fn one_at_a_time(&mut self, before: &Fit, first_tried: &[Tried]) -> Option<Built> {
        let mut current = before.clone();
        let mut effects: Vec<Tried> = Vec::new();
        let mut last_tried = first_tried.to_vec();
        let mut has_to_explain_all = false;
        while effects.len() < MOST_EFFECTS {
            if !effects.is_empty() {
                let named: Vec<&'static Kind> = effects.iter().map(|effect| effect.kind).collect();
                last_tried = self.tries(&current, &named);
            }
            // Before the noise is taken from what it leaves, which may be long.
            let best = last_tried.iter().find(|tried| tried.is_worth_a_name());
            if effects.len() + 1 == ENOUGH_EFFECTS
                && best.is_some_and(|best| self.leaves(&best.fit, before) > 2.0 * HOPELESS)
            {
                return Some(Built::Hopeless);
            }
            let Some(step) = self.next_effect(&last_tried, effects.is_empty()) else { break };
            has_to_explain_all |= step.is_backtracking;
            effects.push(step.tried);
            current = self.in_frames(step.fit)?;
            if self.is_little(&current) {
                break;
            }
            if effects.len() >= ENOUGH_EFFECTS {
                match self.leaves(&current, before) {
                    0.0 => break,
                    part if part > HOPELESS => return Some(Built::Hopeless),
                    _ => {}
                }
            }
        }
        let (after, found) = match &effects[..] {
            // Nothing beside which it could look different.
            [only] => {
                let others = first_tried.iter().filter(|other| other.kind != only.kind && other.may_be_named());
                let alike = |other: &&Tried| only.score() - other.score() < ALIKE;
                let alternatives = others.filter(alike).map(|other| other.kind).collect();
                (current, vec![Found { kind: only.kind, score: only.score(), alternatives }])
            }
            _ => self.review(current, Some(last_tried))?,
        };
        let is_believed =
            !has_to_explain_all || self.explains_all(&after) || self.leaves(&after, before) < ALL_BUT_LITTLE;
        Some(if is_believed { Built::Explained(Box::new(after), found) } else { Built::Hopeless })
    }

    /// The best of the kinds that were `tried` with which nothing but noise is left, though a value lies beyond its plausible range: the
    /// law of an actuator may be a little other than the catalog's, and it is said of the effect.
    fn beyond_its_range(&mut self, tried: &[Tried]) -> Option<(Fit, Vec<Found>)> {
        let best = tried.iter().find(|tried| tried.is_worth_a_name())?;
        let fit = self.settle(&best.fit.hypothesis, self.lags)?;
        let is_all = self.explains_all(&fit);
        if !is_all {
            return None;
        }
        Some((fit, vec![Found { kind: best.kind, score: best.score(), alternatives: Vec::new() }]))
    }

    /// Searches in the noise that the lags alone were evaluated by, which what was tried since may have changed. Where nothing is found
    /// the records are as they were.
    fn in_noise_of<T>(&mut self, noise: Likelihood, search: impl FnOnce(&mut Self) -> Option<T>) -> Option<T> {
        let own = std::mem::replace(&mut self.likelihood, noise);
        let found = search(self);
        if found.is_none() {
            self.likelihood = own;
        }
        found
    }

    /// Whether what `fit` leaves beside noise is too little for a further effect to matter.
    fn is_little(&self, fit: &Fit) -> bool {
        let left = |split| self.likelihood.excess_share(&fit.hypothesis, split);
        [Split::Train, Split::Holdout].into_iter().all(|split| left(split) < MINOR)
            && steadiness(&self.likelihood, &fit.hypothesis).is_noise()
    }

    fn is_surely_noise(&self, fit: &Fit) -> bool {
        self.likelihood.excess(&fit.hypothesis, Split::Train).is_surely_noise()
    }

    /// Whether `fit` leaves nothing but noise.
    pub fn explains_all(&self, fit: &Fit) -> bool {
        self.likelihood.excess(&fit.hypothesis, Split::Train).is_noise()
            && steadiness(&self.likelihood, &fit.hypothesis).is_noise()
    }

    /// `found` with the frames of its last effect where all records have them. A rate that is off by a part of a frame over a record
    /// leaves more than a further effect does, which would be looked for in vain.
    fn in_frames(&mut self, found: Fit) -> Option<Fit> {
        if found.hypothesis.effects.last().is_none_or(|effect| effect.phases.is_empty()) {
            return Some(found);
        }
        let sharp = profile_non_smooth(&self.likelihood, found)?;
        self.settle(&sharp.hypothesis, self.lags)
    }
}
