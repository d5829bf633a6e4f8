//! Bandwidths, predicted and measured.

use rotorlead_identify::design::{BandwidthPoint, ChainPhase, PhaseAtBandwidth};
use rotorlead_identify::{Bandwidth, MeasuredBandwidth};

use crate::bandwidths::bandwidth_cell;
use crate::compensation::bandwidths;
use crate::html::{Cell, Column, Section, Table};

/// The bandwidth at each nominal command with the `phases` of the whole chain, where they are known, and those that records
/// show.
#[must_use]
pub fn bandwidth_section(points: &[BandwidthPoint], phases: &[ChainPhase], measured: &[MeasuredBandwidth]) -> Section {
    let mut text = vec![
        "The bandwidth is the smallest frequency at which the response is 3 dB under its static value.".to_owned(),
    ];
    if let Some(phase) = phases.first() {
        text.push(format!(
            "Phases are of the whole chain, with the model's dead time and {:.2} ms from pulse in to pulse out. The crossover \
             of a rate controller has to lie below -90 degrees.",
            1e3 * phase.latency_s
        ));
    }
    let mut tables = vec![predicted(points, phases)];
    if !measured.is_empty() {
        tables.push(of_records(measured));
    }
    Section { text, tables, figures: vec![bandwidths(points, measured)], ..Section::new("bandwidth", "Bandwidth") }
}

pub(super) fn cell(bandwidth: Bandwidth, digits: usize) -> Cell {
    Cell { text: bandwidth_cell(bandwidth, digits), value: Some(bandwidth.rad_s().unwrap_or(f64::NAN)) }
}

fn predicted(points: &[BandwidthPoint], phases: &[ChainPhase]) -> Table {
    let phase_cells = |phase: &PhaseAtBandwidth| [Cell::optional(phase.phase_deg, 1), cell(phase.minus_90, 2)];
    let row = |(index, point): (usize, &BandwidthPoint)| {
        let factor = point.compensated.rad_s().zip(point.uncompensated.rad_s()).map(|(after, before)| after / before);
        let mut cells = vec![
            Cell::number(point.nominal, 3),
            cell(point.uncompensated, 4),
            cell(point.compensated, 4),
            Cell::optional(factor, 2),
        ];
        if let Some(phase) = phases.get(index) {
            cells.extend([&phase.uncompensated, &phase.compensated].into_iter().flat_map(phase_cells));
        }
        cells
    };
    let mut columns = vec![
        Column::new("u_nom", "u_nom", "duty"),
        Column::new("uncompensated_rad_s", "without compensator", "rad/s"),
        Column::new("compensated_rad_s", "with compensator", "rad/s"),
        Column::new("factor", "factor", ""),
    ];
    if !phases.is_empty() {
        columns.extend([
            Column::new("uncompensated_phase_deg", "phase there without", "degrees"),
            Column::new("uncompensated_minus_90_rad_s", "-90 degrees without", "rad/s"),
            Column::new("compensated_phase_deg", "phase there with", "degrees"),
            Column::new("compensated_minus_90_rad_s", "-90 degrees with", "rad/s"),
        ]);
    }
    Table {
        name: "table_3".to_owned(),
        caption: "Predicted bandwidth".to_owned(),
        columns,
        rows: points.iter().enumerate().map(row).collect(),
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
