//! A fit by the noise that it leaves itself.

use crate::estimate::fit::{Fit, fit, fit_in};
use crate::likelihood::Likelihood;
use crate::model::hypothesis::Hypothesis;

/// Steps between two estimates of the noise. Chosen: the noise needs a fit no better than itself, and a full one follows. More cost only
/// time.
const STEPS: usize = 10;

/// Takes the noise from what a hypothesis leaves and fits it again with that. Twice, since weights and fit depend on each other. The
/// lags only where `lags` says so; `None` where `start` is impossible.
pub(crate) fn settle(likelihood: &Likelihood, start: &Hypothesis, lags: bool) -> Option<(Likelihood, Fit)> {
    let mut likelihood = likelihood.weighed(start);
    let mut hypothesis = start.clone();
    for _ in 0..2 {
        hypothesis = fit_in(&likelihood, &hypothesis, lags, STEPS)?.hypothesis;
        likelihood = likelihood.weighed(&hypothesis);
    }
    let fit = fit(&likelihood, &hypothesis, lags)?;
    Some((likelihood, fit))
}
