//! One kind tried beside what is there: searched to its end, and what that is worth.

use rotorlead_plant::effect::Kind;

use crate::data::dataset::Split;
use crate::estimate::fit::{Fit, fit, fit_behind};
use crate::estimate::prediction::Near;
use crate::estimate::profile::MOVES;
use crate::estimate::{frame_rate, prediction};
use crate::likelihood::hold_delay;
use crate::model::candidate::Candidate;
use crate::model::hypothesis::Hypothesis;
use crate::propose::{self, frames};
use crate::select::explain::Search;
use crate::select::tried::{Tried, complexity_penalty};

/// Changes that stand alone and say this of frames, in log likelihood, say that there are none.
const ALL_ALIKE: f64 = -3.0;

/// What kinds are tried beside, with what it says of what is held out.
pub(crate) struct Beside<'a> {
    pub fit: &'a Fit,
    held_out: Option<f64>,
}

impl Search<'_> {
    /// A kind searched to the end, which is `behind` the best of all in worth so far.
    pub fn attempt(&self, from: &Beside, start: &Hypothesis, kind: &'static Kind, behind: f64) -> Option<Tried> {
        let fit = self.whole(fit_behind(&self.likelihood, start, self.lags, behind)?);
        let mean = self.tried(from, (fit, Near::Moved), kind, complexity_penalty(kind));
        // Where the frames lie is looked for once their rate is about known.
        let anywhere = |effect: &Candidate| effect.kind == kind && effect.has_frames() && effect.phases.is_empty();
        let effect = mean.fit.hypothesis.effects.iter().position(anywhere);
        // Where single changes wait alike there are no frames to be found.
        let waits = |_: &usize| hold_delay::evidence(&self.likelihood, &mean.fit.hypothesis, Split::Train) > ALL_ALIKE;
        let framed = effect.filter(waits).and_then(|effect| {
            let fit = self.framed(&mean.fit, effect, behind)?;
            // A phase for each record, beside the rate.
            Some(self.tried(
                from,
                (fit, Near::Moved),
                kind,
                complexity_penalty(kind) + self.likelihood.data.records.len() as f64,
            ))
        });
        let is_missed = effect.is_some_and(|effect| {
            frames::are_missed(&self.likelihood, &mean.fit, effect, framed.as_ref().map(|framed| framed.fit.chi_square))
        });
        let best = framed.filter(|framed| framed.score() > mean.score()).unwrap_or(mean);
        // What is not there cannot be had at any complexity penalty.
        Some(if is_missed { Tried { complexity_penalty: f64::INFINITY, ..best } } else { best })
    }

    /// `mean` with the rate and the phases of the frames of its `effect`, searched to the end. `None` where the records do not show
    /// them, or not enough for what it is `behind` another, in log likelihood.
    pub fn framed(&self, mean: &Fit, effect: usize, behind: f64) -> Option<Fit> {
        let framed = frames::find(&self.likelihood, mean, effect, behind)?;
        let framed = fit(&self.likelihood, &framed, self.lags)?;
        fit(&self.likelihood, &frame_rate::polish(&self.likelihood, &framed, effect)?, self.lags)
    }

    /// `found` with the steps of a grid such that they make a whole range, where that fits as well: what is fitted may not say on
    /// which side of a step a command lies that is held out.
    fn whole(&self, found: Fit) -> Fit {
        let last = found.hypothesis.effects.last().and_then(|last| propose::of(last.kind).rounded(last));
        let whole = last.and_then(|last| {
            let mut whole = found.hypothesis.clone();
            *whole.effects.last_mut()? = last;
            fit(&self.likelihood, &whole, self.lags)
        });
        whole.filter(|whole| whole.chi_square < found.chi_square + MOVES).unwrap_or(found)
    }

    /// What `fit` is worth beside `from`.
    pub fn tried(
        &self,
        from: &Beside,
        (fit, near): (Fit, Near),
        kind: &'static Kind,
        complexity_penalty: f64,
    ) -> Tried {
        let waits = |split| {
            let of = |hypothesis| hold_delay::evidence(&self.likelihood, hypothesis, split);
            of(&fit.hypothesis) - of(&from.fit.hypothesis)
        };
        let fitted_gain = 0.5 * (from.fit.chi_square - fit.chi_square) + waits(Split::Train);
        let held_out_gain = self.held_out_gain(from, &fit, near) + waits(Split::Holdout);
        Tried { kind, fit, fitted_gain, held_out_gain, complexity_penalty, auxiliary_gain: 0.0 }
    }

    /// What kinds are tried beside.
    pub fn beside<'a>(&self, fit: &'a Fit) -> Beside<'a> {
        Beside { fit, held_out: prediction::deviance(&self.likelihood, fit, Near::Moved) }
    }

    /// By how much the log likelihood of what is held out grows.
    fn held_out_gain(&self, from: &Beside, to: &Fit, near: Near) -> f64 {
        match (from.held_out, prediction::deviance(&self.likelihood, to, near)) {
            (Some(from), Some(to)) => 0.5 * (from - to),
            _ => f64::NEG_INFINITY,
        }
    }
}
