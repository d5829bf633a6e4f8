//! Bandwidths as a table, and as JSON.

use serde_json::{Value, json};

use crate::design::BandwidthPoint;
use crate::identify::{Bandwidth, MeasuredBandwidth};

/// One line per nominal command, with a heading.
#[must_use]
pub fn bandwidth_table(points: &[BandwidthPoint]) -> String {
    let mut text = String::from("  u_nom   uncompensated     compensated\n               (rad/s)         (rad/s)\n");
    for point in points {
        let (before, after) = (bandwidth_cell(point.uncompensated, 4), bandwidth_cell(point.compensated, 4));
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

/// One line per record, with a heading, and what the intervals mean.
#[must_use]
pub fn measured_table(measured: &[MeasuredBandwidth]) -> String {
    let mut text = String::from(
        "  u_nom   compensator     measured   95 % interval     record\n                           (rad/s)   (rad/s)\n",
    );
    for MeasuredBandwidth { file, nominal, compensated, bandwidth } in measured {
        let interval = format!("{} .. {}", bandwidth_cell(bandwidth.lower, 2), bandwidth_cell(bandwidth.upper, 2));
        let value = bandwidth_cell(bandwidth.bandwidth, 2);
        let with = if *compensated { "with" } else { "without" };
        text.push_str(&format!("  {nominal:<5.3}   {with:<11} {value:>12}   {interval:<15}   {file}\n"));
    }
    text.push_str(
        "  Where a compensated response runs almost level near -3 dB,\n  0.1 dB moves its bandwidth by a tenth.\n",
    );
    text
}

/// One object per record.
#[must_use]
pub fn measured_json(measured: &[MeasuredBandwidth]) -> Value {
    let record = |measured: &MeasuredBandwidth| {
        json!({
            "file": measured.file,
            "nominal": measured.nominal,
            "compensated": measured.compensated,
            "bandwidth_rad_s": rad_s(measured.bandwidth.bandwidth),
            "interval_rad_s": [rad_s(measured.bandwidth.lower), rad_s(measured.bandwidth.upper)],
        })
    };
    measured.iter().map(record).collect()
}

/// A bandwidth in a column, or the frequency up to which there is none.
#[must_use]
pub fn bandwidth_cell(bandwidth: Bandwidth, digits: usize) -> String {
    match bandwidth {
        Bandwidth::At(omega) => format!("{omega:.digits$}"),
        Bandwidth::Beyond(limit) => format!("> {limit:.0}"),
    }
}

/// A bandwidth as a number, or null where there is none in the range searched.
#[must_use]
pub fn rad_s(bandwidth: Bandwidth) -> Value {
    bandwidth.rad_s().map_or(Value::Null, Value::from)
}
