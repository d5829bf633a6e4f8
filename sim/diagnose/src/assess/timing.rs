//! Whether the delay varies from step to step (jitter).
//!
//! A delay that wanders is to a multisine a low pass, and to its periods noise: on average it looks like a second pole, a slower lag or
//! frames, and every one of these would be a wrong name. Single changes show it. To first order in the wait `w` of a change, the sum of
//! squares of the residual grows by `P w^2 + 2 p w` (see [`crate::likelihood::hold_delay`]), so it is answered later than by the
//! hypothesis by `-p / P`, give or take `1 / sqrt(P)`. What a hypothesis lacks is the same for all changes of a record that go the same
//! way; of their differences `sum P (w - mean w)^2` is a chi-square where nothing but noise tells them apart.

use serde::Serialize;
use std::fmt;

use crate::data::dataset::PreparedRecord;
use crate::data::split::Split;
use crate::likelihood::Likelihood;
use crate::likelihood::adjoint::Adjoint;
use crate::likelihood::hold_delay::frame_s;
use crate::likelihood::isolated_steps::{IsolatedStep, changes, isolated_steps};
use crate::model::hypothesis::Hypothesis;

/// Waits that differ by more standard deviations than this beyond chance, and by more than [`SCATTERED`], are not those of a delay.
/// Chosen: what a hypothesis lacks adds to the noise of some tens of changes, so that five are not enough. Higher misses jitter.
const SIGNIFICANT: f64 = 8.0;
/// The part of the time constant. Chosen: it turns the phase by 0.02 rad at the pole. Lower, long records find the jitter of any
/// controller; higher, jitter gets the name of a delay.
const SCATTERED: f64 = 0.02;

/// How much the waits of changes that are alike differ, beyond what noise makes of them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Timing {
    /// Their standard deviation, seconds: at least, since the residual grows more slowly than in proportion once a wait is long.
    pub scatter_s: f64,
    /// The same over the time constant, the mean of all nominal commands.
    #[serde(skip)]
    pub part: f64,
    /// By how many standard deviations of noise that is beyond chance.
    pub significance: f64,
}

impl Timing {
    /// Whether they may as well be alike.
    #[must_use]
    pub fn is_steady(&self) -> bool {
        self.significance < SIGNIFICANT || self.part < SCATTERED
    }
}

impl fmt::Display for Timing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let scatter_ms = 1e3 * self.scatter_s;
        write!(f, "The delay varies from step to step (jitter) by at least {scatter_ms:.1} ms RMS.")
    }
}

/// Scatter of the waits of changes in the same direction, as a chi-square.
#[derive(Clone, Copy, Default)]
struct Scatter {
    square: f64,
    /// Its expected value where the waits are alike, and its variance.
    chance: f64,
    variance: f64,
    /// By what it grows with the variance of the waits.
    power: f64,
}

/// Judges what `hypothesis` leaves of the changes that stand alone.
pub(crate) fn timing(likelihood: &Likelihood, hypothesis: &Hypothesis) -> Timing {
    let all = likelihood.data.records.iter();
    let all = all.flat_map(|record| {
        [Split::Train, Split::Holdout].map(|split| record_scatter(likelihood, record, hypothesis, split))
    });
    let sum = all.flatten().fold(Scatter::default(), |sum, one| Scatter {
        square: sum.square + one.square,
        chance: sum.chance + one.chance,
        variance: sum.variance + one.variance,
        power: sum.power + one.power,
    });
    if sum.variance == 0.0 || sum.power == 0.0 {
        return Timing::default();
    }
    let beyond = sum.square - sum.chance;
    let scatter_s = (beyond.max(0.0) / sum.power).sqrt();
    let lags = hypothesis.base.iter().map(|point| point.time_constant_s);
    let lag_s = lags.sum::<f64>() / hypothesis.base.len() as f64;
    Timing { scatter_s, part: scatter_s / lag_s, significance: beyond / sum.variance.sqrt() }
}

/// Of one record, both ways.
fn record_scatter(
    likelihood: &Likelihood,
    record: &PreparedRecord,
    hypothesis: &Hypothesis,
    split: Split,
) -> Option<Scatter> {
    // Frames that do not show make a change wait for anything up to a frame.
    let hidden = hypothesis.effects.iter().filter(|effect| effect.is_hidden_hold()).find_map(frame_s).unwrap_or(0.0);
    let adjoint = Adjoint::for_split(likelihood, record, hypothesis, split)?;
    let changes = changes(record, adjoint.segment, hypothesis);
    let isolated_steps = isolated_steps(record, &adjoint, &changes);
    let ups = changes.iter().filter(|change| **change != 0.0).map(|change| *change > 0.0);
    let isolated_steps: Vec<(&IsolatedStep, bool)> =
        isolated_steps.iter().zip(ups).filter(|(edge, _)| edge.power > 0.0).collect();
    let of_way = |is_up: bool| {
        let alike: Vec<&IsolatedStep> =
            isolated_steps.iter().filter(|(_, up)| *up == is_up).map(|(edge, _)| *edge).collect();
        let power: f64 = alike.iter().map(|edge| edge.power).sum();
        let mean_s = -alike.iter().map(|edge| edge.product).sum::<f64>() / power;
        let square = |edge: &&IsolatedStep| edge.power * (-edge.product / edge.power - mean_s).powi(2);
        let free = alike.len() as f64 - 1.0;
        let of_each = power / alike.len() as f64;
        let expected = 1.0 + of_each * hidden * hidden / 12.0;
        (free > 0.0).then(|| Scatter {
            square: alike.iter().map(square).sum(),
            chance: free * expected,
            variance: 2.0 * free * expected * expected,
            power: free * of_each,
        })
    };
    let (up, down) = (of_way(true).unwrap_or_default(), of_way(false).unwrap_or_default());
    Some(Scatter {
        square: up.square + down.square,
        chance: up.chance + down.chance,
        variance: up.variance + down.variance,
        power: up.power + down.power,
    })
}
