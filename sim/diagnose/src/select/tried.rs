//! A kind that was tried beside the lags alone.

use rotorlead_plant::effect::Kind;

use super::pool::Pool;
use crate::estimate::fit::Fit;
use crate::model::candidate::AT_MOST_OFF;
use crate::policy::POLICY;
use crate::select::search::Search;

/// A kind with what it would be worth.
#[derive(Clone, Debug)]
pub(crate) struct Tried {
    /// The kind.
    pub kind: &'static Kind,
    /// The fit with it.
    pub fit: Fit,
    /// Gain of log likelihood.
    pub fitted_gain: f64,
    /// The same on steps that are held out in turn; `None` where that was not asked.
    pub held_out_gain: Option<f64>,
    /// Gain of log evidence.
    pub score: f64,
}

impl Tried {
    /// Whether its values are those of an actuator.
    pub fn is_plausible(&self) -> bool {
        self.fit.hypothesis.effects.iter().all(|effect| effect.beyond_range(AT_MOST_OFF).is_none())
    }

    /// Whether its score is high enough.
    pub fn scores_enough(&self) -> bool {
        self.score >= POLICY.least_score
    }
}

impl Search<'_> {
    /// Each of a pool, the best first.
    pub fn tried(&self, pool: &Pool) -> Vec<Tried> {
        let of_member = |member| {
            let worth = self.worth(pool, member, 0)?;
            let kind = member.fit.hypothesis.effects.first()?.kind;
            let (fitted_gain, held_out_gain, score) = (worth.fitted_gain, worth.held_out_gain, worth.lost);
            Some(Tried { kind, fit: member.fit.clone(), fitted_gain, held_out_gain, score })
        };
        pool.with_size(1).filter_map(of_member).collect()
    }
}
