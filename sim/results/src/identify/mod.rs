//! What identification finds.

mod chirp;
mod flight;
mod headline;
mod intervals;
mod map;
mod tables;

pub use tables::points_table;

use rayon::iter::{IntoParallelRefIterator as _, ParallelIterator as _};
use rotorlead_answer::words::sentence;
use rotorlead_answer::{Answer, Audience, Figure, Section, Table, Verdict};
use rotorlead_assess::{Assessment, AssessmentContext, assess};
use rotorlead_diagnose::Diagnosis;
use rotorlead_identify::error::IdentifyError;
use rotorlead_identify::identification::{Identification, IdentifyOptions, Lags, identify};
use rotorlead_identify::lag::multisine::{PeriodicIdentification, PeriodicOptions};
use rotorlead_identify::spectra::{LongRecordError, Spectrum};
use rotorlead_identify::static_map::StaticMapFit;
use rotorlead_records::{Experiment, Finding, LongRecord, Output, Record};
use serde::Serialize;
use serde_json::{Map, Value, json};

use self::chirp::ChirpValues;
use self::headline::headline;
use self::intervals::intervals;
use super::diagnosis::found_in_short;
use super::distortion::{DistortionValues, distortion_table};
use super::experiment::excitation_section;
use super::figures::etfe::responses;
use super::figures::static_map::static_map;
use super::figures::steps::{steps, time_constant_curve};
use super::recommendation::{JudgementValues, flight_section, recommendation_table, to_fly_in_short, tone};
use crate::json_object::json_object;

/// An identification, and what follows from it and its records.
pub struct IdentifyResult {
    /// The model, and where its lags come from.
    pub identification: Identification,
    /// Whether a compensator may be built on the model, and what to fly.
    pub assessment: Assessment,
    /// What the user should know of it.
    pub findings: Vec<Finding>,
}

/// A static map, and a table of eleven commands that make the response linear.
#[derive(Serialize)]
struct MapValues<'a> {
    #[serde(flatten)]
    fit: &'a StaticMapFit,
    degree: usize,
    linearization: Option<Vec<(f64, f64)>>,
}

impl<'a> MapValues<'a> {
    fn new(fit: &'a StaticMapFit) -> Self {
        // Chosen: the shares of the table, a tenth apart.
        Self { fit, degree: fit.degree(), linearization: fit.linearization(11) }
    }
}

impl IdentifyResult {
    /// Identifies a motor from the records of an experiment.
    ///
    /// # Errors
    /// Those of [`identify`].
    pub fn identify(experiment: &Experiment, options: &IdentifyOptions) -> Result<Self, IdentifyError> {
        Self::given_diagnosis(experiment, options, None)
    }

    /// The same beside what a diagnosis of the experiment found, for which the motor is judged.
    ///
    /// # Errors
    /// Those of [`identify`].
    pub fn given_diagnosis(
        experiment: &Experiment,
        options: &IdentifyOptions,
        found: Option<&Diagnosis>,
    ) -> Result<Self, IdentifyError> {
        let mut identification = identify(experiment, options)?;
        let in_short = found.map(found_in_short).unwrap_or_default();
        let known = AssessmentContext {
            long: !options.long.is_empty(),
            stand: options.stand.is_some(),
            diagnosis: found.map(|found| (found, &*in_short)),
        };
        let assessment = assess(experiment, &identification.model, known);
        if let Some(provenance) = &mut identification.model.provenance {
            provenance.judgement = Some(assessment.judgement.clone());
        }
        let findings = identification.warnings.clone();
        Ok(Self { assessment, findings, identification })
    }

