//! What a diagnosis found.

use rotorlead_answer::words::sentence;
use rotorlead_answer::{Answer, Cell, Column, ColumnSpec, Table, Tone, Unit, Verdict as Said, build_table};
use rotorlead_assess::{AssessmentContext, assess};
use rotorlead_diagnose::{
    Axis, CutRows, Decision, Diagnosis, Gap, Location, NEEDS_STEADY_START, NamedEffect, SquareOfSpeed, TriedKind,
    Verdict,
};
use rotorlead_identify::estimate::Estimate;
use rotorlead_identify::identification::IdentifyOptions;
use rotorlead_plant::effect::{Kind, Parameter, Use};
use rotorlead_plant::{Model, Point, Provenance};
use rotorlead_records::Experiment;
use serde_json::{Value, json};

use crate::EscRampValues;
use crate::IdentifyResult;
use crate::figures::diagnosis::diagnosis_figures;
use crate::json_object::json_object;
use crate::number::{estimate_cell, is_known, parameter_with_std};
use crate::recommendation::judged_verdict;
use crate::unit::unit;

/// What `score` is.
const SCORE: &str = "score: what it gains, less what the search gains by chance";

/// What is missing in a model, by how much that shrinks the gap, and the experiment that would say more; with whether a compensator may be
/// built on it where that was judged ([`diagnosed_model`]).
#[must_use]
pub fn diagnosis_answer(found: &Diagnosis) -> Answer {
    let next = found.next_experiment().map(|next| next.words);
    let mut values = json_object(found);
    values.insert("next_experiment".to_owned(), json!(next));
    values.insert("effects".to_owned(), found.effects.iter().map(effect_values).collect());
    let ramp = EscRampValues::from(found.esc_ramp());
    values.insert("esc_ramp".to_owned(), json!(ramp));
    let judged = found.model.judgement();
    if let Some(judgement) = judged {
        values.insert("judgement".to_owned(), json!(judgement));
    }
    let judged = judged.map(|judgement| {
        let Said { headline, sentences, .. } = judged_verdict(judgement);
        std::iter::once(headline).chain(sentences.into_iter().take(1)).collect::<Vec<_>>().join(" ")
    });
    let next_words = next.map(|words| format!("Next: {words}"));
    let verdict = Said::new(diagnosis_tone(found.verdict), headline(found));
    Answer {
        name: "diagnosis",
        title: "Diagnosis",
        text: [text(found), vec![ramp.sentence()]].concat(),
        verdict: verdict.with(judged.into_iter().chain(next_words).collect()),
        tables: tables(found),
        figures: diagnosis_figures(found),
        values,
        ..Answer::default()
    }
}

/// How good the news of a verdict are.
#[must_use]
fn diagnosis_tone(verdict: Verdict) -> Tone {
    match verdict {
        Verdict::Agrees => Tone::Good,
        Verdict::Named => Tone::Plain,
        Verdict::PartlyNamed => Tone::Attention,
        Verdict::Unknown => Tone::Bad,
    }
}

/// The titles of the effects that are missing.
fn names(found: &Diagnosis) -> String {
    found.effects.iter().map(|effect| effect.kind.title).collect::<Vec<_>>().join(", and ")
}

/// What it found, in a clause.
pub fn found_in_short(found: &Diagnosis) -> String {
    match found.verdict {
        Verdict::Agrees if found.square_of_speed.is_some() => {
            "the diagnosis finds that thrust is the square of a speed, which lags alike up and down, and noise"
                .to_owned()
        }
        Verdict::Agrees => "the diagnosis finds noise alone".to_owned(),
        Verdict::Named => format!("the diagnosis names {}", names(found)),
        Verdict::PartlyNamed => format!("the diagnosis names {}, and more than noise is left", names(found)),
        Verdict::Unknown => "the diagnosis knows no effect that explains it".to_owned(),
    }
}

