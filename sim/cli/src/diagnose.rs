//! `rotorlead diagnose`

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::Args;
use miette::{IntoDiagnostic as _, WrapErr as _};
use rotorlead_answer::Report;
use rotorlead_answer::Verdict as Headline;
use rotorlead_diagnose::{Diagnosis, NEEDS_STEADY_START, Options, Verdict, diagnose, fill_in_esc_commands};
use rotorlead_plant::{Catalog, Model};
use rotorlead_records::Experiment;
use rotorlead_records::files::{check_writable, write_file};
use rotorlead_results::{diagnosis_json, diagnosis_section, diagnosis_tone, effect_table, excess_table, gap_table};
use serde_json::json;

use super::diagnose_bandwidths::BandwidthArguments;
use super::outcome::{JsonOption, Outcome};
use super::redesign::RedesignArguments;
use super::replaced::written_to;
use super::report_option::ReportOption;
use super::{WrongUse, progress, report_pages};
use rotorlead_answer::words::wrapped;

/// Steps of a search that finds one effect: each kind is screened and some are fitted, twice.
pub(super) const STEPS: u64 = 60;
/// Width of what is said.
const WIDTH: usize = 80;

/// Finds where simulation and measurement disagree, names the effect that is missing, and shows the gap shrink
///
/// The base is the first-order lag at each nominal command: the given model's, or the one that the records show. Effects
/// are fitted to a part of the records, or to those that are not marked `validate`; the rest, to which no number is fitted,
/// helps to choose among them and shows the gap. Staircases and other records that do not repeat are compared from where the
/// motor runs steadily; of them whole steps are held out.
#[derive(Args, Debug)]
pub struct Diagnose {
    /// The experiment's folder
    #[arg(value_name = "DIR", conflicts_with = "bandwidths")]
    experiment: Option<PathBuf>,
    /// The model to be judged; unless given, the lags that the records show
    #[arg(long, value_name = "FILE")]
    model: Option<PathBuf>,
    /// Where the model with the effects that were found goes
    #[arg(long, value_name = "FILE")]
    out_model: Option<PathBuf>,
    /// Where the plan of the experiment that would say more goes, for `rotorlead simulate` and for a controller
    #[arg(long, value_name = "FILE", requires = "experiment")]
    out_plan: Option<PathBuf>,
    #[command(flatten)]
    report: ReportOption,
    #[command(flatten)]
    table: BandwidthArguments,
    #[command(flatten)]
    redesign: RedesignArguments,
    #[command(flatten)]
    pub(super) json: JsonOption,
}

impl Diagnose {
    /// Runs the command.
    pub fn run(&self) -> miette::Result<Outcome> {
        self.redesign.check()?;
        if self.table.table().is_some() && self.redesign.is_given() {
            return Err(WrongUse::new(
                "a redesign rests on an actuator's records, and a table of bandwidths has none",
                "leave --redesign out, or diagnose an experiment's folder: rotorlead diagnose DIR --redesign",
            )
            .into());
        }
        let model = self.model.as_deref().map(Model::read).transpose()?;
        if let (Some(table), Some(model), Some(file)) = (self.table.table(), &model, &self.model) {
            return self.table.run(table, model, file, self.out_model.as_deref(), &self.report);
        }
        let Some(folder) = &self.experiment else {
            return Err(WrongUse::new(
                "there is nothing to diagnose",
                "give an experiment's folder, `rotorlead diagnose DIR`, or a table of bandwidths with the model that it is \
                 held against, `rotorlead diagnose --bandwidths TABLE --model MODEL`",
            )
            .into());
        };
        let mut experiment = Experiment::read(folder)?;
        fill_in_esc_commands(&mut experiment, folder)?;
        if let Some(out) = &self.out_model {
            check_writable(out)?;
        }
        if let Some(out) = &self.out_plan {
            check_writable(out)?;
        }
        self.report.check()?;
        let catalog = Catalog::standard();
        let bar = progress::estimate("diagnosing", STEPS);
        let tick = || progress::step(&bar);
        let options = Options { model: model.as_ref(), catalog: &catalog, progress: &tick };
        let found = diagnose(&experiment, &options)
            .map_err(miette::Report::from)
            .wrap_err_with(|| format!("nothing was diagnosed from `{}`", folder.display()))?;
        bar.finish_and_clear();
        let mut text = words(&found);
        if let Some(out) = &self.out_model {
            found.model.write(out)?;
            writeln!(text, "\n{}", written_to(out)).into_diagnostic()?;
        }
        if let Some(out) = &self.out_plan {
            text.push_str(&write_plan(&found, out)?);
        }
        let (mut sentences, mut redesign_sections, mut redesign) = (Vec::new(), Vec::new(), None);
        if let Some(redesigned) = self.redesign.run(&found, experiment.esc_frame_hz)? {
            text.push_str(&redesigned.text);
            redesign = Some(redesigned.values);
            sentences.push(redesigned.verdict.to_owned());
            redesign_sections = redesigned.sections;
        }
        text.push_str(&self.report.write(|| {
            let given = self.model.as_deref().map(|model| report_pages::file("Model that was judged", model));
            let headline = Headline::new(diagnosis_tone(found.verdict), verdict(&found)).with(sentences);
            Report {
                facts: [report_pages::records(&experiment, folder), given.into_iter().collect()].concat(),
                sections: [vec![diagnosis_section(&found, None)], redesign_sections].concat(),
                ..report_pages::report("Diagnosis", format!("Diagnosis of {}", experiment.name), headline)
            }
        })?);
        let mut values = diagnosis_json(&found);
        if let Some(redesign) = redesign {
            values["redesign"] = json!(redesign);
        }
        let detail = if found.verdict == Verdict::Agrees { String::new() } else { excess_table(&found).text() };
        Ok(Outcome::new(text, &values).with_detail(detail))
    }
}

