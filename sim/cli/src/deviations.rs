//! `--robustness` of `rotorlead bandwidth`: compensators on actuators that differ from their model.

use rayon::prelude::*;
use rotorlead_answer::Table;
use rotorlead_identify::design::{DEVIATIONS, DesignOptions, Robustness, design, robustness};
use rotorlead_plant::{CompensatorDesign, FilterDesign, Model};
use rotorlead_results::robustness_table;
use serde::Serialize;

use super::progress;

/// Each compensator's name, and what it does with each of [`DEVIATIONS`].
pub struct Deviations(Vec<(&'static str, Vec<Robustness>)>);

/// What a compensator does on an actuator that differs, for programs.
#[derive(Serialize)]
pub struct Values {
    compensator: &'static str,
    deviation: &'static str,
    #[serde(flatten)]
    found: Robustness,
}

impl Deviations {
    /// Of a compensator for `model`, and beside an inverse of the paper's lead, where the model gives one.
    pub fn of(model: &Model, given: &CompensatorDesign, esc_frame_hz: Option<f64>) -> miette::Result<Self> {
        let lead = match given.kind {
            FilterDesign::Lead(_) => None,
            FilterDesign::Inverse(_) => design(model, &DesignOptions::default()).ok().map(CompensatorDesign::from),
        };
        let name = if given.as_lead().is_some() { "C(s)" } else { "inverse" };
        let compensators: Vec<_> =
            std::iter::once((name, given)).chain(lead.iter().map(|lead| ("C(s)", lead))).collect();
        let bar = progress::bar("deviating", (compensators.len() * DEVIATIONS.len()) as u64);
        let of = |(name, design): (&'static str, &CompensatorDesign)| {
            let found = DEVIATIONS.par_iter().map(|deviation| {
                let found = robustness(model, design, deviation, esc_frame_hz);
                bar.inc(1);
                found
            });
            Ok((name, found.collect::<Result<_, _>>()?))
        };
        let found = compensators.into_iter().map(of).collect::<miette::Result<_>>()?;
        bar.finish_and_clear();
        Ok(Self(found))
    }

    /// For people.
    pub fn table(&self) -> Table {
        robustness_table(&self.0)
    }

    /// For programs.
    pub fn values(&self) -> Vec<Values> {
        let of = |(compensator, found): &(&'static str, Vec<Robustness>)| {
            let compensator = *compensator;
            let rows = DEVIATIONS.iter().zip(found);
            rows.map(move |(deviation, found)| Values { compensator, deviation: deviation.name, found: *found })
                .collect::<Vec<_>>()
        };
        self.0.iter().flat_map(of).collect()
    }
}
