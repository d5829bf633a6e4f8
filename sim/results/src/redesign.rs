//! A compensator that was designed again, for the model with what was missing in it.

use miette::Diagnostic as _;
use rotorlead_answer::{Answer, Cell, Column, ColumnSpec, Table, Tone, Unit, Verdict as Said, build_table};
use rotorlead_design::redesign::{Compensated, Limit, Redesign, RedesignError, RedesignPoint};
use rotorlead_diagnose::{Diagnosis, Verdict};
use rotorlead_plant::effect::{saturation, slew_limit};
use serde_json::json;

use crate::bandwidth::{bandwidth_cell, bandwidth_text};
use crate::design::in_short;
use crate::figures::compensation::redesigned as bandwidths;
use crate::json_object::json_object;

/// What a compensator does with the effects that were found, by sinusoids of `amplitude`, duty, and whether it is to be used.
#[must_use]
pub fn redesign_answer(found: &Diagnosis, redesigned: Result<&Redesign, &RedesignError>, amplitude: f64) -> Answer {
    let answer = Answer { name: "redesign", title: "Redesign", ..Answer::default() };
    let redesigned = match redesigned {
        Ok(redesigned) => redesigned,
        Err(error) => {
            let reason = error.help().map_or_else(|| error.to_string(), |help| format!("{error}: {help}"));
            return Answer {
                text: vec![format!("There is no redesign. {reason}")],
                verdict: Said::new(Tone::Bad, "No compensator can be designed for the improved model."),
                values: json_object(&json!({ "verdict": "none", "reasons": [reason] })),
                ..answer
            };
        }
    };
    let Redesign { full, weaker, .. } = redesigned;
    let (reasons, remarks) = (redesign_refusals(redesigned), redesign_notes(found, redesigned));
    let (name, tone, verdict, mut text) = if redesigned.is_refused() {
        let verdict = format!(
            "The compensator is refused at an amplitude of {amplitude} duty: it would ask for more than the actuator follows."
        );
        ("refused", Tone::Attention, verdict, [reasons.clone(), vec![strongest(redesigned)]].concat())
    } else {
        let what = format!(
            "The compensator for the improved model: {}. Its bandwidths are predicted for small deviations, and by sinusoids of \
             {amplitude} duty through the controller's own filter and the simulated actuator.",
            in_short(&full.design)
        );
        ("designed", Tone::Good, "A compensator is designed for the improved model.".to_owned(), vec![what])
    };
    text.extend(remarks.iter().cloned());
    let mut values = json_object(full);
    values.extend(json_object(&json!({
        "verdict": name,
        "reasons": reasons,
        "amplitude": amplitude,
        "weaker": weaker,
        "remarks": remarks,
    })));
    let weaker = weaker.as_ref().map(|weaker| {
        let table = redesign_table(weaker, amplitude);
        let caption = format!("The same with the strongest lead that stays within the limits. {}", table.caption);
        Table { name: "weaker_redesign".to_owned(), caption, ..table }
    });
    let limits = limits(&full.points).map(Table::in_detail);
    Answer {
        text,
        verdict: Said::new(tone, verdict),
        tables: std::iter::once(redesign_table(full, amplitude)).chain(weaker).chain(limits).collect(),
        figures: bandwidths(full, amplitude).into_iter().collect(),
        values,
        ..answer
    }
}

/// What is to be said beyond the numbers: of the effects, and of what the diagnosis leaves open.
#[must_use]
pub fn redesign_notes(found: &Diagnosis, redesigned: &Redesign) -> Vec<String> {
    let mut notes = redesigned.remarks.clone();
    let others = || found.effects.iter().flat_map(|effect| &effect.alternatives);
    let bounds: Vec<&str> =
        others().map(|kind| kind.id).filter(|id| [slew_limit::ID, saturation::ID].contains(id)).collect();
    if !bounds.is_empty() {
        notes.push(format!(
            "The records cannot exclude {}, which would limit what a lead can do. Do the next experiment first.",
            bounds.join(" or ")
        ));
    }
    match found.verdict {
        Verdict::Unknown => notes.push(
            "The model does not explain the records, and this prediction holds no better than it does.".to_owned(),
        ),
        Verdict::PartlyNamed => {
            notes.push("Something unexplained is left over, and is not in this prediction.".to_owned())
        }
        Verdict::Agrees | Verdict::Named => {}
    }
    notes
}

/// What there is in place of a lead that is refused.
fn strongest(redesigned: &Redesign) -> String {
    let weaker = redesigned.weaker.as_ref().and_then(|weaker| weaker.design.as_lead());
    let Some(lead) = weaker.map(|design| design.lead()) else {
        return "No weaker lead is worth having at this amplitude either.".to_owned();
    };
    format!(
        "The strongest lead that stays within the limits at this amplitude: --omega-g {:.1} (poles {:.2} rad/s)",
        (10.0 * lead.omega_g_rad_s()).floor() / 10.0,
        lead.omega_f_rad_s
    )
}

