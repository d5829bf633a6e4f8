//! Responses over time beside the model's: the paper's Fig. 7.

use rotorlead_answer::{Axis, Color, Figure, FigureKind, Mark, Panel, Series};
use rotorlead_identify::validate::ComparedRow;
use rotorlead_records::Output;

use crate::unit::quantity;

/// Points of a curve. Chosen: more than the 900 pixels of a figure's width, so that nothing is lost to the eye; more make the file large.
const MOST: usize = 1500;

/// One record beside the model, and what is left.
#[must_use]
pub fn compared(title: String, rows: &[ComparedRow], output: Output) -> Figure {
    let each = rows.len().div_ceil(MOST).max(1);
    let mean = |value: fn(&ComparedRow) -> f64| -> Vec<(f64, f64)> {
        let of = |rows: &[ComparedRow], value: fn(&ComparedRow) -> f64| {
            rows.iter().map(value).sum::<f64>() / rows.len() as f64
        };
        rows.chunks(each).map(|rows| (of(rows, |row| row.time_s), of(rows, value))).collect()
    };
    let (what, unit) = quantity(output);
    let time = || Axis::linear("time in the record", "s");
    let above = vec![
        Series::new("measured", Color::Sky, Mark::Line, mean(|row| row.measured)),
        Series::new("model", Color::Vermilion, Mark::Line, mean(|row| row.model)),
    ];
    let below = vec![Series::new("measured less model", Color::Blue, Mark::Line, mean(|row| row.measured - row.model))];
    let panels = vec![
        Panel::new(time(), Axis::linear(what, unit), above),
        Panel { height: 220, ..Panel::new(time(), Axis::linear("residual", unit), below) },
    ];
    let means = if each > 1 { format!(" Drawn are means of {each} rows.") } else { String::new() };
    let caption = format!(
        "A residual that looks alike after every step is the model's error; what looks different every time is noise.{means}"
    );
    Figure::new(FigureKind::TimeValidation, title, &caption, panels)
}
