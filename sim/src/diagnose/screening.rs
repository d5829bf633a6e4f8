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
/// beside no effect.
pub(super) struct Screening<'a> {
    from: &'a Fit,
    tangent: Tangent,
    /// The chain that changes are taken from, and by record what the fit leaves less what that chain leaves; empty where it
    /// is the fit's own.
    quick: Hypothesis,
    offsets: Vec<Vec<Complex64>>,
}

/// Whether a chain with it takes much longer.
fn is_slow(candidate: &Candidate) -> bool {
    matches!(candidate.kind.site, Site::Supply | Site::Map | Site::Rotor) || candidate.drifts()
}

impl<'a> Screening<'a> {
    /// Beside `from`. `None` where its derivatives are not defined.
    pub fn new(trials: &Trials, from: &'a Fit) -> Option<Self> {
        let tangent = from.tangent(trials)?;
        let mut quick = from.hypothesis.clone();
        quick.effects.retain(|candidate| !is_slow(candidate));
        let mut offsets = Vec::new();
        if quick.effects.len() < from.hypothesis.effects.len() {
            let offset = |trial: &Trial| {
                if trial.end_of(Some(Purpose::Fit)) == 0 {
                    return Some(Vec::new());
                }
                let mut left = residual(trials, trial, &from.hypothesis, Purpose::Fit)?;
                let without = residual(trials, trial, &quick, Purpose::Fit)?;
                left.iter_mut().zip(&without).for_each(|(left, without)| *left -= without);
                Some(left)
            };
            offsets = trials.trials.par_iter().map(offset).collect::<Option<_>>()?;
        }
        Some(Self { from, tangent, quick, offsets })
    }

    /// The sum of squares that is left with one more effect, and all of it moved there. With the misalignment of the fit, or
    /// without any.
    pub fn judge(&self, trials: &Trials, candidate: &Candidate, aligned: bool) -> Option<(f64, Hypothesis)> {
        let mut with = self.from.hypothesis.with(candidate.clone());
        let mut quick = self.quick.with(candidate.clone());
        if aligned {
            (with.late_s, quick.late_s) = (0.0, 0.0);
        }
        let slope = self.tangent.slope_of(trials, &with, |place, trial| {
            let mut left = residual(trials, trial, &quick, Purpose::Fit)?;
            if let Some(offset) = self.offsets.get(place) {
                left.iter_mut().zip(offset).for_each(|(left, offset)| *left += offset);
            }
            Some(left)
        })?;
        self.tangent.follow(&with, slope)
    }
}
