//! What a diagnosis of a table of bandwidths found.

use rotorlead_diagnose::bandwidths::{BandwidthDiagnosis, Column as Of, Explanation};

use crate::bandwidth_diagnosis::bandwidth_diagnosis_figures;
use crate::html::{Cell, Column, Section, Table};

/// Ratios, explanations, and what rules the others out.
#[must_use]
pub fn bandwidth_diagnosis_section(found: &BandwidthDiagnosis) -> Section {
    let after = found.named().map_or(found.gap.before, |_| found.gap.after);
    let on = if found.held_out { found.fitted.other().word() } else { found.fitted.word() };
    let how = if found.held_out { "which no number was fitted to" } else { "which was fitted: nothing was held out" };
    let mut text = vec![format!(
        "The gap on the {on} column, {how}: RMS of ln(measured / simulated) {:.3} before, {after:.3} after.",
        found.gap.before
    )];
    if let Some(next) = &found.next_experiment {
        text.extend(format!("Next experiment: {next}").lines().map(str::to_owned));
    }
    let mut tables = vec![rows(found)];
    if !found.explanations.is_empty() {
        tables.push(explanations(&found.explanations));
    }
    if !found.ruled_out.is_empty() {
        tables.push(Table {
            name: "ruled_out".to_owned(),
            caption: "No explanation".to_owned(),
            columns: vec![Column::new("kind", "kind", ""), Column::new("reason", "why not", "")],
            rows: found
                .ruled_out
                .iter()
                .map(|one| vec![Cell::text(one.kind.id), Cell::text(one.reason.clone())])
                .collect(),
        });
    }
    let figures = bandwidth_diagnosis_figures(found);
    Section { text, tables, figures, ..Section::new("diagnosis", "Diagnosis of the bandwidths") }
}

fn rows(found: &BandwidthDiagnosis) -> Table {
    let rows = found.table.rows.iter().zip(&found.parts).map(|(row, parts)| {
        let mut cells = vec![Cell::number(row.nominal, 3)];
        for column in Of::ALL {
            let index = column as usize;
            cells.push(Cell::optional(row.measured_rad_s[index], 4));
            cells.push(Cell::number(parts[index].simulated_rad_s, 4));
            cells.push(Cell::optional(parts[index].ratio, 3));
        }
        cells
    });
    Table {
        name: "ratios".to_owned(),
        caption: "Measured and simulated bandwidth without and with the compensator".to_owned(),
        columns: vec![
            Column::new("u_nom", "u_nom", "duty"),
            Column::new("uncompensated_measured_rad_s", "without, measured", "rad/s"),
            Column::new("uncompensated_simulated_rad_s", "simulated", "rad/s"),
            Column::new("uncompensated_ratio", "ratio", ""),
            Column::new("compensated_measured_rad_s", "with, measured", "rad/s"),
            Column::new("compensated_simulated_rad_s", "simulated", "rad/s"),
            Column::new("compensated_ratio", "ratio", ""),
        ],
        rows: rows.collect(),
    }
}

fn explanations(all: &[Explanation]) -> Table {
    let row = |one: &Explanation| {
        vec![
            Cell::text(one.name()),
            Cell::text(one.standing.name()),
            Cell::number(one.numbers as f64, 0),
            Cell::number(one.fitted_rms, 3),
            Cell::optional(one.held_out_rms, 3),
        ]
    };
    Table {
        name: "explanations".to_owned(),
        caption: "Explanations: RMS of ln(measured / predicted)".to_owned(),
        columns: vec![
            Column::new("explanation", "explanation", ""),
            Column::new("standing", "standing", ""),
            Column::new("numbers", "numbers", ""),
            Column::new("fitted_rms", "column that was fitted", ""),
            Column::new("held_out_rms", "column that was predicted", ""),
        ],
        rows: all.iter().map(row).collect(),
    }
}
