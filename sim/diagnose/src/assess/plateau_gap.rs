//! How far model and log are apart on steps that were held out.

use rayon::prelude::*;
use rotorlead_numerics::sample::mean;
use serde::Serialize;

use crate::assess::gap::{Gap, RecordGap, SquaredResiduals, squares};
use crate::data::split::Split;
use crate::estimate::fit::fit_in;
use crate::likelihood::Likelihood;
use crate::model::hypothesis::Hypothesis;

/// Steps of a search on a part of the steps. Chosen: it starts at the fit to all of them, and ends sooner where a step gains no more than
/// chance. More cost only time.
const STEPS: usize = 4;

/// The gap on what a split holds out.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SplitGap {
    /// What was fitted and what is evaluated, in words.
    pub split: &'static str,
    /// The gap.
    #[serde(flatten)]
    pub gap: Gap,
}

/// How far levels and motion are off, before and after: they are compared separately, and an effect acts on either.
#[derive(Clone, Debug, Default)]
pub(crate) struct PlateauResidual {
    before: GroupResiduals,
    after: GroupResiduals,
}

/// Squared residuals of a hypothesis.
#[derive(Clone, Debug, Default)]
struct GroupResiduals {
    /// Number of independent levels, and their sum of squares.
    levels: (f64, f64),
    /// The mean square of the motion of each step.
    steps: Vec<f64>,
}

impl GroupResiduals {
    fn compute(likelihood: &Likelihood, hypothesis: &Hypothesis, split: Split) -> Option<Self> {
        let mut all = Self::default();
        for record in &likelihood.data.records {
            let Some(plateaus) = likelihood.plateaus(record) else { continue };
            let (levels, steps) = plateaus.levels_and_motion(hypothesis, split)?;
            all.add(Self { levels, steps });
        }
        Some(all)
    }

    fn add(&mut self, other: Self) {
        self.levels = (self.levels.0 + other.levels.0, self.levels.1 + other.levels.1);
        self.steps.extend(other.steps);
    }
}

impl PlateauResidual {
    /// That of the records over a split, each hypothesis by the errors that it leaves itself.
    pub fn compute(
        (own, before): (&Likelihood, &Hypothesis),
        (likelihood, after): (&Likelihood, &Hypothesis),
        split: Split,
    ) -> Option<Self> {
        Some(Self {
            before: GroupResiduals::compute(own, before, split)?,
            after: GroupResiduals::compute(likelihood, after, split)?,
        })
    }

    fn add(&mut self, other: Self) {
        self.before.add(other.before);
        self.after.add(other.after);
    }

    /// The share of the power that is left of levels, and of the motion of a typical step: the geometric mean over all steps, since
    /// a motor that loses step once leaves more than all the others. `None` of what is not compared.
    pub fn shares(&self) -> [Option<f64>; 2] {
        let ((count, before), (_, after)) = (self.before.levels, self.after.levels);
        let of_levels = (count > 0.0 && before > 0.0).then(|| after / before);
        let pairs = self.before.steps.iter().zip(&self.after.steps);
        let logs: Vec<f64> = pairs.map(|(before, after)| (after / before).ln()).filter(|log| log.is_finite()).collect();
        [of_levels, (!logs.is_empty()).then(|| mean(&logs).exp())]
    }
}

/// What a split holds out, in words: squares by the place of the record, and what is left of levels and motion.
type OfSplit = (&'static str, Vec<(usize, SquaredResiduals)>, PlateauResidual);

/// Gap in total, record by record and split by split, each model fitted anew to the fitted part of each split; the first one
/// only where `refitted` says so.
pub(crate) fn gaps_of_splits(
    likelihood: &Likelihood,
    before: &Hypothesis,
    after: &Hypothesis,
    refitted: bool,
) -> (Gap, Vec<RecordGap>, Vec<SplitGap>, PlateauResidual) {
    let folds = likelihood.folds();
    // Each with the errors that it leaves itself.
    let own = if folds.is_empty() { None } else { likelihood.with_errors_from(before) };
    let own = own.map_or_else(|| folds.clone(), |own| own.folds());
    let evaluated: Vec<OfSplit> = folds
        .par_iter()
        .zip(&own)
        .map(|((words, fold), (_, own))| {
            let fitted = |fold: &Likelihood, hypothesis: &Hypothesis| {
                fit_in(fold, hypothesis, true, STEPS).map_or_else(|| hypothesis.clone(), |fit| fit.hypothesis)
            };
            let before = if refitted { fitted(own, before) } else { before.clone() };
            let after = fitted(fold, after);
            let held_out = fold.data.records.iter().enumerate().filter(|(_, record)| fold.has(record, Split::Holdout));
            let evaluated = held_out
                .filter_map(|(place, record)| Some((place, squares(fold, record, &before, &after, Split::Holdout)?)));
            let residual = PlateauResidual::compute((own, &before), (fold, &after), Split::Holdout).unwrap_or_default();
            (*words, evaluated.collect(), residual)
        })
        .collect();
    let mut total = SquaredResiduals::default();
    let mut records = vec![SquaredResiduals::default(); likelihood.data.records.len()];
    let mut splits = Vec::new();
    let mut residual = PlateauResidual::default();
    for (split, parts, of_split) in evaluated {
        residual.add(of_split);
        let mut sum = SquaredResiduals::default();
        for (place, part) in parts {
            records[place].add(part);
            sum.add(part);
        }
        total.add(sum);
        splits.push(SplitGap { split, gap: sum.gap() });
    }
    let evaluated = likelihood.data.records.iter().zip(&records).filter(|(_, squares)| squares.is_any());
    let records = evaluated.map(|(record, squares)| RecordGap {
        file: record.file.clone(),
        nominal: record.nominal,
        gap: squares.gap(),
    });
    (total.gap(), records.collect(), splits, residual)
}
