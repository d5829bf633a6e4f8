//! What is held out of logs, written down before anything is fitted.
//!
//! | split | fitted on | evaluated on |
//! |---|---|---|
//! | up to down | plateaus after steps up | plateaus after steps down |
//! | down to up | the other way round | |
//! | even to odd | every other level, from the lowest on | the other levels |
//! | odd to even | the other way round | |
//!
//! A record with too few plateaus to be cut goes by its first step and by its place in the
//! experiment; one without plateaus by every other tenth of it, in the last two splits only. Where the experiment itself keeps
//! records back, it is these, and nothing else is split.
//!
//! A kind's gain is the mean over the splits, each with its own fit. What a split does not determine (unequal lags, on
//! steps up alone) stays near the value at which the effect is not there, by a weak tie: twice the plausible range.

use rotorlead_identify::lag::steps::{Direction, Plateau};

use super::groups::{Group, LogGroups};

/// A way of cutting the steps of a log in two.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum StepSplit {
    /// Fitted on steps up, judged on steps down.
    UpToDown,
    /// Fitted on steps down, judged on steps up.
    DownToUp,
    /// Fitted on every other level from the lowest on, judged on the others.
    EvenToOdd,
    /// The other way round.
    OddToEven,
}

impl StepSplit {
    pub(crate) const ALL: [Self; 4] = [Self::UpToDown, Self::DownToUp, Self::EvenToOdd, Self::OddToEven];

    /// What it is fitted on and judged on, in words.
    pub(crate) fn words(self) -> &'static str {
        match self {
            Self::UpToDown => "steps up -> steps down",
            Self::DownToUp => "steps down -> steps up",
            Self::EvenToOdd => "even -> odd levels",
            Self::OddToEven => "odd -> even levels",
        }
    }

    /// Whether the rows of a plateau, whose level has this rank, are fitted.
    fn fits(self, plateau: &Plateau, rank: usize) -> bool {
        let up = plateau.direction != Some(Direction::Down);
        match self {
            Self::UpToDown => up,
            Self::DownToUp => !up,
            Self::EvenToOdd => rank.is_multiple_of(2),
            Self::OddToEven => !rank.is_multiple_of(2),
        }
    }
}

/// Groups that a record has to have to be cut. Derived: two for either side of a split, as a split needs at least.
const CUT_FROM: usize = 4;

/// Whether a split fits a group of a log, which has this place among the records.
pub(crate) fn is_fitted(split: StepSplit, log: &LogGroups, place: usize, group: &Group) -> bool {
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
