//! What a search goes by: the records with their weights, and the kinds that it may try.

use std::sync::Arc;

use rotorlead_plant::Catalog;

use crate::data::dataset::Dataset;
use crate::data::split::Split;
use crate::estimate::fit::Fit;
use crate::estimate::prepare::prepared;
use crate::estimate::settle::settle;
use crate::likelihood::Likelihood;
use crate::model::hypothesis::Hypothesis;

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

    /// Excess chi-square of `fit` over that of `before`; 0 where `fit` leaves no more than noise.
    pub fn leaves(&self, fit: &Fit, before: &Fit) -> f64 {
        let left = |fit: &Fit| self.likelihood.excess(&fit.hypothesis, Split::Train);
        if left(fit).is_noise() { 0.0 } else { left(fit).over() / left(before).over() }
    }
}
