//! Explain: which effects of the catalog the chi-square asks for.
//!
//! Every kind is tried at its starts, with the lags moved along to first order; the promising ones are fitted jointly with
//! the lags on the fitted segments. What a kind is worth is its gain of log likelihood there, less what the search would gain
//! by chance ([`complexity_penalty`]), plus its gain on the held-out segments, where parameters cannot help themselves. Effects are added one
//! at a time; each is then tried again in the presence of the others, exchanged where another kind serves better there, and
//! dropped where the others make it redundant.

use std::sync::Arc;

use rotorlead_plant::Catalog;
use rotorlead_plant::effect::Kind;

use super::decision::Decision;
use crate::assess::minor::MINOR;
use crate::assess::steadiness::steadiness;
use crate::data::dataset::{Dataset, Split};
use crate::estimate::fit::Fit;
use crate::estimate::prepare::prepared;
use crate::estimate::profile::profile_non_smooth;
use crate::estimate::settle::settle;
use crate::likelihood::Likelihood;
use crate::model::hypothesis::Hypothesis;
use crate::select::policy::{ALIKE, ALL_BUT_LITTLE, ENOUGH_EFFECTS, HOPELESS, MOST_EFFECTS};
use crate::select::tried::Tried;
use crate::select::weak_evidence::{self, WeakEvidence};

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
    /// How effects are looked for in records that repeat.
    pub engine: Engine,
}

/// How effects are looked for in records that repeat.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Engine {
    /// One after the other, each time the one that scores highest.
    #[default]
    Stepwise,
    /// Sets of kinds and shapes by their evidence: tried out beside the other.
    Beam,
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
        Some(Self { likelihood: Likelihood::unit(Arc::new(data)), catalog, progress, lags, engine: Engine::default() })
    }
}

impl Search<'_> {
    /// [`settle()`], and goes on by the noise that it leaves.
    pub fn settle(&mut self, start: &Hypothesis, lags: bool) -> Option<Fit> {
        let (likelihood, fit) = settle(&self.likelihood, start, lags)?;
        self.likelihood = likelihood;
        Some(fit)
    }

    /// The part of the chi-square of `before` that `fit` leaves; 0 where it leaves no more than noise.
    pub fn leaves(&self, fit: &Fit, before: &Fit) -> f64 {
        let left = |fit: &Fit| self.likelihood.excess(&fit.hypothesis, Split::Train);
        if left(fit).is_noise() { 0.0 } else { left(fit).over() / left(before).over() }
    }

    /// Finds the effects.
    pub fn explain(&mut self, base: &Hypothesis) -> Option<Explanation> {
        if self.likelihood.data.has_logs() {
            return self.explain_logs(base);
        }
        if self.engine == Engine::Beam {
            return self.explain_by_beam(base);
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
            let best = last_tried.iter().find(|tried| tried.scores_enough());
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
        let best = tried.iter().find(|tried| tried.scores_enough())?;
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
