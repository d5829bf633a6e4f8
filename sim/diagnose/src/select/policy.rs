//! The criteria of the selection: what is named, for how much, and how far the search for it goes. Tuned on the tuning set of the blind
//! cases, and judged on the report set (`docs/confusion.md`).

/// Most effects that are named.
pub(crate) const MOST_EFFECTS: usize = 3;
/// Two effects that leave more than this part of the chi-square are no explanation, and no third is looked for.
pub(crate) const HOPELESS: f64 = 0.15;
/// The same where periods do not repeat: levels are off for more reasons than have a name.
pub(crate) const HOPELESS_IN_LOGS: f64 = 0.5;
/// An effect is named for at least this penalized score. Noise alone gives a kind of one value as much once in 16 000 experiments (half of a
/// chi-square of one degree of freedom beyond 8), and one of 17 kinds of one or two values once in some hundreds. How often
/// that is, `cargo xtask blind` counts.
pub(crate) const LEAST_SCORE: f64 = 7.0;
/// Kinds within this of the best are distinguished by chance only.
pub(crate) const ALIKE: f64 = 5.0;
/// Gain of log likelihood beyond the complexity penalty from which on a kind has weak evidence. For a kind of one value noise alone does
/// so in one of 600 experiments: half of a chi-square of one degree of freedom is beyond 5 that often.
pub(crate) const LEAST_WEAK_EVIDENCE: f64 = 4.0;

/// A name that explains less than this part of what all explain is the shape of a larger one: where more than noise is left, and
/// where it is not.
pub(crate) const OF_LAW: f64 = 0.1;
pub(crate) const OF_NOISE: f64 = 2e-4;

/// Wrong numbers of a given model count as an effect from this gain of log likelihood on, over one per number.
pub(crate) const LEAST_SCORE_OF_NUMBERS: f64 = 10.0;
/// A lag is another one than the given where its squared distance in standard errors is more than this: for two numbers noise
/// alone exceeds it once in 100 times.
pub(crate) const IMPROVED: f64 = 9.2;
/// Beside another effect they have to be this wrong, too: what exactly the lag is in its presence is a matter of definition.
pub(crate) const LEAST_ERROR_BESIDE: f64 = 0.08;

/// Share of the least score that the screening has to promise.
pub(crate) const PROMISED: f64 = 0.7;
/// What promises, or scores, less than this part of the best is not followed.
pub(crate) const PART_OF_BEST: f64 = 0.2;
/// Kinds that are fitted after the screening, and starts of each.
pub(crate) const MOST_FITTED: usize = 7;
pub(crate) const MOST_STARTS: usize = 2;
/// Kinds that are followed in any case.
pub(crate) const MOST_FINISHED: usize = 3;
/// Steps of a search that finishes where periods do not repeat: the chi-square is of models and not of noise, so the last digits mean
/// nothing.
pub(crate) const LAST_STEPS: usize = 8;
