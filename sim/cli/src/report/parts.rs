//! All that a report computes.

use std::path::Path;

use miette::WrapErr as _;
use rotorlead::design::DEFAULT_LOOP_RATE_HZ;
use rotorlead_answer::Answer;
use rotorlead_assess::{Assessment, NotCompared, assess};
use rotorlead_diagnose::{Diagnosis, Options, Verdict, diagnose, fill_in_esc_commands};
use rotorlead_identify::check::{Findings, of_record};
use rotorlead_identify::design::Latency;
use rotorlead_identify::design::redesign::{KindOptions, PAPER_AMPLITUDE, RedesignOptions, redesign};
use rotorlead_identify::{IdentifyOptions, RecordValidation};
use rotorlead_plant::{ActiveEffect, Catalog, Effect, Judgement, Model};
use rotorlead_records::{Experiment, Finding, Topic};
use rotorlead_results::{
    DesignRequest, DesignResult, IdentifyResult, Kind, MeasuredRecords, redesign_notes, redesign_refusals,
};
use rotorlead_vehicle::{Purpose, Recommendation};

use crate::bandwidth::RESAMPLES;
use crate::{diagnose as diagnosis, progress};

/// Where the bootstrap of measured bandwidths starts.
const SEED: u64 = 1;
/// The effect that is part of a point too.
const DEAD_TIME: &str = "transport_delay";

/// What came of one part: a result, or why there is none.
pub(super) type Part<T> = Result<T, String>;

/// All that was computed.
pub(super) struct Parts {
    pub identified: Part<IdentifyResult>,
    /// The given model, or the one identified.
    pub model: Model,
    /// Whether it was given.
    pub is_given: bool,
    pub validated: Part<Vec<RecordValidation>>,
    /// Whether a compensator may be built on it.
    pub judgement: Judgement,
    /// What to fly; `None` where nothing can be compared.
    pub recommendation: Option<Recommendation>,
    /// What was to be designed.
    pub options: Part<KindOptions>,
    pub designed: Part<Answer>,
    pub diagnosed: Option<Part<Diagnosis>>,
    /// What `rotorlead check` finds in the records.
    pub findings: Vec<Finding>,
}

/// What to design: of that kind, or what is recommended for the purpose.
#[derive(Clone, Copy)]
pub(super) struct Asked {
    pub kind: Option<Kind>,
    pub purpose: Purpose,
}

/// An error with what to do, as a sentence.
fn said(error: &miette::Report) -> String {
    let help = error.help().map(|help| format!(": {help}")).unwrap_or_default();
    format!("{error}{help}")
}

