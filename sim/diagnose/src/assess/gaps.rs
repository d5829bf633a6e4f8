//! All gaps between two models and the records: in total, record by record, split by split.

use super::gap::{Gap, RecordGap, compute_gap};
use super::plateau_gap::{PlateauResidual, SplitGap, gaps_of_splits};
use crate::data::split::Split;
use crate::likelihood::Likelihood;
use crate::model::hypothesis::Hypothesis;

/// All gaps between two models and the records.
pub(crate) struct Gaps {
    /// In total.
    pub total: Gap,
    /// Record by record.
    pub records: Vec<RecordGap>,
    /// Split by split, where records are split more than one way.
    pub splits: Vec<SplitGap>,
    /// Whether anything is held out.
    pub held_out: bool,
    /// Of records that do not repeat: what is left of levels and of the motion that were held out.
    pub residual: PlateauResidual,
}

/// Gaps on what is held out; on what was fitted where nothing is. Where a split is not for good each model is fitted anew to
/// what is left, the first one only where `refitted` says so.
pub(crate) fn compute_gaps(likelihood: &Likelihood, before: &Hypothesis, after: &Hypothesis, refitted: bool) -> Gaps {
    let (total, records, splits, residual) = gaps_of_splits(likelihood, before, after, refitted);
    if !splits.is_empty() {
        return Gaps { total, records, splits, held_out: true, residual };
    }
    let held_out = likelihood.data.records.iter().any(|record| likelihood.has(record, Split::Holdout));
    let split = if held_out { Split::Holdout } else { Split::Train };
    let (total, records) = compute_gap(likelihood, before, after, split);
    let residual = PlateauResidual::compute((likelihood, before), (likelihood, after), split).unwrap_or_default();
    Gaps { total, records, splits, held_out, residual }
}
