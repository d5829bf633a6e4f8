//! Candidates beside a fit, evaluated by what they would change.

use num_complex::Complex64;
use rayon::prelude::*;
use rotorlead_plant::effect::Site;

use crate::data::dataset::PreparedRecord;
use crate::data::split::Split;
use crate::estimate::fit::Fit;
use crate::estimate::linearization::Linearization;
use crate::likelihood::Likelihood;
use crate::model::candidate::Candidate;
use crate::model::hypothesis::Hypothesis;

/// Score test of candidates that are added to a fit: the decrease of the chi-square that the linearization predicts.
///
/// Where the fit has effects that need an integrated rotor, or the periods differ, a candidate's change is taken from the chain without
/// these and added to the fit's residual: that is right to first order, as the linearization is, and as quick as without effects. Where
/// commands are applied between the rows and nothing acts on single ones, the change is taken from a straight line from row to row, for
/// the same reason.
pub(crate) struct ScoreTest<'a> {
    from: &'a Fit,
    linearization: Linearization,
    /// The chi-square of the fit.
    before: f64,
    own: Chain,
    /// In rows; `None` where `own` is as quick.
    in_rows: Option<Chain>,
}

/// What changes are taken from.
struct Chain {
    quick: Hypothesis,
    /// By record, the residual of the fit less that of `quick`; empty where `quick` is the fit's own.
    offsets: Vec<Vec<Complex64>>,
}

/// Whether a chain with it takes much longer.
fn is_slow(candidate: &Candidate) -> bool {
    matches!(candidate.kind.site, Site::Supply | Site::Map | Site::Rotor) || candidate.drifts()
}

impl Chain {
    /// The chain of `quick`; `residual` is the white residual of the fit, record by record.
    fn new(likelihood: &Likelihood, quick: Hypothesis, residual: &[&[Complex64]]) -> Option<Self> {
        let of_record = |(record, residual): (&PreparedRecord, &&[Complex64])| {
            if residual.is_empty() {
                return Some(Vec::new());
            }
            let mut offset = likelihood.residual(record, &quick, Split::Train)?;
            offset.iter_mut().zip(*residual).for_each(|(offset, residual)| *offset = residual - *offset);
            Some(offset)
        };
        let offsets: Option<Vec<_>> = likelihood.data.records.par_iter().zip(residual).map(of_record).collect();
        Some(Self { offsets: offsets?, quick })
    }
}

impl<'a> ScoreTest<'a> {
    /// Beside `from`. `None` where its derivatives are not defined.
    pub fn new(likelihood: &Likelihood, from: &'a Fit) -> Option<Self> {
        let linearization = from.linearization(likelihood)?;
        let before = linearization.slope_here(likelihood, &from.hypothesis)?.0;
        let mut quick = from.hypothesis.clone();
        quick.effects.retain(|candidate| !is_slow(candidate));
        let in_rows = match likelihood.data.records.iter().find_map(|record| quick.in_rows(record)) {
            Some(in_rows) => Some(Chain::new(likelihood, in_rows, &linearization.residual())?),
            None => None,
        };
        let is_shorter = quick.effects.len() < from.hypothesis.effects.len();
        let own = if is_shorter {
            Chain::new(likelihood, quick, &linearization.residual())?
        } else {
            Chain { quick, offsets: Vec::new() }
        };
        Some(Self { from, linearization, before, own, in_rows })
    }

    /// The chi-square of the fit on these records.
    pub fn before(&self) -> f64 {
        self.before
    }

    /// The sum of squares that is left with one more effect, and all of it moved there. With the misalignment of the fit, or
    /// without any.
    pub fn predict(&self, likelihood: &Likelihood, candidate: &Candidate, aligned: bool) -> Option<(f64, Hypothesis)> {
        let chain = self.in_rows.as_ref().filter(|_| candidate.is_even()).unwrap_or(&self.own);
        let mut with = self.from.hypothesis.with(candidate.clone());
        let mut quick = chain.quick.with(candidate.clone());
        if aligned {
            (with.time_offset_s, quick.time_offset_s) = (0.0, 0.0);
        }
        let (sum, gradient) = self.linearization.white_slope(likelihood, &with, |place, record| {
            let mut residual = likelihood.residual(record, &quick, Split::Train)?;
            if let Some(offset) = chain.offsets.get(place) {
                residual.iter_mut().zip(offset).for_each(|(residual, offset)| *residual += offset);
            }
            Some(residual)
        })?;
        self.linearization.follow(&with, sum, &gradient)
    }
}

#[cfg(test)]
mod tests {
    use rotorlead_plant::Catalog;

    use super::*;
    use crate::estimate::settle::settle;
    use crate::testing::{likelihood, records_with_command_rate};

    #[test]
    fn what_is_judged_in_rows_is_what_all_commands_say() {
        let pole = "[[effect]]\nkind = \"second_pole\"\nparameters = { time_constant_s = 0.012 }\n";
        let (likelihood, base) = likelihood(&records_with_command_rate(pole, (0.05, 1), (2000, 400)));
        let catalog = Catalog::standard();
        let (likelihood, from) = settle(&likelihood, &Hypothesis::from_lags(base), true).unwrap();
        let likelihood = &likelihood;
        let score_test = ScoreTest::new(likelihood, &from).unwrap();
        assert!(score_test.in_rows.is_some());
        let mut predicted = 0;
        for kind in catalog.kinds().filter(|kind| kind.id != "parameter_error") {
            let start = Candidate::starts(kind, false)[0].clone();
            let (chi_square, _) = score_test.predict(likelihood, &start, false).unwrap();
            let (exact, _) =
                score_test.linearization.predict(likelihood, &from.hypothesis.with(start.clone())).unwrap();
            let changed = (from.chi_square - exact).abs();
            assert!(
                (chi_square - exact).abs() < 0.03 * changed + 0.5,
                "{}: {chi_square} for {exact} of {}",
                kind.id,
                from.chi_square
            );
            predicted += usize::from(start.is_even());
        }
        assert!(predicted > 8, "{predicted} in rows");
    }
}
