//! Bandwidths: what is predicted of a model in a chain, and what records show beside it.

mod deviations;
mod notes;
pub(crate) mod tables;
mod verdict;

pub use deviations::deviations;
pub use tables::{DeviatingActuator, bandwidth_cell, bandwidth_text};
pub use verdict::{bandwidth_range, predicted_bandwidth};

use rotorlead_answer::{Answer, Section, Table, Verdict};
use rotorlead_design::{BandwidthPoint, Chain, ChainPhase, Latency, StepPoint, bandwidths_with, chain_phases};
use rotorlead_identify::error::IdentifyError;
use rotorlead_identify::lag::multisine::MeasuredBandwidth;
use rotorlead_identify::lag::multisine::{
    NominalIdentification, PeriodicIdentification, PeriodicOptions, identify_periodic,
};
use rotorlead_plant::effect::Linearity;
use rotorlead_plant::{ActiveEffect, Model, PlantError};
use rotorlead_records::{Experiment, Finding};
use serde_json::{Map, Value, json};

use self::tables::bandwidth_values;
use self::verdict::faster_as_measured;
use super::caveats::{doubts_in_short, judged, lost_gain, warn_of_another_model};
use super::design::tables::in_short;
use super::figures::compensation::{bandwidths, color, measured, simulated, simulation_and_experiment};
use super::latency::latency_json;
use crate::json_object::json_object;

/// Bandwidths of a model in a chain, and whatever else was asked of it.
pub struct BandwidthResult {
    /// The effects that the model has beside its lags.
    pub effects: Vec<ActiveEffect>,
    /// The pure delays that the phases count.
    pub latency: Latency,
    /// The bandwidths at each point of the model.
    pub points: Vec<BandwidthPoint>,
    /// The phases of the whole chain there.
    pub phases: Vec<ChainPhase>,
    /// Steps through the chain.
    pub steps: Option<Vec<StepPoint>>,
    /// What compensators do where the actuator differs from the model.
    pub robustness: Option<Vec<DeviatingActuator>>,
    /// What records show.
    pub measured: Option<MeasuredRecords>,
    /// What the user should know of it.
    pub findings: Vec<Finding>,
}

/// How many times a measured bandwidth is drawn again from its noise, for its interval. Derived: 25 draws are beyond each end of 95 %,
/// which is so known to 0.5 % of probability, `sqrt(0.025 * 0.975 / 1000)`; time goes with their number.
pub const RESAMPLES: usize = 1000;
/// Where the drawing starts. Chosen: any number; a fixed one gives the same interval each time.
const SEED: u64 = 1;

/// Bandwidths that records show.
#[derive(Clone, Default)]
pub struct MeasuredRecords {
    /// Of each record.
    pub bandwidths: Vec<MeasuredBandwidth>,
    /// The responses that they are those of.
    pub nominals: Vec<NominalIdentification>,
}

impl MeasuredRecords {
    /// Measures those of multisines.
    ///
    /// # Errors
    /// Those of [`PeriodicIdentification::bandwidths`].
    pub fn measure(found: &PeriodicIdentification) -> Result<Self, IdentifyError> {
        Ok(Self { bandwidths: found.bandwidths(RESAMPLES, SEED)?, nominals: found.nominals.clone() })
    }

    /// Measures those of the multisines of an experiment.
    ///
    /// # Errors
    /// Those of [`identify_periodic`] and [`PeriodicIdentification::bandwidths`].
    pub fn from_experiment(experiment: &Experiment) -> Result<Self, IdentifyError> {
        Self::measure(&identify_periodic(experiment, &PeriodicOptions::default())?)
    }

    /// Adds those of another experiment: without and with compensator may be in different ones.
    pub fn extend(&mut self, other: Self) {
        self.bandwidths.extend(other.bandwidths);
        self.nominals.extend(other.nominals);
    }
}

impl BandwidthResult {
    /// Predicts the bandwidths of `model` in `chain`.
    ///
    /// # Errors
    /// [`PlantError`] when the model is impossible.
    pub fn predict(model: &Model, chain: Chain, latency: Latency) -> Result<Self, PlantError> {
        let effects = ActiveEffect::from_model(model)?;
        let points = bandwidths_with(model, &effects, chain);
        let phases = chain_phases(model, &effects, chain, &latency, &points);
        let other = chain.design().and_then(|design| warn_of_another_model(design, model));
        let findings = other.into_iter().chain(lost_gain(&points, &phases)).collect();
        Ok(Self { effects, latency, points, phases, steps: None, robustness: None, measured: None, findings })
    }

    /// The answer, for the model and the chain that it is of.
    #[must_use]
    pub fn answer(&self, model: &Model, chain: Chain) -> Answer {
        let Section { name: _, title: _, text, tables, mut figures } = self.section(chain);
        figures.push(simulated(model, chain));
        let verdict = faster_as_measured(&self.points, self.measured_bandwidths());
        Answer {
            name: "bandwidth",
            title: "Bandwidth",
            text: chain
                .design()
                .map(|design| format!("The compensator: {}.", in_short(design)))
                .into_iter()
                .chain(text)
                .collect(),
            verdict: Verdict {
                sentences: doubts_in_short(model, &self.points, &self.phases)
                    .into_iter()
                    .chain(verdict.sentences)
                    .collect(),
                ..verdict
            },
            findings: judged(model).into_iter().chain(self.findings.clone()).collect(),
            tables,
            figures,
            values: self.values(chain),
        }
    }

    /// The bandwidths as the part of a report.
    #[must_use]
    pub fn section(&self, chain: Chain) -> Section {
        let mut figures: Vec<_> =
            bandwidths(&self.points, self.measured_bandwidths(), color(chain.design())).into_iter().collect();
        if let Some(MeasuredRecords { nominals, .. }) = &self.measured {
            figures.extend(measured(nominals));
            figures.extend(chain.design().and_then(|design| simulation_and_experiment(nominals, design)));
        }
        Section { tables: self.tables(chain), figures, ..Section::new("bandwidth", "Bandwidth") }
    }

    fn measured_bandwidths(&self) -> &[MeasuredBandwidth] {
        self.measured.as_ref().map_or(&[], |measured| &measured.bandwidths)
    }

    fn tables(&self, chain: Chain) -> Vec<Table> {
        let predicted = Table { notes: notes::counted(self, chain), ..tables::predicted(&self.points, &self.phases) };
        let measured = self.measured_bandwidths();
        std::iter::once(predicted)
            .chain(self.steps.as_deref().map(tables::steps))
            .chain(self.robustness.as_deref().map(tables::robustness))
            .chain((!measured.is_empty()).then(|| tables::measured(measured)))
            .collect()
    }

    /// For programs. What was not asked for has no key.
    pub(super) fn values(&self, chain: Chain) -> Map<String, Value> {
        let left_out = self.effects.iter().map(ActiveEffect::kind).filter(|kind| kind.linearity == Linearity::Absent);
        let asked = [
            ("steps", self.steps.as_ref().map(|steps| json!(steps))),
            ("robustness", self.robustness.as_ref().map(|found| json!(found))),
            ("left_out", (!self.effects.is_empty()).then(|| json!(left_out.collect::<Vec<_>>()))),
            ("measured", self.measured.as_ref().map(|measured| json!(measured.bandwidths))),
        ];
        let mut values = json_object(&json!({
            "points": bandwidth_values(&self.points, &self.phases),
            "latency": latency_json(&self.latency, chain, &self.phases),
        }));
        values.extend(asked.into_iter().filter_map(|(key, value)| Some((key.to_owned(), value?))));
        values
    }
}
