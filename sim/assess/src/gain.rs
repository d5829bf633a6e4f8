//! What the paper's lead gains on a model, and what takes it away.

use rotorlead_identify::design::{
    Chain, CompensatorError, DesignOptions, Latency, bandwidths_with, chain_phases, design,
};
use rotorlead_plant::{ActiveEffect, CompensatorDesign, Model};

/// Within which limits a lead may be built on the model.
pub fn limits(model: &Model) -> Vec<String> {
    let lead = match design(model, &DesignOptions::default()) {
        Ok(lead) => CompensatorDesign::from(lead),
        Err(CompensatorError::TooMuchLead { largest_omega_g_rad_s, .. }) => {
            return vec![format!("a lead takes --omega-g {largest_omega_g_rad_s:.1} at most")];
        }
        Err(refused) => return vec![format!("no lead can be designed, as {refused}: --kind inverse may")],
    };
    lost(model, &lead).into_iter().collect()
}

/// Where dead time takes the use from what the lead gains, with a flight controller's usual pulses.
fn lost(model: &Model, lead: &CompensatorDesign) -> Option<String> {
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
