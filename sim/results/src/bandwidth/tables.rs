//! The tables of bandwidths, and what programs read of them.

use rotorlead_answer::{Cell, CellValue, ColumnSpec, Table, Unit, build_table};
use rotorlead_design::{BandwidthPoint, ChainPhase, Robustness, StepPoint};
use rotorlead_identify::frequency_response::bandwidth::Bandwidth;
use rotorlead_identify::lag::multisine::MeasuredBandwidth;
use serde::Serialize;

const DEGREES: Unit = Unit::plain("deg");

/// The bandwidths at one nominal command, with the phase of the whole chain there and the frequency at which it is -90 degrees.
#[derive(Clone, Copy, Debug, Serialize)]
pub(super) struct BandwidthValues {
    #[serde(flatten)]
    point: BandwidthPoint,
    uncompensated_phase_deg: Option<f64>,
    uncompensated_minus_90_rad_s: Bandwidth,
    compensated_phase_deg: Option<f64>,
    compensated_minus_90_rad_s: Bandwidth,
    dead_time_s: f64,
}

/// One value per nominal command. `phases` are those of the same points.
pub(super) fn bandwidth_values(points: &[BandwidthPoint], phases: &[ChainPhase]) -> Vec<BandwidthValues> {
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

/// The same in a typed column.
fn datum(bandwidth: Bandwidth) -> CellValue {
    match bandwidth.rad_s().filter(|omega_rad_s| omega_rad_s.is_finite()) {
        Some(omega_rad_s) => CellValue::Number(omega_rad_s),
        None => CellValue::Unknown(bandwidth_text(bandwidth, 0).into()),
    }
}

/// One row per nominal command. `phases` are those of the same points.
pub(super) fn predicted(points: &[BandwidthPoint], phases: &[ChainPhase]) -> Table {
    type Row<'a> = (&'a BandwidthPoint, &'a ChainPhase);
    let factor = |(point, _): &Row| Some(point.compensated.rad_s()? / point.uncompensated.rad_s()?);
    let columns = [
        ColumnSpec::new("u_nom", "u_nom", Unit::DUTY, 3, |(point, _): &Row| point.nominal),
        ColumnSpec::new("uncompensated_rad_s", "without compensator", Unit::RAD_S, 4, |(point, _): &Row| {
            datum(point.uncompensated)
        }),
        ColumnSpec::new("uncompensated_phase_deg", "phase there without", DEGREES, 1, |(_, phase): &Row| {
            phase.uncompensated.phase_deg
        }),
        ColumnSpec::new("uncompensated_minus_90_rad_s", "-90 degrees without", Unit::RAD_S, 2, |(_, phase): &Row| {
            datum(phase.uncompensated.minus_90)
        }),
        ColumnSpec::new("compensated_rad_s", "with compensator", Unit::RAD_S, 4, |(point, _): &Row| {
            datum(point.compensated)
        }),
        ColumnSpec::new("compensated_phase_deg", "phase there with", DEGREES, 1, |(_, phase): &Row| {
            phase.compensated.phase_deg
        }),
        ColumnSpec::new("compensated_minus_90_rad_s", "-90 degrees with", Unit::RAD_S, 2, |(_, phase): &Row| {
            datum(phase.compensated.minus_90)
        }),
        ColumnSpec::new("factor", "factor", Unit::NONE, 2, factor).in_detail(),
    ];
    let caption = "Predicted bandwidth: the smallest frequency at which the response is 3 dB under its static value";
    build_table("predicted_bandwidth", caption, &columns, &points.iter().zip(phases).collect::<Vec<_>>())
}

/// One row per record.
pub(super) fn measured(measured: &[MeasuredBandwidth]) -> Table {
    type Row = MeasuredBandwidth;
    let columns = [
        ColumnSpec::new("file", "record", Unit::NONE, 0, |one: &Row| one.file.clone()),
        ColumnSpec::new("u_nom", "u_nom", Unit::DUTY, 3, |one: &Row| one.nominal),
        ColumnSpec::new("compensator", "compensator", Unit::NONE, 0, |one: &Row| {
            (if one.compensated { "with" } else { "without" }).to_owned()
        }),
        ColumnSpec::new("bandwidth_rad_s", "bandwidth", Unit::RAD_S, 2, |one: &Row| datum(one.bandwidth.bandwidth)),
        ColumnSpec::new("lower_rad_s", "from", Unit::RAD_S, 2, |one: &Row| datum(one.bandwidth.lower)),
        ColumnSpec::new("upper_rad_s", "to", Unit::RAD_S, 2, |one: &Row| datum(one.bandwidth.upper)),
    ];
    let caption = "Measured bandwidth, and its 95 % interval. Where a compensated response runs almost level near -3 dB, 0.1 dB moves its \
                   bandwidth by a tenth.";
    build_table("measured_bandwidths", caption, &columns, measured)
}

/// Rise, overshoot and settling of each step.
pub(super) fn steps(steps: &[StepPoint]) -> Table {
    type Row = StepPoint;
    let ms = |key, heading: &str, get: fn(&Row) -> Option<f64>| {
        ColumnSpec::new(key, heading, Unit::plain("ms"), 1, move |row: &Row| get(row).map(|seconds| 1e3 * seconds))
    };
    let percent = |key, heading: &str, get: fn(&Row) -> f64| {
        ColumnSpec::new(key, heading, Unit::PERCENT, 1, move |row: &Row| 100.0 * get(row))
    };
    let columns = [
        ColumnSpec::new("u_nom", "u_nom", Unit::DUTY, 3, |row: &Row| row.nominal),
        ColumnSpec::new("step", "step", Unit::DUTY, 3, |row: &Row| {
            CellValue::Shown(row.step, format!("{:+.3}", row.step))
        }),
        ms("uncompensated_rise_ms", "rise without", |row| row.uncompensated.rise_s),
        percent("uncompensated_overshoot_percent", "overshoot without", |row| row.uncompensated.overshoot),
        ms("uncompensated_settling_ms", "settling without", |row| row.uncompensated.settling_s),
        ms("compensated_rise_ms", "rise with", |row| row.compensated.rise_s),
        percent("compensated_overshoot_percent", "overshoot with", |row| row.compensated.overshoot),
        ms("compensated_settling_ms", "settling with", |row| row.compensated.settling_s),
    ];
    let caption = "Steps: rise from 10 to 90 %, overshoot, and settling to 5 %, without and with the compensator";
    build_table("steps", caption, &columns, steps)
}

/// A compensator on an actuator that differs from its model.
#[derive(Clone, Debug, Serialize)]
pub struct DeviatingActuator {
    /// What stands before it.
    pub compensator: &'static str,
    /// By what it differs.
    pub deviation: &'static str,
    /// What comes of it.
    #[serde(flatten)]
    pub found: Robustness,
}

/// One row per compensator and deviation.
pub(super) fn robustness(found: &[DeviatingActuator]) -> Table {
    type Row = DeviatingActuator;
    let columns = [
        ColumnSpec::new("compensator", "", Unit::NONE, 0, |row: &Row| row.compensator.to_owned()),
        ColumnSpec::new("deviation", "actuator", Unit::NONE, 0, |row: &Row| row.deviation.to_owned()),
        ColumnSpec::new("lowest_rad_s", "lowest bandwidth", Unit::RAD_S, 1, |row: &Row| datum(row.found.lowest)),
        ColumnSpec::new("highest_rad_s", "highest bandwidth", Unit::RAD_S, 1, |row: &Row| datum(row.found.highest)),
        ColumnSpec::new("lowest_phase_rad_s", "lowest -90 degrees", Unit::RAD_S, 1, |row: &Row| {
            datum(row.found.lowest_phase_crossing)
        }),
        ColumnSpec::new("peak_db", "peak", Unit::plain("dB"), 2, |row: &Row| row.found.peak_db),
        ColumnSpec::new("overshoot_percent", "overshoot", Unit::PERCENT, 1, |row: &Row| 100.0 * row.found.overshoot),
    ];
    let caption = "Where the actuator differs from its model: over all points, by small sinusoids and by steps of 0.05";
    build_table("robustness", caption, &columns, found)
}
