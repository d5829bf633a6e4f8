//! A kind that was fitted, and its score.

use std::cmp::Ordering;

use rotorlead_plant::effect::Kind;

use crate::estimate::fit::Fit;
use crate::model::candidate::Candidate;
use crate::propose;
use crate::select::policy::{LEAST_SCORE, LEAST_TRAINING_GAIN};

/// A kind with what it would be worth.
#[derive(Clone, Debug)]
pub(crate) struct Tried {
    /// The kind.
    pub kind: &'static Kind,
    /// The fit with it; its effect is the last one.
    pub fit: Fit,
    /// Gain of log likelihood over what is fitted.
    pub fitted_gain: f64,
    /// Gain of log likelihood over what is held out.
    pub held_out_gain: f64,
    /// What the search itself would gain by chance: see [`complexity_penalty`].
    pub complexity_penalty: f64,
}

impl Tried {
    /// Whether no value lies farther from where the effect vanishes than any actuator of its kind is plausible to have it.
    pub fn is_plausible(&self) -> bool {
        self.fit.is_plausible()
    }

    /// Whether its score is high enough.
    pub fn scores_enough(&self) -> bool {
        self.score() >= LEAST_SCORE && self.exceeds_least_gain()
    }

    /// Whether it gains enough on what is fitted, whatever it does for what is held out.
    pub fn exceeds_least_gain(&self) -> bool {
        self.fitted_gain - self.complexity_penalty >= LEAST_TRAINING_GAIN
    }

    /// What it is worth, in units of log likelihood.
    pub fn score(&self) -> f64 {
        self.fitted_gain - self.complexity_penalty + self.held_out_gain
    }
}

/// What a search for a kind would gain on average where there is nothing: one for each number that it moves (Akaike 1974). Where
/// the response jumps about as the value moves, or a peak is narrow, each of many places is a trial of its own, and the best of `n`
/// trials has `ln n` more (the tail of the log likelihood's gain by chance is exponential).
pub(crate) fn complexity_penalty(kind: &'static Kind) -> f64 {
    Candidate::searched(kind).count() as f64 + propose::of(kind).places(kind).ln()
}

/// The most valuable first, of those that may be named.
pub(crate) fn by_score(a: &Tried, b: &Tried) -> Ordering {
    b.exceeds_least_gain().cmp(&a.exceeds_least_gain()).then(b.score().total_cmp(&a.score()))
}
