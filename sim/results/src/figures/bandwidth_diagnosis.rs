//! What a diagnosis of a table of bandwidths found, as figures.

use rotorlead_answer::{Axis, Color, Figure, FigureKind, Mark, Panel, Series};
use rotorlead_diagnose::bandwidth_table::{BandwidthDiagnosis, Column, Explanation, Standing};

/// Height of a line of a table of bars or dots, and of what is around them.
const LINE: u32 = 26;
const AROUND: u32 = 100;
/// An RMS below this is drawn as this.
const LEAST: f64 = 1e-3;

/// The bandwidths before and after, and the explanations side by side.
#[must_use]
pub fn bandwidth_diagnosis_figures(found: &BandwidthDiagnosis) -> Vec<Figure> {
    [Some(bandwidths(found)), explanations(found)].into_iter().flatten().collect()
}

fn bandwidths(found: &BandwidthDiagnosis) -> Figure {
    let rows = || found.table.rows.iter().zip(&found.parts);
    let panel = |column: Column| {
        let index = column as usize;
        let measured = rows().filter_map(|(row, _)| Some((row.nominal, row.measured_rad_s[index]?))).collect();
        let simulated = rows().map(|(row, parts)| (row.nominal, parts[index].simulated_rad_s)).collect();
        let mut series = vec![
            Series::new("model as it is", Color::Vermilion, Mark::Dashes, simulated),
            Series::new("measured", Color::Blue, Mark::Discs, measured),
        ];
        if let Some(one) = found.named() {
            let predicted = found.table.rows.iter().zip(&one.predicted_rad_s);
            let predicted = predicted.filter_map(|(row, predicted)| Some((row.nominal, predicted[index]?)));
            series.insert(1, Series::new(one.name(), Color::Green, Mark::Line, predicted.collect()));
        }
        series.retain(|series| !series.points.is_empty());
        let role = if column == found.fitted { "fitted" } else { "predicted only" };
        Panel { title: format!("{} ({role})", column.word()), ..Panel::new(Axis::nominal(), Axis::bandwidth(), series) }
    };
    Figure::new(
        FigureKind::Bandwidths,
        "Measured and simulated bandwidths",
        "The explanation is calibrated on one column alone. Where it meets the other one as well, it explains; where it only \
         follows the fitted one, it merely has enough numbers.",
        Column::ALL.map(panel).to_vec(),
    )
}

fn explanations(found: &BandwidthDiagnosis) -> Option<Figure> {
    let all = &found.explanations;
    if all.is_empty() {
        return None;
    }
    let name = |one: &Explanation| match one.standing {
        Standing::Chosen => format!("{} (taken)", one.name()),
        Standing::Alternative => format!("{} (as likely)", one.name()),
        Standing::Worse => one.name(),
    };
    let names: Vec<String> = std::iter::once("as it is".to_owned()).chain(all.iter().map(name)).collect();
    let points = |rms: Vec<Option<f64>>| -> Vec<(f64, f64)> {
        rms.into_iter().enumerate().filter_map(|(row, rms)| Some((rms?.max(LEAST), row as f64))).collect()
    };
    let fitted = std::iter::once(Some(found.fitted_gap.before)).chain(all.iter().map(|one| Some(one.fitted_rms)));
    let before = found.held_out.then_some(found.gap.before);
    let held_out = std::iter::once(before).chain(all.iter().map(|one| one.held_out_rms));
    let mut series = vec![
        Series::new(
            format!("{} column, fitted", found.fitted.word()),
            Color::Sky,
            Mark::Rings,
            points(fitted.collect()),
        ),
        Series::new(
            format!("{} column, predicted", found.fitted.other().word()),
            Color::Vermilion,
            Mark::Discs,
            points(held_out.collect()),
        ),
    ];
    series.retain(|series| !series.points.is_empty());
    let axis = Axis::log("RMS of ln(measured / predicted)", "dimensionless");
    let panel =
        Panel { height: names.len() as u32 * LINE + AROUND, ..Panel::new(axis, Axis::names("", names), series) };
    Some(Figure::new(
        FigureKind::Explanations,
        "Explanations side by side",
        "Left is better. The ring shows what an explanation was calibrated on, the dot what it then predicts; only the dot is \
         evidence.",
        vec![panel],
    ))
}
