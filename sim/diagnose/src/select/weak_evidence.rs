//! Effects with weak evidence, where no effect has enough to be added.
//!
//! An effect whose log likelihood does not outweigh the search for it is not named: among so many kinds noise alone would do as much
//! too often. Where it does the larger part of that, it says where to look, and how much longer: evidence grows in proportion to
//! the periods that are recorded.

use serde::Serialize;
use std::fmt;

use rotorlead_plant::effect::Kind;

use crate::estimate::fit::Fit;
use crate::model::candidate::Candidate;
use crate::policy::POLICY;
use crate::propose;
use crate::select::screen::Screened;
use crate::select::tried::Tried;

/// A kind whose evidence is too weak for it to be added.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct WeakEvidence {
    /// The kind.
    pub kind: &'static Kind,
    /// Gain of log likelihood on what is fitted, less what the search itself would gain by chance.
    pub evidence: f64,
}

impl WeakEvidence {
    /// How many times as long records like these have to be for it to be named: in proportion to what is needed, and twice at least. Twice
    /// is chosen: less is hardly worth another day at the stand.
    #[must_use]
    pub fn times_longer(&self) -> u32 {
        (POLICY.least_score / self.evidence.max(POLICY.least_weak_evidence)).ceil().max(2.0) as u32
    }
}

impl fmt::Display for WeakEvidence {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { kind, evidence } = self;
        write!(
            f,
            "Weak evidence for {} ({}): log-likelihood {evidence:+.1} beyond its complexity penalty, of which the choice among all kinds \
             leaves less than the {} that are needed; not added.",
            kind.id, kind.title, POLICY.least_score
        )
    }
}

/// What a search for a kind would gain on average where there is nothing: one for each number that it moves (Akaike 1974). Where
/// the response jumps about as the value moves, or a peak is narrow, each of many places is a trial of its own, and the best of `n`
/// trials has `ln n` more (the tail of the log likelihood's gain by chance is exponential).
fn complexity_penalty(kind: &'static Kind) -> f64 {
    Candidate::searched(kind).count() as f64 + propose::proposal_for(kind).independent_trials(kind).ln()
}

/// The gain over `from` that the linearization predicts for each kind.
pub(crate) fn linearized_evidence(from: &Fit, screened: &[Screened]) -> Vec<WeakEvidence> {
    let mut promised: Vec<WeakEvidence> = Vec::new();
    // The best start of a kind comes first.
    for (left, _, kind) in screened {
        if promised.iter().all(|other| other.kind != *kind) {
            promised.push(WeakEvidence { kind, evidence: 0.5 * (from.chi_square - left) - complexity_penalty(kind) });
        }
    }
    promised
}

/// Those to which the records lean, the strongest first. What was `tried` to the end is known better than by what it promised; what
/// came out with values that no actuator has is none.
pub(crate) fn weak_evidence(promised: Vec<WeakEvidence>, tried: &[Tried]) -> Vec<WeakEvidence> {
    let of = |promised: WeakEvidence| match tried.iter().find(|tried| tried.kind == promised.kind) {
        Some(tried) => {
            let evidence = tried.fitted_gain - complexity_penalty(tried.kind);
            tried.is_plausible().then_some(WeakEvidence { evidence, ..promised })
        }
        None => Some(promised),
    };
    let mut weak_evidence: Vec<WeakEvidence> = promised.into_iter().filter_map(of).collect();
    weak_evidence.sort_by(|a, b| b.evidence.total_cmp(&a.evidence));
    let best = weak_evidence.first().map_or(0.0, |best| best.evidence);
    weak_evidence
        .retain(|suspect| suspect.evidence >= POLICY.least_weak_evidence && best - suspect.evidence < POLICY.alike);
    weak_evidence
}
