//! What takes away what a lead gains on a model.

use rotorlead_design::{Chain, ChainPhase, DesignOptions, Latency, bandwidths_with, chain_phases, design};
use rotorlead_plant::effect::transport_delay;
use rotorlead_plant::{ActiveEffect, CompensatorDesign, Model};

use crate::remedy;

/// Where dead time takes the use from what the lead gains, with a flight controller's usual pulses.
pub fn lost(model: &Model) -> Option<String> {
    let lead = &CompensatorDesign::from(design(model, &DesignOptions::default()).ok()?);
    let effects = ActiveEffect::from_model(model).ok()?;
    let chain = Chain::Designed(lead);
    let points = bandwidths_with(model, &effects, chain);
    let phases = chain_phases(model, &effects, chain, &Latency::standard(lead.loop_rate_hz()), &points);
    let lost: Vec<&ChainPhase> = points
        .iter()
        .zip(&phases)
        .filter(|(point, phase)| phase.is_dead_time_limited(point))
        .map(|(_, phase)| phase)
        .collect();
    let longest = lost.iter().max_by(|a, b| a.dead_time_s().total_cmp(&b.dead_time_s()))?;
    Some(format!(
        "a dead time of {:.1} ms, {:.1} of which are the compensator's pulses, takes what a lead gains at {} of {} points from any loop \
         around it: {}",
        1e3 * longest.dead_time_s(),
        1e3 * (longest.dead_time_s() - longest.model_dead_time_s),
        lost.len(),
        points.len(),
        dead_time_remedy(longest)
    ))
}

/// What to do about a dead time, by its larger part.
#[must_use]
pub fn dead_time_remedy(phase: &ChainPhase) -> String {
    if phase.model_dead_time_s > phase.compensated.late_s {
        format!(
            "{}. A lower bandwidth does not shorten it, but amplifies less noise above what can be used",
            remedy(transport_delay::ID)
        )
    } else {
        "use shorter and faster pulses: --input-protocol and --output-protocol oneshot125, or a higher --input-frame with an \
         --output-frame some percent above it"
            .to_owned()
    }
}
