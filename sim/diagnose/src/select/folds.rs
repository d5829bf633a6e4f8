//! What an explanation gains on steps that were held out.

use rayon::prelude::*;

use crate::data::dataset::Split;
use crate::estimate::fit::{Fit, fit_in};
use crate::likelihood::Likelihood;
use crate::model::hypothesis::Hypothesis;

/// Steps of a search on a part of the steps, from what was found on all of them.
const STEPS: usize = 3;

/// The splits of an experiment, each with minus twice the log likelihood of what it holds out by what is to be improved on.
pub(crate) struct Folds {
    folds: Vec<(&'static str, f64)>,
}

impl Folds {
    /// Empty where nothing has to be split.
    pub fn of(likelihood: &Likelihood, from: &Fit) -> Self {
        let folds = likelihood.folds().into_par_iter();
        let fitted = folds.filter_map(|(split, fold)| {
            let fit = fit_in(&fold, &from.hypothesis, true, STEPS)?;
            Some((split, fold.deviance(&fit.hypothesis, Split::Holdout)?))
        });
        Self { folds: fitted.collect() }
    }

    /// Mean gain of log likelihood over what is held out by `hypothesis`, with the errors of `likelihood`; `None` where nothing
    /// is split.
    pub fn gain(&self, likelihood: &Likelihood, hypothesis: &Hypothesis) -> Option<f64> {
        let folds = likelihood.folds();
        let gains: Vec<f64> = self
            .folds
            .par_iter()
            .map(|(split, before)| {
                let (_, fold) = folds.iter().find(|(other, _)| other == split)?;
                let fitted = fit_in(fold, hypothesis, true, STEPS)?;
                Some(0.5 * (before - fold.deviance(&fitted.hypothesis, Split::Holdout)?))
            })
            .map(|gain| gain.unwrap_or(f64::NEG_INFINITY))
            .collect();
        (!gains.is_empty()).then(|| gains.iter().sum::<f64>() / gains.len() as f64)
    }
}
