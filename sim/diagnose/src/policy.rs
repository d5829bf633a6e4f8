//! What is named, for how much, and what is said of it. Tuned on the tuning set of the blind cases, and judged on the report set
//! (`docs/confusion.md`).

use serde::Serialize;

/// Most effects that are named.
pub(crate) const MOST_EFFECTS: usize = 3;

/// The criteria by which effects are named and a verdict is given, as they go into the answer. How far the search goes is said where it
/// goes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Policy {
    /// Log evidence that each name has to bring. Noise alone gives a kind of one value as much once in 16 000 experiments (half of a
    /// chi-square of one degree of freedom beyond 8), and one of 17 kinds of one or two values once in some hundreds. How often
    /// that is, `cargo xtask blind` counts.
    pub least_score: f64,
    /// Sets of kinds within this of the best, in log evidence, are distinguished by chance only.
    pub alike: f64,
    /// What a name brings less than this part of what all explain is what the law of a larger one is off by, where more than noise is left.
    pub of_law: f64,
    /// The same where no more is left.
    pub of_noise: f64,
    /// Log likelihood beyond the complexity penalty from which on a kind has weak evidence. For a kind of one value noise alone does
    /// so in one of 600 experiments: half of a chi-square of one degree of freedom is beyond 5 that often.
    pub least_weak_evidence: f64,
    /// Wrong numbers of a given model count as an effect from this gain of log likelihood on, over one per number.
    pub least_score_of_numbers: f64,
    /// Beside another effect they have to be this wrong, too: what exactly the lag is in its presence is a matter of definition.
    pub least_error_beside: f64,
    /// RMS over that of the noise below which a change of the prediction does not matter.
    pub minor: f64,
    /// Where more than noise is left, effects that leave more than this share of the power of the gap are no story at all, be it on what
    /// was fitted or on what was held out.
    pub most_left: f64,
    /// The same where nothing but noise is left of what was fitted: what was held out may be known worse.
    pub most_left_of_held_out: f64,
    /// The same for records that do not repeat: levels of the whole range, over minutes, are off for more reasons than have a name, and
    /// effects explain them from where they explain more of the power of the gap than they leave; or more of the power of what is left of
    /// the motion, or of the levels, on which an effect acts. What keeps wrong names out is
    /// their worth; `how_often_something_is_named_where_levels_are_off` counts them.
    pub most_left_of_logs: f64,
}

/// The criteria of now.
pub(crate) const POLICY: Policy = Policy {
    least_score: 7.0,
    alike: 5.0,
    of_law: 0.1,
    of_noise: 2e-4,
    least_weak_evidence: 4.0,
    least_score_of_numbers: 10.0,
    least_error_beside: 0.08,
    minor: 0.1,
    most_left: 0.1,
    most_left_of_held_out: 0.5,
    most_left_of_logs: 0.5,
};
