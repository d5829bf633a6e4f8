//! What a report says of its parts.

use std::path::Path;

use rotorlead_answer::words::sentence;
use rotorlead_answer::{Report, Section, Table, Tone, Verdict};
use rotorlead_diagnose::{Diagnosis, NamedEffect};
use rotorlead_identify::design::redesign::KindOptions;
use rotorlead_identify::design::{DesignOptions, InverseOptions};
use rotorlead_records::import::shell_word;
use rotorlead_records::{Experiment, Finding};
use rotorlead_results::{
    JudgementValues, diagnosis_answer, excitation_section, flight_section, judged_verdict, parameter_with_std,
    points_table, recommendation_table, to_fly_in_short, validation_answer,
};
use serde_json::{Value, json};

use super::ReportCommand;
use super::parts::Parts;
use crate::measured::Measured;
use crate::report_option::this_command;
use crate::report_pages;

/// By when warnings of the records are to be read.
const MODEL_USED: &str = "the model is used";

impl Parts {
    /// All of it as one report. `given` is the file of the model that was judged.
    pub fn report(&self, command: &ReportCommand, experiment: &Experiment, given: Option<&Path>) -> Report {
        let of_records = in_groups(&self.findings);
        let of_design = self.designed.iter().flat_map(|answer| in_groups(&answer.findings));
        let judged = given.map(|file| report_pages::file("Model that was judged", file));
        Report {
            facts: [report_pages::records(experiment, command.measured.path()), judged.into_iter().collect()].concat(),
            sections: self.sections(experiment),
            commands: self.commands(&command.measured, given),
            verdict: self.verdict(experiment, of_records.len()),
            warnings: of_records.iter().cloned().chain(of_design).collect(),
            ..report_pages::report("Experiment", experiment.name.clone(), Verdict::new(Tone::Plain, ""))
        }
    }

    fn sections(&self, experiment: &Experiment) -> Vec<Section> {
        let mut sections = match &self.identified {
            Ok(found) => vec![found.answer(experiment).section(), excitation_section(experiment)],
            Err(reason) => {
                vec![left_out("identification", "Identified lags", reason), excitation_section(experiment)]
            }
        };
        sections.splice(0..0, self.recommendation.iter().map(flight_section));
        sections.push(match &self.validated {
            Ok(records) => {
                let recommendation = self.recommendation.as_ref();
                validation_answer(records, &self.judgement, recommendation, experiment.output).section()
            }
            Err(reason) => left_out("validation", "Validation", reason),
        });
        match &self.diagnosed {
            Some(Ok(found)) => sections.push(diagnosis_answer(found).section()),
            Some(Err(reason)) => sections.push(left_out("diagnosis", "Diagnosis", reason)),
            None => {}
        }
        match &self.designed {
            Ok(answer) => sections.push(answer.section()),
            Err(reason) => sections.push(Section {
                tables: self.recommendation.iter().map(recommendation_table).collect(),
                ..left_out("compensator", "Compensator", reason)
            }),
        }
        sections
    }