/// The model with what was missing, as a file. Where it comes from and what it was judged to be is that of the lag alone, `given` or
/// identified: what may be built on a lag does not grow with what else is known to act.
#[must_use]
pub fn diagnosed_model(experiment: &Experiment, given: Option<&Model>, found: &Diagnosis) -> Model {
    let of_given = |model: &Model| {
        let known =
            AssessmentContext { diagnosis: Some((found, &found_in_short(found))), ..AssessmentContext::default() };
        let judgement = Some(assess(experiment, model, known).judgement);
        Some(Provenance { judgement, ..model.provenance.clone()? })
    };
    let provenance = match given {
        Some(model) => of_given(model),
        None => IdentifyResult::given_diagnosis(experiment, &IdentifyOptions::default(), Some(found))
            .ok()
            .and_then(|identified| identified.identification.model.provenance),
    };
    Model { provenance, ..found.model.clone() }
}

fn headline(found: &Diagnosis) -> String {
    let names = || names(found);
    match found.verdict {
        Verdict::Agrees if found.square_of_speed.is_some() => {
            "A lag of thrust misses that thrust is the square of a speed: with that the residual is noise.".to_owned()
        }
        Verdict::Agrees if found.minor.is_empty() => "Model and measurement agree: the residual is noise.".to_owned(),
        Verdict::Agrees => "Model and measurement agree: the residual is noise and what does not matter.".to_owned(),
        Verdict::Named => format!("Missing in the model: {}.", names()),
        Verdict::PartlyNamed => {
            let left = found.excess.1;
            // Where this is not the test that rejects, it is that of stationarity, which has a sentence of its own.
            let by = if left.is_noise() {
                String::new()
            } else {
                format!(": its chi-square is {:.0} where noise leaves {:.0}", left.sum, left.expected)
            };
            format!("Missing in the model: {}. A part of the residual stays unexplained{by}.", names())
        }
        Verdict::Unknown if found.square_of_speed.is_some() => format!(
            "A lag of thrust misses that thrust is the square of a speed. A lag of that speed misses {:.1} % of its response, and no effect \
             of the catalog explains it.",
            100.0 * found.gap.before
        ),
        Verdict::Unknown if found.has_free_map => format!(
            "One lag with the measured static map misses {:.1} % of the response, and no effect of the catalog explains it.",
            100.0 * found.gap.before
        ),
        Verdict::Unknown => "Model and measurement disagree, and no effect of the catalog explains it.".to_owned(),
    }
}

/// What is to be known beside the numbers.
fn text(found: &Diagnosis) -> Vec<String> {
    let mut text: Vec<String> = found.square_of_speed.iter().map(square_of_speed).collect();
    if !found.steadiness.is_noise() {
        text.push(format!(
            "The residual is not stationary: the power of what does not repeat changes by {:.0} % over time.",
            100.0 * found.steadiness.spread
        ));
    }
    text.extend((!found.timing.is_steady()).then(|| found.timing.to_string()));
    text.extend(found.needs_steady_start.then(|| NEEDS_STEADY_START.to_owned()));
    text.extend(found.minor.iter().map(ToString::to_string));
    text.extend(found.weak_evidence.iter().map(ToString::to_string));
    text.extend(found.lateness.iter().map(ToString::to_string));
    if !found.columns.is_empty() {
        let columns: Vec<&str> = found.columns.iter().map(|column| column.name()).collect();
        text.push(format!("Beside the response, compared too where it says more: {}.", columns.join(", ")));
    }
    let cut = || found.cut.iter().filter(|cut| !cut.is_empty());
    text.extend(cut().map(|cut| format!("Rows not compared of {cut}.")));
    text.extend(cut().filter_map(CutRows::stalls));
    if found.has_free_map {
        text.push(
            "The speed that each level settles to is taken as measured, as `identify` does: curvature of the static map is part of \
             the model, and no effect."
                .to_owned(),
        );
    }
    text.extend(found.left_out.iter().map(|out| format!("Not compared: {}: {}", out.file, out.reason)));
    text
}

/// That the square root of thrust was diagnosed, and why.
fn square_of_speed(square: &SquareOfSpeed) -> String {
    let time_constants: Vec<String> = square.time_constants_s.iter().map(|tau| format!("{:.1}", 1e3 * tau)).collect();
    let with =
        if square.instead_of.is_empty() { String::new() } else { format!(" with {}", square.instead_of.join(" and ")) };
    format!(
        "Thrust is taken as the square of a speed, whose time constant is {} ms: that explains the steps better than a lag of thrust{with}, \
         which leaves a gap of {:.2} %. Gaps and effects are those of the square root of thrust.",
        time_constants.join(", "),
        100.0 * square.gap_of_thrust.after
    )
}

