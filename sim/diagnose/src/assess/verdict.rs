//! What is to be said of it all, in a word.

use crate::assess::gap::Gap;
use crate::assess::steadiness::Steadiness;
use crate::likelihood::excess::Excess;
use crate::policy::POLICY;
use serde::Serialize;

/// A gap that is no wider than this times the noise floor is noise, whose estimate is off. Chosen: 21 % in power, and the limit that
/// `cargo xtask blind` counts by. Lower, the floor's own error takes names away.
const WIDE: f64 = 1.1;
/// Standard errors by which the lags may be off. Standard: 95.4 % of a normal distribution.
const ERRORS: f64 = 2.0;

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

/// What a diagnosis found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Finding {
    Nothing,
    /// Wrong numbers of the lags alone.
    Numbers,
    Effects,
}

/// What the verdict rests on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Evidence {
    pub finding: Finding,
    /// What is left over noise of what was fitted, before and after.
    pub excess: (Excess, Excess),
    /// Whether what is left after does not matter, significant as it may be.
    pub is_minor: bool,
    /// The gap on what was held out.
    pub gap: Gap,
    /// Square of the part of that gap which the standard errors of the lags account for.
    pub unsure: f64,
    /// Whether a kind that matters is worth a name beside the lags alone.
    pub is_rejected: bool,
    /// Whether what does not repeat can be noise.
    pub steadiness: Steadiness,
    /// Whether the delay is the same at every step.
    pub is_timely: bool,
    /// Where there are records that do not repeat: the shares of the power that is left of levels and of the motion, on what was
    /// fitted and on what was held out.
    pub residual_of_logs: Option<[[Option<f64>; 2]; 2]>,
}

impl Evidence {
    /// The verdict. A wrong name is worse than none: on average a delay that wanders looks like many kinds, what nothing explains moves
    /// gain and lag too, and effects that the held-out gap does not confirm are not named.
    pub fn verdict(&self) -> Verdict {
        let is_steady = self.steadiness.is_noise();
        let is_surely_noise = self.excess.1.is_surely_noise() && is_steady;
        match self.finding {
            _ if !self.is_timely => Verdict::Unknown,
            Finding::Nothing if is_surely_noise && !self.is_rejected => Verdict::Agrees,
            Finding::Nothing => Verdict::Unknown,
            Finding::Numbers if !is_surely_noise => Verdict::Unknown,
            _ if !self.explains() => Verdict::Unknown,
            _ if self.is_all() && is_steady => Verdict::Named,
            _ => Verdict::PartlyNamed,
        }
    }

    /// Whether all but noise is explained of what was fitted.
    fn is_all(&self) -> bool {
        self.excess.1.is_noise() || self.is_minor
    }

    /// Whether what was found leaves no more of the gap than its share, and takes away more than what bursts of noise may be off by.
    fn explains(&self) -> bool {
        let Gap { before, after, noise_floor } = self.gap.squared();
        let outweighs_bursts = || before - after > self.steadiness.spread.min(1.0) * noise_floor;
        !self.gap.is_wider()
            && self.residual_share() < self.most_left()
            && (self.steadiness.is_noise() || outweighs_bursts())
    }

    /// The share of the gap that an explanation may leave.
    fn most_left(&self) -> f64 {
        match self.residual_of_logs {
            _ if self.is_all() => POLICY.most_left_of_held_out,
            Some(_) => POLICY.most_left_of_logs,
            None => POLICY.most_left,
        }
    }

    /// Why effects that were found are not named.
    pub fn why_unknown(&self) -> String {
        let (residual_share, most) = (self.residual_share(), self.most_left());
        if !self.is_timely {
            "explanation: the delay is not the same at every step".to_owned()
        } else if self.gap.is_wider() || residual_share >= 1.0 {
            "explanation: leaves no less of the gap than there was".to_owned()
        } else if residual_share < most {
            "explanation: takes away no more than bursts of noise may be off by".to_owned()
        } else {
            let parts =
                if self.residual_of_logs.is_some() { ", of its levels or its motion where that is less" } else { "" };
            format!(
                "explanation: leaves {:.0} % of the power of the gap{parts}, at most {:.0} % accepted",
                100.0 * residual_share,
                100.0 * most
            )
        }
    }

    /// The share of the power of the gap that is left, of what was fitted or of what was held out, the larger; of logs that of their
    /// levels, or of their motion, where it is less and the gap is no wider.
    fn residual_share(&self) -> f64 {
        let Gap { before, after, noise_floor } = self.gap.squared();
        let over = after - WIDE * WIDE * noise_floor - ERRORS * ERRORS * self.unsure;
        let held_out = over.max(0.0) / (before - noise_floor).max(f64::MIN_POSITIVE);
        let fitted = if self.is_all() { 0.0 } else { self.excess.1.over() / self.excess.0.over() };
        let parts = self.residual_of_logs.filter(|_| after <= before).into_iter();
        let larger = |(fitted, held_out): (Option<f64>, Option<f64>)| Some(fitted?.max(held_out?));
        let parts = parts.flat_map(|[fitted, held_out]| fitted.into_iter().zip(held_out).filter_map(larger));
        parts.fold(fitted.max(held_out), f64::min)
    }
}

