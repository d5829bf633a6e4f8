//! What a diagnosis found.

use rotorlead_diagnose::{Diagnosis, NEEDS_STEADY_START, NamedEffect, TriedKind, Verdict};
use rotorlead_plant::Point;

use super::estimate;
use crate::diagnosis::diagnosis_figures;
use crate::html::{Cell, Column, Section, Table, Tone};
use crate::number::parameter_with_std;
use crate::unit::unit;

/// How good the news of a verdict are.
#[must_use]
pub fn diagnosis_tone(verdict: Verdict) -> Tone {
    match verdict {
        Verdict::Agrees => Tone::Good,
        Verdict::Named => Tone::Plain,
        Verdict::PartlyNamed => Tone::Attention,
        Verdict::Unknown => Tone::Bad,
    }
}

/// Effects, gaps and candidates. `verdict` is the diagnosis in a sentence, where that is not said elsewhere.
#[must_use]
pub fn diagnosis_section(found: &Diagnosis, verdict: Option<&str>) -> Section {
    let percent = |value: f64| format!("{:.2} %", 100.0 * value);
    let on = if found.held_out { "what was held out" } else { "what was fitted, since nothing was held out" };
    let before = if found.is_of_given { "the model as it was given" } else { "the lags that fit these records best" };
    let mut text: Vec<String> = verdict.map(str::to_owned).into_iter().collect();
    text.push(format!(
        "The gap on {on}, RMS of the residual over that of the response: {} before, by {before}; {} after; noise alone leaves {}.",
        percent(found.gap.before),
        percent(found.gap.after),
        percent(found.gap.noise_floor)
    ));
    if found.held_out {
        let which = if found.splits.is_empty() {
            "records that are marked `validate`, or a part of the periods of each. It is another choice than that of the \
             validation, whose records no lag was fitted to"
        } else {
            "in turn, a part of the steps of each log, both models fitted anew to the others"
        };
        text.push(format!("No number was fitted to what was held out: {which}."));
    }
    if !found.timing.is_steady() {
        text.push(found.timing.to_string());
    }
    if found.needs_steady_start {
        text.push(NEEDS_STEADY_START.to_owned());
    }
    text.extend(found.weak_evidence.iter().map(ToString::to_string));
    for out in &found.left_out {
        text.push(format!("Not compared: {}: {}", out.file, out.reason));
    }
    if let Some(next) = found.next_experiment() {
        text.push(format!("Next experiment: {}", next.words));
    }
    let mut tables = Vec::new();
    if !found.effects.is_empty() {
        tables.push(effects(&found.effects));
        tables.push(lags(found));
    }
    if !found.tried.is_empty() {
        tables.push(tried(&found.tried));
    }
    let figures = diagnosis_figures(found);
    Section { text, tables, figures, ..Section::new("diagnosis", "Diagnosis") }
}

/// The lags with the effects beside them: others than those that a lag alone takes on to imitate them.
fn lags(found: &Diagnosis) -> Table {
    let row = |point: &Point| {
        vec![
            Cell::number(point.nominal, 3),
            estimate(point.gain, point.gain_std, 1.0, 4),
            estimate(point.time_constant_s, point.time_constant_s_std, 1e3, 2),
            Cell::number(1.0 / point.time_constant_s, 3),
        ]
    };
    Table {
        name: "improved_lags".to_owned(),
        caption: "Lags of the improved model".to_owned(),
        columns: vec![
            Column::new("u_nom", "u_nom", "duty"),
            Column::new("gain", "gain", unit(found.conditions.output)),
            Column::new("time_constant_ms", "tau", "ms"),
            Column::new("pole_rad_s", "1/tau", "rad/s"),
        ],
        rows: found.model.points.iter().map(row).collect(),
    }
}

fn effects(effects: &[NamedEffect]) -> Table {
    let row = |effect: &NamedEffect| {
        let parameters = effect.parameters.iter().map(|(parameter, value)| {
            format!("{} {}", parameter.name, parameter_with_std(parameter, value).replace("+-", "±"))
        });
        let others: Vec<&str> = effect.alternatives.iter().map(|kind| kind.id).collect();
        vec![
            Cell::text(effect.kind.id),
            Cell::text(effect.kind.title),
            Cell::text(parameters.collect::<Vec<_>>().join("; ")),
            Cell::number(100.0 * effect.gap_before, 2),
            Cell::number(100.0 * effect.gap_after, 2),
            Cell::number(effect.evidence, 0),
            Cell::text(if others.is_empty() { "-".to_owned() } else { others.join(", ") }),
        ]
    };
    Table {
        name: "effects".to_owned(),
        caption: "Effects that the model lacks".to_owned(),
        columns: vec![
            Column::new("kind", "effect", ""),
            Column::new("title", "what it is", ""),
            Column::new("parameters", "parameters", ""),
            Column::new("gap_without_percent", "gap without", "%"),
            Column::new("gap_with_percent", "gap with", "%"),
            Column::new("evidence", "evidence", "log likelihood"),
            Column::new("alternatives", "cannot be told from", ""),
        ],
        rows: effects.iter().map(row).collect(),
    }
}

fn tried(tried: &[TriedKind]) -> Table {
    let row = |tried: &TriedKind| {
        let finite = |value: f64| Cell::optional(Some(value).filter(|value| value.is_finite()), 1);
        vec![Cell::text(tried.kind.id), finite(tried.score), finite(tried.fitted_gain), finite(tried.held_out_gain)]
    };
    Table {
        name: "tried".to_owned(),
        caption: "Kinds tried alone: log likelihood gained".to_owned(),
        columns: vec![
            Column::new("kind", "kind", ""),
            Column::new("worth", "evidence", "both, less what the search gains by chance"),
            Column::new("fitted_gain", "on what was fitted", ""),
            Column::new("held_out_gain", "on what was held out", ""),
        ],
        rows: tried.iter().map(row).collect(),
    }
}
