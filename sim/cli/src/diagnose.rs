//! `rotorlead diagnose`

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::Args;
use miette::{IntoDiagnostic as _, WrapErr as _};
use rotorlead_diagnose::{
    Axis, Diagnosis, Gap, Location, NEEDS_STEADY_START, Options, Verdict, diagnose, fill_in_esc_commands,
};
use rotorlead_plant::{Catalog, Model};
use rotorlead_records::Experiment;
use rotorlead_records::files::{check_writable, write_file};
use rotorlead_report::Verdict as Headline;
use rotorlead_report::{Report, diagnosis_section, diagnosis_tone, parameter_with_std};
use serde_json::{Value, json};

use super::diagnose_bandwidths::BandwidthArguments;
use super::outcome::{JsonOption, Outcome, wrapped};
use super::redesign::RedesignArguments;
use super::report_option::ReportOption;
use super::{WrongUse, progress, report_pages};

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
    pub(super) out_model: Option<PathBuf>,
    /// Where the plan of the experiment that would say more goes, for `rotorlead simulate` and for a controller
    #[arg(long, value_name = "FILE", requires = "experiment")]
    out_plan: Option<PathBuf>,
    #[command(flatten)]
    pub(super) report: ReportOption,
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
        self.report.check(self.out_model.as_deref())?;
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
            writeln!(text, "\nWritten to {}", out.display()).into_diagnostic()?;
        }
        if let Some(out) = &self.out_plan {
            text.push_str(&write_plan(&found, out)?);
        }
        let mut json = values(&found);
        let (mut sentences, mut redesign_sections) = (Vec::new(), Vec::new());
        if let Some(redesigned) = self.redesign.run(&found, experiment.esc_frame_hz)? {
            text.push_str(&redesigned.text);
            json["redesign"] = redesigned.json;
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
        Ok(Outcome { text, json })
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
        Verdict::Agrees => "Model and measurement agree: the residual is noise.".to_owned(),
        Verdict::Named => format!("Missing in the model: {}.", names()),
        Verdict::PartlyNamed => format!("Missing in the model: {}. A part of the residual stays unexplained.", names()),
        Verdict::Unknown => "Model and measurement disagree, and no effect of the catalog explains it.".to_owned(),
    }
}

fn words(found: &Diagnosis) -> String {
    let mut text = format!("{}\n", verdict(found));
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
    if found.verdict != Verdict::Agrees {
        line("\nWhere the excess chi-square of the first model lies, in percent:".to_owned());
        for axis in [
            Axis::Frequency,
            Axis::Nominal,
            Axis::Amplitude,
            Axis::Direction,
            Axis::Time,
            Axis::Harmonics,
            Axis::Excitation,
        ] {
            let mut parts: Vec<&Location> = found.locations.iter().filter(|part| part.axis == axis).collect();
            parts.sort_by(|a, b| b.share.total_cmp(&a.share));
            let shown = parts.iter().take(3).filter(|part| part.share >= 0.01).map(|part| place(part));
            let shown = shown.collect::<Vec<_>>().join(", ");
            if !shown.is_empty() {
                line(format!("  {:<11} {shown}", axis.name()));
            }
        }
    }
    for effect in &found.effects {
        line(format!(
            "\n{} ({})\n  gap {:.2} % without it, {:.2} % with it; log likelihood {:+.0}",
            effect.kind.id,
            effect.kind.title,
            100.0 * effect.gap_before,
            100.0 * effect.gap_after,
            effect.evidence
        ));
        for (parameter, estimate) in &effect.parameters {
            line(format!("  {:<22} {}", parameter.name, parameter_with_std(parameter, estimate)));
        }
        if !effect.alternatives.is_empty() {
            let others: Vec<&str> = effect.alternatives.iter().map(|kind| kind.id).collect();
            line(format!("  the records cannot tell it from {}", others.join(", ")));
        }
    }
    if found.needs_steady_start {
        line(format!("\n{}", wrapped(NEEDS_STEADY_START, WIDTH, "")));
    }
    for kind in &found.weak_evidence {
        line(format!("\n{kind}"));
    }
    let on = if found.held_out { "held-out data" } else { "the training data (nothing was held out)" };
    line(format!(
        "\nGap on {on}, RMS over that of the response:\n  {:.2} % before, {:.2} % after, {:.2} % noise",
        100.0 * found.gap.before,
        100.0 * found.gap.after,
        100.0 * found.gap.noise_floor
    ));
    for split in &found.splits {
        let Gap { before, after, noise_floor } = split.gap;
        let percents =
            format!("{:.2} % before, {:.2} % after, {:.2} % noise", 100.0 * before, 100.0 * after, 100.0 * noise_floor);
        line(format!("  {:<24} {percents}", split.split));
    }
    if !found.splits.is_empty() {
        let Gap { before, after, .. } = found.fitted;
        line(format!("On all steps, which are fitted: {:.2} % before, {:.2} % after", 100.0 * before, 100.0 * after));
    }
    if !found.columns.is_empty() {
        let columns: Vec<&str> = found.columns.iter().map(|column| column.name()).collect();
        line(format!("\nBeside the response, compared too where it says more: {}", columns.join(", ")));
    }
    for cut in found.cut.iter().filter(|cut| !cut.is_empty()) {
        line(format!("\nRows not compared of {cut}"));
    }
    for out in &found.left_out {
        line(format!("\nNot compared: {}: {}", out.file, out.reason));
    }
    if let Some(next) = found.next_experiment() {
        line(format!("\nNext: {}", wrapped(&next.words, WIDTH - 6, "  ")));
    }
    text
}

