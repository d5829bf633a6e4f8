//! One judgement of a motor's model, of which every command, page and result is a view.
//!
//! [`assess`] compares a model with records, and says in one of four words whether a compensator may be built on it, with the
//! reasons. `rotorlead identify` writes the word into the model's file, where commands without records find it. The rules
//! are in `docs/judgement.md`.

mod comparison;
pub mod fleet;
mod gain;
mod imitated_lag;
mod other_output;
mod residual;

pub use comparison::{Compared, ComparisonError, Difference, LagParameter, compare};
pub use gain::dead_time_remedy;
pub use other_output::OtherOutput;
pub use residual::{SIGNIFICANCE, SMALLEST_ERROR_PERCENT, error_percent, records_with_model_error};

use imitated_lag::ImitatedLag;
use rotorlead_diagnose::Diagnosis;
use rotorlead_identify::check::{Findings, check_rate, check_record};
use rotorlead_identify::error::IdentifyError;
use rotorlead_identify::validate::{RecordValidation, validate};
use rotorlead_plant::{Catalog, Judgement, Model, Readiness};
use rotorlead_records::{Excitation, Experiment, Record, Topic};
use rotorlead_vehicle::{Asked, Recommendation, recommend};

/// What a lag may miss of a response, percent, and still be one to design with. Chosen: a step of 5 % is about the smallest that a
/// compensator is asked to sharpen; more would hide all of it, less refuses more models.
const LARGEST_ERROR_PERCENT: f64 = 5.0;
/// A time constant is known well enough to this part of it. Chosen: the gain of a lead far above its zero goes with the time constant, and
/// is off by 0.8 dB at one standard error.
const LARGEST_STD: f64 = 0.1;

/// A model beside records.
#[derive(Clone, Debug)]
pub struct Assessment {
    /// Whether a compensator may be built on it.
    pub judgement: Judgement,
    /// What to fly on the motor; `None` where there is no lag, or none that can be simulated.
    pub recommendation: Option<Recommendation>,
    /// Thrust beside speed, where a record of steps has both.
    pub other_output: Option<OtherOutput>,
    /// How well it explains each record.
    pub records: Result<Vec<RecordValidation>, IdentifyError>,
}

impl Assessment {
    fn from_claims(claims: Objections, in_doubt: bool, records: Result<Vec<RecordValidation>, IdentifyError>) -> Self {
        let judgement = Judgement { in_doubt, ..claims.judgement() };
        Self { judgement, recommendation: None, other_output: None, records }
    }
}

/// What is known beside the records that a model is judged by.
#[derive(Clone, Copy, Debug, Default)]
pub struct AssessmentContext<'a> {
    /// Whether the model rests on records that are too long to be in memory, too.
    pub long: bool,
    /// Whether a stand was divided out, which is still in the records.
    pub stand: bool,
    /// What a diagnosis of them found, and the same in a clause. Without one the judgement itself looks for the one effect that a lag
    /// imitates well.
    pub diagnosis: Option<(&'a Diagnosis, &'a str)>,
}

/// Judges `model` by the records of `experiment`.
#[must_use]
pub fn assess(experiment: &Experiment, model: &Model, known: AssessmentContext) -> Assessment {
    let mut claims = Objections::default();
    if model.points.is_empty() {
        claims.add(
            Readiness::MeasureAgain,
            "the records show a static map alone: record a multisine or a staircase".to_owned(),
        );
        return Assessment::from_claims(claims, false, validate(experiment, model));
    }
    let records = validate(experiment, model);
    // Nothing below is worth more than the numbers.
    let in_doubt = claims.add_findings(experiment, model);
    if known.long {
        let reason =
            "there are records too long to be compared while they are read: `rotorlead validate` compares them";
        claims.add(Readiness::MeasureAgain, reason.to_owned());
    }
    match &records {
        _ if known.stand => claims.add(
            Readiness::ReadyWithinLimits,
            "a stand was divided out, and no record is without it: what the lag leaves is known of the fit alone"
                .to_owned(),
        ),
        _ if model.is_from_flight() => claims.add(
            Readiness::ReadyWithinLimits,
            "identified in flight, where gusts answer for a part of every response: the interval is that of simulated flights, and no record \
             is free of them"
                .to_owned(),
        ),
        // All of them are long.
        Ok(records) if records.is_empty() && known.long => {}
        Ok(records) => claims.add_residual(experiment, model, records, known.diagnosis),
        Err(error) => claims.add(Readiness::MeasureAgain, format!("the model was compared with no record: {error}")),
    }
    claims.add_points(experiment, model);
    let other_output = records.is_ok().then(|| OtherOutput::from_experiment(experiment, model)).flatten();
    for limit in gain::lost(model).into_iter().chain(other_output.as_ref().and_then(OtherOutput::limit)) {
        claims.add(Readiness::ReadyWithinLimits, limit);
    }
    let assessment = Assessment::from_claims(claims, in_doubt, records);
    let recommendation = recommend(model, assessment.judgement.doubt(), &Asked::default()).ok();
    Assessment { recommendation, other_output, ..assessment }
}

/// What speaks against a model.
#[derive(Clone, Debug, Default)]
struct Objections(Vec<Objection>);

#[derive(Clone, Debug)]
struct Objection {
    /// The best word that it leaves.
    word: Readiness,
    reason: String,
}

impl Objections {
    fn add(&mut self, word: Readiness, reason: String) {
        self.0.push(Objection { word, reason });
    }

