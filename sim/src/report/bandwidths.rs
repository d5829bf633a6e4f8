//! Bandwidths as a table, and as JSON.

use serde_json::{Value, json};

use crate::design::BandwidthPoint;
use crate::identify::Bandwidth;

/// One line per nominal command, with a heading.
#[must_use]
pub fn bandwidth_table(points: &[BandwidthPoint]) -> String {
    let mut text = String::from("  u_nom   uncompensated     compensated\n               (rad/s)         (rad/s)\n");
    let cell = |bandwidth: Bandwidth| match bandwidth {
        Bandwidth::At(omega) => format!("{omega:.4}"),
        Bandwidth::Beyond(limit) => format!("> {limit:.0}"),
    };
    for point in points {
        let (before, after) = (cell(point.uncompensated), cell(point.compensated));
        text.push_str(&format!("  {:<5.3} {before:>15} {after:>15}\n", point.nominal));
    }
    text
}

/// One object per nominal command: `nominal`, `uncompensated_rad_s`, `compensated_rad_s`.
#[must_use]
pub fn bandwidth_json(points: &[BandwidthPoint]) -> Value {
    let point = |point: &BandwidthPoint| {
        json!({
            "nominal": point.nominal,
            "uncompensated_rad_s": rad_s(point.uncompensated),
            "compensated_rad_s": rad_s(point.compensated),
        })
    };
    points.iter().map(point).collect()
}

/// A bandwidth as a number, or null where there is none in the range searched.
#[must_use]
pub fn rad_s(bandwidth: Bandwidth) -> Value {
    bandwidth.rad_s().map_or(Value::Null, Value::from)
}
