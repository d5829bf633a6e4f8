//! Bandwidths, predicted and measured.

use crate::design::BandwidthPoint;
use crate::identify::{Bandwidth, MeasuredBandwidth};
use crate::report::bandwidths::bandwidth_cell;
use crate::report::compensation::bandwidths;
use crate::report::html::{Cell, Column, Section, Table};

/// The bandwidth at each nominal command, and those that records show.
#[must_use]
pub fn bandwidth_section(points: &[BandwidthPoint], measured: &[MeasuredBandwidth]) -> Section {
    let text = vec![
        "The bandwidth is the smallest frequency at which the response is 3 dB under its static value.".to_owned(),
    ];
    let mut tables = vec![predicted(points)];
    if !measured.is_empty() {
        tables.push(of_records(measured));
    }
    Section { text, tables, figures: vec![bandwidths(points, measured)], ..Section::new("bandwidth", "Bandwidth") }
}

pub(super) fn cell(bandwidth: Bandwidth, digits: usize) -> Cell {
    Cell { text: bandwidth_cell(bandwidth, digits), value: Some(bandwidth.rad_s().unwrap_or(f64::NAN)) }
}

fn predicted(points: &[BandwidthPoint]) -> Table {
    let row = |point: &BandwidthPoint| {
        let factor = point.compensated.rad_s().zip(point.uncompensated.rad_s()).map(|(after, before)| after / before);
        vec![
            Cell::number(point.nominal, 3),
            cell(point.uncompensated, 4),
            cell(point.compensated, 4),
            Cell::optional(factor, 2),
        ]
    };
    Table {
        name: "table_3".to_owned(),
        caption: "Predicted bandwidth".to_owned(),
        columns: vec![
            Column::new("u_nom", "u_nom", "duty"),
            Column::new("uncompensated_rad_s", "without compensator", "rad/s"),
            Column::new("compensated_rad_s", "with compensator", "rad/s"),
            Column::new("factor", "factor", ""),
        ],
        rows: points.iter().map(row).collect(),
    }
}

fn of_records(measured: &[MeasuredBandwidth]) -> Table {
    let row = |one: &MeasuredBandwidth| {
        vec![
            Cell::text(one.file.clone()),
            Cell::number(one.nominal, 3),
            Cell::text(if one.compensated { "with" } else { "without" }),
            cell(one.bandwidth.bandwidth, 2),
            cell(one.bandwidth.lower, 2),
            cell(one.bandwidth.upper, 2),
        ]
    };
    Table {
        name: "measured_bandwidths".to_owned(),
        caption: "Measured bandwidth, and its 95 % interval".to_owned(),
        columns: vec![
            Column::new("file", "record", ""),
            Column::new("u_nom", "u_nom", "duty"),
            Column::new("compensator", "compensator", ""),
            Column::new("bandwidth_rad_s", "bandwidth", "rad/s"),
            Column::new("lower_rad_s", "from", "rad/s"),
            Column::new("upper_rad_s", "to", "rad/s"),
        ],
        rows: measured.iter().map(row).collect(),
    }
}
