//! The criteria of the selection: what is named, for how much, and how far the search for it goes. Tuned on the tuning set of the blind
//! cases, and judged on the report set (`docs/confusion.md`).

use rotorlead_plant::effect::{Kind, Site};

/// Most effects that are named.
pub(crate) const MOST_EFFECTS: usize = 3;
/// Two effects that leave more than this part of the chi-square are no explanation, and no third is looked for.
pub(crate) const HOPELESS: f64 = 0.15;
/// An effect is named for at least this penalized score. Noise alone gives a kind of one value as much once in 16 000 experiments (half of a
/// chi-square of one degree of freedom beyond 8), and one of 17 kinds of one or two values once in some hundreds. How often
/// that is, `cargo xtask blind` counts.
pub(crate) const LEAST_SCORE: f64 = 7.0;
/// Of that, what is fitted has to bring this much by itself. What is held out can gain by accident: where a nominal command was
/// fitted to little, anything that moves its lag may move it nearer.
pub(crate) const LEAST_TRAINING_GAIN: f64 = 0.5 * LEAST_SCORE;
/// [`LEAST_SCORE`] where periods do not repeat: what a log leaves is estimated from the log itself.
pub(crate) const LEAST_SCORE_IN_LOGS: f64 = 10.0;
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
/// Steps after which the kinds are compared; after these so many go on, and all that are close.
pub(crate) const FIRST_STEPS: usize = 3;
pub(crate) const MOST_FINISHED: usize = 3;
/// Steps of a search that finishes where periods do not repeat: the chi-square is of models and not of noise, so the last digits mean
/// nothing.
pub(crate) const LAST_STEPS: usize = 8;
/// Parsimony rank of a kind where periods do not repeat, the simplest first: a map that is not straight, as levels are soon read off, and
/// a response that is late as a whole, as a logger's may well be. Both pass for whatever else moves levels or slows the motor, so they
/// come first where they score enough, and each of the others has to do so beside them. They are dropped where one makes them redundant.
pub(crate) fn parsimony_rank(kind: &Kind) -> usize {
    match kind.site {
        Site::Map => 0,
        Site::Line => 1,
        _ => 2,
    }
}