/// Why it is refused, at each point where it is.
#[must_use]
pub fn redesign_refusals(redesigned: &Redesign) -> Vec<String> {
    redesigned.full.points.iter().filter_map(|point| Some(refusal(point, point.passed()?))).collect()
}

fn refusal(point: &RedesignPoint, limit: &Limit) -> String {
    let nominal = point.small.nominal;
    let what = match limit.kind.id {
        slew_limit::ID => format!("change faster than the {:.3} duty/s that are followed", limit.most),
        _ => format!("go farther than the {:.3} duty that are left up to the clip", limit.most),
    };
    let from = limit.passed_from_rad_s.unwrap_or_default();
    let largest = limit.largest_amplitude;
    let promised = bandwidth_text(point.small.compensated, 1);
    let alone = bandwidth_text(point.small.uncompensated, 1);
    let reached = bandwidth_text(point.chain.magnitude, 1);
    let reachable = limit.reachable_rad_s;
    format!(
        "u_nom {nominal:.3}: from {from:.1} rad/s on the compensated command would {what}. The {promised} rad/s that the lead \
         promises hold for amplitudes up to {largest:.4} duty; at {:.3} duty the chain reaches {reached} rad/s, and no \
         filter can make it much more than {reachable:.1} rad/s. Without one it is {alone} rad/s for small deviations.",
        point.amplitude
    )
}

/// Bandwidths of small deviations, and those of sinusoids of `amplitude`, duty, through the whole chain.
fn redesign_table(compensated: &Compensated, amplitude: f64) -> Table {
    let row = |RedesignPoint { small, chain, at_least, .. }: &RedesignPoint| {
        vec![
            Cell::number(small.nominal, 3),
            bandwidth_cell(small.uncompensated, 4),
            bandwidth_cell(small.compensated, 4),
            bandwidth_cell(chain.magnitude, 1),
            at_least.map_or_else(|| Cell::optional(None, 1), |at_least| bandwidth_cell(at_least, 1)),
            bandwidth_cell(chain.phase, 1),
        ]
    };
    Table {
        name: "redesign".to_owned(),
        caption: format!(
            "Bandwidths with the effects present: of small deviations, and of sinusoids of {amplitude} duty through the \
             whole chain"
        ),
        columns: vec![
            Column::new("u_nom", "u_nom", "duty"),
            Column::new("uncompensated_rad_s", "without compensator", "rad/s"),
            Column::new("compensated_rad_s", "with compensator", "rad/s"),
            Column::new("chain_rad_s", "whole chain to -3 dB", "rad/s"),
            Column::new("chain_at_least_rad_s", "at least (95 %)", "rad/s"),
            Column::new("chain_phase_rad_s", "whole chain to -90 degrees", "rad/s"),
        ],
        rows: compensated.points.iter().map(row).collect(),
        ..Table::default()
    }
}

/// What the lead asks of each limit of the actuator; `None` where it has none.
fn limits<'a>(points: &'a [RedesignPoint]) -> Option<Table> {
    type Row<'a> = (f64, &'a Limit);
    let number = |key, heading: &str, unit, decimals, get: fn(&Limit) -> Option<f64>| {
        ColumnSpec::new(key, heading, unit, decimals, move |(_, limit): &Row| get(limit))
    };
    let columns = [
        ColumnSpec::new("u_nom", "u_nom", Unit::DUTY, 3, |(nominal, _): &Row| *nominal),
        ColumnSpec::words("kind", "limit", |(_, limit): &Row| limit.kind.id),
        number("most", "most that is followed", Unit::NONE, 3, |limit| Some(limit.most)),
        ColumnSpec::words(
            "unit",
            "unit",
            |(_, limit): &Row| if limit.kind.id == slew_limit::ID { "duty/s" } else { "duty" },
        ),
        number("passed_from_rad_s", "passed from", Unit::RAD_S, 1, |limit| limit.passed_from_rad_s),
        number("largest_amplitude", "largest amplitude within it", Unit::DUTY, 4, |limit| {
            Some(limit.largest_amplitude)
        }),
        number("reachable_rad_s", "reachable with any filter", Unit::RAD_S, 1, |limit| Some(limit.reachable_rad_s)),
    ];
    let of_point = |point: &'a RedesignPoint| point.limits.iter().map(|limit| (point.small.nominal, limit));
    let rows: Vec<Row> = points.iter().flat_map(of_point).collect();
    let caption = "Limits of the actuator, and what the lead asks of them below its bandwidth";
    (!rows.is_empty()).then(|| build_table("limits", caption, &columns, &rows))
}
