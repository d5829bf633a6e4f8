//! `rotorlead report`

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::Args;
use miette::{IntoDiagnostic as _, WrapErr as _};
use serde_json::{Value, json};

use super::check::warn;
use super::diagnose::verdict as diagnosed;
use super::identify::{Identified, identify, transform};
use super::outcome::{JsonOption, Outcome, wrapped};
use super::report_option::{FiguresOption, this_command};
use super::{progress, report_pages};
use crate::design::{BandwidthPoint, Chain, DesignOptions, bandwidths, design};
use crate::diagnose::{Diagnosis, NamedEffect, Options, diagnose, fill_in_esc_commands};
use crate::files::{check_writable, write_file};
use crate::identify::check::{Finding, Findings, Topic, of_record};
use crate::identify::{FirstOrderOptions, MeasuredBandwidth, RecordValidation, validate};
use crate::plant::{Catalog, Model};
use crate::record::{Experiment, LongRecord};
use crate::report::{
    Report, Section, Tone, Verdict, bandwidth_section, design_section, diagnosis_section, diagnosis_tone,
    excitation_section, measured_response, simulation_and_experiment, validation_section, with_std,
};

use super::bandwidth::RESAMPLES;

/// Where the bootstrap of measured bandwidths starts.
const SEED: u64 = 1;
/// Width of what is said.
const WIDTH: usize = 80;

/// Everything that an experiment says, in one report: identification, validation, compensator, bandwidth and diagnosis
///
/// One HTML file with the verdict, tables, interactive figures and the commands that give each part by itself. It needs no
/// network. A part that the records do not allow is left out, and the report says why.
#[derive(Args, Debug)]
pub struct ReportCommand {
    /// The experiment's folder
    #[arg(value_name = "DIR")]
    experiment: PathBuf,
    /// Where the report goes
    #[arg(long, value_name = "FILE", default_value = "report.html")]
    pub(super) out: PathBuf,
    /// The model to be judged; unless given, DIR/model.toml where it is there, or else the lags that the records show
    #[arg(long, value_name = "FILE")]
    model: Option<PathBuf>,
    /// Leave the diagnosis out, which takes the longest
    #[arg(long)]
    no_diagnosis: bool,
    #[command(flatten)]
    figures: FiguresOption,
    #[command(flatten)]
    pub(super) json: JsonOption,
}

/// What came of one part: a result, or why there is none.
type Part<T> = Result<T, String>;

impl ReportCommand {
    /// Runs the command.
    pub fn run(&self) -> miette::Result<Outcome> {
        check_writable(&self.out)?;
        self.figures.check()?;
        let given = self.given();
        let model = given.as_deref().map(Model::read).transpose()?;
        let experiment = Experiment::read(&self.experiment)?;
        let parts = Parts::of(&experiment, &self.experiment, model.as_ref(), !self.no_diagnosis)?;
        let report = parts.report(self, &experiment, given.as_deref());
        let figures = self.figures.write(&report)?;
        write_file(&self.out, report.html()?.as_bytes())?;

        let mut text = format!("{}\n", wrapped(&report.verdict.headline, WIDTH, ""));
        for sentence in &report.verdict.sentences {
            writeln!(text, "{}", wrapped(sentence, WIDTH, "")).into_diagnostic()?;
        }
        text.push_str(&figures);
        writeln!(text, "\nReport: {}", self.out.display()).into_diagnostic()?;
        Ok(Outcome { text, json: parts.json(&report) })
    }

    /// The model that is judged: the one given, or the one that lies with the records.
    fn given(&self) -> Option<PathBuf> {
        self.model.clone().or_else(|| Some(self.experiment.join("model.toml")).filter(|file| file.is_file()))
    }
}

/// All that was computed.
struct Parts {
    identified: Part<Identified>,
    /// The given model, or the one identified.
    model: Model,
    validated: Part<Vec<RecordValidation>>,
    designed: Part<(rotorlead::design::LeadDesign, Vec<BandwidthPoint>)>,
    measured: Vec<MeasuredBandwidth>,
    diagnosed: Option<Part<Diagnosis>>,
    /// What `rotorlead check` finds in the records.
    findings: Vec<Finding>,
}

