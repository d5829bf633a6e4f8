//! One motor: its logs, and what was made of them. What each question of [`Request`] is answered with stands where it is answered.

mod logs;
#[cfg(test)]
mod tests;

use base64::Engine as _;
use rotorlead_answer::{Answer, Fact, Report};
use rotorlead_export::{ExportSettings, Exported, Exporter, c_header};
use rotorlead_plant::{CompensatorDesign, Judgement};
use rotorlead_records::Experiment;
use rotorlead_records::files::to_toml;
use rotorlead_report::{Fragment, html, table_html};
use rotorlead_results::{
    Asked, DesignRequest, Kind, Overview, Watch, answer_page, diagnosis_answer, experiment_facts, export_warnings,
    flight_section, recommendation_table,
};
use rotorlead_vehicle::{MotorControlKind, recommend};
use serde_json::{Value, json};

use crate::fault::Fault;
use crate::page::{page, verdict};
use crate::request::{FileName, KindName, PurposeName, Request, target};
use logs::{Given, Taken};

/// A motor, from its first log on.
#[derive(Default)]
pub struct Motor {
    given: Given,
    taken: Option<Taken>,
    /// All that the logs say, with the compensator that was shown last.
    answered: Option<Overview>,
    /// What gives the report of it on the command line, without the inverse that is tried.
    commands: Vec<String>,
}

impl Motor {
    /// Gives it a log, or a file of an experiment's folder. What was made of the others is out of date then.
    pub fn add(&mut self, name: String, bytes: Vec<u8>) {
        self.given.add(name, bytes);
        *self = Self { given: std::mem::take(&mut self.given), ..Self::default() };
    }

    /// Answers a question. `watch` gets what is done now, and how many steps of it are done.
    pub fn ask(&mut self, request: &Request, watch: &dyn Fn(&str, u32)) -> Result<Value, Fault> {
        match request {
            Request::Read { options, held_out } => {
                watch("reading", 0);
                self.answered = None;
                let taken = self.taken.insert(self.given.read(options, held_out)?);
                Ok(json!({
                    "name": taken.experiment.name,
                    "response": taken.experiment.output.option(),
                    "logs": taken.logs,
                    "findings": taken.findings,
                }))
            }
            Request::Answer { kind, purpose, diagnosis } => {
                let options = Request::report_options(*kind, *purpose, *diagnosis);
                let typed = self.taken.as_ref().and_then(|taken| taken.typed.as_ref());
                self.commands = typed.map(|typed| typed.report(&options)).unwrap_or_default();
                let kind = kind.map(|kind| kind.kind());
                let asked = Asked { model: None, kind, purpose: purpose.purpose(), with_diagnosis: *diagnosis };
                self.answer(asked, watch)
            }
            Request::Fly { natural_rad_s, purpose } => self.fly(*natural_rad_s, *purpose),
            Request::Export { target, compensated } => self.export(target, *compensated),
            Request::File { name } => self.file(*name),
        }
    }

    /// The report of an experiment in parts, beside what `identify`, `diagnose` and `report` give to programs.
    fn answer(&mut self, asked: Asked, watch: &dyn Fn(&str, u32)) -> Result<Value, Fault> {
        let taken = self.taken.as_ref().ok_or_else(no_logs)?;
        let experiment = &taken.experiment;
        let (stage, steps) = (std::cell::Cell::new("identifying"), std::cell::Cell::new(0));
        let watch = Watch {
            stage: &|now| {
                stage.set(now);
                steps.set(0);
                watch(now, 0);
            },
            step: &|| {
                steps.set(steps.get() + 1);
                watch(stage.get(), steps.get());
            },
        };
        // Another kind or purpose is another design for what was found.
        let known = self.answered.take();
        let mut overview = match known.filter(|known| known.diagnosed.is_some() == asked.with_diagnosis) {
            Some(mut known) => {
                known.design(
                    experiment,
                    &DesignRequest { kind: asked.kind, ..DesignRequest::default() },
                    asked.purpose,
                );
                known
            }
            None => Overview::from_experiment(experiment, self.given.folder(), asked, watch)
                .map_err(|error| Fault::from_identification(error, taken.has_logs()))?,
        };
        if let Ok(found) = &mut overview.identified {
            let provenance = found.identification.model.provenance.iter_mut().chain(&mut overview.model.provenance);
            provenance.for_each(|from| from.records_crc32.clone_from(&taken.checksum));
        }
        let report = report(taken, &overview, &self.commands);
        let mut answer = page(&report)?;
        let identified = overview.identified.as_ref().ok().map(|found| found.answer(experiment).json());
        let diagnosed = overview.diagnosed.as_ref().and_then(|part| part.as_ref().ok());
        let natural = overview.compensator.as_ref().and_then(natural_rad_s).or_else(|| compared_rad_s(&overview));
        answer["values"] = overview.values(experiment, &report).into();
        answer["identify"] = identified.into();
        answer["diagnose"] = diagnosed.map(|found| diagnosis_answer(found).json()).into();
        answer["natural_rad_s"] = natural.into();
        self.answered = Some(overview);
        Ok(answer)
    }

