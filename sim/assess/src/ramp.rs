//! An ESC that ramps its command, which a lag with a dead time imitates well at the steps that it is fitted to.

use rotorlead_diagnose::{Diagnosis, Options, diagnose};
use rotorlead_plant::effect::slew_limit;
use rotorlead_plant::{Catalog, Model};
use rotorlead_records::Experiment;

/// The effect, as the catalog has it.
pub const KIND: &str = slew_limit::ID;
/// With the ramp in the model, what is left beyond noise has to shrink to this part of its power. Chosen: the ramp then explains more than
/// all else together; less would name ramps that other effects imitate.
const SHRINKS_TO: f64 = 0.5;

/// The rate of the ramp, commands a second, where one explains the most of what a lag leaves: that which a diagnosis has `found`, if there
/// was one. A model that has the ramp is not asked.
pub fn ramp_per_s(experiment: &Experiment, model: &Model, found: Option<&Diagnosis>) -> Option<f64> {
    if model.effects.iter().any(|effect| effect.kind == KIND) {
        return None;
    }
    if let Some(found) = found {
        return rate_per_s(found);
    }
    let catalog = Catalog::standard().only(KIND);
    rate_per_s(&diagnose(experiment, &Options { model: None, catalog: &catalog, progress: &|| () }).ok()?)
}

/// That of a ramp that is worth more than all else that is named, where most of what the lag misses is explained.
fn rate_per_s(found: &Diagnosis) -> Option<f64> {
    let effect = found.effects.first().filter(|effect| effect.kind.id == KIND)?;
    let beyond_noise = |gap: f64| (gap * gap - found.gap.noise_floor * found.gap.noise_floor).max(0.0);
    let (_, rate) = effect.parameters.first()?;
    (beyond_noise(found.gap.after) < SHRINKS_TO * beyond_noise(found.gap.before)).then_some(rate.value)
}