impl Gap {
    /// Whether what came after is further off than what was before, by more than the noise may be.
    pub(crate) fn is_wider(self) -> bool {
        let Self { before, after, noise_floor } = self.squared();
        after > before + (WIDE * WIDE - 1.0) * noise_floor
    }

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
            finding: Finding::Effects,
            excess: (Excess { sum: 90_000.0, expected: 7000.0 }, Excess { sum: 7100.0, expected: 7000.0 }),
            gap: Gap { before: 0.3, after: 0.1, noise_floor: 0.1 },
            unsure: 0.0,
            is_minor: false,
            is_rejected: false,
            steadiness: Steadiness::default(),
            is_timely: true,
            residual_of_logs: None,
        }
    }

    #[test]
    fn what_leaves_noise_is_the_whole_story() {
        assert_eq!(evidence().verdict(), Verdict::Named);
        assert_eq!(Evidence { finding: Finding::Nothing, ..evidence() }.verdict(), Verdict::Agrees);
    }

    #[test]
    fn what_leaves_more_is_a_part_of_it_or_none() {
        let residual_share =
            |sum: f64| Evidence { excess: (evidence().excess.0, Excess { sum, expected: 7000.0 }), ..evidence() };
        assert_eq!(residual_share(9000.0).verdict(), Verdict::PartlyNamed);
        assert_eq!(residual_share(40_000.0).verdict(), Verdict::Unknown);
        assert_eq!(Evidence { finding: Finding::Nothing, ..residual_share(9000.0) }.verdict(), Verdict::Unknown);
    }

    #[test]
    fn names_that_what_was_held_out_does_not_bear_out_are_not_given() {
        let gap = |after: f64| Evidence { gap: Gap { after, ..evidence().gap }, ..evidence() };
        assert_eq!(gap(0.15).verdict(), Verdict::Named);
        assert_eq!(gap(0.28).verdict(), Verdict::Unknown);
        assert_eq!(gap(0.4).verdict(), Verdict::Unknown);
        // Nor where the lags are so uncertain that they alone might account for it.
        let wider = Evidence { unsure: 1.0, ..gap(0.32) };
        assert_eq!(wider.verdict(), Verdict::Unknown);
        assert!(wider.why_unknown().contains("no less of the gap"), "{}", wider.why_unknown());
        assert_eq!(Evidence { unsure: 1.0, ..gap(0.28) }.verdict(), Verdict::Named);
    }

    #[test]
    fn other_numbers_that_leave_more_than_noise_are_no_story() {
        let alone = Evidence { finding: Finding::Numbers, ..evidence() };
        assert_eq!(alone.verdict(), Verdict::Named);
        let residual_share = (evidence().excess.0, Excess { sum: 9000.0, expected: 7000.0 });
        assert_eq!(Evidence { excess: residual_share, ..alone }.verdict(), Verdict::Unknown);
        let little = (evidence().excess.0, Excess { sum: 7700.0, expected: 7000.0 });
        assert_eq!(Evidence { excess: little, ..evidence() }.verdict(), Verdict::Named);
        assert_eq!(Evidence { excess: little, ..alone }.verdict(), Verdict::Unknown);
        let steadiness = Steadiness { spread: 0.5, significance: 40.0 };
        assert_eq!(Evidence { steadiness, ..alone }.verdict(), Verdict::Unknown);
    }

    #[test]
    fn a_delay_that_wanders_has_no_name() {
        for finding in [Finding::Nothing, Finding::Numbers, Finding::Effects] {
            assert_eq!(Evidence { is_timely: false, finding, ..evidence() }.verdict(), Verdict::Unknown);
        }
    }

    #[test]
    fn bursts_are_no_noise() {
        let steadiness = Steadiness { spread: 1.5, significance: 40.0 };
        assert_eq!(Evidence { steadiness, ..evidence() }.verdict(), Verdict::PartlyNamed);
        assert_eq!(Evidence { steadiness, finding: Finding::Nothing, ..evidence() }.verdict(), Verdict::Unknown);
        let gap = Gap { before: 0.11, ..evidence().gap };
        assert_eq!(Evidence { steadiness, gap, ..evidence() }.verdict(), Verdict::Unknown);
        let small = Steadiness { spread: 0.05, significance: 40.0 };
        assert_eq!(Evidence { steadiness: small, ..evidence() }.verdict(), Verdict::Named);
    }
}
