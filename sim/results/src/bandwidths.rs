//! Bandwidths: their tables, and their values for programs.

use rotorlead_answer::{Cell, Column, Table};
use rotorlead_identify::design::{BandwidthPoint, ChainPhase, PhaseAtBandwidth};
use rotorlead_identify::{Bandwidth, MeasuredBandwidth};
use serde::Serialize;

/// The bandwidths at one nominal command, with the phase of the whole chain there and the frequency at which it is -90 degrees.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct BandwidthValues {
    #[serde(flatten)]
    point: BandwidthPoint,
    uncompensated_phase_deg: Option<f64>,
    uncompensated_minus_90_rad_s: Bandwidth,
    compensated_phase_deg: Option<f64>,
    compensated_minus_90_rad_s: Bandwidth,
    dead_time_s: f64,
}

/// One value per nominal command. `phases` are those of the same points.
#[must_use]
pub fn bandwidth_values(points: &[BandwidthPoint], phases: &[ChainPhase]) -> Vec<BandwidthValues> {
    let values = |(point, phase): (&BandwidthPoint, &ChainPhase)| BandwidthValues {
        point: *point,
        uncompensated_phase_deg: phase.uncompensated.phase_deg,
        uncompensated_minus_90_rad_s: phase.uncompensated.minus_90,
        compensated_phase_deg: phase.compensated.phase_deg,
        compensated_minus_90_rad_s: phase.compensated.minus_90,
        dead_time_s: phase.model_dead_time_s,
    };
    points.iter().zip(phases).map(values).collect()
}

/// A bandwidth in a column, or the frequency up to which there is none.
#[must_use]
pub fn bandwidth_text(bandwidth: Bandwidth, digits: usize) -> String {
    match bandwidth {
        Bandwidth::At(omega) => format!("{omega:.digits$}"),
        Bandwidth::Beyond(limit) => format!("> {limit:.0}"),
    }
}

/// A bandwidth as a cell: its words and, where there is one, its number.
#[must_use]
pub fn bandwidth_cell(bandwidth: Bandwidth, digits: usize) -> Cell {
    let text = bandwidth_text(bandwidth, digits);
    match bandwidth.rad_s().filter(|omega_rad_s| omega_rad_s.is_finite()) {
        Some(omega_rad_s) => Cell::shown(omega_rad_s, text),
        None => Cell::unknown(text),
    }
}

/// One row per nominal command, with the `phases` of the same points where they are known.
#[must_use]
pub fn bandwidth_table(points: &[BandwidthPoint], phases: &[ChainPhase]) -> Table {
    let phase_cells =
        |phase: &PhaseAtBandwidth| [Cell::optional(phase.phase_deg, 1), bandwidth_cell(phase.minus_90, 2)];
    let row = |(index, point): (usize, &BandwidthPoint)| {
        let factor = point.compensated.rad_s().zip(point.uncompensated.rad_s()).map(|(after, before)| after / before);
        let phase = phases.get(index);
        let with_phase = |bandwidth, phase: Option<&PhaseAtBandwidth>| -> Vec<Cell> {
            std::iter::once(bandwidth_cell(bandwidth, 4)).chain(phase.into_iter().flat_map(phase_cells)).collect()
        };
        std::iter::once(Cell::number(point.nominal, 3))
            .chain(with_phase(point.uncompensated, phase.map(|phase| &phase.uncompensated)))
            .chain(with_phase(point.compensated, phase.map(|phase| &phase.compensated)))
            .chain([Cell::optional(factor, 2)])
            .collect()
    };
    let mut columns = vec![
        Column::new("u_nom", "u_nom", "duty"),
        Column::new("uncompensated_rad_s", "without compensator", "rad/s"),
        Column::new("uncompensated_phase_deg", "phase there without", "deg"),
        Column::new("uncompensated_minus_90_rad_s", "-90 degrees without", "rad/s"),
        Column::new("compensated_rad_s", "with compensator", "rad/s"),
        Column::new("compensated_phase_deg", "phase there with", "deg"),
        Column::new("compensated_minus_90_rad_s", "-90 degrees with", "rad/s"),
        Column::new("factor", "factor", "").in_detail(),
    ];
    if phases.is_empty() {
        columns.retain(|column| !(column.name.ends_with("phase_deg") || column.name.ends_with("minus_90_rad_s")));
    }
    Table {
        name: "predicted_bandwidth".to_owned(),
        caption: "Predicted bandwidth".to_owned(),
        columns,
        rows: points.iter().enumerate().map(row).collect(),
        ..Table::default()
    }
}

/// One row per record.
#[must_use]
pub fn measured_table(measured: &[MeasuredBandwidth]) -> Table {
    let row = |one: &MeasuredBandwidth| {
        vec![
            Cell::text(one.file.clone()),
            Cell::number(one.nominal, 3),
            Cell::text(if one.compensated { "with" } else { "without" }),
            bandwidth_cell(one.bandwidth.bandwidth, 2),
            bandwidth_cell(one.bandwidth.lower, 2),
            bandwidth_cell(one.bandwidth.upper, 2),
        ]
    };
    Table {
        name: "measured_bandwidths".to_owned(),
        caption: "Measured bandwidth, and its 95 % interval. Where a compensated response runs almost level near -3 dB, 0.1 dB \
                  moves its bandwidth by a tenth."
            .to_owned(),
        columns: vec![
            Column::new("file", "record", ""),
            Column::new("u_nom", "u_nom", "duty"),
            Column::new("compensator", "compensator", ""),
            Column::new("bandwidth_rad_s", "bandwidth", "rad/s"),
            Column::new("lower_rad_s", "from", "rad/s"),
            Column::new("upper_rad_s", "to", "rad/s"),
        ],
        rows: measured.iter().map(row).collect(),
        ..Table::default()
    }
}
