//! Which effects matter: what they change, beside the noise.
//!
//! With 360 000 rows everything is significant. An effect without which the prediction would be another one by less than a tenth of the
//! noise makes no difference to whoever uses the model.

use rotorlead_plant::effect::Kind;
use serde::Serialize;
use std::fmt;

use crate::data::split::Split;
use crate::likelihood::Likelihood;
use crate::model::hypothesis::Hypothesis;

/// An effect that is significant and does not matter.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct MinorEffect {
    /// The kind.
    pub kind: &'static Kind,
    /// Gain of log likelihood that it is worth beside the others.
    pub evidence: f64,
    /// RMS of the change that it makes to the prediction, over that of the noise: the larger of what was fitted and of what was held out.
    pub share: f64,
}

impl fmt::Display for MinorEffect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "Minor: {} ({}) is significant (score {:.1}), and changes the prediction by {:.1} % of the noise only; not added.",
            self.kind.id,
            self.kind.title,
            self.evidence,
            100.0 * self.share
        )
    }
}

/// RMS of the change of the prediction from one hypothesis to another, over that of the noise: of what was held out or of what was
/// fitted, the larger, since an effect may show in one kind of record only. Infinite where either is impossible.
pub(crate) fn share(likelihood: &Likelihood, with: &Hypothesis, without: &Hypothesis) -> f64 {
    let of_split = |split: Split| {
        let (mut change, mut noise) = (0.0, 0.0);
        for record in likelihood.compared(split) {
            let of = likelihood.for_record(record);
            let tau_s = with.base[record.point].time_constant_s;
            change += of.change(with, without, tau_s, split).unwrap_or(f64::INFINITY);
            noise += of.power(split).noise;
        }
        if noise > 0.0 { (change / noise).sqrt() } else { change }
    };
    of_split(Split::Train).max(of_split(Split::Holdout))
}
