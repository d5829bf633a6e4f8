//! An ESC that ramps its command, which a lag with a dead time imitates well at the steps that it is fitted to.

use rotorlead_diagnose::{Options, diagnose};
use rotorlead_plant::Catalog;
use rotorlead_records::Experiment;

/// The effect, as the catalog has it.
const KIND: &str = "slew_limit";
/// With the ramp in the model, what is left has to shrink to this part.
const SHRINKS_TO: f64 = 0.5;

/// The rate of the ramp, commands a second, where one explains the most of what a lag leaves.
pub fn ramp_per_s(experiment: &Experiment) -> Option<f64> {
    let catalog = Catalog::standard().only(KIND);
    let found = diagnose(experiment, &Options { model: None, catalog: &catalog, progress: &|| () }).ok()?;
    let effect = found.effects.first()?;
    let (_, rate) = effect.parameters.first()?;
    (found.gap.after < SHRINKS_TO * found.gap.before).then_some(rate.value)
}
