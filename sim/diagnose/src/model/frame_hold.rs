//! Frames of an ESC that may lie anywhere.

use rotorlead_plant::Catalog;
use rotorlead_plant::effect::transport_delay;

use super::candidate::Candidate;

/// Place of the phase among the values of the kind.
pub(crate) const PHASE: usize = 1;

/// Two delays whose mean is what frames of this rate do where they may lie anywhere: a wait that is uniform over a frame. The
/// points are Gauss's, right up to the third power of frequency over rate.
pub(crate) fn mean_waits(frame_hz: f64) -> Option<[Candidate; 2]> {
    let delay = Catalog::standard().find(transport_delay::ID)?;
    let to_side = 1.0 / 12.0_f64.sqrt();
    let frame_s = if frame_hz.is_finite() { 1.0 / frame_hz } else { 0.0 };
    Some([0.5 - to_side, 0.5 + to_side].map(|part| Candidate::new(delay, vec![part * frame_s])))
}