fn tables(found: &Diagnosis) -> Vec<Table> {
    let mut tables = vec![gap_table(found)];
    if found.verdict != Verdict::Agrees {
        tables.push(excess_table(found).in_detail());
    }
    if !found.effects.is_empty() {
        tables.push(effects(&found.effects).in_detail());
        tables.extend(found.effects.iter().map(effect_table));
        tables.push(lags(found).in_detail());
    }
    if !found.tried.is_empty() {
        tables.push(tried(&found.tried).in_detail());
    }
    if !found.decisions.is_empty() && found.verdict != Verdict::Agrees {
        tables.push(decisions(&found.decisions).in_detail());
    }
    tables
}

/// The gap on what was held out, or on what was fitted where nothing was; with it that on each split.
fn gap_table(found: &Diagnosis) -> Table {
    let on = if found.held_out { "held-out data" } else { "training data" };
    let all = |gap: &Gap| [Some(gap.before), Some(gap.after), Some(gap.noise_floor)];
    let mut rows = vec![(on, all(&found.gap))];
    rows.extend(found.splits.iter().map(|split| (split.split, all(&split.gap))));
    if !found.splits.is_empty() {
        let Gap { before, after, .. } = found.fitted;
        rows.push(("all steps, which are fitted", [Some(before), Some(after), None]));
    }
    let percent = |key, heading: &str, place: usize| {
        ColumnSpec::new(key, heading, Unit::PERCENT, 2, move |(_, gaps): &(&'static str, [Option<f64>; 3])| {
            gaps[place].map(|gap| 100.0 * gap)
        })
    };
    let columns = [
        ColumnSpec::words("on", "on", |(on, _): &(&'static str, _)| *on),
        percent("before_percent", "before", 0),
        percent("after_percent", "after", 1),
        percent("noise_percent", "noise", 2),
    ];
    let before = if found.is_of_given { "the model as it was given" } else { "the lags that fit these records best" };
    let note = match (found.held_out, found.splits.is_empty()) {
        (false, _) => "Nothing was held out.",
        (true, true) => {
            "Held out are records that are marked `validate`, or a part of the periods of each, unlike in the validation: no number was \
             fitted to them."
        }
        (true, false) => {
            "Held out is in turn a part of the steps of each log, both models fitted anew to the others: no number was fitted to it."
        }
    };
    let caption = format!("Gap: RMS of the residual over that of the response; before, by {before}");
    Table { notes: vec![note.to_owned()], ..build_table("gaps", caption, &columns, &rows) }
}

/// Where the excess chi-square of the first model lies: along each axis its three largest parts.
fn excess_table(found: &Diagnosis) -> Table {
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
        // Chosen: three parts fit a line, and a part under 1 % is none to look at; more hide the largest.
        let shown = parts.iter().take(3).filter(|part| part.share >= 0.01).map(|part| place(part));
        let shown = shown.collect::<Vec<_>>().join(", ");
        (!shown.is_empty()).then_some((axis, shown))
    });
    let columns = [
        ColumnSpec::words("axis", "axis", |(axis, _): &(Axis, String)| axis.name()),
        ColumnSpec::words("parts", "largest parts", |(_, parts): &(Axis, String)| parts.clone()),
    ];
    let caption = "Where the excess chi-square of the first model lies, in percent";
    build_table("excess", caption, &columns, &rows.collect::<Vec<_>>())
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
        Axis::Excitation => {
            ["multisine", "square", "triangle", "step", "staircase", "chirp", "free", "steady", "random"]
                .get((low as usize).saturating_sub(1))
                .map_or_else(String::new, |name| (*name).to_owned())
        }
    };
    format!("{where_it_is}: {:.0}", 100.0 * part.share)
}

/// An effect for programs.
fn effect_values(effect: &NamedEffect) -> Value {
    let mut values = json_object(effect);
    values.insert("bends".to_owned(), json!(bends(effect)));
    values.insert("to_do".to_owned(), json!(effect.kind.remedy));
    Value::Object(values)
}