/// How large each effect is, and what it cannot be told from.
fn sizes(found: &Diagnosis) -> Vec<String> {
    let of_effect = |effect: &NamedEffect| {
        let values = effect.parameters.iter().map(|(parameter, estimate)| {
            let value = with_std(estimate.value, Some(estimate.std), 1.0, 4);
            format!("{} {value} {}", parameter.name, parameter.unit).trim_end().to_owned()
        });
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

/// Whether a finding makes all numbers of a record others than they say: a unit or a sign.
fn is_grave(finding: &Finding) -> bool {
    matches!(finding.topic, Topic::TimeUnit | Topic::CommandUnit | Topic::ResponseUnit | Topic::Sign)
}

/// A finding with its remedy.
fn in_words(finding: &Finding) -> String {
    finding.remedy.as_ref().map_or_else(|| finding.message.clone(), |remedy| format!("{}: {remedy}", finding.message))
}

impl Parts {
    fn of(experiment: &Experiment, folder: &Path, given: Option<&Model>, with_diagnosis: bool) -> miette::Result<Self> {
        let bar = progress::estimate("identifying", super::diagnose::STEPS);
        let long: &[LongRecord] = &[];
        let identified = transform(experiment, long)
            .map_err(miette::Report::from)
            .and_then(|long| identify(experiment, &long, FirstOrderOptions::default().delay_level, None))
            .map(|mut identified| {
                super::identify_map::add(experiment, &mut identified);
                identified
            });
        let model = match (given, &identified) {
            (Some(model), _) => model.clone(),
            (None, Ok(identified)) => identified.model.clone(),
            (None, Err(_)) => {
                return identified
                    .map(|_| unreachable!("it is an error"))
                    .wrap_err_with(|| format!("nothing was identified from `{}`", folder.display()));
            }
        };
        bar.set_message("validating");
        let validated = validate(experiment, &model).map_err(|error| said(&error.into()));
        let mut findings = Findings::default();
        experiment.records.iter().for_each(|record| findings.extend(of_record(experiment, record, false)));
        if let Ok(identified) = &identified {
            warn(experiment, identified, false, &mut findings);
        }
        let findings = findings.sorted();
        let designed = if findings.iter().any(is_grave) {
            Err("the numbers of the records are in doubt, and a compensator would rest on them".to_owned())
        } else {
            design(&model, &DesignOptions::default()).map_err(|error| said(&error.into())).map(|design| {
                let points = bandwidths(&model, Chain::Continuous(design.lead()));
                (design, points)
            })
        };
        bar.set_message("measuring");
        let found = identified.as_ref().ok().and_then(|identified| identified.found.as_ref());
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
        bar.finish_and_clear();
        let identified = identified.map_err(|error| said(&error));
        Ok(Self { identified, model, validated, designed, measured, diagnosed, findings })
    }

    fn report(&self, command: &ReportCommand, experiment: &Experiment, given: Option<&Path>) -> Report {
        let found = self.identified.as_ref().ok().and_then(|identified| identified.found.as_ref());
        let mut sections = match &self.identified {
            Ok(identified) => identified.sections(experiment),
            Err(reason) => {
                vec![left_out("identification", "Identified lags", reason), excitation_section(experiment)]
            }
        };
        // The records come first.
        sections.reverse();
        sections.push(match &self.validated {
            Ok(records) => validation_section(records, experiment.output),
            Err(reason) => left_out("validation", "Validation", reason),
        });
        match &self.designed {
            Ok((design, points)) => {
                sections.push(design_section(design, &self.model));
                let mut bandwidth = bandwidth_section(points, &self.measured);
                if let Some(found) = found {
                    bandwidth.figures.extend(measured_response(found, found));
                    bandwidth.figures.extend(simulation_and_experiment(found, found, design));
                }
                sections.push(bandwidth);
            }
            Err(reason) => sections.push(left_out("compensator", "Compensator", reason)),
        }
        match &self.diagnosed {
            Some(Ok(found)) => sections.push(diagnosis_section(found, &diagnosed(found))),
            Some(Err(reason)) => sections.push(left_out("diagnosis", "Diagnosis", reason)),
            None => {}
        }
        let warnings: Vec<String> = self.findings.iter().map(in_words).collect();
        let judged = given.map(|file| report_pages::file("Model that was judged", file));
        Report {
            facts: [report_pages::records(experiment, &command.experiment), judged.into_iter().collect()].concat(),
            sections,
            commands: commands(&command.experiment, given, self.designed.is_ok()),
            verdict: self.verdict(warnings.len()),
            warnings,
            ..report_pages::report("Experiment", experiment.name.clone(), Verdict::new(Tone::Plain, ""))
        }
    }

    /// The diagnosis first where there is one: whether the model can be relied on. Then what was found on the way.
    fn verdict(&self, warnings: usize) -> Verdict {
        let mut verdicts = Vec::new();
        // Nothing below is worth more than the records.
        if let Some(finding) = self.findings.iter().find(|finding| is_grave(finding)) {
            let headline = "Something is wrong with the records, and all that follows rests on them.";
            verdicts.push(Verdict::new(Tone::Bad, headline).with(vec![format!("{}.", in_words(finding))]));
        }
        if let Some(Ok(found)) = &self.diagnosed {
            verdicts.push(Verdict::new(diagnosis_tone(found.verdict), diagnosed(found)).with(sizes(found)));
        }
        if self.identified.is_ok() {
            verdicts.push(report_pages::identified(&self.model, warnings));
        }
        // A diagnosis has compared the same records more closely.
        if let Ok(records) = &self.validated
            && !matches!(self.diagnosed, Some(Ok(_)))
        {
            verdicts.push(report_pages::validated(records));
        }
        match &self.designed {
            Ok((design, points)) => verdicts.push(report_pages::designed(design, points, 0)),
            Err(reason) => verdicts.push(Verdict::new(Tone::Attention, format!("No compensator: {reason}."))),
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

    fn json(&self, report: &Report) -> Value {
        let left_out = |part: Option<&String>| part.map_or(Value::Null, |reason| json!(reason));
        json!({
            "verdict": report.verdict.headline,
            "sentences": report.verdict.sentences,
            "points": self.model.points.iter().map(super::identify_tables::point_json).collect::<Vec<_>>(),
            "diagnosis": self.diagnosed.as_ref().and_then(|part| part.as_ref().ok()).map(|found| found.verdict.name()),
            "warnings": report.warnings,
            "left_out": {
                "identification": left_out(self.identified.as_ref().err()),
                "validation": left_out(self.validated.as_ref().err()),
                "compensator": left_out(self.designed.as_ref().err()),
                "diagnosis": left_out(self.diagnosed.as_ref().and_then(|part| part.as_ref().err())),
            },
            "figures": report.sections.iter().flat_map(|section| &section.figures).map(|figure| &figure.name).collect::<Vec<_>>(),
        })
    }
}

/// An error with what to do, as a sentence.
fn said(error: &miette::Report) -> String {
    let help = error.help().map(|help| format!(": {help}")).unwrap_or_default();
    format!("{error}{help}")
}

/// A part that there is not.
fn left_out(name: &str, title: &str, reason: &str) -> Section {
    Section { text: vec![format!("Left out: {reason}.")], ..Section::new(name, title) }
}

/// The report again, and each part by itself.
fn commands(folder: &Path, given: Option<&Path>, is_designed: bool) -> Vec<String> {
    let quoted = |path: &Path| {
        let path = path.display().to_string();
        shlex::try_quote(&path).map_or_else(|_| path.clone(), std::borrow::Cow::into_owned)
    };
    let (folder, model) = (quoted(folder), given.map_or_else(|| "model.toml".to_owned(), quoted));
    let mut commands = vec![this_command()];
    if given.is_none() {
        commands.push(format!("rotorlead identify {folder} --out {model}"));
    }
    commands.push(format!("rotorlead validate {folder} --model {model}"));
    if is_designed {
        commands.push(format!("rotorlead design --model {model} --out compensator.toml"));
        commands.push(format!("rotorlead bandwidth --model {model} --records {folder}"));
    }
    commands.push(if given.is_some() {
        format!("rotorlead diagnose {folder} --model {model}")
    } else {
        format!("rotorlead diagnose {folder}")
    });
    commands
}
