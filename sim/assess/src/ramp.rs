//! An ESC that ramps its command, which a lag with a dead time imitates well at the steps that it is fitted to.

use rotorlead_diagnose::{Options, diagnose};
use rotorlead_plant::{Catalog, Model};
use rotorlead_records::Experiment;

/// The effect, as the catalog has it.
pub const KIND: &str = "slew_limit";
/// With the ramp in the model, what is left beyond noise has to shrink to this part of its power.
const SHRINKS_TO: f64 = 0.5;

/// The rate of the ramp, commands a second, where one explains the most of what a lag leaves. A model that has the ramp is not asked.
pub fn ramp_per_s(experiment: &Experiment, model: &Model) -> Option<f64> {
    if model.effects.iter().any(|effect| effect.kind == KIND) {
        return None;
    }
    let catalog = Catalog::standard().only(KIND);
    let found = diagnose(experiment, &Options { model: None, catalog: &catalog, progress: &|| () }).ok()?;
    let effect = found.effects.first()?;
    let (_, rate) = effect.parameters.first()?;
    let beyond_noise = |gap: f64| (gap * gap - found.gap.noise_floor * found.gap.noise_floor).max(0.0);
    (beyond_noise(found.gap.after) < SHRINKS_TO * beyond_noise(found.gap.before)).then_some(rate.value)
}
