//! What is to be said of it all, in a word.

use crate::assess::gap::Gap;
use crate::assess::minor::MINOR;
use crate::assess::steadiness::Steadiness;
use crate::likelihood::excess::Excess;
use serde::Serialize;

/// Where more than noise is left, effects that leave more than this share of the chi-square are no story at all, be it on what
/// was fitted or on what was held out.
const NONE: f64 = 0.1;
/// Where it is noise, a gap wider than this times the noise floor must not be more than this share of what it was.
const WIDE: f64 = 1.1;
const HALF: f64 = 0.5;
/// Standard errors by which the lags may be off.
const ERRORS: f64 = 2.0;
/// [`NONE`] for records that do not repeat: levels of the whole range, over minutes, are off for more reasons than have a name, and
/// effects explain them from where they explain more of the power of the gap than they leave; or more of the power of what is left of
/// the motion, or of the levels, on which an effect acts. What keeps wrong names out is
/// their worth; `how_often_something_is_named_where_levels_are_off` counts them.
pub(crate) const NONE_OF_LOGS: f64 = 0.5;

/// What is to be said.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// There is no gap beyond noise.
    Agrees,
    /// The effects explain the gap.
    Named,
    /// The effects explain much of it, and something is left that nothing explains.
    PartlyNamed,
    /// There is a gap, and nothing in the catalog explains it.
    Unknown,
}

impl Verdict {
    /// Its name in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Agrees => "agrees",
            Self::Named => "named",
            Self::PartlyNamed => "partly_named",
            Self::Unknown => "unknown",
        }
    }
}

/// What the verdict rests on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Evidence {
    /// Whether any effect was found, or wrong numbers.
    pub found: bool,
    /// Whether wrong numbers are all that was found.
    pub numbers_alone: bool,
    /// What is left over noise on the lines of what was fitted, before and after.
    pub excess: (Excess, Excess),
    /// The gap on what was held out.
    pub gap: Gap,
    /// Square of the part of that gap which the standard errors of the lags account for.
    pub unsure: f64,
    /// RMS of what is left of what was fitted beside noise, over that of the noise.
    pub left_share: f64,
    /// Whether a kind that matters is worth a name beside the lags alone.
    pub is_rejected: bool,
    /// Whether what does not repeat can be noise.
    pub steadiness: Steadiness,
    /// Whether the delay is the same at every step.
    pub is_timely: bool,
    /// Where there are records that do not repeat: the shares of the power that is left of levels and of the motion, on what was
    /// fitted and on what was held out.
    pub left_of_logs: Option<[[f64; 2]; 2]>,
}

impl Evidence {
    /// The verdict. A wrong name is worse than none: effects that the held-out gap does not confirm are not named.
    pub fn verdict(&self) -> Verdict {
        let (before, after) = self.excess;
        let is_noise = after.is_noise();
        let is_steady = self.steadiness.is_noise();
        // On average a delay that wanders looks like many kinds.
        if !self.is_timely {
            return Verdict::Unknown;
        }
        if !self.found {
            // No test rejects: neither that of the residual nor that of any kind.
            let agrees = after.is_surely_noise() && is_steady && !self.is_rejected;
            return if agrees { Verdict::Agrees } else { Verdict::Unknown };
        }
        let part = after.over() / before.over();
        // What is left may be significant, and not matter.
        let is_all = is_noise || self.left_of_logs.is_none() && self.left_share < MINOR;
        let explains = if is_all {
            let Gap { after, noise_floor, .. } = self.gap.squared();
            after < WIDE * WIDE * noise_floor + self.allowed() || self.left() < HALF
        } else {
            let none = if self.left_of_logs.is_some() { NONE_OF_LOGS } else { NONE };
            part < none && self.left() < none || self.explains_levels_or_motion()
        };
        let explains = explains && (is_steady || self.outweighs_bursts());
        // An effect that nothing explains moves gain and lag too: other numbers that leave more than noise are its shadow.
        let explains = explains && (!self.numbers_alone || is_steady && after.is_surely_noise());
        match (explains, is_all && is_steady) {
            (true, true) => Verdict::Named,
            (true, false) => Verdict::PartlyNamed,
            (false, _) => Verdict::Unknown,
        }
    }

    /// Whether most of the power of levels, or of the motion, is explained, and none is added to the held-out gap.
    fn explains_levels_or_motion(&self) -> bool {
        let Gap { before, after, .. } = self.gap;
        let most = |[fitted, held_out]: [[f64; 2]; 2]| {
            (0..2).any(|part| fitted[part] < NONE_OF_LOGS && held_out[part] < NONE_OF_LOGS)
        };
        after <= before && self.left_of_logs.is_some_and(most)
    }

