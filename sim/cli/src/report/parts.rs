//! All that a report computes.

use std::path::Path;

use miette::WrapErr as _;
use rotorlead_assess::{Assessment, NotCompared, assess};
use rotorlead_diagnose::{Diagnosis, Options, Verdict, diagnose, fill_in_esc_commands};
use rotorlead_identify::check::{Findings, of_record};
use rotorlead_identify::design::redesign::{KindOptions, PAPER_AMPLITUDE, RedesignOptions, redesign};
use rotorlead_identify::design::{
    BandwidthPoint, Chain, ChainPhase, CompensatorError, DesignOptions, Latency, bandwidths_with, chain_phases, design,
    design_inverse,
};
use rotorlead_identify::{IdentifyOptions, MeasuredBandwidth, RecordValidation};
use rotorlead_plant::{ActiveEffect, Catalog, CompensatorDesign, Effect, Judgement, Model};
use rotorlead_records::{Experiment, Finding, LongRecord, Topic};
use rotorlead_results::{DesignRequest, IdentifyResult, Kind, redesign_notes, redesign_refusals, transform};
use rotorlead_vehicle::{Purpose, Recommendation, design_options};

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
    pub designed: Part<Designed>,
    /// The highest `omega_g` that the model allows, where it is too slow for the paper's, rad/s.
    pub lowered_omega_g_rad_s: Option<f64>,
    pub measured: Vec<MeasuredBandwidth>,
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

impl Asked {
    fn options(self, recommendation: Option<&Recommendation>, omega_g_rad_s: Option<f64>) -> Part<KindOptions> {
        if let Some(kind) = self.kind {
            return Ok(DesignRequest { omega_g_rad_s, ..DesignRequest::default() }.options(kind));
        }
        let recommendation = recommendation.ok_or("what to fly cannot be said of this model")?;
        let choice = recommendation.of(self.purpose);
        let none = || {
            format!(
                "none is recommended for {}, as {}. --kind designs one all the same",
                self.purpose.words(),
                choice.why
            )
        };
        design_options(choice.actuator, &Default::default()).ok_or_else(none)
    }
}

/// A compensator, and what it was designed for.
pub(super) struct Designed {
    pub design: CompensatorDesign,
    pub points: Vec<BandwidthPoint>,
    /// Of the whole chain, with a controller's default pulses.
    pub phases: Vec<ChainPhase>,
    pub model: Model,
    /// What is to be known of it beside the numbers.
    pub remarks: Vec<String>,
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
        let long: &[LongRecord] = &[];
        let identified = transform(experiment, long).map_err(miette::Report::from).and_then(|long| {
            let options = IdentifyOptions { long: &long, ..IdentifyOptions::default() };
            Ok(IdentifyResult::of(experiment, &options)?)
        });
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
        let measured = found.and_then(|found| found.bandwidths(RESAMPLES, SEED).ok()).unwrap_or_default();
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
        let lowered_omega_g_rad_s = match asked.kind {
            Some(Kind::Lead) => lowered(extended.as_ref().unwrap_or(&model)),
            Some(Kind::Inverse) | None => None,
        };
        let options = asked.options(recommendation.as_ref(), lowered_omega_g_rad_s);
        let designed = if findings.iter().any(Finding::is_grave) {
            Err("the numbers of the records are in doubt, and a compensator would rest on them".to_owned())
        } else {
            options.clone().and_then(|options| match lacking.zip(extended) {
                Some((found, extended)) => {
                    let with_effects = designed_with_effects(found, extended, options, experiment);
                    match with_effects {
                        // Lags of steps have in them what the effects do to a step, and would have it twice.
                        Ok(Designed { remarks, .. }) if is_of_steps => {
                            designed(&model, options).map(|designed| Designed { remarks, ..designed })
                        }
                        with_effects => with_effects,
                    }
                }
                None => designed(&model, options),
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
            lowered_omega_g_rad_s,
            measured,
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

/// What `omega_g` has to be lowered to where nobody asked for one and the fastest motor is too slow for the paper's.
fn lowered(model: &Model) -> Option<f64> {
    match design(model, &DesignOptions::default()) {
        Err(CompensatorError::TooMuchLead { largest_omega_g_rad_s, .. }) => Some(largest_omega_g_rad_s),
        _ => None,
    }
}

/// For the model as it is, as `rotorlead bandwidth` does.
fn designed(model: &Model, options: KindOptions) -> Part<Designed> {
    let effects = ActiveEffect::of_model(model).map_err(|error| said(&error.into()))?;
    let design = match options {
        KindOptions::Lead(options) => design(model, &options).map(CompensatorDesign::from),
        KindOptions::Inverse(options) => design_inverse(model, &options).map(|found| found.compensator.into()),
    };
    let design = design.map_err(|error| said(&error.into()))?;
    let points = bandwidths_with(model, &effects, Chain::Designed(&design));
    let phases = phases(model, &effects, &design, &points);
    Ok(Designed { design, points, phases, model: model.clone(), remarks: Vec::new() })
}

/// A model of steps with what was missing in it, which says whether a lead is of use at all. Its lags are those of each level, where a
/// diagnosis of steps has one for all, and its dead time is theirs.
fn with_effects(model: &Model, found: &Diagnosis) -> Model {
    let is_known = |effect: &&Effect| effect.kind != DEAD_TIME || model.points.iter().all(|point| point.delay_s == 0.0);
    Model { effects: found.model.effects.iter().filter(is_known).cloned().collect(), ..model.clone() }
}

/// For the model with what was missing in it; none where it would ask for more than the actuator follows.
fn designed_with_effects(
    found: &Diagnosis,
    model: Model,
    design: KindOptions,
    experiment: &Experiment,
) -> Part<Designed> {
    let options = RedesignOptions { design, amplitude: PAPER_AMPLITUDE, esc_frame_hz: experiment.esc_frame_hz };
    let redesigned = redesign(&model, &options, &|| ()).map_err(|error| said(&error.into()))?;
    let remarks = redesign_notes(found, &redesigned);
    if let Some(refusal) = redesign_refusals(&redesigned).last() {
        let reasons = std::iter::once(refusal).chain(&remarks).map(|reason| reason.trim_end_matches('.'));
        return Err(reasons.collect::<Vec<_>>().join(". "));
    }
    let effects = ActiveEffect::of_model(&model).map_err(|error| said(&error.into()))?;
    let design = redesigned.full.design;
    let points: Vec<_> = redesigned.full.points.into_iter().map(|point| point.small).collect();
    let phases = phases(&model, &effects, &design, &points);
    Ok(Designed { design, points, phases, model, remarks })
}

fn phases(
    model: &Model,
    effects: &[ActiveEffect],
    design: &CompensatorDesign,
    points: &[BandwidthPoint],
) -> Vec<ChainPhase> {
    let latency = Latency::standard(design.loop_rate_hz());
    chain_phases(model, effects, Chain::Designed(design), &latency, points)
}
