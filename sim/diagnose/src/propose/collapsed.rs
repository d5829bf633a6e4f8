//! Nominal commands at which the response has all but vanished.
//!
//! Behind a limit that most commands of a record pass, little moves, and the lag that fits best there has little gain or none. From such a
//! lag no search finds the limit: without a gain a clip changes nothing. So effects are looked for from a lag with the gain of
//! the other nominal commands as well.

use rotorlead_numerics::sample::median;

use crate::estimate::fit::{Fit, fit_in};
use crate::likelihood::Likelihood;

/// A gain that is a smaller part of the others' median than this has collapsed. Chosen: gains of the paper's motor differ by 1.6 in all.
/// Higher lifts a gain that is right, which costs a second look; lower loses limits that leave some response.
const COLLAPSED: f64 = 0.4;

/// `from` with the lags of the nearest nominal command that responds wherever one has collapsed; not fitted. `None` where none
/// has, or all have.
pub(crate) fn lifted(likelihood: &Likelihood, from: &Fit) -> Option<Fit> {
    let base = &from.hypothesis.base;
    let least = COLLAPSED * median(base.iter().map(|lag| lag.gain.abs()))?;
    let responds = |point: &usize| base[*point].gain.abs() > least;
    if (0..base.len()).all(|point| responds(&point)) {
        return None;
    }
    let mut lifted = from.hypothesis.clone();
    for point in (0..base.len()).filter(|point| !responds(point)) {
        let away = |other: &usize| (likelihood.data.nominals[*other] - likelihood.data.nominals[point]).abs();
        let nearest = (0..base.len()).filter(responds).min_by(|a, b| away(a).total_cmp(&away(b)))?;
        lifted.base[point] = base[nearest];
    }
    fit_in(likelihood, &lifted, true, 0)
}
