//! Explain: which effects of the catalog the chi-square asks for.

use std::sync::Arc;

use rotorlead_plant::Catalog;
use rotorlead_plant::effect::Kind;

use super::decision::Decision;
use crate::data::dataset::{Dataset, Split};
use crate::estimate::fit::Fit;
use crate::estimate::prepare::prepared;
use crate::estimate::settle::settle;
use crate::likelihood::Likelihood;
use crate::model::hypothesis::Hypothesis;
use crate::select::tried::Tried;
use crate::select::weak_evidence::WeakEvidence;

/// An effect that was found.
#[derive(Clone, Debug)]
pub(crate) struct Found {
    /// The kind.
    pub kind: &'static Kind,
    /// Its score beside the others that were found.
    pub score: f64,
    /// Others that would do as well in its place.
    pub alternatives: Vec<&'static Kind>,
    /// The odds of it against each of these.
    pub odds: Vec<f64>,
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

    /// The part of the chi-square of `before` that `fit` leaves; 0 where it leaves no more than noise.
    pub fn leaves(&self, fit: &Fit, before: &Fit) -> f64 {
        let left = |fit: &Fit| self.likelihood.excess(&fit.hypothesis, Split::Train);
        if left(fit).is_noise() { 0.0 } else { left(fit).over() / left(before).over() }
    }
}