/// How an effect bends the law of the catalog, a clause; `None` where it does not, as far as the records can tell.
fn bends(effect: &NamedEffect) -> Option<String> {
    effect.parameters.iter().find_map(|(parameter, estimate)| {
        let Use::Shape { neutral, says } = parameter.usage else { return None };
        (estimate.excludes(neutral) && is_known(parameter, estimate)).then(|| says(estimate.value))
    })
}

/// Odds to the unit: beyond that they are no better known than what they rest on.
fn in_words(odds: f64) -> String {
    if odds >= 1.0 { format!("{odds:.0} to 1") } else { format!("1 to {:.0}", 1.0 / odds) }
}

/// What is to be said of an effect beside its numbers, what to do last.
pub fn effect_notes(effect: &NamedEffect) -> Vec<String> {
    let bends = bends(effect).map(|how| format!("Its law bends: {how}."));
    let others = effect.alternatives.iter().zip(&effect.odds);
    let others: Vec<String> = others.map(|(kind, odds)| format!("{} (odds {})", kind.id, in_words(*odds))).collect();
    let others = (!others.is_empty()).then(|| format!("The records cannot tell it from {}.", others.join(", ")));
    let reservation = effect.reservation.as_ref();
    let reservation = reservation
        .map(|reservation| format!("It fails {reservation}; named, since nothing but noise is left with it."));
    let to_do = sentence(effect.kind.remedy);
    bends.into_iter().chain(others).chain(reservation).chain([to_do]).collect()
}

/// The parameters of an effect.
fn effect_table(effect: &NamedEffect) -> Table {
    let caption = format!(
        "{} ({}): gap {:.2} % without it, {:.2} % with it; log likelihood {:+.0}",
        effect.kind.id,
        effect.kind.title,
        100.0 * effect.gap_before,
        100.0 * effect.gap_after,
        effect.evidence
    );
    Table { notes: effect_notes(effect), ..parameter_table(effect.kind, caption, &effect.parameters) }
}