    /// An inverse of one natural frequency beside the bare motor and the lead.
    fn fly(&mut self, natural_rad_s: f64, purpose: PurposeName) -> Result<Value, Fault> {
        let (Some(taken), Some(overview)) = (&self.taken, &mut self.answered) else { return Err(no_logs()) };
        let request =
            DesignRequest { kind: Some(Kind::Inverse), natural_rad_s: Some(natural_rad_s), ..DesignRequest::default() };
        // As the report would have it: refused where it is, and for what a diagnosis has added.
        overview.design(&taken.experiment, &request, purpose.purpose());
        let (model, designed) = (&overview.model, &overview.designed);
        let asked =
            rotorlead_vehicle::Asked { natural_rad_s: Some(natural_rad_s), ..rotorlead_vehicle::Asked::default() };
        let found = recommend(model, model.judgement().and_then(Judgement::doubt), &asked)
            .map_err(|error| Fault::from(miette::Report::from(error)))?;
        let says = designed.as_ref().map(|answer| verdict(&answer.verdict)).ok().transpose()?;
        let compensator = overview.compensator.as_ref().map(CompensatorDesign::stored);
        let with_diagnosis = overview.diagnosed.is_some();
        let options = Request::report_options(Some(KindName::Inverse), purpose, with_diagnosis);
        self.commands = taken.typed.as_ref().map(|typed| typed.report(&options)).unwrap_or_default();
        // No command designs for what a diagnosis has added but the report, which has its own natural frequency.
        let typed = taken.typed.as_ref().filter(|_| compensator.is_some() && !with_diagnosis);
        let inverse = typed.map(|typed| typed.inverse(natural_rad_s)).into_iter().flatten();
        let commands: Vec<_> = self.commands.iter().cloned().chain(inverse).collect();
        Ok(json!({
            "section": Fragment::new(&flight_section(&found))?,
            "table": table_html(&recommendation_table(&found))?,
            "refused": designed.as_ref().err(),
            "says": says,
            "compensator": compensator,
            "commands": commands,
        }))
    }

    /// A file of `rotorlead export`.
    fn export(&self, name: &str, compensated: bool) -> Result<Value, Fault> {
        let target = target(name)?;
        let overview = self.answered()?;
        let model = &overview.model;
        if let Some(purpose) = target.foreign("--compensator").filter(|_| compensated) {
            let message = format!("a compensator is {purpose}, and {name} has none");
            return Err(Fault::new(message, "leave the compensator out"));
        }
        let compensator = if compensated { Some(compensator(overview)?) } else { None };
        let settings =
            ExportSettings { compensator, warnings: export_warnings(model, compensator), ..ExportSettings::default() };
        let experiment = self.taken.as_ref().map(|taken| &taken.experiment);
        let Exported { content, values } =
            Exporter::new(model, experiment, settings).export(target).map_err(|refused| {
                let reasons = refused.iter().map(|refusal| format!("{}: {}", refusal.full_name(), refusal.why));
                Fault::new(
                    format!("nothing is known for {name}: {}", reasons.collect::<Vec<_>>().join("; ")),
                    "docs/export.md says what each parameter is from, and what to record",
                )
            })?;
        let encoded = (!target.is_text()).then(|| base64::prelude::BASE64_STANDARD.encode(&content));
        Ok(json!({
            "file": format!("{}.{}", target.name(), target.extension()),
            "text": target.is_text().then(|| String::from_utf8_lossy(&content)),
            "base64": encoded,
            "values": values,
        }))
    }

    /// A file to keep.
    fn file(&self, name: FileName) -> Result<Value, Fault> {
        let overview = self.answered()?;
        let (file, text) = match name {
            FileName::Model => ("model.toml", to_toml(&overview.model)),
            FileName::Compensator => ("compensator.toml", compensator(overview)?.text("compensator.toml".as_ref())?),
            FileName::Header => ("compensator.h", c_header(compensator(overview)?)),
            FileName::Report => {
                let taken = self.taken.as_ref().ok_or_else(no_logs)?;
                ("report.html", html(&report(taken, overview, &self.commands))?)
            }
        };
        Ok(json!({ "file": file, "text": text }))
    }

    fn answered(&self) -> Result<&Overview, Fault> {
        self.answered.as_ref().ok_or_else(no_logs)
    }
}

/// The compensator that was shown last.
fn compensator(overview: &Overview) -> Result<&CompensatorDesign, Fault> {
    let none = || Fault::new("there is no compensator", "choose one that is not refused");
    overview.compensator.as_ref().ok_or_else(none)
}

fn no_logs() -> Fault {
    Fault::new("no log was taken", "give one, and say what it does not say of itself")
}

fn report(taken: &Taken, overview: &Overview, commands: &[String]) -> Report {
    let experiment = &taken.experiment;
    Report {
        facts: facts(experiment, taken),
        verdict: overview.verdict(experiment),
        warnings: overview.warnings(),
        sections: overview.sections(experiment),
        commands: commands.to_vec(),
        ..answer_page("Experiment", experiment.name.clone(), &Answer::default())
    }
}

fn facts(experiment: &Experiment, taken: &Taken) -> Vec<Fact> {
    let mut facts = experiment_facts(experiment, &taken.names.join(", "));
    facts.extend(taken.checksum.iter().map(|sum| Fact::new("CRC-32 of these files", sum.clone())));
    facts
}

/// The natural frequency of an inverse.
fn natural_rad_s(design: &CompensatorDesign) -> Option<f64> {
    design.as_inverse().map(|inverse| inverse.design().reference().omega_f_rad_s)
}

/// That of the first inverse which was compared.
fn compared_rad_s(overview: &Overview) -> Option<f64> {
    let compared = &overview.assessment.recommendation.as_ref()?.candidates;
    compared.iter().find_map(|one| match one.actuator {
        MotorControlKind::Inverse { omega_f_rad_s } => Some(omega_f_rad_s),
        _ => None,
    })
}
