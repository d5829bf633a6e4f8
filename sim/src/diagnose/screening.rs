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
/// beside no effect. Where commands are told between the rows, the change by what does not act on single commands is taken from
/// their mean over each row, for the same reason.
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

/// White residuals of the records that are fitted, by their place.
fn residuals(trials: &Trials, hypothesis: &Hypothesis) -> Option<Vec<Vec<Complex64>>> {
    let of_trial = |trial: &Trial| {
        let is_fitted = trial.end_of(Some(Purpose::Fit)) > 0;
        if is_fitted { residual(trials, trial, hypothesis, Purpose::Fit) } else { Some(Vec::new()) }
    };
    trials.trials.par_iter().map(of_trial).collect()
}

impl Chain {
    /// That of `trials`, beside what the fit leaves of the records.
    fn new(trials: &Trials, quick: Hypothesis, left: &[Vec<Complex64>]) -> Option<Self> {
        let mut offsets = residuals(trials, &quick)?;
        for (offset, left) in offsets.iter_mut().zip(left) {
            offset.iter_mut().zip(left).for_each(|(offset, left)| *offset = left - *offset);
        }
        Some(Self { quick, offsets })
    }
}

impl<'a> Screening<'a> {
    /// Beside `from`. `None` where its derivatives are not defined.
    pub fn new(trials: &Trials, from: &'a Fit) -> Option<Self> {
        let tangent = from.tangent(trials)?;
        let mut quick = from.hypothesis.clone();
        quick.effects.retain(|candidate| !is_slow(candidate));
        let is_shorter = quick.effects.len() < from.hypothesis.effects.len();
        let has_more = trials.trials.iter().any(|trial| trial.told_per_row > 1);
        let left = if is_shorter || has_more { residuals(trials, &from.hypothesis)? } else { Vec::new() };
        let in_rows = Hypothesis { in_rows: true, ..quick.clone() };
        let in_rows = has_more.then(|| Chain::new(trials, in_rows, &left));
        let in_rows = if let Some(in_rows) = in_rows { Some(in_rows?) } else { None };
        let own = if is_shorter { Chain::new(trials, quick, &left)? } else { Chain { quick, offsets: Vec::new() } };
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
        let (trials, base) = trials(&records_told(pole, (0.05, 1), 5));
        let catalog = Catalog::standard();
        let mut search = Search { trials, catalog: &catalog, progress: &|| {}, lags: true };
        let from = search.settle(&Hypothesis::of_lags(base), true).unwrap();
        let trials = &search.trials;
        let screening = Screening::new(trials, &from).unwrap();
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
