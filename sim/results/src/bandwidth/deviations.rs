//! Compensators on actuators that differ from their model.

use rayon::prelude::*;
use rotorlead_design::{DEVIATIONS, DesignOptions, design, robustness};
use rotorlead_plant::{CompensatorDesign, FilterDesign, Model};

use super::DeviatingActuator;

/// Of a compensator for `model`, and beside an inverse of the paper's lead, where the model gives one. `progress` is given how many are
/// simulated, and gives what is to be called after each.
///
/// # Errors
/// When an actuator cannot be simulated.
pub fn deviations<Step: Fn() + Sync>(
    model: &Model,
    given: &CompensatorDesign,
    esc_frame_hz: Option<f64>,
    progress: impl FnOnce(usize) -> Step,
) -> miette::Result<Vec<DeviatingActuator>> {
    let lead = match given.kind {
        FilterDesign::Lead(_) => None,
        FilterDesign::Inverse(_) => design(model, &DesignOptions::default()).ok().map(CompensatorDesign::from),
    };
    let name = if given.as_lead().is_some() { "C(s)" } else { "inverse" };
    let compensators = std::iter::once((name, given)).chain(lead.iter().map(|lead| ("C(s)", lead)));
    let all: Vec<_> = compensators.flat_map(|each| DEVIATIONS.iter().map(move |deviation| (each, deviation))).collect();
    let step = progress(all.len());
    let simulated = all.into_par_iter().map(|((compensator, design), deviation)| {
        let found = robustness(model, design, deviation, esc_frame_hz)?;
        step();
        Ok(DeviatingActuator { compensator, deviation: deviation.name, found })
    });
    // The error is that of the first faulty one, whichever is found first.
    simulated.collect::<Vec<miette::Result<_>>>().into_iter().collect()
}
