//! Noise and nonlinear distortion, per nominal command.

use rotorlead_identify::{DistortionLevel, PeriodicIdentification};
use serde_json::{Value, json};

/// The levels at every nominal command whose records can tell; empty without any.
#[must_use]
pub fn distortion_table(found: &PeriodicIdentification) -> String {
    let rows: String = found
        .nominals
        .iter()
        .filter_map(|nominal| nominal.distortion.map(|distortion| (nominal, distortion)))
        .map(|(nominal, distortion)| {
            let robust = nominal.robust.as_ref();
            format!(
                "  {:<5.3} {:>12} {:>12} {:>12} {:>20}\n",
                nominal.nominal,
                decibels(distortion.noise_db()),
                level(distortion.even),
                level(distortion.odd),
                robust.map_or_else(|| String::from("-"), |robust| decibels(robust.stochastic_db)),
            )
        })
        .collect();
    if rows.is_empty() {
        return rows;
    }
    let none_skipped = found.nominals.iter().all(|nominal| nominal.distortion.is_none_or(|d| d.odd.is_none()));
    let hint = if none_skipped {
        "  No odd line is skipped, so odd distortion does not show:\n  `rotorlead excite --detection` skips some.\n"
    } else {
        ""
    };
    format!(
        "\n  u_nom   noise (dB)    even (dB)     odd (dB)   other phases (dB)\n{rows}  \
         Of one line, mean over the periods, relative to the linear response.\n{hint}"
    )
}

/// The same for programs: one object per nominal command.
#[must_use]
pub fn distortion_json(found: &PeriodicIdentification) -> Value {
    let level = |level: Option<DistortionLevel>| {
        level.map(|level| {
            json!({
                "lines": level.lines,
                "level_db": finite(level.relative_db),
                "p_value": level.p_value,
                "seen": level.is_seen(),
                "strong": level.is_strong(),
            })
        })
    };
    found
        .nominals
        .iter()
        .map(|nominal| {
            let distortion = nominal.distortion;
            json!({
                "nominal": nominal.nominal,
                "noise_db": distortion.and_then(|d| finite(d.noise_db())),
                "even": level(distortion.and_then(|d| d.even)),
                "odd": level(distortion.and_then(|d| d.odd)),
                "realizations": nominal.robust.as_ref().map(|robust| robust.realizations),
                "stochastic_db": nominal.robust.as_ref().and_then(|robust| finite(robust.stochastic_db)),
            })
        })
        .collect()
}

/// JSON has no infinity.
fn finite(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}

fn decibels(value: f64) -> String {
    finite(value).map_or_else(|| String::from("none"), |value| format!("{value:.1}"))
}

fn level(level: Option<DistortionLevel>) -> String {
    match level {
        None => String::from("-"),
        Some(level) if level.is_seen() => decibels(level.relative_db),
        Some(_) => String::from("in noise"),
    }
}
