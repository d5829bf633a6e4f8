//! What a diagnosis of a table of bandwidths found.

use rotorlead_answer::{Cell, Column, Section, Table};
use rotorlead_diagnose::bandwidth_table::{BandwidthDiagnosis, Column as Of, Explanation, Scope};

use crate::figures::bandwidth_diagnosis::bandwidth_diagnosis_figures;

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
    let mut tables = vec![ratios_table(found)];
    if !found.explanations.is_empty() {
        tables.push(explanations_table(found));
    }
    tables.extend(found.named().map(|one| predicted_table(found, one)));
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
            ..Table::default()
        });
    }
    let figures = bandwidth_diagnosis_figures(found);
    Section { text, tables, figures, ..Section::new("diagnosis", "Diagnosis of the bandwidths") }
}

/// Measured and simulated bandwidths, their ratio, and which part of the gap lies there.
#[must_use]
pub fn ratios_table(found: &BandwidthDiagnosis) -> Table {
    let rows = found.table.rows.iter().zip(&found.parts).map(|(row, parts)| {
        let mut cells = vec![Cell::number(row.nominal, 3)];
        for column in Of::ALL {
            let index = column as usize;
            cells.push(Cell::optional(row.measured_rad_s[index], 4));
            cells.push(Cell::number(parts[index].simulated_rad_s, 4));
            cells.push(Cell::optional(parts[index].ratio, 3));
            cells.push(Cell::optional(parts[index].ratio.map(|_| 100.0 * parts[index].share), 1));
        }
        cells
    });
    let share = |column: Of| 100.0 * found.parts.iter().map(|parts| parts[column as usize].share).sum::<f64>();
    let [without, with] = Of::ALL.map(share);
    Table {
        name: "ratios".to_owned(),
        caption: format!(
            "Measured over simulated bandwidth without and with the compensator, and the part of the gap that lies there (of \
             the squares of the logarithm): {without:.1} % without, {with:.1} % with"
        ),
        columns: vec![
            Column::new("u_nom", "u_nom", "duty"),
            Column::new("uncompensated_measured_rad_s", "without, measured", "rad/s").in_detail(),
            Column::new("uncompensated_simulated_rad_s", "simulated", "rad/s").in_detail(),
            Column::new("uncompensated_ratio", "ratio without", ""),
            Column::new("uncompensated_share_percent", "of the gap", "%"),
            Column::new("compensated_measured_rad_s", "with, measured", "rad/s").in_detail(),
            Column::new("compensated_simulated_rad_s", "simulated", "rad/s").in_detail(),
            Column::new("compensated_ratio", "ratio with", ""),
            Column::new("compensated_share_percent", "of the gap", "%"),
        ],
        rows: rows.collect(),
        ..Table::default()
    }
}

/// The model as it is, and each explanation, by what it leaves of either column.
#[must_use]
pub fn explanations_table(found: &BandwidthDiagnosis) -> Table {
    let row = |name: String, standing: &str, numbers: usize, fitted_rms: f64, held_out_rms: Option<f64>| {
        vec![
            Cell::text(name),
            Cell::text(standing),
            Cell::number(numbers as f64, 0),
            Cell::number(fitted_rms, 3),
            Cell::optional(held_out_rms, 3),
        ]
    };
    let as_it_is =
        row("as it is".to_owned(), "-", 0, found.fitted_gap.before, found.held_out.then_some(found.gap.before));
    let explained = found
        .explanations
        .iter()
        .map(|one: &Explanation| row(one.name(), one.standing.name(), one.numbers, one.fitted_rms, one.held_out_rms));
    let (fitted, held_out) = (found.fitted.word(), found.fitted.other().word());
    Table {
        name: "explanations".to_owned(),
        caption: format!(
            "Explanations, calibrated on the {fitted} column alone. RMS of ln(measured / predicted) there, and on the \
             {held_out} column, which is only predicted"
        ),
        columns: vec![
            Column::new("explanation", "explanation", ""),
            Column::new("standing", "standing", ""),
            Column::new("numbers", "numbers", ""),
            Column::new("fitted_rms", "column that was fitted", ""),
            Column::new("held_out_rms", "column that was predicted", ""),
        ],
        rows: std::iter::once(as_it_is).chain(explained).collect(),
        ..Table::default()
    }
}

/// What an explanation predicts at each nominal command, and its parameters there.
#[must_use]
pub fn predicted_table(found: &BandwidthDiagnosis, one: &Explanation) -> Table {
    let rows = found.table.rows.iter().zip(&one.predicted_rad_s).zip(&one.values).map(|((row, predicted), values)| {
        let named = one.kind.fitted().filter_map(|(index, parameter)| {
            let value = values.as_ref().filter(|_| one.scope == Scope::Each)?[index];
            Some(format!("{} {value:.4} {}", parameter.name, parameter.unit).trim_end().to_owned())
        });
        let named = named.collect::<Vec<_>>().join(", ");
        let mut cells = vec![Cell::number(row.nominal, 3)];
        cells.extend(predicted.map(|omega| Cell::optional(omega, 2)));
        cells.push(Cell::text(if named.is_empty() { "the same".to_owned() } else { named }));
        cells
    });
    Table {
        name: "predicted".to_owned(),
        caption: format!("Bandwidth as {} predicts it", one.name()),
        columns: vec![
            Column::new("u_nom", "u_nom", "duty"),
            Column::new("uncompensated_rad_s", "without", "rad/s"),
            Column::new("compensated_rad_s", "with", "rad/s"),
            Column::new("parameters", "parameters", ""),
        ],
        rows: rows.collect(),
        ..Table::default()
    }
}
