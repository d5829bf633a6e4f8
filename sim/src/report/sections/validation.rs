//! How well a model explains records.

use crate::identify::{Comparison, RecordValidation};
use crate::record::Output;
use crate::report::html::{Cell, Column, Section, Table};
use crate::report::validation::{figures_of, table_by_nominal, verdict};

/// The scores, and the figures of every record.
#[must_use]
pub fn validation_section(records: &[RecordValidation], output: Output) -> Section {
    let text = verdict(records).replace('\n', " ").replace("  ", " ").trim().to_owned();
    let figures = records.iter().map(|record| figures_of(record, output)).collect();
    let mut tables = vec![scores(records)];
    tables.extend(table_by_nominal(records));
    let ceiling = "The ceiling is what a perfect model would score, given the noise of the record.".to_owned();
    Section { text: vec![text, ceiling], tables, figures, ..Section::new("validation", "Validation") }
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
            Cell::text(super::experiment::name(record.excitation)),
            Cell::text(match record.fitted {
                Some(true) => "no",
                Some(false) => "yes",
                None => "-",
            }),
            Cell::text(in_domain),
            Cell::number(record.fit_percent, 2),
            Cell::optional(record.ceiling_percent, 2),
            Cell::optional(left.map(|left| left.power_ratio), 2),
            left.map_or_else(|| Cell::text("-"), |left| Cell::shown(left.p_value, format!("{:.2e}", left.p_value))),
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
