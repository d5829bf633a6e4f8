//! All that records say of a motor, in one: identification, judgement, validation, diagnosis and compensator.

mod words;

pub use words::lags;

use rotorlead::design::DEFAULT_LOOP_RATE_HZ;
use rotorlead_answer::Answer;
use rotorlead_assess::{Assessment, AssessmentContext, assess};
use rotorlead_design::Latency;
use rotorlead_design::redesign::{KindOptions, RedesignOptions, redesign};
use rotorlead_diagnose::{Diagnosis, Options, Verdict, diagnose, fill_in_esc_commands};
use rotorlead_identify::check::{Findings, check_record};
use rotorlead_identify::error::IdentifyError;
use rotorlead_identify::identification::IdentifyOptions;
use rotorlead_identify::lag::multisine::PeriodicIdentification;
use rotorlead_plant::bench::PAPER_AMPLITUDE;
use rotorlead_plant::effect::transport_delay;
use rotorlead_plant::{ActiveEffect, Catalog, CompensatorDesign, Effect, Model};
use rotorlead_records::files::InputFolder;
use rotorlead_records::{Experiment, Finding, Topic};
use rotorlead_vehicle::Purpose;

use super::diagnosis::found_in_short;
use super::{DesignRequest, DesignResult, IdentifyResult, Kind, MeasuredRecords, redesign_notes, redesign_refusals};

/// The effect that is part of a point too.
const DEAD_TIME: &str = transport_delay::ID;

/// What came of one part: a result, or why there is none.
pub type Part<T> = Result<T, String>;

/// What is asked beside the records.
#[derive(Clone, Copy)]
pub struct Asked<'a> {
    /// The model to be judged; the one identified unless given.
    pub model: Option<&'a Model>,
    /// What to design: of that kind, or what is recommended for the purpose.
    pub kind: Option<Kind>,
    /// What the compensator is for.
    pub purpose: Purpose,
    /// Whether the diagnosis is asked too, which takes the longest.
    pub with_diagnosis: bool,
}

/// Whom to tell how far it is.
#[derive(Clone, Copy)]
pub struct Watch<'a> {
    /// What is done now.
    pub stage: &'a dyn Fn(&'static str),
    /// A step of the diagnosis is done.
    pub step: &'a dyn Fn(),
}

/// All that was computed.
pub struct Overview {
    /// What was identified.
    pub identified: Part<IdentifyResult>,
    /// The given model, or the one identified.
    pub model: Model,
    /// Whether it was given.
    pub is_given: bool,
    /// Whether a compensator may be built on it, and what to fly.
    pub assessment: Assessment,
    /// What was to be designed.
    pub options: Part<KindOptions>,
    /// The compensator's design.
    pub designed: Part<Answer>,
    /// What of it runs, where it was designed.
    pub compensator: Option<CompensatorDesign>,
    /// What is missing in the model; `None` where that was not asked.
    pub diagnosed: Option<Part<Diagnosis>>,
    /// What is wrong with the records.
    pub findings: Vec<Finding>,
}

/// An error with what to do, as a sentence.
fn said(error: &miette::Report) -> String {
    let help = error.help().map(|help| format!(": {help}")).unwrap_or_default();
    format!("{error}{help}")
}

impl Overview {
    /// Computes them. `folder` is where the records come from.
    ///
    /// # Errors
    /// What is wrong with the records, where neither a model is given nor one can be identified.
    pub fn from_experiment(
        experiment: &Experiment,
        folder: InputFolder,
        asked: Asked,
        watch: Watch,
    ) -> Result<Self, IdentifyError> {
        let diagnosed = asked.with_diagnosis.then(|| {
            (watch.stage)("diagnosing");
            let mut experiment = experiment.clone();
            fill_in_esc_commands(&mut experiment, folder).map_err(|error| said(&error.into()))?;
            let catalog = Catalog::standard();
            diagnose(&experiment, &Options { model: asked.model, catalog: &catalog, progress: watch.step })
                .map_err(|error| said(&error.into()))
        });
        let found = diagnosed.as_ref().and_then(|found| found.as_ref().ok());
        (watch.stage)("identifying");
        let identified = IdentifyResult::given_diagnosis(experiment, &IdentifyOptions::default(), found);
        let model = match (asked.model, &identified) {
            (Some(model), _) => model.clone(),
            (None, Ok(found)) => found.identification.model.clone(),
            (None, Err(error)) => return Err(error.clone()),
        };
        let findings = findings(experiment, identified.as_ref().ok());
        (watch.stage)("validating");
        let in_short = found.map(found_in_short).unwrap_or_default();
        let assessment = match (asked.model, &identified) {
            (None, Ok(found)) => found.assessment.clone(),
            _ => assess(
                experiment,
                &model,
                AssessmentContext { diagnosis: found.map(|found| (found, &*in_short)), ..AssessmentContext::default() },
            ),
        };
        let mut overview = Self {
            identified: identified.map_err(|error| said(&error.into())),
            model,
            is_given: asked.model.is_some(),
            assessment,
            options: Err(String::new()),
            designed: Err(String::new()),
            compensator: None,
            diagnosed,
            findings,
        };
        if overview.lacking().is_some() {
            // That a lag does not suffice, and to ask the diagnosis why, is answered.
            overview.findings.retain(|finding| finding.topic != Topic::GoodnessOfFit);
        }
        (watch.stage)("designing");
        overview.design(experiment, &DesignRequest { kind: asked.kind, ..DesignRequest::default() }, asked.purpose);
        Ok(overview)
    }

