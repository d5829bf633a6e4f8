//! A compensator that was designed again, for the model with what was missing in it.

use rotorlead_answer::{Cell, Column, Section, Table};
use rotorlead_identify::design::redesign::{Compensated, Limit, Redesign, RedesignPoint};
use rotorlead_plant::Model;

use super::design_section;
use crate::bandwidths::bandwidth_cell;
use crate::figures::compensation::redesigned;

/// What a lead does with the effects present, and the lead itself where it is to be used. `model` is what it was designed for,
/// `amplitude` that of the sinusoids, duty; `text` says whether it is refused and why, and what is to be known beside the numbers.
#[must_use]
pub fn redesign_sections(redesign: &Redesign, model: &Model, amplitude: f64, text: Vec<String>) -> Vec<Section> {
    let full = &redesign.full;
    let mut tables = vec![redesign_table(full, amplitude)];
    if let Some(weaker) = &redesign.weaker {
        let table = redesign_table(weaker, amplitude);
        let caption = format!("The same with the strongest lead that stays within the limits. {}", table.caption);
        tables.push(Table { name: "weaker_redesign".to_owned(), caption, ..table });
    }
    tables.extend(limits(&full.points));
    let figures = redesigned(&full.points, amplitude).into_iter().collect();
    let mut sections = vec![Section { text, tables, figures, ..Section::new("redesign", "Redesign") }];
    if !redesign.is_refused() {
        sections.push(design_section(&full.design, model));
    }
    sections
}

/// Bandwidths of small deviations, and those of sinusoids of `amplitude`, duty, through the whole chain.
#[must_use]
pub fn redesign_table(compensated: &Compensated, amplitude: f64) -> Table {
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
fn limits(points: &[RedesignPoint]) -> Option<Table> {
    let row = |(point, limit): (&RedesignPoint, &Limit)| {
        let unit = if limit.kind.id == "slew_limit" { "duty/s" } else { "duty" };
        vec![
            Cell::number(point.small.nominal, 3),
            Cell::text(limit.kind.id),
            Cell::number(limit.most, 3),
            Cell::text(unit),
            Cell::optional(limit.passed_from_rad_s, 1),
            Cell::number(limit.largest_amplitude, 4),
            Cell::number(limit.reachable_rad_s, 1),
        ]
    };
    let all = points.iter().flat_map(|point| point.limits.iter().map(move |limit| (point, limit)));
    let rows: Vec<Vec<Cell>> = all.map(row).collect();
    (!rows.is_empty()).then(|| Table {
        name: "limits".to_owned(),
        caption: "Limits of the actuator, and what the lead asks of them below its bandwidth".to_owned(),
        columns: vec![
            Column::new("u_nom", "u_nom", "duty"),
            Column::new("kind", "limit", ""),
            Column::new("most", "most that is followed", ""),
            Column::new("unit", "unit", ""),
            Column::new("passed_from_rad_s", "passed from", "rad/s"),
            Column::new("largest_amplitude", "largest amplitude within it", "duty"),
            Column::new("reachable_rad_s", "reachable with any filter", "rad/s"),
        ],
        rows,
        ..Table::default()
    })
}
