//! What the records lean to where nothing is worth a name.
//!
//! An effect whose log likelihood does not outweigh the search for it is not named: among so many kinds noise alone would do as much
//! too often. Where it does the larger part of that, it says where to look, and how much longer: evidence grows in proportion to
//! the periods that are recorded.

use std::fmt;

use super::explain::Screened;
use super::fit::Fit;
use super::tried::{ALIKE, LEAST_WORTH, Tried, price};
use crate::plant::effect::Kind;

/// Gain of log likelihood beyond the price from which on records lean to a kind. For a kind of one value noise alone does so in one
/// of 200 experiments: half of a chi-square of one degree of freedom is beyond 4 that often.
const LEAST: f64 = 3.0;

/// A kind to which the records lean, too little to be named.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Suspect {
    /// The kind.
    pub kind: &'static Kind,
    /// Gain of log likelihood on what is fitted, less what the search itself would gain by chance.
    pub evidence: f64,
}

impl Suspect {
    /// How many times as long records like these have to be for it to be named.
    #[must_use]
    pub fn times_longer(&self) -> u32 {
        (LEAST_WORTH / self.evidence.max(LEAST)).ceil().max(2.0) as u32
    }
}

impl fmt::Display for Suspect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { kind, evidence } = self;
        write!(f, "Too little to be named: {} ({}), log likelihood {evidence:+.1}.", kind.id, kind.title)
    }
}

/// What each kind would gain on `from`, as far as the tangent holds.
pub(super) fn promised(from: &Fit, screened: &[Screened]) -> Vec<Suspect> {
    let mut promised: Vec<Suspect> = Vec::new();
    // The best start of a kind comes first.
    for (left, _, kind) in screened {
        if promised.iter().all(|other| other.kind != *kind) {
            promised.push(Suspect { kind, evidence: 0.5 * (from.misfit - left) - price(kind) });
        }
    }
    promised
}

/// Those to which the records lean, the strongest first. What was `tried` to the end is known better than by what it promised; what
/// came out with values that no actuator has is none.
pub(super) fn suspected(promised: Vec<Suspect>, tried: &[Tried]) -> Vec<Suspect> {
    let of = |promised: Suspect| match tried.iter().find(|tried| tried.kind == promised.kind) {
        Some(tried) => {
            let evidence = tried.fitted_gain - tried.price;
            tried.is_plausible().then_some(Suspect { evidence, ..promised })
        }
        None => Some(promised),
    };
    let mut suspected: Vec<Suspect> = promised.into_iter().filter_map(of).collect();
    suspected.sort_by(|a, b| b.evidence.total_cmp(&a.evidence));
    let best = suspected.first().map_or(0.0, |best| best.evidence);
    suspected.retain(|suspect| suspect.evidence >= LEAST && best - suspect.evidence < ALIKE);
    suspected
}
