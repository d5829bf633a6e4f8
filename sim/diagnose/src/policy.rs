//! What is named, for how much, and what is said of it. Tuned on the tuning set of the blind cases, and judged on the report set
//! (`docs/confusion.md`).

use serde::Serialize;

/// Most effects that are named. Chosen: cases of the blind report have up to three. One more costs another round of joint fits, one less
/// leaves the third unnamed.
pub(crate) const MOST_EFFECTS: usize = 3;

/// The criteria by which effects are named and a verdict is given, as they go into the answer. How far the search goes is said where it
/// goes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Policy {
    /// Log evidence that each name has to bring. Derived: noise alone gives a kind of one value as much less than once in 16 000
    /// experiments (half of a chi-square of one degree of freedom is beyond 8 that often; the evidence charges `ln 16` and more besides),
    /// one of all kinds less than once in some hundreds. `cargo xtask blind` counts how often.
    pub least_score: f64,
    /// Sets of kinds within this of the best, in log evidence, are distinguished by chance only. Standard: beyond odds of 150 to 1 (5.0)
    /// evidence is "very strong" (Kass & Raftery, J. Am. Stat. Assoc. 90, 1995). Lower, a rival is left out; higher, many are listed.
    pub alike: f64,
    /// What a name brings less than this part of what all explain is what the law of a larger one is off by, where more than noise is left.
    /// Chosen: a law is off by a third in amplitude then (`0.1^0.5`). Lower, a law's error gets a name; higher, a second effect gets none.
    pub of_law: f64,
    /// The same where no more is left. Chosen: 1.4 % in amplitude (`0.0002^0.5`), since a law that leaves only noise is off by little.
    /// It counts beside `least_score` from where all explain 35 000. Higher, what is small beside a large effect gets no name.
    pub of_noise: f64,
    /// Log likelihood beyond the complexity penalty from which on a kind has weak evidence. Derived: for a kind of one value noise alone
    /// does so in one of 600 experiments, since half of a chi-square of one degree of freedom is beyond 5 that often.
    pub least_weak_evidence: f64,
    /// Wrong numbers of a given model count as an effect from this gain of log likelihood on, over one per number. Derived: noise alone
    /// gives as much less than once in 50 000 experiments, be it of 2 numbers or of 12 (half of a chi-square of as many degrees of
    /// freedom).
    pub least_score_of_numbers: f64,
    /// Beside another effect they have to be this wrong, too: what exactly the lag is in its presence is a matter of definition. Chosen:
    /// lower, an effect whose law is a little off makes the given numbers wrong; higher, numbers that are wrong by a tenth stay unnamed.
    pub least_error_beside: f64,
    /// RMS over that of the noise below which a change of the prediction does not matter. Derived: it adds half a percent to the RMS of
    /// what is left, `(1 + 0.1^2)^0.5`.
    pub minor: f64,
    /// Where more than noise is left, effects that leave more than this share of the power of the gap explain nothing, be it on what was
    /// fitted or on what was held out. Chosen: a third in amplitude. Higher, what merely resembles the cause is named; lower, bent laws
    /// are not.
    pub most_left: f64,
    /// The same where nothing but noise is left of what was fitted: what was held out may be known worse. Chosen: half of the power has to
    /// go. Lower, noise on what was held out takes names away; higher, a fit that does not carry over keeps them.
    pub most_left_of_held_out: f64,
    /// The same for records that do not repeat, of the gap or of either of its parts, levels and motion: effects have to explain more than
    /// they leave. Tuned on simulated staircases whose levels are off by 1.5 to 4 %: a curved map that is rightly named leaves 10 to 25 %
    /// of the power there (`how_often_something_is_named_where_levels_are_off` counts right and wrong names).
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
