//! What effects gain on steps that are held out in turn.

use rayon::prelude::*;

use crate::data::split::Split;
use crate::estimate::fit::fit_in;
use crate::likelihood::Likelihood;
use crate::model::hypothesis::Hypothesis;

/// Steps of a search on a part of the steps of a log, from what was found on all of them. Chosen: the start is near, and three damped
/// steps with fresh derivatives reach what a part moves it. More cost only time.
const STEPS: usize = 3;

/// Mean gain of log likelihood over what each split holds out, with what it leaves for the other fitted. `None` where nothing is split.
pub(crate) fn gain(likelihood: &Likelihood, without: &Hypothesis, with: &Hypothesis) -> Option<f64> {
    let folds = likelihood.folds();
    let left = |fold: &Likelihood, hypothesis: &Hypothesis| {
        let fitted = fit_in(fold, hypothesis, true, STEPS)?;
        fold.chi_square(&fitted.hypothesis, Split::Holdout)
    };
    let gain = |fold: &Likelihood| Some(0.5 * (left(fold, without)? - left(fold, with)?));
    let gains: Vec<f64> = folds.par_iter().map(|(_, fold)| gain(fold).unwrap_or(f64::NEG_INFINITY)).collect();
    (!gains.is_empty()).then(|| gains.iter().sum::<f64>() / gains.len() as f64)
}
