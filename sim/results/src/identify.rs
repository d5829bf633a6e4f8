//! What identification finds.

use rayon::iter::{IntoParallelRefIterator as _, ParallelIterator as _};
use rotorlead_assess::{Assessment, NotCompared, assess};
use rotorlead_identify::static_map::StaticMapFit;
use rotorlead_identify::steps::{LawComparison, StaircaseFit, compare_laws};
use rotorlead_identify::{
    Finding, Identification, IdentifyError, IdentifyOptions, LongRecordError, PeriodicIdentification, PeriodicOptions,
    Spectrum, identify, step_record,
};
use rotorlead_plant::Judgement;
use rotorlead_records::{Experiment, LongRecord, Output, Record};
use rotorlead_vehicle::Recommendation;
use serde::Serialize;
use serde_json::Value;

use super::distortion::DistortionValues;
use super::headline::headline;
use super::intervals::{Intervals, intervals};
use super::other_output::OtherOutput;
use super::points::{ChirpValues, PointValues};
use super::recommendation::JudgementValues;

/// An identification, and what follows from it and its records.
pub struct IdentifyResult {
    /// The model, and where its lags come from.
    pub identification: Identification,
    /// One lag beside one that depends on the speed, of steps.
    pub laws: Option<LawComparison>,
    /// The lag of the column that is not the response, of steps.
    pub other_output: Option<OtherOutput>,
    /// What came out, in a sentence.
    pub headline: String,
    /// Whether a compensator may be built on the model.
    pub judgement: Judgement,
    /// What to fly on the motor; `None` where nothing can be compared.
    pub recommendation: Option<Recommendation>,
    /// What the user should know of it, in sentences.
    pub warnings: Vec<String>,
    output: Output,
}

/// The result for programs.
#[derive(Serialize)]
pub struct IdentifyValues<'a> {
    headline: &'a str,
    judgement: JudgementValues<'a>,
    output: Output,
    other_output: Option<&'a OtherOutput>,
    points: Vec<PointValues>,
    /// What the user should know of it.
    pub warnings: Vec<String>,
    detail: Option<&'a StaircaseFit>,
    distortion: Option<Vec<DistortionValues>>,
    intervals: Option<Vec<Intervals>>,
    /// Of chirps.
    frequency_responses: Option<Vec<ChirpValues<'a>>>,
    /// How logs were merged, of each record; `None` where none were.
    pub alignment: Option<Value>,
    static_map: Option<MapValues<'a>>,
    laws: Option<&'a LawComparison>,
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
        Self { fit, degree: fit.degree(), linearization: fit.linearization(11) }
    }
}

impl IdentifyResult {
    /// Identifies a motor from the records of an experiment.
    ///
    /// # Errors
    /// Those of [`identify`].
    pub fn of(experiment: &Experiment, options: &IdentifyOptions) -> Result<Self, IdentifyError> {
        let mut identification = identify(experiment, options)?;
        let not_compared = NotCompared { long: !options.long.is_empty(), stand: options.stand.is_some() };
        let Assessment { judgement, recommendation, .. } = assess(experiment, &identification.model, not_compared);
        if let Some(provenance) = &mut identification.model.provenance {
            provenance.judgement = Some(judgement.clone());
        }
        let mut warnings: Vec<String> = identification.warnings.iter().map(sentence).collect();
        let in_time = identification.lags.in_time();
        let laws = in_time.map(|_| compare_laws(step_record(experiment)?, experiment.output).map_err(Into::into));
        let laws = laws.transpose().unwrap_or_else(|error: IdentifyError| {
            warnings.push(format!("one lag was not compared with one that depends on the speed: {error}"));
            None
        });
        Ok(Self {
            laws,
            other_output: in_time.and_then(|fit| OtherOutput::of(experiment, fit)),
            headline: headline(&identification, &judgement),
            judgement,
            recommendation,
            warnings,
            output: experiment.output,
            identification,
        })
    }

    /// The result for programs. What is not known is null.
    #[must_use]
    pub fn values(&self) -> IdentifyValues<'_> {
        let identified = &self.identification;
        let chirps = identified.lags.chirps();
        let in_frequency = identified.lags.in_frequency();
        let distortion = |found: &PeriodicIdentification| found.nominals.iter().map(DistortionValues::of).collect();
        IdentifyValues {
            headline: &self.headline,
            judgement: JudgementValues::new(&self.judgement, self.recommendation.as_ref()),
            output: self.output,
            other_output: self.other_output.as_ref(),
            points: identified.model.points.iter().cloned().map(PointValues).collect(),
            warnings: self.warnings.clone(),
            detail: identified.lags.in_time(),
            distortion: in_frequency.filter(|_| chirps.is_none()).map(distortion),
            intervals: in_frequency.map(intervals),
            frequency_responses: chirps.map(|found| found.responses.iter().map(ChirpValues::new).collect()),
            alignment: None,
            static_map: identified.static_map.as_ref().map(|(_, fit)| MapValues::new(fit)),
            laws: self.laws.as_ref(),
        }
    }
}

/// The spectra of records that stay on disk, side by side.
pub fn transform(experiment: &Experiment, long: &[LongRecord]) -> Result<Vec<(Record, Spectrum)>, LongRecordError> {
    let options = PeriodicOptions::default().spectrum;
    let spectra: Vec<_> = long
        .par_iter()
        .map(|record| Ok((record.header.clone(), Spectrum::of_long(experiment, record, &options)?)))
        .collect();
    // The error is that of the first faulty record, whichever is found first.
    spectra.into_iter().collect()
}

/// A warning in a sentence: what is wrong, and behind a semicolon what to do about it.
fn sentence(finding: &Finding) -> String {
    match &finding.remedy {
        Some(remedy) => format!("{}; {remedy}", finding.message),
        None => finding.message.clone(),
    }
}
