//! Candidates beside a fit, judged by what they would change.

use num_complex::Complex64;
use rayon::prelude::*;

use super::candidate::Candidate;
use super::fit::Fit;
use super::hypothesis::Hypothesis;
use super::residual::residual;
use super::tangent::Tangent;
use super::trial::{Purpose, Trial, Trials};
use crate::plant::effect::Site;

/// Judges candidates beside a fit by what they would change.
///
/// Where the fit has effects that make the rotor one that is integrated, or the periods differ, a candidate's change is taken from
/// the chain without these and added to what the fit leaves: right to first order, which is all that the tangent is, and as quick as
/// beside no effect. Where commands are told between the rows and nothing acts on single ones, the change is taken from a straight
/// line from row to row, for the same reason.
pub(super) struct Screening<'a> {
    from: &'a Fit,
    tangent: Tangent,
    own: Chain,
    /// In rows; `None` where `own` is as quick.
    in_rows: Option<Chain>,
}

/// What changes are taken from.
struct Chain {
    quick: Hypothesis,
    /// By record what the fit leaves less what this leaves; empty where it is the fit's own.
    offsets: Vec<Vec<Complex64>>,
}

/// Whether a chain with it takes much longer.
fn is_slow(candidate: &Candidate) -> bool {
    matches!(candidate.kind.site, Site::Supply | Site::Map | Site::Rotor) || candidate.drifts()
}

impl Chain {
    /// That of `quick`, where `left` is what the fit leaves of each record.
    fn new(trials: &Trials, quick: Hypothesis, left: &[&[Complex64]]) -> Option<Self> {
        let of_record = |(trial, left): (&Trial, &&[Complex64])| {
            if left.is_empty() {
                return Some(Vec::new());
            }
            let mut offset = residual(trials, trial, &quick, Purpose::Fit)?;
            offset.iter_mut().zip(*left).for_each(|(offset, left)| *offset = left - *offset);
            Some(offset)
        };
        let offsets: Option<Vec<_>> = trials.trials.par_iter().zip(left).map(of_record).collect();
        Some(Self { offsets: offsets?, quick })
    }
}

impl<'a> Screening<'a> {
    /// Beside `from`. `None` where its derivatives are not defined.
    pub fn new(trials: &Trials, from: &'a Fit) -> Option<Self> {
        let tangent = from.tangent(trials)?;
        let mut quick = from.hypothesis.clone();
        quick.effects.retain(|candidate| !is_slow(candidate));
        let in_rows = match trials.trials.iter().find_map(|trial| quick.in_rows(trial)) {
            Some(in_rows) => Some(Chain::new(trials, in_rows, &tangent.left())?),
            None => None,
        };
        let is_shorter = quick.effects.len() < from.hypothesis.effects.len();
        let own =
            if is_shorter { Chain::new(trials, quick, &tangent.left())? } else { Chain { quick, offsets: Vec::new() } };
        Some(Self { from, tangent, own, in_rows })
    }

    /// The sum of squares that is left with one more effect, and all of it moved there. With the misalignment of the fit, or
    /// without any.
    pub fn judge(&self, trials: &Trials, candidate: &Candidate, aligned: bool) -> Option<(f64, Hypothesis)> {
        let chain = self.in_rows.as_ref().filter(|_| candidate.is_even()).unwrap_or(&self.own);
        let mut with = self.from.hypothesis.with(candidate.clone());
        let mut quick = chain.quick.with(candidate.clone());
        if aligned {
            (with.late_s, quick.late_s) = (0.0, 0.0);
        }
        let slope = self.tangent.slope_of(trials, &with, |place, trial| {
            let mut left = residual(trials, trial, &quick, Purpose::Fit)?;
            if let Some(offset) = chain.offsets.get(place) {
                left.iter_mut().zip(offset).for_each(|(left, offset)| *left += offset);
            }
            Some(left)
        })?;
        self.tangent.follow(&with, slope)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::explain::Search;
    use crate::diagnose::testing::{records_told, trials};
    use crate::plant::Catalog;

    #[test]
    fn what_is_judged_in_rows_is_what_all_commands_say() {
        let pole = "[[effect]]\nkind = \"second_pole\"\nparameters = { time_constant_s = 0.012 }\n";
        let (trials, base) = trials(&records_told(pole, (0.05, 1), (2000, 400)));
        let catalog = Catalog::standard();
        let mut search = Search { trials, catalog: &catalog, progress: &|| {}, lags: true };
        let from = search.settle(&Hypothesis::of_lags(base), true).unwrap();
        let trials = &search.trials;
        let screening = Screening::new(trials, &from).unwrap();
        assert!(screening.in_rows.is_some());
        let mut judged = 0;
        for kind in catalog.kinds().filter(|kind| kind.id != "parameter_error") {
            let start = Candidate::starts(kind, false)[0].clone();
            let (left, _) = screening.judge(trials, &start, false).unwrap();
            let (exact, _) = screening.tangent.judge(trials, &from.hypothesis.with(start.clone())).unwrap();
            let changed = (from.misfit - exact).abs();
            assert!((left - exact).abs() < 0.03 * changed + 0.5, "{}: {left} for {exact} of {}", kind.id, from.misfit);
            judged += usize::from(start.is_even());
        }
        assert!(judged > 8, "{judged} in rows");
    }
}
