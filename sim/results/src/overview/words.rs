//! What an overview says: its summary, sections and values.

use crate::json_object::json_object;
use rotorlead_answer::words::sentence;
use rotorlead_answer::{Report, Section, Table, Tone, Verdict};
use rotorlead_assess::Assessment;
use rotorlead_diagnose::{Diagnosis, NamedEffect};
use rotorlead_identify::validate::RecordValidation;
use rotorlead_numerics::sample::extent;
use rotorlead_plant::Model;
use rotorlead_records::{Experiment, Finding};
use serde_json::{Map, Value, json};

use super::{Overview, Part, said};
use crate::{
    JudgementValues, diagnosis_answer, effect_notes, excitation_section, flight_section, judged_verdict,
    parameter_with_std, points_table, recommendation_table, to_fly_in_short, validation_answer,
};

/// By when warnings of the records are to be read.
const MODEL_USED: &str = "the model is used";

impl Overview {
    /// What the reader should know, each with what to do: of the records, then of the compensator.
    #[must_use]
    pub fn warnings(&self) -> Vec<String> {
        self.grouped_findings().iter().map(in_words).collect()
    }

    /// The same as findings, those with one remedy together.
    #[must_use]
    pub fn grouped_findings(&self) -> Vec<Finding> {
        let of_design = self.designed.iter().flat_map(|answer| in_groups(&answer.findings));
        in_groups(&self.findings).into_iter().chain(of_design).collect()
    }

    /// A part for each question; one that has no answer says why.
    #[must_use]
    pub fn sections(&self, experiment: &Experiment) -> Vec<Section> {
        let mut sections = match &self.identified {
            Ok(found) => vec![found.answer(experiment).section(), excitation_section(experiment)],
            Err(reason) => {
                vec![left_out("identification", "Identified lags", reason), excitation_section(experiment)]
            }
        };
        let Assessment { judgement, recommendation, .. } = &self.assessment;
        sections.splice(0..0, recommendation.iter().map(flight_section));
        sections.push(match self.validated() {
            Ok(records) => validation_answer(records, judgement, recommendation.as_ref(), experiment.output).section(),
            Err(reason) => left_out("validation", "Validation", &reason),
        });
        match &self.diagnosed {
            Some(Ok(found)) => sections.push(diagnosis_answer(found).section()),
            Some(Err(reason)) => sections.push(left_out("diagnosis", "Diagnosis", reason)),
            None => {}
        }
        match &self.designed {
            Ok(answer) => sections.push(answer.section()),
            Err(reason) => sections.push(Section {
                tables: recommendation.iter().map(recommendation_table).collect(),
                ..left_out("compensator", "Compensator", reason)
            }),
        }
        sections
    }

    /// The diagnosis first where there is one: whether the model can be relied on. Then what was found on the way.
    #[must_use]
    pub fn verdict(&self, experiment: &Experiment) -> Verdict {
        let Assessment { judgement, recommendation, .. } = &self.assessment;
        let warnings = in_groups(&self.findings).len();
        let mut verdicts = Vec::new();
        // Nothing below is worth more than the records.
        if let Some(finding) = self.findings.iter().find(|finding| finding.is_grave()) {
            let headline = "Something is wrong with the records, and all that follows rests on them.";
            verdicts.push(Verdict::new(Tone::Bad, headline).with(vec![format!("{}.", in_words(finding))]));
        }
        if let Some(Ok(found)) = &self.diagnosed {
            verdicts.push(Verdict { sentences: sizes(found), ..diagnosis_answer(found).verdict });
        }
        // A diagnosis of steps has one lag for all levels, beside which those of each level stay.
        let own = self.identified.as_ref().ok().filter(|_| !self.is_given);
        match (self.missing().filter(|_| !self.is_of_steps()), own) {
            (None, Some(found)) => verdicts.push(warned(found.answer(experiment).verdict, warnings, MODEL_USED)),
            (missing, _) => {
                if let Some(found) = missing {
                    let lags = format!("With that in the model: {}.", lags(&found.model));
                    verdicts.push(warned(Verdict::new(Tone::Plain, lags), warnings, MODEL_USED));
                }
                verdicts.push(judged_verdict(judgement));
                let to_fly = recommendation.iter().map(|found| sentence(&to_fly_in_short(found)));
                verdicts.extend(to_fly.map(|sentence| Verdict::new(Tone::Plain, sentence)));
            }
        }
        if self.diagnosed.is_none() {
            let unasked = "Whether more acts than a lag was not asked: the diagnosis says it, which was left out.";
            verdicts.push(Verdict::new(Tone::Plain, unasked));
        }
        match &self.designed {
            Ok(answer) => {
                verdicts.push(warned(answer.verdict.clone(), answer.findings.len(), "the compensator flies"));
            }
            Err(reason) => verdicts.push(Verdict::new(Tone::Attention, format!("No compensator: {reason}."))),
        }
        if let Some(Ok(found)) = &self.diagnosed
            && let Some(next) = found.next_experiment()
        {
            verdicts.push(Verdict::new(Tone::Plain, format!("Next: {}", next.words)));
        }
        let tone = verdicts.iter().map(|verdict| verdict.tone).max().unwrap_or(Tone::Plain);
        let said = verdicts.into_iter().flat_map(|verdict| std::iter::once(verdict.headline).chain(verdict.sentences));
        let mut said = said.collect::<Vec<_>>();
        if said.is_empty() {
            said.push("Nothing came of these records with this model.".to_owned());
        }
        let sentences = said.split_off(1);
        let headline = said.remove(0);
        Verdict { tone, headline, sentences }
    }

