//! What a diagnosis found.

use rotorlead_answer::{Cell, Column, Section, Table, Tone};
use rotorlead_diagnose::{
    Axis, CutRows, Decision, Diagnosis, Gap, Location, NEEDS_STEADY_START, NamedEffect, TriedKind, Verdict,
};
use rotorlead_identify::Estimate;
use rotorlead_plant::Point;
use rotorlead_plant::effect::{Kind, Parameter};

use super::estimate;
use crate::figures::diagnosis::diagnosis_figures;
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
    let reservations = found.effects.iter().filter_map(|effect| Some((effect.kind, effect.reservation.as_ref()?)));
    text.extend(reservations.map(|(kind, reservation)| format!("{} fails {reservation}.", kind.id)));
    text.extend(found.minor.iter().map(ToString::to_string));
    text.extend(found.weak_evidence.iter().map(ToString::to_string));
    text.extend(found.lateness.iter().map(ToString::to_string));
    for cut in found.cut.iter().filter(|cut| !cut.is_empty()) {
        text.push(format!("Rows not compared of {cut}."));
    }
    text.extend(found.cut.iter().filter_map(CutRows::stalls));
    for out in &found.left_out {
        text.push(format!("Not compared: {}: {}", out.file, out.reason));
    }
    if let Some(next) = found.next_experiment() {
        text.push(format!("Next experiment: {}", next.words));
    }
    let mut tables = vec![gap_table(found)];
    if found.verdict != Verdict::Agrees {
        tables.push(excess_table(found));
    }
    if !found.effects.is_empty() {
        tables.push(effects(&found.effects));
        tables.extend(found.effects.iter().map(effect_table));
        tables.push(lags(found));
    }
    if !found.tried.is_empty() {
        tables.push(tried(&found.tried));
    }
    if !found.decisions.is_empty() && found.verdict != Verdict::Agrees {
        tables.push(decisions(&found.decisions));
    }
    let figures = diagnosis_figures(found);
    Section { text, tables, figures, ..Section::new("diagnosis", "Diagnosis") }
}

/// The gap on what was held out, or on what was fitted where nothing was; with it that on each split.
#[must_use]
pub fn gap_table(found: &Diagnosis) -> Table {
    let on = if found.held_out { "held-out data" } else { "training data" };
    let row = |name: &str, gap: &Gap| {
        let numbers = [gap.before, gap.after, gap.noise_floor].map(|value| Cell::number(100.0 * value, 2));
        std::iter::once(Cell::text(name)).chain(numbers).collect()
    };
    let mut rows: Vec<Vec<Cell>> = vec![row(on, &found.gap)];
    rows.extend(found.splits.iter().map(|split| row(split.split, &split.gap)));
    if !found.splits.is_empty() {
        let Gap { before, after, .. } = found.fitted;
        let numbers = [before, after].map(|value| Cell::number(100.0 * value, 2));
        rows.push(
            [Cell::text("all steps, which are fitted")].into_iter().chain(numbers).chain([Cell::text("-")]).collect(),
        );
    }
    let nothing = if found.held_out { "" } else { ". Nothing was held out" };
    Table {
        name: "gaps".to_owned(),
        caption: format!("Gap: RMS of the residual over that of the response{nothing}"),
        columns: vec![
            Column::new("on", "on", ""),
            Column::new("before_percent", "before", "%"),
            Column::new("after_percent", "after", "%"),
            Column::new("noise_percent", "noise", "%"),
        ],
        rows,
        ..Table::default()
    }
}

/// Where the excess chi-square of the first model lies: along each axis its three largest parts.
#[must_use]
pub fn excess_table(found: &Diagnosis) -> Table {
    let axes = [
        Axis::Frequency,
        Axis::Nominal,
        Axis::Amplitude,
        Axis::Direction,
        Axis::Time,
        Axis::Harmonics,
        Axis::Excitation,
    ];
    let rows = axes.into_iter().filter_map(|axis| {
        let mut parts: Vec<&Location> = found.locations.iter().filter(|part| part.axis == axis).collect();
        parts.sort_by(|a, b| b.share.total_cmp(&a.share));
        let shown = parts.iter().take(3).filter(|part| part.share >= 0.01).map(|part| place(part));
        let shown = shown.collect::<Vec<_>>().join(", ");
        (!shown.is_empty()).then(|| vec![Cell::text(axis.name()), Cell::text(shown)])
    });
    Table {
        name: "excess".to_owned(),
        caption: "Where the excess chi-square of the first model lies, in percent".to_owned(),
        columns: vec![Column::new("axis", "axis", ""), Column::new("parts", "largest parts", "")],
        rows: rows.collect(),
        ..Table::default()
    }
}