    /// Square of the gap that lags may leave that were fitted to little, with nothing else wrong.
    fn allowed(&self) -> f64 {
        ERRORS * ERRORS * self.unsure
    }

    /// Share of the power of the held-out gap over the noise that is left.
    fn left(&self) -> f64 {
        let Gap { before, after, noise_floor } = self.gap.squared();
        (after - noise_floor - self.allowed()).max(0.0) / (before - noise_floor).max(f64::MIN_POSITIVE)
    }

    fn outweighs_bursts(&self) -> bool {
        let Gap { before, after, noise_floor } = self.gap.squared();
        before - after > self.steadiness.spread.min(1.0) * noise_floor
    }
}

impl Gap {
    fn squared(self) -> Self {
        let Self { before, after, noise_floor } = self;
        Self { before: before * before, after: after * after, noise_floor: noise_floor * noise_floor }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn evidence() -> Evidence {
        Evidence {
            found: true,
            numbers_alone: false,
            excess: (Excess { sum: 90_000.0, expected: 7000.0 }, Excess { sum: 7100.0, expected: 7000.0 }),
            gap: Gap { before: 0.3, after: 0.1, noise_floor: 0.1 },
            unsure: 0.0,
            left_share: 1.0,
            is_rejected: false,
            steadiness: Steadiness::default(),
            is_timely: true,
            left_of_logs: None,
        }
    }

    #[test]
    fn what_leaves_noise_is_the_whole_story() {
        assert_eq!(evidence().verdict(), Verdict::Named);
        assert_eq!(Evidence { found: false, ..evidence() }.verdict(), Verdict::Agrees);
    }

    #[test]
    fn what_leaves_more_is_a_part_of_it_or_none() {
        let left =
            |sum: f64| Evidence { excess: (evidence().excess.0, Excess { sum, expected: 7000.0 }), ..evidence() };
        assert_eq!(left(9000.0).verdict(), Verdict::PartlyNamed);
        assert_eq!(left(40_000.0).verdict(), Verdict::Unknown);
        assert_eq!(Evidence { found: false, ..left(9000.0) }.verdict(), Verdict::Unknown);
    }

    #[test]
    fn names_that_what_was_held_out_does_not_bear_out_are_not_given() {
        let gap = |after: f64| Evidence { gap: Gap { after, ..evidence().gap }, ..evidence() };
        assert_eq!(gap(0.15).verdict(), Verdict::Named);
        assert_eq!(gap(0.28).verdict(), Verdict::Unknown);
        assert_eq!(gap(0.4).verdict(), Verdict::Unknown);
    }

    #[test]
    fn other_numbers_that_leave_more_than_noise_are_no_story() {
        let alone = Evidence { numbers_alone: true, ..evidence() };
        assert_eq!(alone.verdict(), Verdict::Named);
        let left = (evidence().excess.0, Excess { sum: 9000.0, expected: 7000.0 });
        assert_eq!(Evidence { excess: left, ..alone }.verdict(), Verdict::Unknown);
        let little = (evidence().excess.0, Excess { sum: 7700.0, expected: 7000.0 });
        assert_eq!(Evidence { excess: little, ..evidence() }.verdict(), Verdict::Named);
        assert_eq!(Evidence { excess: little, ..alone }.verdict(), Verdict::Unknown);
        let steadiness = Steadiness { spread: 0.5, significance: 40.0 };
        assert_eq!(Evidence { steadiness, ..alone }.verdict(), Verdict::Unknown);
    }

    #[test]
    fn a_delay_that_wanders_has_no_name() {
        for found in [false, true] {
            assert_eq!(Evidence { is_timely: false, found, ..evidence() }.verdict(), Verdict::Unknown);
        }
    }

    #[test]
    fn bursts_are_no_noise() {
        let steadiness = Steadiness { spread: 1.5, significance: 40.0 };
        assert_eq!(Evidence { steadiness, ..evidence() }.verdict(), Verdict::PartlyNamed);
        assert_eq!(Evidence { steadiness, found: false, ..evidence() }.verdict(), Verdict::Unknown);
        let gap = Gap { before: 0.11, ..evidence().gap };
        assert_eq!(Evidence { steadiness, gap, ..evidence() }.verdict(), Verdict::Unknown);
        let small = Steadiness { spread: 0.05, significance: 40.0 };
        assert_eq!(Evidence { steadiness: small, ..evidence() }.verdict(), Verdict::Named);
    }
}