    fn add_residual(
        &mut self,
        experiment: &Experiment,
        model: &Model,
        records: &[RecordValidation],
        diagnosis: Option<(&Diagnosis, &str)>,
    ) {
        match records_with_model_error(records) {
            None if records.iter().any(|record| record.residual_power.is_some()) => self.add(
                Readiness::MeasureAgain,
                "the lag leaves less than the noise of the records, which no model can: readings that repeat, or levels that drift or \
                 hum, make the noise seem larger, so that nothing is known of what the lag leaves"
                    .to_owned(),
            ),
            None => self.add(
                Readiness::MeasureAgain,
                "no record shows its noise, so that nothing is known of what the lag leaves: hold each level for 14 time constants and \
                 32 rows at the least, log the response in finer steps where it stands still there, or record more periods"
                    .to_owned(),
            ),
            Some(wrong) => {
                let worst = wrong.into_iter().max_by(|a, b| error_percent(a).total_cmp(&error_percent(b)));
                if let Some(record) = worst {
                    // What a model misses of other records than those it was fitted to may be another motor's.
                    let is_of_them = records.iter().any(|record| record.fitted == Some(true));
                    let found = diagnosis.map(|(found, _)| found);
                    let imitated = is_of_them.then(|| ImitatedLag::find(experiment, model, found)).flatten();
                    self.add_error(record, imitated, diagnosis.map(|(_, in_short)| in_short));
                }
            }
        }
        let is_held_out =
            |record: &RecordValidation| record.fitted == Some(false) && record.judged_residual().is_some();
        if records.iter().any(is_held_out) {
            return;
        }
        let reason = match records.iter().all(|record| record.fitted.is_some()) {
            true => {
                "no record was held out that shows its noise: add a second run (`rotorlead import --append`) and give it role = \"validate\" in experiment.toml"
            }
            false => {
                "the model does not say what it was fitted to, so that no record is known to be held out: identify it again"
            }
        };
        self.add(Readiness::MeasureAgain, reason.to_owned());
    }

    /// Of a record that shows the model to be wrong, with what a diagnosis `found` in place of the advice to ask one.
    fn add_error(&mut self, record: &RecordValidation, imitated: Option<ImitatedLag>, found: Option<&str>) {
        let mut add = |word, reason: String, advice: &str| {
            let more = found.map_or_else(|| advice.to_owned(), |found| format!("; {found}"));
            self.add(word, reason + &more);
        };
        let missed = format!(
            "the lag misses {:.1} % of the response of {}, more than its noise",
            error_percent(record),
            record.file
        );
        if let Some(imitated) = imitated {
            let reason =
                if imitated.is_no_lag() { imitated.reason() } else { format!("{missed}; {}", imitated.reason()) };
            let word = match imitated.is_no_lag() || error_percent(record) > LARGEST_ERROR_PERCENT {
                true => Readiness::NotALag,
                false => Readiness::ReadyWithinLimits,
            };
            let advice = format!(": {}; or see `rotorlead diagnose`", imitated.advice());
            add(word, reason, &advice);
        } else if error_percent(record) > LARGEST_ERROR_PERCENT {
            add(Readiness::NotALag, missed, ": `rotorlead diagnose` looks for what is missing");
        } else {
            let reason = format!("{missed}: expect as much of what is built on it");
            add(Readiness::ReadyWithinLimits, reason, ", or see `rotorlead diagnose`");
        }
    }

    /// Of what `rotorlead check` finds in the records, whether any number means something else than its column says.
    fn add_findings(&mut self, experiment: &Experiment, model: &Model) -> bool {
        let mut findings = Findings::default();
        for record in &experiment.records {
            findings.extend(check_record(experiment, record, false));
            findings.extend(check_rate(record, &model.points));
        }
        let findings = findings.sorted();
        let grave = findings.iter().find(|finding| finding.is_grave());
        if let Some(finding) = grave {
            self.add(Readiness::MeasureAgain, format!("the numbers are in doubt: {}", finding.sentence()));
        }
        // One of each: records of one logger have the same faults.
        for topic in [Topic::Sampling, Topic::Response] {
            if let Some(finding) = findings.iter().find(|finding| finding.topic == topic) {
                self.add(Readiness::ReadyWithinLimits, finding.sentence());
            }
        }
        grave.is_some()
    }

    /// Of the operating points.
    fn add_points(&mut self, experiment: &Experiment, model: &Model) {
        if let [point] = &model.points[..] {
            let reason = format!("the lag is known at u_nom {} alone: record at a second level", point.nominal);
            self.add(Readiness::MeasureAgain, reason);
        }
        let part = |point: &rotorlead_plant::Point| point.time_constant_s_std.unwrap_or(0.0) / point.time_constant_s;
        let worst = model.points.iter().max_by(|a, b| part(a).total_cmp(&part(b)));
        if let Some(point) = worst.filter(|point| part(point) > LARGEST_STD) {
            let is_steps = |record: &Record| matches!(record.excitation, Excitation::Staircase | Excitation::Step);
            let remedy = match experiment.records.iter().all(is_steps) {
                true => "record more steps to it, both from below and from above",
                false => "record it longer, or with a larger amplitude",
            };
            let reason = format!(
                "the time constant at u_nom {:.3} is known to {:.0} % only: {remedy}",
                point.nominal,
                100.0 * part(point)
            );
            self.add(Readiness::MeasureAgain, reason);
        }
    }

    /// The worst word with all reasons, those of worse words first.
    fn judgement(&self) -> Judgement {
        let mut claims: Vec<&Objection> = self.0.iter().collect();
        claims.sort_by_key(|claim| std::cmp::Reverse(claim.word));
        Judgement {
            state: claims.first().map_or(Readiness::Ready, |claim| claim.word),
            limits: claims.iter().map(|claim| claim.reason.clone()).collect(),
            in_doubt: false,
        }
    }
}

/// What the catalog says of what to do about a kind of effect.
fn remedy(kind: &str) -> &'static str {
    Catalog::standard().find(kind).expect("the catalog has it").remedy
}

#[cfg(test)]
mod tests;
