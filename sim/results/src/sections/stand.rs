//! A stand that was identified.

use std::f64::consts::TAU;

use rotorlead_answer::{Cell, Column, Section, Table};
use rotorlead_identify::stand::StandIdentification;
use rotorlead_identify::times_noise;

use super::estimate;
use crate::figures::stand::stand_figures;

/// Its poles and zeros, and its frequency response.
#[must_use]
pub fn stand_section(stand: &StandIdentification) -> Section {
    let fit = &stand.fit;
    let text = vec![format!(
        "{} lines up to {:.1} Hz, {}: it leaves {}.",
        stand.response.lines.len(),
        stand.top_hz,
        fit.structure,
        times_noise(fit.residual.reduced_chi_square, 2)
    )];
    Section {
        text,
        tables: vec![stand_table(stand)],
        figures: stand_figures(stand),
        ..Section::new("stand", "The stand")
    }
}

/// The poles, and then the zeros.
#[must_use]
pub fn stand_table(stand: &StandIdentification) -> Table {
    let roots = stand.poles().map(|root| ("pole", root)).chain(stand.zeros().map(|root| ("zero", root)));
    let rows = roots.map(|(kind, root)| {
        let frequency = root.frequency_rad_s;
        let damping = if root.is_pair() {
            estimate(root.damping.value, Some(root.damping.std), 1.0, 4)
        } else {
            Cell::text(if root.damping.value < 0.0 { "real, right half" } else { "real" })
        };
        vec![
            Cell::text(kind),
            estimate(frequency.value, Some(frequency.std), 1.0, 2),
            estimate(frequency.value, Some(frequency.std), 1.0 / TAU, 3),
            damping,
        ]
    });
    Table {
        name: "poles_and_zeros".to_owned(),
        caption: format!(
            "Poles and zeros up to {:.1} Hz, as far as the lines say them; pairs count once",
            stand.top_hz
        ),
        columns: vec![
            Column::new("kind", "", ""),
            Column::new("frequency_rad_s", "frequency", "rad/s"),
            Column::new("frequency_hz", "frequency", "Hz"),
            Column::new("damping", "damping ratio", ""),
        ],
        rows: rows.collect(),
        ..Table::default()
    }
}
