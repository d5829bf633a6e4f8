//! What a set of effects is worth: the logarithm of its evidence, in the one place where a score is made.
//!
//! The evidence of a hypothesis is its likelihood averaged over what its numbers might have been. With the chi-square `S` at the best
//! numbers, their information `I` beside the lags (Laplace's approximation; MacKay, Information Theory, Inference and Learning
//! Algorithms, ch. 28), and priors that are flat over the plausible ranges, of the width `w` in the coordinates of a search,
//!
//! ```text
//! ln E = -S / 2 - 1/2 ln det(I + 1) - sum ln w + k/2 ln 2 pi
//! ```
//!
//! Where the response depends in jumps on a number there is no information in derivatives: it could stand at each of so many places.
//! The choice of a kind costs the logarithm of how many there are. A value beyond its plausible range is less likely the farther it
//! lies beyond, by a normal density of a tenth of the range.

use std::f64::consts::{LN_2, TAU};

use nalgebra::DMatrix;

use crate::data::split::Split;
use crate::estimate::fit::Fit;
use crate::likelihood::{Likelihood, hold_delay};
use crate::model::candidate::Candidate;
use crate::model::hypothesis::Coordinate;
use crate::propose;

/// The kinds among which one is chosen, about. Derived: the catalog has 18 that are looked for, less those that the records cannot show;
/// two more or fewer change a score by 0.12.
const KINDS: f64 = 16.0;
/// Added to the diagonal of the information on the lags, in parts of it. Chosen: far above rounding and far below any information that
/// counts; it only lets a matrix be inverted of which a lag is not determined.
const RIDGE: f64 = 1e-9;
/// Rates of frames that can be told apart. Chosen: 2.3 % apart over the plausible 20 to 2000 Hz (`ln 100 / 200`). Twice or half as many
/// change a score by 0.7.
const RATES: f64 = 200.0;

/// The logarithm of the evidence, but for what all hypotheses of the same records have in common.
pub(crate) fn evidence(likelihood: &Likelihood, fit: &Fit) -> f64 {
    let effects = &fit.hypothesis.effects;
    let waits = hold_delay::evidence(likelihood, &fit.hypothesis, Split::Train);
    -0.5 * fit.chi_square + waits
        - occam(fit)
        - effects
            .iter()
            .map(|effect| choice(effect) + jumps(likelihood, effect) + 0.5 * effect.beyond_range_square())
            .sum::<f64>()
}

/// The logarithm of the number of kinds, and of whether its law bends.
fn choice(effect: &Candidate) -> f64 {
    KINDS.ln() + if effect.bends { LN_2 } else { 0.0 }
}

/// Laplace's term of the numbers of effects on which the response depends smoothly.
fn occam(fit: &Fit) -> f64 {
    let is_of_effect = |place: &usize| matches!(fit.coordinates[*place], Coordinate::Effect { .. });
    let (own, others): (Vec<usize>, Vec<usize>) = (0..fit.coordinates.len()).partition(is_of_effect);
    if own.is_empty() {
        return 0.0;
    }
    let part = |rows: &[usize], columns: &[usize]| {
        DMatrix::from_fn(rows.len(), columns.len(), |i, j| fit.information[(rows[i], columns[j])])
    };
    let mut beside = part(&own, &own);
    let mut lags = part(&others, &others);
    // What says nothing at all has no inverse.
    lags.set_diagonal(&lags.diagonal().map(|own| own + RIDGE * (1.0 + own)));
    if let Some(known) = lags.cholesky() {
        beside -= part(&own, &others) * known.solve(&part(&others, &own));
    }
    let information = beside + DMatrix::identity(own.len(), own.len());
    let half_log_det = information.cholesky().map_or(0.0, |root| root.l().diagonal().map(f64::ln).sum());
    let widths: f64 = own.iter().map(|place| fit.hypothesis.width(fit.coordinates[*place]).max(1.0).ln()).sum();
    half_log_det + widths - 0.5 * own.len() as f64 * TAU.ln()
}

/// The logarithm of the number of places at which a value could stand where the response depends in jumps on it. Standard: such a value,
/// or each phase of frames, costs 1 beside, which a number gains by chance (Akaike 1974).
fn jumps(likelihood: &Likelihood, effect: &Candidate) -> f64 {
    if !effect.phases.is_empty() {
        // The rate, and a phase for each record.
        return propose::proposal_for(effect.kind).independent_trials(effect.kind).max(RATES).ln()
            + likelihood.data.records.len() as f64;
    }
    if !effect.is_non_smooth() {
        return 0.0;
    }
    let shapes = effect.kind.shape().filter(|_| effect.bends).map_or(1.0, |(_, shape)| f64::from(shape.pieces));
    (propose::proposal_for(effect.kind).independent_trials(effect.kind) * shapes).ln() + 1.0
}
