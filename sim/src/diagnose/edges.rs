//! Changes of the command that stand alone, as those of a square wave do.

use super::backward::{Backward, told};
use super::trial::{Stretch, Trial};

/// A record with no more changes of the command than this has them far between.
const FEW: usize = 64;

/// A change of the command that stands alone.
pub(super) struct Edge {
    /// Seconds from the first row of the transform.
    pub at_s: f64,
    /// Inner product of the residual with the white response to a unit of wait less.
    pub product: f64,
    /// Sum of squares of that response.
    pub power: f64,
}

/// The changes of a stretch where they are few and far between; none elsewhere. `changes` are all of them, row by row.
pub(super) fn lone_edges(trial: &Trial, backward: &Backward, changes: &[f64]) -> Vec<Edge> {
    let told = changes.iter().enumerate().filter(|(_, change)| **change != 0.0);
    let edge = |(row, change): (usize, &f64)| Edge {
        at_s: row as f64 / trial.rate_hz,
        product: change * backward.g[row],
        power: change * change * backward.lags[0],
    };
    let edges: Vec<Edge> = told.map(edge).collect();
    if edges.len() <= FEW { edges } else { Vec::new() }
}

/// Changes of the command at each row of a stretch.
pub(super) fn changes(trial: &Trial, stretch: &Stretch) -> Vec<f64> {
    let (mut before, told) = told(trial, stretch);
    told.into_iter().map(|told| told - std::mem::replace(&mut before, told)).collect()
}
