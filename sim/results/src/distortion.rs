//! Noise and nonlinear distortion, per nominal command.

use rotorlead_answer::{Cell, Column, Table};
use rotorlead_identify::frequency_response::distortion::DistortionLevel;
use rotorlead_identify::lag::multisine::{NominalIdentification, PeriodicIdentification};
use serde::Serialize;

/// The levels at one nominal command, dB; null where its records do not tell them.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct DistortionValues {
    nominal: f64,
    noise_db: Option<f64>,
    even: Option<DistortionLevel>,
    odd: Option<DistortionLevel>,
    realizations: Option<usize>,
    stochastic_db: Option<f64>,
}

impl DistortionValues {
    /// Of one nominal command.
    #[must_use]
    pub fn from_nominal(found: &NominalIdentification) -> Self {
        let robust = found.robust.as_ref();
        Self {
            nominal: found.nominal,
            noise_db: found.distortion.map(|distortion| distortion.noise_db()),
            even: found.distortion.and_then(|distortion| distortion.even),
            odd: found.distortion.and_then(|distortion| distortion.odd),
            realizations: robust.map(|robust| robust.realizations),
            stochastic_db: robust.map(|robust| robust.stochastic_db),
        }
    }
}

/// The levels at every nominal command whose records can tell; `None` without any.
#[must_use]
pub fn distortion_table(found: &PeriodicIdentification) -> Option<Table> {
    let known: Vec<_> = found.nominals.iter().filter(|nominal| nominal.distortion.is_some()).collect();
    let row = |nominal: &&NominalIdentification| {
        let DistortionValues { nominal, noise_db, even, odd, stochastic_db, .. } =
            DistortionValues::from_nominal(nominal);
        vec![Cell::number(nominal, 3), decibels(noise_db), level(even), level(odd), decibels(stochastic_db)]
    };
    let mut caption =
        "Noise and distortion of one line, mean over the periods, relative to the linear response".to_owned();
    if known.iter().all(|nominal| nominal.distortion.is_some_and(|distortion| distortion.odd.is_none())) {
        caption +=
            ". No odd line is skipped, so odd distortion does not show: `rotorlead excite --detection` skips some.";
    }
    (!known.is_empty()).then(|| Table {
        name: "distortion".to_owned(),
        caption,
        columns: vec![
            Column::new("u_nom", "u_nom", "duty"),
            Column::new("noise_db", "noise", "dB"),
            Column::new("even_db", "even", "dB"),
            Column::new("odd_db", "odd", "dB"),
            Column::new("stochastic_db", "other phases", "dB"),
        ],
        rows: known.iter().map(row).collect(),
        ..Table::default()
    })
}

fn decibels(value: Option<f64>) -> Cell {
    match value {
        Some(value) if !value.is_finite() => Cell::text("none"),
        value => Cell::optional(value, 1),
    }
}

fn level(level: Option<DistortionLevel>) -> Cell {
    match level {
        Some(level) if !level.is_seen() => Cell::text("in noise"),
        level => decibels(level.map(|level| level.relative_db)),
    }
}
