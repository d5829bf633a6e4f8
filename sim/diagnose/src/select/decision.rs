//! Decision on each kind of effect: added or rejected, and the tests it failed.

use rotorlead_plant::effect::Kind;
use serde::Serialize;

use super::pool::{Member, Pool, without};
use crate::select::search::Search;
use crate::select::weak_evidence::WeakEvidence;

/// What became of a kind in records that do not repeat.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Decision {
    /// The kind.
    pub kind: &'static Kind,
    /// What it was tried beside.
    pub beside: Vec<&'static Kind>,
    /// Gain of log likelihood over what is fitted; of a kind that was not followed, as far as its first look says.
    pub fitted_gain: f64,
    /// The mean gain over what is held out in turn; `None` where the score was too low to ask.
    pub held_out_gain: Option<f64>,
    /// The gain of log evidence; `None` for a kind that was not followed.
    pub score: Option<f64>,
    /// What it failed, empty for a kind that was added.
    pub failed: Vec<String>,
    /// Whether it was added.
    pub is_added: bool,
}

impl Decision {
    /// What became of it, in words.
    #[must_use]
    pub fn outcome(&self) -> String {
        match self.is_added {
            true => "added: passes every test".to_owned(),
            false => format!("not added. Fails {}", self.failed.join("; ")),
        }
    }
}

impl Search<'_> {
    /// What became of each kind: of those that were tried beside those that were chosen where they were tried there, and of what was only
    /// `promised` beside the lags.
    pub fn decisions(&self, pool: &Pool, chosen: &Member, promised: &[WeakEvidence]) -> Vec<Decision> {
        let named = chosen.kinds();
        let of_kind = |member: &Member| {
            let kind = member.fit.hypothesis.effects.first()?.kind;
            let more = |kind| {
                let mut kinds = named.clone();
                kinds.push(kind);
                kinds.sort_by_key(|kind| kind.id);
                kinds
            };
            let is_added = named.contains(&kind);
            let tried = if is_added { chosen } else { pool.get(&more(kind)).unwrap_or(member) };
            let place = tried.fit.hypothesis.effects.iter().position(|effect| effect.kind == kind)?;
            let worth = self.worth(pool, tried, place)?;
            let mut failed = worth.failed;
            if !is_added && failed.is_empty() {
                failed.push("score: another one explains the same better".to_owned());
            }
            Some(Decision {
                kind,
                beside: without(&tried.kinds(), kind),
                fitted_gain: worth.fitted_gain,
                held_out_gain: worth.held_out_gain,
                score: Some(worth.lost),
                failed: if is_added { Vec::new() } else { failed },
                is_added,
            })
        };
        let mut decisions: Vec<Decision> = pool.with_size(1).filter_map(of_kind).collect();
        for WeakEvidence { kind, evidence } in promised {
            if decisions.iter().all(|decision| decision.kind != *kind) {
                decisions.push(Decision {
                    kind,
                    beside: Vec::new(),
                    fitted_gain: *evidence,
                    held_out_gain: None,
                    score: None,
                    failed: vec!["training gain: others promise more".to_owned()],
                    is_added: false,
                });
            }
        }
        decisions
    }
}