    /// The answer. What is not known is null for programs.
    #[must_use]
    pub fn answer(&self, experiment: &Experiment) -> Answer {
        let identified = &self.identification;
        let output = experiment.output;
        let Assessment { judgement, recommendation, .. } = &self.assessment;
        let mut detail: Vec<Table> = Vec::new();
        detail.extend(identified.lags.in_time().map(tables::steps));
        detail.extend(identified.lags.in_flight().map(flight::motors_table));
        detail.extend(identified.lags.in_frequency().and_then(distortion_table).map(Table::in_detail));
        detail.extend(identified.static_map.iter().flat_map(|(_, fit)| map::tables(fit, output)));
        if matches!(identified.lags, Lags::None) {
            // A static map is all that there is to say then.
            detail.iter_mut().for_each(|table| table.weight = Audience::Shown);
        }
        detail.extend(
            recommendation.iter().map(|found| Table { weight: Audience::Terminal, ..recommendation_table(found) }),
        );
        Answer {
            name: "identification",
            title: "Identified lags",
            text: Vec::new(),
            verdict: self.verdict(output),
            findings: self.findings.clone(),
            tables: [tables::lags(identified, experiment), detail].concat(),
            figures: figures(identified, experiment),
            values: self.values(output, JudgementValues::new(judgement, recommendation.as_ref())),
        }
    }

    /// The parts of a report: what to fly, the answer with what that was chosen from, and what was played.
    #[must_use]
    pub fn sections(&self, answer: &Answer, experiment: &Experiment) -> Vec<Section> {
        let recommendation = &self.assessment.recommendation;
        let mut lags = answer.section();
        lags.tables.extend(recommendation.iter().map(recommendation_table));
        recommendation.iter().map(flight_section).chain([lags, excitation_section(experiment)]).collect()
    }

    /// The lag, whether a compensator may be built on it, what to fly, and what speaks against it.
    fn verdict(&self, output: Output) -> Verdict {
        let Assessment { judgement, recommendation, other_output, .. } = &self.assessment;
        let (first, others) = judgement.limits.split_at(judgement.limits.len().min(1));
        let to_fly = recommendation.iter().map(to_fly_in_short);
        let other_output = other_output.iter().map(|other| other.sentence(output));
        let sentences = first.iter().cloned().chain(to_fly).chain(others.iter().cloned()).chain(other_output);
        let sentences = sentences.map(|words| sentence(&words)).collect();
        Verdict::new(tone(judgement.state), headline(&self.identification, judgement)).with(sentences)
    }

    fn values(&self, output: Output, judgement: JudgementValues) -> Map<String, Value> {
        let identified = &self.identification;
        let chirps = identified.lags.chirps();
        let in_frequency = identified.lags.in_frequency();
        let distortion = |found: &PeriodicIdentification| -> Vec<_> {
            found.nominals.iter().map(DistortionValues::from_nominal).collect()
        };
        let responses = chirps.map(|found| found.responses.iter().map(ChirpValues::new).collect::<Vec<_>>());
        json_object(&json!({
            "judgement": judgement,
            "output": output,
            "other_output": self.assessment.other_output,
            "detail": identified.lags.in_time(),
            "distortion": in_frequency.filter(|_| chirps.is_none()).map(distortion),
            "intervals": in_frequency.map(intervals),
            "frequency_responses": responses,
            "motors": identified.lags.in_flight().map(|found| &found.motors),
            "alignment": null,
            "static_map": identified.static_map.as_ref().map(|(_, fit)| MapValues::new(fit)),
        }))
    }
}

/// The responses that the lags were fitted to, and the static map.
fn figures(identified: &Identification, experiment: &Experiment) -> Vec<Figure> {
    let output = experiment.output;
    let mut figures: Vec<Figure> =
        identified.lags.in_frequency().and_then(|found| responses(found, output)).into_iter().collect();
    if let Some(fit) = identified.lags.in_time() {
        let record = experiment.records.iter().find(|record| record.file == fit.record);
        figures.extend(record.and_then(|record| steps(fit, record)));
        figures.extend(time_constant_curve(fit));
    }
    figures.extend(identified.lags.in_flight().and_then(|_| flight::time_constants(&identified.model)));
    figures.extend(identified.static_map.as_ref().map(|(points, fit)| static_map(points, fit, output)));
    figures
}

/// The spectra of records that stay on disk, side by side.
pub fn transform(experiment: &Experiment, long: &[LongRecord]) -> Result<Vec<(Record, Spectrum)>, LongRecordError> {
    let options = PeriodicOptions::default().spectrum;
    let spectra: Vec<_> = long
        .par_iter()
        .map(|record| Ok((record.header.clone(), Spectrum::from_long_record(experiment, record, &options)?)))
        .collect();
    // The error is that of the first faulty record, whichever is found first.
    spectra.into_iter().collect()
}