    /// The diagnosis first where there is one: whether the model can be relied on. Then what was found on the way.
    fn verdict(&self, experiment: &Experiment, warnings: usize) -> Verdict {
        let mut verdicts = Vec::new();
        // Nothing below is worth more than the records.
        if let Some(finding) = self.findings.iter().find(|finding| finding.is_grave()) {
            let headline = "Something is wrong with the records, and all that follows rests on them.";
            verdicts.push(
                Verdict::new(Tone::Bad, headline).with(vec![format!("{}.", in_words(std::slice::from_ref(finding)))]),
            );
        }
        if let Some(Ok(found)) = &self.diagnosed {
            verdicts.push(Verdict { sentences: sizes(found), ..diagnosis_answer(found).verdict });
        }
        // A diagnosis of steps has one lag for all levels, beside which those of each level stay.
        let own = self.identified.as_ref().ok().filter(|_| !self.is_given);
        match (self.missing().filter(|_| !self.is_of_steps()), own) {
            (None, Some(found)) => {
                verdicts.push(report_pages::warned(found.answer(experiment).verdict, warnings, MODEL_USED));
            }
            (missing, _) => {
                if let Some(found) = missing {
                    let lags = format!("With that in the model: {}.", report_pages::lags(&found.model));
                    verdicts.push(report_pages::warned(Verdict::new(Tone::Plain, lags), warnings, MODEL_USED));
                }
                verdicts.push(judged_verdict(&self.judgement));
                verdicts.extend(
                    self.recommendation
                        .iter()
                        .map(|found| Verdict::new(Tone::Plain, sentence(&to_fly_in_short(found)))),
                );
            }
        }
        if self.diagnosed.is_none() {
            let unasked =
                "Whether more acts than a lag was not asked: leave --no-diagnosis out, and the report says it.";
            verdicts.push(Verdict::new(Tone::Plain, unasked));
        }
        match &self.designed {
            Ok(answer) => verdicts.push(report_pages::warned(
                answer.verdict.clone(),
                answer.findings.len(),
                "the compensator flies",
            )),
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

    /// The same for programs.
    pub fn json(&self, report: &Report, experiment: &Experiment) -> Value {
        json!({
            "verdict": report.verdict.headline,
            "sentences": report.verdict.sentences,
            "judgement": JudgementValues::new(&self.judgement, self.recommendation.as_ref()),
            "points": self.points(experiment).json(),
            "candidates": self.recommendation.as_ref().map(|found| recommendation_table(found).json()),
            "diagnosis": self.diagnosed.as_ref().and_then(|part| part.as_ref().ok()).map(|found| found.verdict),
            "warnings": report.warnings,
            "left_out": {
                "identification": self.identified.as_ref().err(),
                "validation": self.validated.as_ref().err(),
                "compensator": self.designed.as_ref().err(),
                "diagnosis": self.diagnosed.as_ref().and_then(|part| part.as_ref().err()),
            },
            "figures": report.sections.iter().flat_map(|section| &section.figures).map(|figure| &figure.name).collect::<Vec<_>>(),
        })
    }

    /// The report again, and each part by itself.
    fn commands(&self, measured: &Measured, given: Option<&Path>) -> Vec<String> {
        let quoted = |path: &Path| shell_word(&path.display().to_string()).into_owned();
        let (folder, model) = (quoted(measured.as_folder()), given.map_or_else(|| "model.toml".to_owned(), quoted));
        let mut commands = vec![this_command()];
        commands.extend(measured.import_command());
        if given.is_none() {
            commands.push(format!("rotorlead identify {folder} --out {model}"));
        }
        commands.push(format!("rotorlead validate {folder} --model {model}"));
        let judged = given.map(|_| format!(" --model {model}")).unwrap_or_default();
        let papers = DesignOptions::default().omega_g_rad_s;
        let own = match &self.options {
            Ok(KindOptions::Lead(DesignOptions { omega_g_rad_s, .. })) if *omega_g_rad_s < papers => {
                format!(" --kind lead --omega-g {omega_g_rad_s:.1}")
            }
            Ok(KindOptions::Lead(_)) => " --kind lead".to_owned(),
            Ok(KindOptions::Inverse(InverseOptions { omega_f_rad_s: Some(omega), .. })) => {
                format!(" --kind inverse --natural {omega:.0}")
            }
            Ok(KindOptions::Inverse(_)) => " --kind inverse".to_owned(),
            Err(_) => String::new(),
        };
        let (extended, compensated) = (" --out-model improved.toml", " --redesign --out-compensator compensator.toml");
        // Steps have their lags level by level, which the compensator is designed for with or without effects.
        if self.missing().is_some() && !self.is_of_steps() {
            commands.push(format!("rotorlead diagnose {folder}{judged}{extended}{compensated}{own}"));
            return commands;
        }
        commands.push(format!("rotorlead diagnose {folder}{judged}"));
        if self.designed.is_ok() {
            commands.push(format!("rotorlead design --model {model}{own} --out compensator.toml"));
            commands
                .push(format!("rotorlead bandwidth --model {model} --compensator compensator.toml --records {folder}"));
        }
        commands
    }
}

/// How large each effect is, and what it cannot be distinguished from.
fn sizes(found: &Diagnosis) -> Vec<String> {
    let of_effect = |effect: &NamedEffect| {
        let values = effect
            .parameters
            .iter()
            .map(|(parameter, estimate)| format!("{} {}", parameter.name, parameter_with_std(parameter, estimate)));
        let values = values.collect::<Vec<_>>().join(", ");
        let others: Vec<&str> = effect.alternatives.iter().map(|kind| kind.title).collect();
        let beside = if others.is_empty() {
            String::new()
        } else {
            format!(" These records cannot tell it from: {}.", others.join(", "))
        };
        format!("The {}: {values}.{beside}", effect.kind.title)
    };
    found.effects.iter().map(of_effect).collect()
}

/// Findings of one remedy, with it.
fn in_words(alike: &[Finding]) -> String {
    let messages: Vec<&str> = alike.iter().map(|finding| finding.message.as_str()).collect();
    let remedy = alike.first().and_then(|finding| finding.remedy.as_deref());
    [messages.join("; ").as_str()].into_iter().chain(remedy).collect::<Vec<_>>().join(": ")
}

/// All of them; those that follow each other with one remedy, as of one lack at several nominal commands, together.
fn in_groups(findings: &[Finding]) -> Vec<String> {
    let is_one = |a: &Finding, b: &Finding| a.remedy.is_some() && a.remedy == b.remedy;
    findings.chunk_by(is_one).map(in_words).collect()
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
        assert_eq!(in_groups(&findings), ["u_nom 0.4: a; u_nom 0.5: a: record longer", "b", "c", "d: record less"]);
    }
}
