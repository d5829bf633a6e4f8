//! What is held out of logs, written down before anything is fitted.
//!
//! | split | fitted on | evaluated on |
//! |---|---|---|
//! | up to down | plateaus after steps up | plateaus after steps down |
//! | down to up | the other way round | |
//! | even to odd | every other level, from the lowest on | the other levels |
//! | odd to even | the other way round | |
//!
//! They are those of [`SPLITS`]. A record with too few plateaus to be cut goes by its first step and by its place in the
//! experiment; one without plateaus by every other tenth of it, in the last two splits only. Where the experiment itself keeps
//! records back, it is these, and nothing else is split.
//!
//! A kind's gain is the mean over the splits, each with its own fit. What a split does not determine (unequal lags, on
//! steps up alone) stays near the value at which the effect is not there, by a weak tie: twice the plausible range.

use rayon::prelude::*;
use rotorlead_identify::steps::{SPLITS, Split as StepSplit};

use super::Group;
use crate::dataset::{Dataset, Split};
use crate::fit::{Fit, fit_in};
use crate::hypothesis::Hypothesis;
use crate::residual::deviance;

/// Steps of a search on a part of the steps, from what was found on all of them.
const STEPS: usize = 3;
/// Groups that a record has to have to be cut, and that each side of a split has to have.
const CUT_FROM: usize = 4;
const LEAST_GROUPS: usize = 2;

/// The splits of an experiment, each with minus twice the log likelihood of what it holds out by what is to be improved on.
pub(crate) struct Folds {
    folds: Vec<(&'static str, f64)>,
}

impl Folds {
    /// Empty where nothing has to be split.
    pub fn of(data: &Dataset, from: &Fit) -> Self {
        let folds = data.folds().into_par_iter();
        let fitted = folds.filter_map(|(split, fold)| {
            let fit = fit_in(&fold, &from.hypothesis, true, STEPS)?;
            Some((split, deviance(&fold, &fit.hypothesis, Split::Holdout)?))
        });
        Self { folds: fitted.collect() }
    }

    /// Mean gain of log likelihood over what is held out by `hypothesis`, with the errors that `trials` has; `None` where nothing
    /// is split.
    pub fn gain(&self, data: &Dataset, hypothesis: &Hypothesis) -> Option<f64> {
        let folds = data.folds();
        let gains: Vec<f64> = self
            .folds
            .par_iter()
            .map(|(split, before)| {
                let (_, fold) = folds.iter().find(|(other, _)| other == split)?;
                let fitted = fit_in(fold, hypothesis, true, STEPS)?;
                Some(0.5 * (before - deviance(fold, &fitted.hypothesis, Split::Holdout)?))
            })
            .map(|gain| gain.unwrap_or(f64::NEG_INFINITY))
            .collect();
        (!gains.is_empty()).then(|| gains.iter().sum::<f64>() / gains.len() as f64)
    }
}

impl Dataset {
    /// The splits that the records are long enough for, in words and as records with other purposes. Empty where there are no
    /// logs, or the experiment says itself what is held out.
    pub fn folds(&self) -> Vec<(&'static str, Self)> {
        let split_up = self.records.iter().any(|record| record.log.as_ref().is_some_and(|log| !log.has_role));
        if !split_up {
            return Vec::new();
        }
        SPLITS.into_iter().filter_map(|split| self.fold(split).map(|fold| (split.words(), fold))).collect()
    }

    fn fold(&self, split: StepSplit) -> Option<Self> {
        let mut fold = Self { is_part: true, ..self.clone() };
        let (mut fitted, mut held_out) = (0, 0);
        for (place, record) in fold.records.iter_mut().enumerate() {
            let Some(log) = record.log.as_mut().filter(|log| !log.has_role) else { continue };
            if log.groups.len() < CUT_FROM {
                let is_fitted = whole(split, &log.groups, place);
                log.assign(|_| train_or_holdout(is_fitted));
            } else {
                log.assign(|group| train_or_holdout(part(split, group)));
            }
            let log = &*log;
            fitted += log.groups.iter().filter(|group| group.split == Split::Train).count();
            held_out += log.groups.iter().filter(|group| group.split == Split::Holdout).count();
            record.assign_channels();
        }
        (fitted >= LEAST_GROUPS && held_out >= LEAST_GROUPS).then_some(fold)
    }
}

fn train_or_holdout(is_fitted: bool) -> Split {
    if is_fitted { Split::Train } else { Split::Holdout }
}

/// Whether a group is fitted.
fn part(split: StepSplit, group: &Group) -> bool {
    match (&group.plateau, split) {
        (Some(plateau), _) => split.fits(plateau, group.rank),
        (None, StepSplit::EvenToOdd) => group.rank.is_multiple_of(2),
        (None, StepSplit::OddToEven) => !group.rank.is_multiple_of(2),
        // A block has no direction: all of it is fitted.
        (None, StepSplit::UpToDown | StepSplit::DownToUp) => true,
    }
}

/// Whether a record that is not cut is fitted.
fn whole(split: StepSplit, groups: &[Group], place: usize) -> bool {
    let up = groups.iter().find(|group| group.step != 0.0).is_none_or(|group| group.step > 0.0);
    match split {
        StepSplit::UpToDown => up,
        StepSplit::DownToUp => !up,
        StepSplit::EvenToOdd => place.is_multiple_of(2),
        StepSplit::OddToEven => !place.is_multiple_of(2),
    }
}