fn place(part: &Location) -> String {
    let (low, high) = part.range;
    let span = |decimals: usize| {
        let [from, to] = [low, high].map(|end| format!("{end:.decimals$}"));
        if from == to { from } else { format!("{from} to {to}") }
    };
    let where_it_is = match part.axis {
        Axis::Frequency => format!("{} Hz", span(2)),
        Axis::Nominal if low == high => format!("{low}"),
        Axis::Nominal => span(2),
        Axis::Amplitude => span(3),
        Axis::Direction => (if low > 0.0 { "rising" } else { "falling" }).to_owned(),
        Axis::Time => format!("{} s", span(0)),
        Axis::Harmonics if low < 2.0 => "excited lines".to_owned(),
        Axis::Harmonics if low < 3.0 => "even lines".to_owned(),
        Axis::Harmonics => "odd lines".to_owned(),
        Axis::Excitation => ["multisine", "square", "triangle", "step", "staircase", "chirp", "free"]
            .get((low as usize).saturating_sub(1))
            .map_or_else(String::new, |name| (*name).to_owned()),
    };
    format!("{where_it_is}: {:.0}", 100.0 * part.share)
}

fn values(found: &Diagnosis) -> Value {
    let finite = |value: f64| if value.is_finite() { json!(value) } else { Value::Null };
    json!({
        "verdict": found.verdict.name(),
        "where": found.locations.iter().map(|part| json!({
            "axis": part.axis.name(),
            "range": [part.range.0, part.range.1],
            "share": part.share,
            "significance": part.significance,
        })).collect::<Vec<_>>(),
        "effects": found.effects.iter().map(|effect| json!({
            "kind": effect.kind.id,
            "parameters": effect.parameters.iter().map(|(parameter, estimate)| {
                let value = json!({ "value": estimate.value, "std": finite(estimate.std), "unit": parameter.unit });
                (parameter.name.to_owned(), value)
            }).collect::<serde_json::Map<_, _>>(),
            "gap_before": effect.gap_before,
            "gap_after": effect.gap_after,
            "evidence": effect.evidence,
            "alternatives": effect.alternatives.iter().map(|kind| kind.id).collect::<Vec<_>>(),
        })).collect::<Vec<_>>(),
        "needs_steady_start": found.needs_steady_start,
        "weak_evidence": found.weak_evidence.iter().map(|kind| json!({
            "kind": kind.kind.id,
            "evidence": kind.evidence,
        })).collect::<Vec<_>>(),
        "gap": { "before": found.gap.before, "after": found.gap.after, "noise_floor": found.gap.noise_floor },
        "records": found.records.iter().map(|record| json!({
            "file": record.file,
            "nominal": record.nominal,
            "before": record.gap.before,
            "after": record.gap.after,
            "noise_floor": record.gap.noise_floor,
        })).collect::<Vec<_>>(),
        "splits": found.splits.iter().map(|split| json!({
            "split": split.split,
            "before": split.gap.before,
            "after": split.gap.after,
            "noise_floor": split.gap.noise_floor,
        })).collect::<Vec<_>>(),
        "fitted": { "before": found.fitted.before, "after": found.fitted.after, "noise_floor": found.fitted.noise_floor },
        "columns": found.columns.iter().map(|column| column.name()).collect::<Vec<_>>(),
        "rows_cut": found.cut.iter().map(|cut| json!({
            "file": cut.file,
            "rows": cut.rows,
            "start": cut.start,
            "end": cut.end,
            "spikes": cut.spikes,
            "after_gaps": cut.after_gaps,
        })).collect::<Vec<_>>(),
        "not_compared": found.left_out.iter().map(|out| &out.file).collect::<Vec<_>>(),
        "held_out": found.held_out,
        "excess": {
            "before": { "sum": found.excess.0.sum, "expected": found.excess.0.expected },
            "after": { "sum": found.excess.1.sum, "expected": found.excess.1.expected },
        },
        "steadiness": { "spread": found.steadiness.spread, "significance": found.steadiness.significance },
        "timing": { "scatter_s": found.timing.scatter_s, "significance": found.timing.significance },
        "tried": found.tried.iter().map(|tried| json!({
            "kind": tried.kind.id,
            "fitted_gain": tried.fitted_gain,
            "held_out_gain": finite(tried.held_out_gain),
            "score": finite(tried.score),
        })).collect::<Vec<_>>(),
        "next_experiment": found.next_experiment().map(|next| next.words),
    })
}