    /// The points of the model that is judged.
    fn points(&self, experiment: &Experiment) -> Table {
        let own = self.identified.as_ref().ok().filter(|_| !self.is_given);
        let fitted = own.and_then(|found| found.identification.lags.in_frequency());
        points_table(&self.model.points, experiment.output, fitted)
    }

    /// The same for programs, beside the `verdict`, `warnings` and `sections` that people see.
    #[must_use]
    pub fn values(&self, experiment: &Experiment, report: &Report) -> Map<String, Value> {
        let Assessment { judgement, recommendation, .. } = &self.assessment;
        let figures = report.sections.iter().flat_map(|section| &section.figures).map(|figure| &figure.name);
        json_object(&json!({
            "verdict": report.verdict.headline,
            "sentences": report.verdict.sentences,
            "judgement": JudgementValues::new(judgement, recommendation.as_ref()),
            "points": self.points(experiment).json(),
            "candidates": recommendation.as_ref().map(|found| recommendation_table(found).json()),
            "diagnosis": self.diagnosed.as_ref().and_then(|part| part.as_ref().ok()).map(|found| found.verdict),
            "warnings": report.warnings,
            "left_out": {
                "identification": self.identified.as_ref().err(),
                "validation": self.validated().err(),
                "compensator": self.designed.as_ref().err(),
                "diagnosis": self.diagnosed.as_ref().and_then(|part| part.as_ref().err()),
            },
            "figures": figures.collect::<Vec<_>>(),
        }))
    }

    /// How well the model explains each record.
    fn validated(&self) -> Part<&[RecordValidation]> {
        let records = self.assessment.records.as_ref();
        records.map(Vec::as_slice).map_err(|error| said(&error.clone().into()))
    }
}

/// The lags of a model, in a phrase.
#[must_use]
pub fn lags(model: &Model) -> String {
    if model.points.is_empty() {
        return "a static map alone, and no lag".to_owned();
    }
    let (low, high) = extent(&model.points.iter().map(|point| point.time_constant_s).collect::<Vec<_>>());
    if let [_] = model.points.as_slice() {
        return format!("one lag, time constant {:.1} ms, a pole at {:.2} rad/s", 1e3 * low, 1.0 / low);
    }
    format!(
        "{} lags, time constants from {:.1} to {:.1} ms, poles from {:.2} to {:.2} rad/s",
        model.points.len(),
        1e3 * low,
        1e3 * high,
        1.0 / high,
        1.0 / low
    )
}

/// The same verdict where there may be warnings below, to be read before `what` happens.
fn warned(verdict: Verdict, warnings: usize, what: &str) -> Verdict {
    let said = match warnings {
        0 => return verdict,
        1 => format!("There is a warning: read it before {what}."),
        count => format!("There are {count} warnings: read them before {what}."),
    };
    let sentences = [verdict.sentences, vec![said]].concat();
    Verdict { tone: verdict.tone.max(Tone::Attention), sentences, ..verdict }
}

/// How large each effect is, and what is to be said of it.
fn sizes(found: &Diagnosis) -> Vec<String> {
    let of_effect = |effect: &NamedEffect| {
        let values = effect
            .parameters
            .iter()
            .map(|(parameter, estimate)| format!("{} {}", parameter.name, parameter_with_std(parameter, estimate)));
        let values = values.collect::<Vec<_>>().join(", ");
        format!("The {}: {values}. {}", effect.kind.title, effect_notes(effect).join(" "))
    };
    found.effects.iter().map(of_effect).collect()
}

/// A finding with its remedy.
fn in_words(finding: &Finding) -> String {
    [&finding.message].into_iter().chain(&finding.remedy).map(String::as_str).collect::<Vec<_>>().join(": ")
}

/// All of them; those that follow each other with one remedy, as of one lack at several nominal commands, together.
fn in_groups(findings: &[Finding]) -> Vec<Finding> {
    let is_one = |a: &Finding, b: &Finding| a.severity == b.severity && a.remedy.is_some() && a.remedy == b.remedy;
    let together = |alike: &[Finding]| {
        let messages: Vec<&str> = alike.iter().map(|finding| finding.message.as_str()).collect();
        Some(Finding { message: messages.join("; "), ..alike.first()?.clone() })
    };
    findings.chunk_by(is_one).filter_map(together).collect()
}

/// A part that there is not.
fn left_out(name: &str, title: &str, reason: &str) -> Section {
    Section { text: vec![format!("Left out: {reason}.")], ..Section::new(name, title) }
}

#[cfg(test)]
mod tests {
    use rotorlead_records::{Severity, Topic};

    use super::*;

    #[test]
    fn findings_that_follow_each_other_with_one_remedy_say_it_once() {
        let finding = |message: &str, remedy: Option<&str>| Finding {
            severity: Severity::Warning,
            topic: Topic::Identification,
            file: None,
            row: None,
            message: message.to_owned(),
            remedy: remedy.map(str::to_owned),
        };
        let findings = [
            finding("u_nom 0.4: a", Some("record longer")),
            finding("u_nom 0.5: a", Some("record longer")),
            finding("b", None),
            finding("c", None),
            finding("d", Some("record less")),
        ];
        let grouped: Vec<String> = in_groups(&findings).iter().map(in_words).collect();
        assert_eq!(grouped, ["u_nom 0.4: a; u_nom 0.5: a: record longer", "b", "c", "d: record less"]);
    }
}