    /// Designs what is asked for, or what is recommended for the purpose, for the model with what the diagnosis found to be missing: anew,
    /// where something was designed already.
    pub fn design(&mut self, experiment: &Experiment, request: &DesignRequest, purpose: Purpose) {
        let in_frequency = self.identified.as_ref().ok().and_then(|found| found.identification.lags.in_frequency());
        let measured = in_frequency.map(measured);
        let lacking = self.lacking();
        let is_of_steps = self.is_of_steps();
        let extended =
            lacking.map(|found| if is_of_steps { with_effects(&self.model, found) } else { found.model.clone() });
        let recommendation = &self.assessment.recommendation;
        let chosen = request
            .chosen(extended.as_ref().unwrap_or(&self.model), purpose, recommendation.clone())
            .map_err(|error| said(&error.into()));
        let options = chosen.as_ref().map(|chosen| chosen.options).map_err(Clone::clone);
        let mut compensator = None;
        let designed = if self.findings.iter().any(Finding::is_grave) {
            Err("the numbers of the records are in doubt, and a compensator would rest on them".to_owned())
        } else {
            chosen.and_then(|mut chosen| {
                let (mut model, mut text) = (&self.model, Vec::new());
                if let Some((found, extended)) = lacking.zip(extended.as_ref()) {
                    text = remarks(found, extended, chosen.options, experiment)?;
                    // Lags of steps have in them what the effects do to a step, and would have it twice.
                    if !is_of_steps {
                        let effects = ActiveEffect::from_model(extended).map_err(|error| said(&error.into()))?;
                        let of_extended = "For the model that the diagnosis has extended.".to_owned();
                        text.splice(0..0, (!effects.is_empty()).then_some(of_extended));
                        chosen.options = chosen.options.within(&effects);
                        model = extended;
                    }
                }
                chosen.recommendation.clone_from(recommendation);
                let mut found = DesignResult::design(model, chosen, Latency::standard(DEFAULT_LOOP_RATE_HZ))
                    .map_err(|error| said(&error.into()))?;
                found.bandwidth.measured = measured;
                compensator = Some(found.compensator.clone());
                // What the model was judged to be is said of the model itself.
                Ok(Answer { text, findings: found.findings.clone(), ..found.answer(model) })
            })
        };
        (self.options, self.designed, self.compensator) = (options, designed, compensator);
    }

    /// Whether the lags are those of steps.
    #[must_use]
    pub fn is_of_steps(&self) -> bool {
        self.identified.as_ref().is_ok_and(|found| found.identification.lags.in_time().is_some())
    }

    /// A diagnosis that says that the model lacks something.
    fn lacking(&self) -> Option<&Diagnosis> {
        self.diagnosed.as_ref()?.as_ref().ok().filter(|found| found.verdict != Verdict::Agrees)
    }

    /// What a diagnosis found to be missing.
    #[must_use]
    pub fn missing(&self) -> Option<&Diagnosis> {
        self.diagnosed.as_ref()?.as_ref().ok().filter(|found| !found.effects.is_empty())
    }
}

/// What `rotorlead check` finds in the records, and what identification does.
fn findings(experiment: &Experiment, identified: Option<&IdentifyResult>) -> Vec<Finding> {
    let mut findings = Findings::default();
    experiment.records.iter().for_each(|record| findings.extend(check_record(experiment, record, false)));
    let of_identification = identified.into_iter().flat_map(|found| &found.findings);
    of_identification.cloned().for_each(|warning| findings.warn(warning));
    findings.sorted()
}

/// The bandwidths that the records show, none where there are none to measure.
fn measured(found: &PeriodicIdentification) -> MeasuredRecords {
    MeasuredRecords::measure(found)
        .unwrap_or_else(|_| MeasuredRecords { nominals: found.nominals.clone(), ..MeasuredRecords::default() })
}

/// A model of steps with what was missing in it, which says whether a lead is of use at all. Its lags are those of each level, where a
/// diagnosis of steps has one for all, and its dead time is theirs.
fn with_effects(model: &Model, found: &Diagnosis) -> Model {
    let is_known = |effect: &&Effect| effect.kind != DEAD_TIME || model.points.iter().all(|point| point.delay_s == 0.0);
    Model { effects: found.model.effects.iter().filter(is_known).cloned().collect(), ..model.clone() }
}

/// What is to be said of a compensator for the model with what was missing in it, or why there is none: it would ask for more than the
/// actuator follows.
fn remarks(found: &Diagnosis, model: &Model, design: KindOptions, experiment: &Experiment) -> Part<Vec<String>> {
    let options = RedesignOptions { design, amplitude: PAPER_AMPLITUDE, esc_frame_hz: experiment.esc_frame_hz };
    let redesigned = redesign(model, &options, &|| ()).map_err(|error| said(&error.into()))?;
    let remarks = redesign_notes(found, &redesigned);
    match redesign_refusals(&redesigned).last() {
        Some(refusal) => {
            let reasons = std::iter::once(refusal).chain(&remarks).map(|reason| reason.trim_end_matches('.'));
            Err(reasons.collect::<Vec<_>>().join(". "))
        }
        None => Ok(remarks),
    }
}