/// Where a part of the excess lies, and how large it is in percent.
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
        Axis::Excitation => ["multisine", "square", "triangle", "step", "staircase", "chirp", "free", "steady"]
            .get((low as usize).saturating_sub(1))
            .map_or_else(String::new, |name| (*name).to_owned()),
    };
    format!("{where_it_is}: {:.0}", 100.0 * part.share)
}

/// The parameters of an effect.
#[must_use]
pub fn effect_table(effect: &NamedEffect) -> Table {
    let caption = format!(
        "{} ({}): gap {:.2} % without it, {:.2} % with it; log likelihood {:+.0}",
        effect.kind.id,
        effect.kind.title,
        100.0 * effect.gap_before,
        100.0 * effect.gap_after,
        effect.evidence
    );
    parameter_table(effect.kind, caption, &effect.parameters)
}

/// Parameters with their standard errors and units.
#[must_use]
pub fn parameter_table(kind: &Kind, caption: String, parameters: &[(&'static Parameter, Estimate)]) -> Table {
    let row = |(parameter, estimate): &(&'static Parameter, Estimate)| {
        vec![Cell::text(parameter.name), Cell::text(parameter_with_std(parameter, estimate).replace("+-", "±"))]
    };
    Table {
        name: format!("parameters_{}", kind.id),
        caption,
        columns: vec![Column::new("parameter", "parameter", ""), Column::new("value", "value", "")],
        rows: parameters.iter().map(row).collect(),
        ..Table::default()
    }
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
        ..Table::default()
    }
}

fn effects(effects: &[NamedEffect]) -> Table {
    let row = |effect: &NamedEffect| {
        let others: Vec<&str> = effect.alternatives.iter().map(|kind| kind.id).collect();
        vec![
            Cell::text(effect.kind.id),
            Cell::text(effect.kind.title),
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
            Column::new("gap_without_percent", "gap without", "%"),
            Column::new("gap_with_percent", "gap with", "%"),
            Column::new("evidence", "evidence", "log likelihood"),
            Column::new("alternatives", "cannot be distinguished from", ""),
        ],
        rows: effects.iter().map(row).collect(),
        ..Table::default()
    }
}

/// What became of each kind that was tried on logs, and why.
fn decisions(decisions: &[Decision]) -> Table {
    let row = |decision: &Decision| {
        let beside: Vec<&str> = decision.beside.iter().map(|kind| kind.id).collect();
        vec![
            Cell::text(decision.kind.id),
            Cell::text(beside.join(", ")),
            Cell::number(decision.fitted_gain, 1),
            Cell::optional(decision.held_out_gain, 1),
            Cell::optional(decision.score, 1),
            Cell::text(decision.outcome()),
        ]
    };
    Table {
        name: "decisions".to_owned(),
        caption: "Kinds tried in turn on steps: log likelihood gained, and what became of each".to_owned(),
        columns: vec![
            Column::new("kind", "kind", ""),
            Column::new("beside", "beside", ""),
            Column::new("fitted_gain", "on training steps", ""),
            Column::new("held_out_gain", "on held-out steps", ""),
            Column::new("score", "score", "both, less what the search gains by chance"),
            Column::new("outcome", "outcome", ""),
        ],
        rows: decisions.iter().map(row).collect(),
        ..Table::default()
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
            Column::new("score", "score", "both, less what the search gains by chance"),
            Column::new("fitted_gain", "on what was fitted", ""),
            Column::new("held_out_gain", "on what was held out", ""),
        ],
        rows: tried.iter().map(row).collect(),
        ..Table::default()
    }
}
