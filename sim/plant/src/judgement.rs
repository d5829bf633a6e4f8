//! Whether a compensator may be built on a model, as its file carries it.

use std::fmt;

use serde::{Deserialize, Serialize};

/// Whether a compensator may be built on a model, and what stands in the way. `docs/judgement.md` has the rules.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Judgement {
    /// In a word.
    pub state: Readiness,
    /// Why, what weighs most first, each with what to do; none where it is [`Readiness::Ready`].
    pub limits: Vec<String>,
    /// Whether units or signs of the records are wrong, so that no number of the model is what it says.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub in_doubt: bool,
}

/// Why nothing is flown on a motor that is not a lag.
const NOT_A_LAG: &str = "the motor is not a lag, and a compensator inverts one";
/// Why nothing is flown where units or signs are wrong.
const IN_DOUBT: &str = "the numbers of the records are in doubt";

impl Judgement {
    /// Why nothing is flown on the model, whatever it promises; `None` where that is not so.
    #[must_use]
    pub fn doubt(&self) -> Option<&'static str> {
        if self.in_doubt { Some(IN_DOUBT) } else { (self.state == Readiness::NotALag).then_some(NOT_A_LAG) }
    }
}

/// The four words, from the best on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Readiness {
    /// A lag, to within the noise of records that it was not fitted to.
    #[serde(rename = "ready")]
    Ready,
    /// A lag that is good enough where the reasons are heeded.
    #[serde(rename = "ready within limits")]
    ReadyWithinLimits,
    /// The records do not show whether it is one.
    #[serde(rename = "measure again")]
    MeasureAgain,
    /// The records show that it is none.
    #[serde(rename = "not a lag")]
    NotALag,
}

impl fmt::Display for Readiness {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Ready => "ready",
            Self::ReadyWithinLimits => "ready within limits",
            Self::MeasureAgain => "measure again",
            Self::NotALag => "not a lag",
        })
    }
}

/// The word, and the reason that weighs most.
impl fmt::Display for Judgement {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.limits.first() {
            Some(reason) => write!(f, "{}: {reason}", self.state),
            None => write!(f, "{}", self.state),
        }
    }
}
