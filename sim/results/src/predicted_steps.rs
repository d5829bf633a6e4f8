//! Predicted steps, without and with a compensator, and what is left of one where the actuator differs.

use rotorlead_answer::{Cell, Column, Table};
use rotorlead_identify::design::{DEVIATIONS, Robustness, StepPoint, StepResponse};

use crate::bandwidths::bandwidth_cell;

/// Rise, overshoot and settling of each step.
#[must_use]
pub fn steps_table(steps: &[StepPoint]) -> Table {
    let ms = |seconds: Option<f64>| Cell::optional(seconds.map(|seconds| 1e3 * seconds), 1);
    let of = |response: &StepResponse| {
        [ms(response.rise_s), Cell::number(100.0 * response.overshoot, 1), ms(response.settling_s)]
    };
    let row = |StepPoint { nominal, step, uncompensated, compensated }: &StepPoint| {
        let head = [Cell::number(*nominal, 3), Cell::shown(*step, format!("{step:+.3}"))];
        head.into_iter().chain(of(uncompensated)).chain(of(compensated)).collect()
    };
    let column = |key, heading, unit| Column::new(key, heading, unit);
    Table {
        name: "steps".to_owned(),
        caption: "Steps: rise from 10 to 90 %, overshoot, and settling to 5 %, without and with the compensator"
            .to_owned(),
        columns: vec![
            column("u_nom", "u_nom", "duty"),
            column("step", "step", "duty"),
            column("uncompensated_rise_ms", "rise without", "ms"),
            column("uncompensated_overshoot_percent", "overshoot without", "%"),
            column("uncompensated_settling_ms", "settling without", "ms"),
            column("compensated_rise_ms", "rise with", "ms"),
            column("compensated_overshoot_percent", "overshoot with", "%"),
            column("compensated_settling_ms", "settling with", "ms"),
        ],
        rows: steps.iter().map(row).collect(),
        ..Table::default()
    }
}

/// What compensators do where the actuator differs from its model: each has a name and a row for each of [`DEVIATIONS`].
#[must_use]
pub fn robustness_table(compensators: &[(&str, Vec<Robustness>)]) -> Table {
    let rows = compensators.iter().flat_map(|(name, found)| {
        DEVIATIONS.iter().zip(found).map(move |(deviation, found)| {
            vec![
                Cell::text(*name),
                Cell::text(deviation.name),
                bandwidth_cell(found.lowest, 1),
                bandwidth_cell(found.highest, 1),
                bandwidth_cell(found.lowest_phase, 1),
                Cell::number(found.peak_db, 2),
                Cell::number(100.0 * found.overshoot, 1),
            ]
        })
    });
    let column = |key, heading, unit| Column::new(key, heading, unit);
    Table {
        name: "robustness".to_owned(),
        caption: "Where the actuator differs from its model: over all points, by small sinusoids and by steps of 0.05"
            .to_owned(),
        columns: vec![
            column("compensator", "", ""),
            column("deviation", "actuator", ""),
            column("lowest_rad_s", "lowest bandwidth", "rad/s"),
            column("highest_rad_s", "highest bandwidth", "rad/s"),
            column("lowest_phase_rad_s", "lowest -90 degrees", "rad/s"),
            column("peak_db", "peak", "dB"),
            column("overshoot_percent", "overshoot", "%"),
        ],
        rows: rows.collect(),
        ..Table::default()
    }
}
