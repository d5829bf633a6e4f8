//! Where searches of an effect begin, by what its kind says of that ([`Search`]).

pub(crate) mod collapsed;
pub(crate) mod frame_rate_scan;
mod limit;
mod peak;
mod quantizer_step;
pub(crate) mod scan;

use rotorlead_plant::effect::{Kind, Search};

use crate::estimate::fit::Fit;
use crate::likelihood::Likelihood;
use crate::model::candidate::{Candidate, GRID};
use scan::Scan;

/// Where a search begins, and how it goes on.
pub(crate) struct Starts {
    /// Values to begin with.
    pub candidates: Vec<Candidate>,
    /// Whether the best of them lies in a narrow valley, which has to be followed down.
    pub is_in_valley: bool,
}

/// How one kind is looked for.
pub(crate) trait Proposal: Sync {
    /// Where to begin beside `from`.
    fn starts(&self, likelihood: &Likelihood, from: &Fit, scan: &Scan, kind: &'static Kind) -> Starts {
        let _ = from;
        let candidates = scan.valleys(kind, GRID);
        let is_in_valley = !candidates.is_empty();
        let general = || Candidate::starts(kind, likelihood.data.has_logs());
        Starts { candidates: if is_in_valley { candidates } else { general() }, is_in_valley }
    }

    /// How many separate places are looked at, each a trial of its own: where the response jumps about as a value moves, or a peak is
    /// narrow.
    fn independent_trials(&self, kind: &'static Kind) -> f64 {
        let of_value = |pieces: u32| if pieces > GRID { f64::from(pieces) } else { 1.0 };
        Candidate::searched(kind).map(|(_, parameter)| of_value(parameter.pieces)).product()
    }

    /// The values near these that are likelier by what kinds like it are made of. `None` where there are no such.
    fn rounded(&self, _: &Candidate) -> Option<Candidate> {
        None
    }
}

/// By starts and plausible ranges alone.
struct ByPlausibleRange;

impl Proposal for ByPlausibleRange {}

/// How a kind is looked for.
pub(crate) fn proposal_for(kind: &Kind) -> &'static dyn Proposal {
    match kind.search {
        Search::Values | Search::Frames => &ByPlausibleRange,
        Search::Steps => &quantizer_step::QuantizerStep,
        Search::Peak => &peak::Peak,
        Search::Limit => &limit::Limit,
    }
}
