//! Changes of the command that stand alone, as those of a square wave do.

use crate::data::dataset::{PreparedRecord, Segment};
use crate::likelihood::adjoint::{Adjoint, applied};
use crate::model::hypothesis::Hypothesis;

/// A record with no more changes of the command than this has them far between. Chosen: a square wave changes twice in a period, and
/// periods are few; a multisine changes in every row, hundreds of times.
const FEW: usize = 64;

/// A change of the command that stands alone.
pub(crate) struct IsolatedStep {
    /// Seconds from the first row of the transform.
    pub at_s: f64,
    /// Inner product of the residual with the white response to a unit of wait less.
    pub product: f64,
    /// Sum of squares of that response.
    pub power: f64,
}

/// The changes of a segment where they are few and far between; none elsewhere. `changes` are all of them, row by row.
pub(crate) fn isolated_steps(record: &PreparedRecord, adjoint: &Adjoint, changes: &[f64]) -> Vec<IsolatedStep> {
    let applied = changes.iter().enumerate().filter(|(_, change)| **change != 0.0);
    let edge = |(row, change): (usize, &f64)| IsolatedStep {
        at_s: row as f64 / record.rate_hz,
        product: change * adjoint.g[row],
        power: change * change * adjoint.lags[0],
    };
    let isolated_steps: Vec<IsolatedStep> = applied.map(edge).collect();
    if isolated_steps.len() <= FEW { isolated_steps } else { Vec::new() }
}

/// Changes of the command at each row of a segment.
pub(crate) fn changes(record: &PreparedRecord, segment: &Segment, hypothesis: &Hypothesis) -> Vec<f64> {
    let (mut before, applied) = applied(record, segment, hypothesis);
    applied.into_iter().map(|applied| applied - std::mem::replace(&mut before, applied)).collect()
}
