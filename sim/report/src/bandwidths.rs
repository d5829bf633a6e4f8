//! Bandwidths as a table, and as JSON.

use rotorlead_identify::design::{BandwidthPoint, ChainPhase, PhaseAtBandwidth};
use rotorlead_identify::{Bandwidth, MeasuredBandwidth};
use serde_json::{Value, json};

/// One line per nominal command, with a heading. `phases` are those of the same points.
#[must_use]
pub fn bandwidth_table(points: &[BandwidthPoint], phases: &[ChainPhase]) -> String {
    let mut text = String::from(
        "  u_nom            uncompensated                     compensated
              -3 dB   phase  -90 deg          -3 dB   phase  -90 deg
            (rad/s)   (deg)  (rad/s)        (rad/s)   (deg)  (rad/s)\n",
    );
    let cells = |bandwidth: Bandwidth, phase: &PhaseAtBandwidth| {
        let phase_deg = phase.phase_deg.map_or_else(|| "-".to_owned(), |deg| format!("{deg:.1}"));
        format!("{:>11} {phase_deg:>7} {:>8}", bandwidth_cell(bandwidth, 4), bandwidth_cell(phase.minus_90, 2))
    };
    for (point, phase) in points.iter().zip(phases) {
        let before = cells(point.uncompensated, &phase.uncompensated);
        let after = cells(point.compensated, &phase.compensated);
        text.push_str(&format!("  {:<5.3} {before}    {after}\n", point.nominal));
    }
    text
}

/// One object per nominal command: `nominal`, and without and with the compensator the bandwidth, the phase there and the
/// frequency of -90 degrees; null where there is none in the range searched.
#[must_use]
pub fn bandwidth_json(points: &[BandwidthPoint], phases: &[ChainPhase]) -> Value {
    let point = |(point, phase): (&BandwidthPoint, &ChainPhase)| {
        json!({
            "nominal": point.nominal,
            "uncompensated_rad_s": rad_s(point.uncompensated),
            "uncompensated_phase_deg": phase.uncompensated.phase_deg,
            "uncompensated_minus_90_rad_s": rad_s(phase.uncompensated.minus_90),
            "compensated_rad_s": rad_s(point.compensated),
            "compensated_phase_deg": phase.compensated.phase_deg,
            "compensated_minus_90_rad_s": rad_s(phase.compensated.minus_90),
            "dead_time_s": phase.model_dead_time_s,
        })
    };
    points.iter().zip(phases).map(point).collect()
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
