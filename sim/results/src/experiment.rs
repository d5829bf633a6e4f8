//! What was recorded, or simulated.

use rotorlead_answer::{Axis, Cell, Color, Column, Fact, Figure, FigureKind, Mark, Panel, Section, Series, Table};
use rotorlead_records::{Excitation, Experiment, Record, Role};

use crate::figures::excitation::{crest_factor, excitation_figure};
use crate::unit::quantity;

/// Pieces of which a curve is drawn. Chosen: a figure is 900 pixels wide, so that each piece has about one; fewer show corners, more make
/// the file large.
const MOST: usize = 750;

/// Facts about the records that a run rests on.
#[must_use]
pub fn experiment_facts(experiment: &Experiment, folder: &str) -> Vec<Fact> {
    let (what, unit) = quantity(experiment.output);
    let rate = |rate: Option<f64>| rate.map_or_else(|| "not stated".to_owned(), |rate| format!("{rate} Hz"));
    let records = experiment.records.iter().map(|record| record.file.clone()).collect::<Vec<_>>().join(", ");
    vec![
        Fact::new("Experiment", format!("{} (folder {folder})", experiment.name)),
        Fact::new("Response", format!("{what}, {unit}")),
        Fact::new("ESC frame rate", rate(experiment.esc_frame_hz)),
        Fact::new(
            "Records",
            if records.is_empty() { "taken as they are read, period by period".into() } else { records },
        ),
        Fact::new("Version", format!("Rotorlead {}", env!("CARGO_PKG_VERSION"))),
    ]
}

/// The records in a table.
fn records(experiment: &Experiment) -> Table {
    let row = |record: &Record| {
        let (first, last) =
            (record.time_s.first().copied().unwrap_or(0.0), record.time_s.last().copied().unwrap_or(0.0));
        vec![
            Cell::text(record.file.clone()),
            Cell::number(record.nominal, 3),
            Cell::text(record.excitation.name()),
            Cell::text(match record.role {
                Some(Role::Fit) => "fit",
                Some(Role::Validate) => "validate",
                None => "not stated",
            }),
            Cell::text(if record.compensated { "yes" } else { "no" }),
            Cell::number(record.time_s.len() as f64, 0),
            Cell::number(last - first, 1),
        ]
    };
    Table {
        name: "records".to_owned(),
        caption: "Records".to_owned(),
        columns: vec![
            Column::new("file", "record", ""),
            Column::new("u_nom", "u_nom", "duty"),
            Column::new("excitation", "excitation", ""),
            Column::new("role", "role", ""),
            Column::new("compensated", "compensated", ""),
            Column::new("rows", "rows", ""),
            Column::new("length_s", "length", "s"),
        ],
        rows: experiment.records.iter().map(row).collect(),
        ..Table::default()
    }
}

/// What was played: a table of the records, and the multisine at each nominal command where it is another one.
#[must_use]
pub fn excitation_section(experiment: &Experiment) -> Section {
    // Most experiments play one signal around several levels.
    let mut known: Vec<(f64, usize)> = Vec::new();
    let is_new = |record: &&Record| {
        let key = (crest_factor(&record.command), record.command.len());
        let is_known = known.iter().any(|one| (one.0 - key.0).abs() < 1e-3 && one.1 == key.1);
        known.push(key);
        !is_known
    };
    let multisines =
        experiment.records.iter().filter(|record| record.excitation == Excitation::Multisine && !record.compensated);
    let figures = multisines.filter(is_new).filter_map(excitation_figure).collect();
    Section { tables: vec![records(experiment)], figures, ..Section::new("excitation", "Records and excitation") }
}

/// What a simulation gave: the records over time.
#[must_use]
pub fn simulation_section(experiment: &Experiment) -> Section {
    let figures = experiment.records.iter().filter_map(|record| over_time(experiment, record)).collect();
    Section { tables: vec![records(experiment)], figures, ..Section::new("records", "Simulated records") }
}

/// Command and response over time.
fn over_time(experiment: &Experiment, record: &Record) -> Option<Figure> {
    let response = record.response(experiment.output)?;
    let each = record.time_s.len().div_ceil(MOST).max(1);
    // A mean would make a quick excitation smaller than it is.
    let ends = |(time, values): (&[f64], &[f64])| {
        let rows = || time.iter().copied().zip(values.iter().copied());
        let by_value = |a: &(f64, f64), b: &(f64, f64)| a.1.total_cmp(&b.1);
        let mut ends: Vec<(f64, f64)> = rows().min_by(by_value).into_iter().chain(rows().max_by(by_value)).collect();
        ends.sort_by(|a, b| a.0.total_cmp(&b.0));
        ends.dedup();
        ends
    };
    let drawn = |values: &[f64]| -> Vec<(f64, f64)> {
        record.time_s.chunks(each).zip(values.chunks(each)).flat_map(ends).collect()
    };
    let time = || Axis::linear("time", "s");
    let mut commands = vec![Series::new("command", Color::Blue, Mark::Line, drawn(&record.command))];
    if let Some(esc) = &record.esc_command {
        commands.push(Series::new("ESC command", Color::Vermilion, Mark::Line, drawn(esc)));
    }
    let (what, unit) = quantity(experiment.output);
    let panels = vec![
        Panel { height: 220, ..Panel::new(time(), Axis::linear("command", "duty"), commands) },
        Panel {
            height: 260,
            ..Panel::new(
                time(),
                Axis::linear(what, unit),
                vec![Series::new(what, Color::Green, Mark::Line, drawn(response))],
            )
        },
    ];
    let caption =
        if each > 1 { format!("Of every {each} rows the lowest and the highest are drawn.") } else { String::new() };
    Some(Figure::new(FigureKind::Record, record.file.clone(), &caption, panels).with_record(&record.file))
}
