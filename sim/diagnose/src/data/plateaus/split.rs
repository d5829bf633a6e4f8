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

use rotorlead_identify::lag::steps::Split as StepSplit;

use super::{Group, Log};

/// Groups that a record has to have to be cut.
const CUT_FROM: usize = 4;

/// Whether a split fits a group of a log, which has this place among the records.
pub(crate) fn is_fitted(split: StepSplit, (log, place): (&Log, usize), group: &Group) -> bool {
    if log.groups.len() < CUT_FROM { whole(split, &log.groups, place) } else { part(split, group) }
}

/// Whether a group of a record that is cut is fitted.
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
