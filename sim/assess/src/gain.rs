//! What takes away what a lead gains on a model.

use rotorlead_identify::design::{Chain, DesignOptions, Latency, bandwidths_with, chain_phases, design};
use rotorlead_plant::{ActiveEffect, CompensatorDesign, Model};

/// Where dead time takes the use from what the lead gains, with a flight controller's usual pulses.
pub fn lost(model: &Model) -> Option<String> {
    let lead = &CompensatorDesign::from(design(model, &DesignOptions::default()).ok()?);
    let effects = ActiveEffect::of_model(model).ok()?;
    let chain = Chain::Designed(lead);
    let points = bandwidths_with(model, &effects, chain);
    let phases = chain_phases(model, &effects, chain, &Latency::standard(lead.loop_rate_hz()), &points);
    let lost = points.iter().zip(&phases).filter(|(point, phase)| phase.is_gain_lost(point)).count();
    let longest_s = phases.iter().map(|phase| phase.dead_time_s()).fold(0.0, f64::max);
    (lost > 0).then(|| {
        format!(
            "a dead time of {:.1} ms takes what a lead gains at {lost} of {} points from any loop around it: shorten the pulses, or \
             find out whether the log makes it",
            1e3 * longest_s,
            points.len()
        )
    })
}
