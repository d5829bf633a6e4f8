//! The lags that were identified.

use rotorlead_identify::Identification;
use rotorlead_plant::{Model, Point};
use rotorlead_records::Output;

use super::estimate;
use crate::etfe::responses;
use crate::figure::{Axis, Color, Figure, FigureKind, Mark, Panel, Series};
use crate::html::{Cell, Column, Section, Table};
use crate::static_map::static_map;
use crate::unit::unit;

/// The lags as a table, the responses that they were fitted to, and the static map.
#[must_use]
pub fn identification_section(identified: &Identification, output: Output) -> Section {
    let mut figures: Vec<Figure> =
        identified.lags.in_frequency().and_then(|found| responses(found, output)).into_iter().collect();
    figures.extend(directions(&identified.model));
    figures.extend(identified.static_map.as_ref().map(|(points, fit)| static_map(points, fit, output)));
    let text = vec![
        "At each nominal command the actuator is a first-order lag, response = gain / (tau s + 1), with a dead time where the \
         records show one. ± is one standard error, of the noise alone."
            .to_owned(),
    ];
    Section {
        text,
        tables: vec![lags(identified, output)],
        figures,
        ..Section::new("identification", "Identified lags")
    }
}

fn lags(identified: &Identification, output: Output) -> Table {
    let points = &identified.model.points;
    let both_ways = points.iter().any(|point| point.time_constant_up_s.is_some());
    let mut columns = vec![
        Column::new("u_nom", "u_nom", "duty"),
        Column::new("gain", "gain", unit(output)),
        Column::new("time_constant_ms", "tau", "ms"),
        Column::new("pole_rad_s", "1/tau", "rad/s"),
        Column::new("delay_ms", "dead time", "ms"),
    ];
    if both_ways {
        columns.push(Column::new("time_constant_up_ms", "tau upward", "ms"));
        columns.push(Column::new("time_constant_down_ms", "tau downward", "ms"));
    }
    columns.push(Column::new("fit_frequency_percent", "fit in frequency", "%"));
    columns.push(Column::new("fit_square_percent", "fit on squares", "%"));
    if identified.lags.in_frequency().is_some() {
        columns.push(Column::new("reduced_chi_square", "chi-square / dof", ""));
    }
    let row = |(index, point): (usize, &Point)| {
        let delay = match point.delay_s_std {
            Some(std) => estimate(point.delay_s, Some(std), 1e3, 2),
            None if point.delay_s == 0.0 => Cell::text("-"),
            None => Cell::number(1e3 * point.delay_s, 2),
        };
        let mut row = vec![
            Cell::number(point.nominal, 3),
            estimate(point.gain, point.gain_std, 1.0, 4),
            estimate(point.time_constant_s, point.time_constant_s_std, 1e3, 2),
            Cell::number(1.0 / point.time_constant_s, 3),
            delay,
        ];
        if both_ways {
            for tau in [point.time_constant_up_s, point.time_constant_down_s] {
                row.push(Cell::optional(tau.map(|tau| 1e3 * tau), 2));
            }
        }
        row.push(Cell::optional(point.fit_frequency_percent, 2));
        row.push(Cell::optional(point.fit_square_percent, 2));
        if let Some(found) = identified.lags.in_frequency() {
            row.push(Cell::optional(found.nominals.get(index).map(|nominal| nominal.fit.reduced_chi_square), 2));
        }
        row
    };
    Table {
        name: "table_1".to_owned(),
        caption: "Lag at each nominal command".to_owned(),
        columns,
        rows: points.iter().enumerate().map(row).collect(),
    }
}

/// Time constants upward and downward, where steps tell them apart.
fn directions(model: &Model) -> Option<Figure> {
    let points = |tau: fn(&Point) -> Option<f64>| -> Vec<(f64, f64)> {
        model.points.iter().filter_map(|point| Some((point.nominal, 1e3 * tau(point)?))).collect()
    };
    let mut series = vec![
        Series::new("upward", Color::Blue, Mark::Discs, points(|point| point.time_constant_up_s)),
        Series::new("downward", Color::Vermilion, Mark::Rings, points(|point| point.time_constant_down_s)),
    ];
    series.retain(|series| !series.points.is_empty());
    (!series.is_empty()).then(|| {
        Figure::new(
            FigureKind::TimeConstants,
            "Time constants upward and downward",
            "An actuator that slows down later than it speeds up is not one lag: `rotorlead diagnose` weighs that.",
            vec![Panel::new(Axis::nominal(), Axis::linear("time constant", "ms"), series)],
        )
    })
}
