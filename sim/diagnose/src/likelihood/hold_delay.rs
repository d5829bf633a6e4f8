//! Frames whose rate the records do not tell: what single changes of the command say of them all the same.
//!
//! A delay holds back every change of the command for as long, frames hold back each for another while: `w` beyond half a frame, as
//! likely to be any `w` from `-T/2` to `T/2`. To first order in `w` the log likelihood of what follows a change grows by
//! `-p w - P w^2 / 2`, with `p` the inner product of the residual with the response to a unit of wait less and `P` that response's
//! sum of squares. What the change says for frames over a delay of half a frame is the mean over all waits,
//!
//! ```text
//! ln (1/T) integral from -T/2 to T/2 of exp(-p w - P w^2 / 2) dw
//! ```
//!
//! It falls where the waits are all alike, and rises where they are not. Nothing is fitted for it. Where the frames of the records are
//! found (`estimate::frame_rate`) the waits are not free any more, and that says more.

use rayon::prelude::*;

use crate::data::dataset::PreparedRecord;
use crate::data::split::Split;
use crate::likelihood::Likelihood;
use crate::likelihood::adjoint::Adjoint;
use crate::likelihood::isolated_steps::{IsolatedStep, changes, isolated_steps};
use crate::model::candidate::Candidate;
use crate::model::hypothesis::Hypothesis;

/// Waits of which the mean is taken. Derived: they are 0.04 of a standard error apart at most, and the midpoint rule is off by `0.04^2 /
/// 24`, 7e-5, where the end of a frame cuts the density.
const WAITS: usize = 400;
/// Over so many standard errors to either side of the likeliest. Derived: beyond, the likelihood is below `e^-32`, 1e-14.
const ERRORS: f64 = 8.0;

/// By how much the log likelihood of what is in `split` grows where each change waits for a frame of its own. 0 without frames,
/// and where it is known where they lie.
pub(crate) fn evidence(likelihood: &Likelihood, hypothesis: &Hypothesis, split: Split) -> f64 {
    let frames = hypothesis.effects.iter().find(|effect| effect.is_hidden_hold());
    let Some(frame_s) = frames.and_then(frame_s) else { return 0.0 };
    sum_over_isolated_steps(likelihood, hypothesis, split, |edge| mean_over_waits(edge.product, edge.power, frame_s))
}

/// Standard error of the logarithm of the rate of frames that do not show, where `std` is that of the curvature: what few changes say
/// of the mean wait scatters by their own waits, of the variance `T^2 / 12`, beside the noise.
pub(crate) fn with_scatter(likelihood: &Likelihood, hypothesis: &Hypothesis, frames: &Candidate, std: f64) -> f64 {
    let Some(frame_s) = frame_s(frames).filter(|_| frames.is_hidden_hold()) else { return std };
    // The mean wait, half a frame, is the mean of all waits, each weighted by what is known of it.
    let variance = (0.5 * frame_s * std).powi(2);
    let squares = sum_over_isolated_steps(likelihood, hypothesis, Split::Train, |edge| edge.power * edge.power);
    let scatter = variance * variance * squares * frame_s * frame_s / 12.0;
    (variance + scatter).sqrt() / (0.5 * frame_s)
}

/// Seconds from frame to frame; `None` without frames.
pub(crate) fn frame_s(frames: &Candidate) -> Option<f64> {
    Some(frames.values[0].recip()).filter(|frame_s| *frame_s > 0.0 && frame_s.is_finite())
}

/// A sum over the changes that stand alone.
fn sum_over_isolated_steps(
    likelihood: &Likelihood,
    hypothesis: &Hypothesis,
    split: Split,
    of: impl Fn(&IsolatedStep) -> f64 + Sync,
) -> f64 {
    let of_record = |record: &PreparedRecord| {
        let adjoint = Adjoint::for_split(likelihood, record, hypothesis, split)?;
        Some(
            isolated_steps(record, &adjoint, &changes(record, adjoint.segment, hypothesis))
                .iter()
                .map(&of)
                .sum::<f64>(),
        )
    };
    likelihood.data.records.par_iter().filter_map(of_record).sum()
}

/// `ln (1/T) integral exp(-p w - P w^2 / 2) dw` from `-T/2` to `T/2`, over what of it counts.
fn mean_over_waits(product: f64, power: f64, frame_s: f64) -> f64 {
    let half_s = 0.5 * frame_s;
    let likeliest_s = (-product / power).clamp(-half_s, half_s);
    let (from_s, to_s) = if power > 0.0 {
        let reach_s = ERRORS / power.sqrt();
        ((likeliest_s - reach_s).max(-half_s), (likeliest_s + reach_s).min(half_s))
    } else {
        (-half_s, half_s)
    };
    let step_s = (to_s - from_s) / WAITS as f64;
    let gain = |index: usize| {
        let wait_s = from_s + (index as f64 + 0.5) * step_s;
        -product * wait_s - 0.5 * power * wait_s * wait_s
    };
    let most = (0..WAITS).map(gain).fold(f64::NEG_INFINITY, f64::max);
    most + ((0..WAITS).map(|index| (gain(index) - most).exp()).sum::<f64>() * step_s / frame_s).ln()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_change_that_is_not_seen_says_nothing_and_waits_that_are_alike_speak_for_a_delay() {
        assert!(mean_over_waits(0.0, 0.0, 2e-3).abs() < 1e-12);
        // Known to a tenth of a frame: the integral of a normal density is sqrt(2 pi) of that.
        let (frame_s, std_s) = (2e-3, 2e-4_f64);
        let power = std_s.powi(-2);
        let alike = mean_over_waits(0.0, power, frame_s);
        assert!((alike - (std_s * (2.0 * std::f64::consts::PI).sqrt() / frame_s).ln()).abs() < 1e-4, "{alike}");
        // Known to a thousandth of a frame.
        let sharp_s = 2e-6_f64;
        let sharp = mean_over_waits(0.0, sharp_s.powi(-2), frame_s);
        assert!((sharp - (sharp_s * (2.0 * std::f64::consts::PI).sqrt() / frame_s).ln()).abs() < 1e-3, "{sharp}");
        // A wait of two such errors: e^2 times as likely as none, and the likelihood is as wide.
        let waits = mean_over_waits(-2.0 * std_s * power, power, frame_s);
        assert!((waits - alike - 2.0).abs() < 2e-3, "{waits}");
    }
}