impl Parts {
    /// Computes them. `given` is the model to be judged.
    pub fn of(
        experiment: &Experiment,
        folder: &Path,
        given: Option<&Model>,
        with_diagnosis: bool,
        asked: Asked,
    ) -> miette::Result<Self> {
        let bar = progress::estimate("identifying", diagnosis::STEPS);
        let identified = IdentifyResult::of(experiment, &IdentifyOptions::default()).map_err(miette::Report::from);
        let model = match (given, &identified) {
            (Some(model), _) => model.clone(),
            (None, Ok(found)) => found.identification.model.clone(),
            (None, Err(_)) => {
                return identified
                    .map(|_| unreachable!("it is an error"))
                    .wrap_err_with(|| format!("nothing was identified from `{}`", folder.display()));
            }
        };
        bar.set_message("validating");
        let assessment = match (given, &identified) {
            (None, Ok(found)) => found.assessment.clone(),
            _ => assess(experiment, &model, NotCompared::default()),
        };
        let Assessment { judgement, recommendation, records, .. } = assessment;
        let validated = records.map_err(|error| said(&error.into()));
        let mut findings = Findings::default();
        experiment.records.iter().for_each(|record| findings.extend(of_record(experiment, record, false)));
        if let Ok(found) = &identified {
            found.findings.iter().cloned().for_each(|warning| findings.warn(warning));
        }
        bar.set_message("measuring");
        let found = identified.as_ref().ok().and_then(|found| found.identification.lags.in_frequency());
        let measured = found.map(|found| MeasuredRecords {
            bandwidths: found.bandwidths(RESAMPLES, SEED).unwrap_or_default(),
            nominals: found.nominals.clone(),
        });
        let diagnosed = with_diagnosis.then(|| {
            bar.set_message("diagnosing");
            let mut experiment = experiment.clone();
            fill_in_esc_commands(&mut experiment, folder).map_err(|error| said(&error.into()))?;
            let catalog = Catalog::standard();
            let tick = || progress::step(&bar);
            diagnose(&experiment, &Options { model: given, catalog: &catalog, progress: &tick })
                .map_err(|error| said(&error.into()))
        });
        let mut findings = findings.sorted();
        if let Some(Ok(found)) = &diagnosed
            && found.verdict != Verdict::Agrees
        {
            // That a lag does not suffice, and to ask the diagnosis why, is answered.
            findings.retain(|finding| finding.topic != Topic::GoodnessOfFit);
        }
        bar.set_message("designing");
        let lacking = match &diagnosed {
            Some(Ok(found)) if found.verdict != Verdict::Agrees => Some(found),
            _ => None,
        };
        let is_of_steps = identified.as_ref().is_ok_and(|found| found.identification.lags.in_time().is_some());
        let extended = lacking.map(|found| if is_of_steps { with_effects(&model, found) } else { found.model.clone() });
        let request = DesignRequest { kind: asked.kind, ..DesignRequest::default() };
        let chosen = request
            .chosen(extended.as_ref().unwrap_or(&model), asked.purpose, recommendation.clone())
            .map_err(|error| said(&error.into()));
        let options = chosen.as_ref().map(|chosen| chosen.options).map_err(Clone::clone);
        let designed = if findings.iter().any(Finding::is_grave) {
            Err("the numbers of the records are in doubt, and a compensator would rest on them".to_owned())
        } else {
            chosen.and_then(|mut chosen| {
                let (mut model, mut text) = (&model, Vec::new());
                if let Some((found, extended)) = lacking.zip(extended.as_ref()) {
                    text = remarks(found, extended, chosen.options, experiment)?;
                    // Lags of steps have in them what the effects do to a step, and would have it twice.
                    if !is_of_steps {
                        let effects = ActiveEffect::of_model(extended).map_err(|error| said(&error.into()))?;
                        let of_extended = "For the model that the diagnosis has extended.".to_owned();
                        text.splice(0..0, (!effects.is_empty()).then_some(of_extended));
                        chosen.options = chosen.options.within(&effects);
                        model = extended;
                    }
                }
                chosen.recommendation.clone_from(&recommendation);
                let mut found = DesignResult::of(model, chosen, Latency::standard(DEFAULT_LOOP_RATE_HZ))
                    .map_err(|error| said(&error.into()))?;
                found.bandwidth.measured = measured;
                // What the model was judged to be is said of the model itself.
                Ok(Answer { text, findings: found.findings.clone(), ..found.answer(model) })
            })
        };
        bar.finish_and_clear();
        let identified = identified.map_err(|error| said(&error));
        Ok(Self {
            identified,
            model,
            is_given: given.is_some(),
            validated,
            judgement,
            recommendation,
            options,
            designed,
            diagnosed,
            findings,
        })
    }

    /// Whether the lags are those of steps.
    pub fn is_of_steps(&self) -> bool {
        self.identified.as_ref().is_ok_and(|found| found.identification.lags.in_time().is_some())
    }

    /// What a diagnosis found to be missing.
    pub fn missing(&self) -> Option<&Diagnosis> {
        self.diagnosed.as_ref()?.as_ref().ok().filter(|found| !found.effects.is_empty())
    }
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