/// Writes the plan of the next experiment where there is one, and says so.
fn write_plan(found: &Diagnosis, out: &Path) -> miette::Result<String> {
    let Some(next) = found.next_experiment() else {
        return Ok(format!("\nNo further experiment needed: no plan is written to {}\n", out.display()));
    };
    write_file(out, next.file().into_diagnostic()?.as_bytes())?;
    Ok(format!("Its plan, {} records, is written to {}\n", next.plan.records.len(), out.display()))
}

pub(super) fn verdict(found: &Diagnosis) -> String {
    let names = || found.effects.iter().map(|effect| effect.kind.title).collect::<Vec<_>>().join(", and ");
    match found.verdict {
        Verdict::Agrees if found.minor.is_empty() => "Model and measurement agree: the residual is noise.".to_owned(),
        Verdict::Agrees => "Model and measurement agree: the residual is noise and what does not matter.".to_owned(),
        Verdict::Named => format!("Missing in the model: {}.", names()),
        Verdict::PartlyNamed => {
            let left = found.excess.1;
            // Where this is not the test that rejects, it is that of stationarity, which has a line of its own.
            let by = if left.is_noise() {
                String::new()
            } else {
                format!(": its chi-square is {:.0} where noise leaves {:.0}", left.sum, left.expected)
            };
            format!("Missing in the model: {}. A part of the residual stays unexplained{by}.", names())
        }
        Verdict::Unknown if found.has_free_map => format!(
            "One lag with the measured static map misses {:.1} % of the response, and no effect of the catalog explains it.",
            100.0 * found.gap.before
        ),
        Verdict::Unknown => "Model and measurement disagree, and no effect of the catalog explains it.".to_owned(),
    }
}

/// What became of each kind that was tried on logs.
fn decisions(found: &Diagnosis) -> String {
    let mut lines = vec!["Effects tried, with the log likelihood gained on training and held-out steps".to_owned()];
    lines.extend(found.decisions.iter().map(|decision| {
        let ids: Vec<&str> = decision.beside.iter().map(|kind| kind.id).collect();
        let beside = if ids.is_empty() { String::new() } else { format!(" beside {}", ids.join(", ")) };
        let gains = match (decision.held_out_gain, decision.score) {
            (Some(held_out), Some(score)) => {
                format!("{:+.1} training, {held_out:+.1} held-out, score {score:.1}", decision.fitted_gain)
            }
            _ => format!("{:+.1} training", decision.fitted_gain),
        };
        let text = format!("  {}{beside}: {gains}; {}", decision.kind.id, decision.outcome());
        wrapped(&text, WIDTH, "    ")
    }));
    lines.join("\n")
}

fn words(found: &Diagnosis) -> String {
    let mut text = format!("{}\n", wrapped(&verdict(found), WIDTH, "  "));
    if !found.steadiness.is_noise() {
        let _ = writeln!(
            text,
            "The residual is not stationary: the power of what does not repeat changes by {:.0} % over time.",
            100.0 * found.steadiness.spread
        );
    }
    if !found.timing.is_steady() {
        let _ = writeln!(text, "{}", found.timing);
    }
    let mut line = |line: String| {
        text.push_str(&line);
        text.push('\n');
    };
    for effect in &found.effects {
        line(format!("\n{}", effect_table(effect).text().trim_end()));
        if !effect.alternatives.is_empty() {
            let others: Vec<&str> = effect.alternatives.iter().map(|kind| kind.id).collect();
            line(format!("  the records cannot tell it from {}", others.join(", ")));
        }
        if let Some(reservation) = &effect.reservation {
            line(wrapped(
                &format!("  fails {reservation}; named, since nothing but noise is left with it"),
                WIDTH,
                "  ",
            ));
        }
    }
    if let Some(lateness) = &found.lateness {
        line(format!("\n{}", wrapped(&lateness.to_string(), WIDTH, "  ")));
    }
    if !found.decisions.is_empty() && found.verdict != Verdict::Agrees {
        line(format!("\n{}", decisions(found)));
    }
    if found.needs_steady_start {
        line(format!("\n{}", wrapped(NEEDS_STEADY_START, WIDTH, "")));
    }
    for minor in &found.minor {
        line(format!("\n{}", wrapped(&minor.to_string(), WIDTH, "  ")));
    }
    for kind in &found.weak_evidence {
        line(format!("\n{kind}"));
    }
    line(format!("\n{}", gap_table(found).text().trim_end()));
    if !found.columns.is_empty() {
        let columns: Vec<&str> = found.columns.iter().map(|column| column.name()).collect();
        line(format!("\nBeside the response, compared too where it says more: {}", columns.join(", ")));
    }
    for cut in found.cut.iter().filter(|cut| !cut.is_empty()) {
        line(format!("\n{}", wrapped(&format!("Rows not compared of {cut}"), WIDTH, "  ")));
        if let Some(stalls) = cut.stalls() {
            line(wrapped(&stalls, WIDTH, "  "));
        }
    }
    if found.has_free_map {
        let text = "The speed that each level settles to is taken as measured, as `identify` does: curvature of the static map is part of \
                    the model, and no effect.";
        line(format!("\n{}", wrapped(text, WIDTH, "  ")));
    }
    for out in &found.left_out {
        line(format!("\nNot compared: {}: {}", out.file, out.reason));
    }
    if let Some(next) = found.next_experiment() {
        line(format!("\nNext: {}", wrapped(&next.words, WIDTH - 6, "  ")));
    }
    text
}
