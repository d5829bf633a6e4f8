//! What became of each kind, and by which test.

use rotorlead_plant::effect::Kind;
use serde::Serialize;

use crate::select::tried::Tried;

/// What became of a kind in a log.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Decision {
    /// The kind.
    pub kind: &'static Kind,
    /// What it was tried beside.
    pub beside: Vec<&'static Kind>,
    /// Gain of log likelihood over what is fitted; after a few steps of a search only where no score is known.
    pub fitted_gain: f64,
    /// The mean gain over what is held out; `None` where the fitted gain was too far behind to go on.
    pub held_out_gain: Option<f64>,
    /// Both, less what the search would gain by chance.
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
            false if self.failed.is_empty() => "not added: passes every test, but another one comes first".to_owned(),
            false => format!("not added. Fails {}", self.failed.join("; ")),
        }
    }

    /// That of a kind that was tried to the end.
    pub(crate) fn of(tried: &Tried, beside: &[&'static Kind], failed: Vec<String>) -> Self {
        Self {
            kind: tried.kind,
            beside: beside.to_vec(),
            fitted_gain: tried.fitted_gain,
            held_out_gain: Some(tried.held_out_gain),
            score: Some(tried.score()),
            is_added: failed.is_empty(),
            failed,
        }
    }
}