/// Parameters with their standard errors and units.
#[must_use]
fn parameter_table(kind: &Kind, caption: String, parameters: &[(&'static Parameter, Estimate)]) -> Table {
    type Row = (&'static Parameter, Estimate);
    let columns = [
        ColumnSpec::words("parameter", "parameter", |(parameter, _): &Row| parameter.name),
        ColumnSpec::words("value", "value", |(parameter, estimate): &Row| {
            parameter_with_std(parameter, estimate).replace("+-", "±")
        }),
    ];
    build_table(&format!("parameters_{}", kind.id), caption, &columns, parameters)
}

/// The lags with the effects beside them: others than those that a lag alone takes on to imitate them.
fn lags(found: &Diagnosis) -> Table {
    let row = |point: &Point| {
        vec![
            Cell::number(point.nominal, 3),
            estimate_cell(point.gain, point.gain_std, 1.0, 4),
            estimate_cell(point.time_constant_s, point.time_constant_s_std, 1e3, 2),
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
    let columns = [
        ColumnSpec::words("kind", "effect", |effect: &NamedEffect| effect.kind.id),
        ColumnSpec::words("title", "what it is", |effect: &NamedEffect| effect.kind.title),
        ColumnSpec::new("gap_without_percent", "gap without", Unit::PERCENT, 2, |effect: &NamedEffect| {
            100.0 * effect.gap_before
        }),
        ColumnSpec::new("gap_with_percent", "gap with", Unit::PERCENT, 2, |effect: &NamedEffect| {
            100.0 * effect.gap_after
        }),
        ColumnSpec::new("evidence", "evidence", Unit::plain("log likelihood"), 0, |effect: &NamedEffect| {
            effect.evidence
        }),
        ColumnSpec::words("alternatives", "cannot be distinguished from", |effect: &NamedEffect| {
            if effect.alternatives.is_empty() { "-".to_owned() } else { named(&effect.alternatives) }
        }),
    ];
    build_table("effects", "Effects that the model lacks", &columns, effects)
}

fn named(kinds: &[&Kind]) -> String {
    kinds.iter().map(|kind| kind.id).collect::<Vec<_>>().join(", ")
}

/// What became of each kind that was tried on logs, and why.
fn decisions(decisions: &[Decision]) -> Table {
    let columns = [
        ColumnSpec::words("kind", "kind", |decision: &Decision| decision.kind.id),
        ColumnSpec::words("beside", "beside", |decision: &Decision| named(&decision.beside)),
        ColumnSpec::new("fitted_gain", "on training steps", Unit::NONE, 1, |decision: &Decision| decision.fitted_gain),
        ColumnSpec::new("held_out_gain", "on held-out steps", Unit::NONE, 1, |decision: &Decision| {
            decision.held_out_gain
        }),
        ColumnSpec::new("score", "score", Unit::NONE, 1, |decision: &Decision| decision.score),
        ColumnSpec::words("outcome", "outcome", Decision::outcome),
    ];
    let caption = format!("Kinds tried in turn on steps: log likelihood gained, and what became of each; {SCORE}");
    build_table("decisions", caption, &columns, decisions)
}

fn tried(tried: &[TriedKind]) -> Table {
    let finite = |key, heading: &str, get: fn(&TriedKind) -> Option<f64>| {
        ColumnSpec::new(key, heading, Unit::NONE, 1, move |tried: &TriedKind| {
            get(tried).filter(|gain| gain.is_finite())
        })
    };
    let columns = [
        ColumnSpec::words("kind", "kind", |tried: &TriedKind| tried.kind.id),
        finite("score", "score", |tried| Some(tried.score)),
        finite("fitted_gain", "on what was fitted", |tried| Some(tried.fitted_gain)),
        finite("held_out_gain", "on what was held out", |tried| tried.held_out_gain),
    ];
    build_table("tried", format!("Kinds tried alone: log likelihood gained; {SCORE}"), &columns, tried)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rotorlead_plant::Catalog;

    /// An effect that is named with a value for each of its fitted parameters, and bent where `is_bent`.
    fn effect(kind: &'static Kind, is_bent: bool) -> NamedEffect {
        let shape = kind.shape().filter(|_| is_bent);
        let parameters = kind.fitted().chain(shape);
        NamedEffect {
            kind,
            parameters: parameters
                .map(|(_, parameter)| (parameter, Estimate::normal(parameter.starts[0], 1e-3)))
                .collect(),
            evidence: 100.0,
            alternatives: Vec::new(),
            odds: Vec::new(),
            reservation: None,
            gap_before: 0.1,
            gap_after: 0.02,
        }
    }

    #[test]
    fn an_effect_says_how_its_law_bends_and_last_what_to_do() {
        let catalog = Catalog::standard();
        for kind in catalog.kinds() {
            let [straight, bent] = [false, true].map(|is_bent| effect(kind, is_bent));
            let to_do = sentence(kind.remedy);
            assert_eq!(effect_notes(&straight), std::slice::from_ref(&to_do));
            assert_eq!(effect_values(&straight)["bends"], Value::Null);
            let Some((_, shape)) = kind.shape() else { continue };
            let Use::Shape { says, .. } = shape.usage else { unreachable!("it is a shape") };
            let words = says(shape.starts[0]);
            assert_eq!(effect_notes(&bent), [format!("Its law bends: {words}."), to_do]);
            let values = effect_values(&bent);
            assert_eq!((&values["bends"], &values["to_do"]), (&json!(words), &json!(kind.remedy)));
            assert_eq!(values["parameters"][shape.name]["value"], json!(shape.starts[0]));
        }
        let slew = effect(catalog.find("slew_limit").unwrap(), true);
        let text = effect_table(&slew).text();
        assert!(text.contains("\n  Its law bends: it slews downward at 0.10 times the rate upward.\n"), "{text}");
        assert!(text.contains("\n  Where it is a ramp or a soft start of the ESC, switch that off in its"), "{text}");
    }

    #[test]
    fn a_law_whose_shape_may_be_the_catalogs_does_not_bend() {
        let mut play = effect(Catalog::standard().find("backlash").unwrap(), true);
        for (std, is_said) in [(0.1, true), (0.2, false), (f64::INFINITY, false), (f64::NAN, false)] {
            play.parameters[1].1 = Estimate::normal(0.3, std);
            assert_eq!(bends(&play).is_some(), is_said, "{std}");
        }
    }
}
