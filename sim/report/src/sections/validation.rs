//! How well a model explains records.

use rotorlead_identify::{Comparison, RecordValidation};
use rotorlead_records::Output;

use crate::html::{Cell, Column, Section, Table};
use crate::validation::{figures_of, probability, table_by_nominal, verdict};

/// The scores, and the figures of every record.
#[must_use]
pub fn validation_section(records: &[RecordValidation], output: Output) -> Section {
    // For a terminal lines are broken, and go on further to the right; here each sentence and each record is a paragraph.
    let mut text: Vec<String> = Vec::new();
    for line in verdict(records).lines() {
        match text.last_mut() {
            Some(last)
                if line.starts_with("    ")
                    || !(last.ends_with('.') || last.ends_with(':') || line.starts_with("  ")) =>
            {
                last.push(' ');
                last.push_str(line.trim());
            }
            _ => text.push(line.trim().to_owned()),
        }
    }
    let figures = records.iter().map(|record| figures_of(record, output)).collect();
    let mut tables = vec![scores(records)];
    tables.extend(table_by_nominal(records));
    let ceiling =
        "The ceiling is what a perfect model would score on average, given the noise of the record.".to_owned();
    text.push(ceiling);
    Section { text, tables, figures, ..Section::new("validation", "Validation") }
}

fn scores(records: &[RecordValidation]) -> Table {
    let row = |record: &RecordValidation| {
        let in_domain = match record.comparison {
            Comparison::Frequency(_) => "frequency",
            Comparison::Time(_) => "time",
        };
        let left = record.left_over;
        vec![
            Cell::text(record.file.clone()),
            Cell::number(record.nominal, 3),
            Cell::text(record.excitation.name()),
            Cell::text(match record.fitted {
                Some(true) => "no",
                Some(false) => "yes",
                None => "-",
            }),
            Cell::text(in_domain),
            Cell::number(record.fit_percent, 2),
            Cell::optional(record.ceiling_percent, 2),
            Cell::optional(left.map(|left| left.power_ratio), 2),
            left.map_or_else(|| Cell::text("-"), |left| Cell::shown(left.p_value, probability(left.p_value))),
            Cell::optional(record.model_error_percent(), 2),
        ]
    };
    Table {
        name: "validation".to_owned(),
        caption: "Each record".to_owned(),
        columns: vec![
            Column::new("file", "record", ""),
            Column::new("u_nom", "u_nom", "duty"),
            Column::new("excitation", "excitation", ""),
            Column::new("held_out", "held out", ""),
            Column::new("domain", "compared in", ""),
            Column::new("fit_percent", "fit", "%"),
            Column::new("ceiling_percent", "ceiling", "%"),
            Column::new("left_over_noise", "left, over noise", "power"),
            Column::new("p_value", "p", ""),
            Column::new("model_error_percent", "model's error", "% of the response"),
        ],
        rows: records.iter().map(row).collect(),
    }
}
