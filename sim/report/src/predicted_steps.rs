//! Predicted steps, without and with a compensator.

use rotorlead_identify::design::{StepPoint, StepResponse};

use crate::html::{Cell, Column, Table};

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
    }
}
