//! Actuators compared in a vehicle.

use rotorlead_answer::{Answer, CellValue, ColumnSpec, Table, Tone, Unit, Verdict, build_table};
use rotorlead_plant::Model;
use rotorlead_vehicle::{
    Airframe, AtLatency, Benefit, ForceRow, MotorControlKind, Performance, Ratios, Row, Study, TuningRule, findings,
    headline,
};
use serde_json::{Value, json};

use crate::caveats::judged;
use crate::figures::vehicle::vehicle_figures;
use crate::json_object::json_object;

const MILLISECONDS: Unit = Unit::plain("ms");
const DEGREES: Unit = Unit::plain("deg");

/// What each actuator is worth in `airframe` with the motors of `model`.
#[must_use]
pub fn vehicle_answer(study: &Study, airframe: &Airframe, model: &Model) -> Answer {
    let found = findings(study, airframe.hover.command, airframe.hover.range);
    let mut text = found.clone();
    text.extend(study.refused.iter().map(|one| format!("There is no {}: {}.", one.actuator.name(), one.reason)));
    if !model.effects.is_empty() {
        let kinds: Vec<&str> = model.effects.iter().map(|effect| effect.kind.as_str()).collect();
        text.push(format!("Left out of the model: {}.", kinds.join(", ")));
    }
    text.push(
        "Simulated: a rigid axis, rotors with one lag, no airflow, no vibration but the gyro's noise. It shows which actuator is \
         worth a flight, and does not replace one."
            .to_owned(),
    );
    let at_latency = |index: usize| {
        let [hover, range] = [false, true].map(|is_range| roll_table(study, airframe, index, is_range));
        [hover, range, other_table(study, airframe, index), gains_table(study, airframe, index).in_detail()]
    };
    let mut compared = study.latencies.iter().flat_map(|at| [&at.hover, &at.range]);
    let is_worse = compared.any(|rows| rows.iter().any(|row| row.benefit(&rows[0]) == Some(Benefit::Worse)));
    let over_none = |at: &AtLatency| {
        let beside = |rows: &[Row]| -> Value {
            rows.iter().map(|row| json!({"ratios": row.ratios(&rows[0]), "worth": row.benefit(&rows[0])})).collect()
        };
        json!({"latency_s": at.latency_s, "hover": beside(&at.hover), "range": beside(&at.range)})
    };
    let mut values = json_object(study);
    values.extend(json_object(&json!({
        "airframe": airframe,
        "over_none": study.latencies.iter().map(over_none).collect::<Value>(),
        "findings": found,
    })));
    Answer {
        name: "vehicle",
        title: "In a vehicle",
        text,
        verdict: Verdict::new(if is_worse { Tone::Attention } else { Tone::Good }, headline(study)),
        findings: judged(model).into_iter().collect(),
        tables: (0..study.latencies.len()).flat_map(at_latency).chain(force_table(study, airframe)).collect(),
        figures: vehicle_figures(study, airframe),
        values,
    }
}

fn rule_said(rule: &TuningRule, airframe: &Airframe) -> String {
    format!(
        "Each controller has the largest integral gain at an integral time of {} s that keeps a sensitivity of {}, a phase margin of \
         {:.0} degrees and a noise of the ESC's command of {}, and then the largest attitude gain at a sensitivity of {}.",
        airframe.controller.integral_time_s,
        rule.max_sensitivity,
        rule.phase_margin_deg,
        rule.actuator_noise,
        rule.attitude_max_sensitivity
    )
}

/// The column of the actuators' names.
fn actuator<'a, R: 'a>(get: fn(&R) -> MotorControlKind) -> ColumnSpec<'a, R> {
    ColumnSpec::words("actuator", "actuator", move |row: &R| get(row).name())
}

/// A column of what gain sets reach.
fn reached<'a>(
    key: &'static str,
    heading: &str,
    unit: Unit,
    decimals: usize,
    get: fn(&Performance) -> Option<f64>,
) -> ColumnSpec<'a, Row> {
    ColumnSpec::new(key, heading, unit, decimals, move |row: &Row| row.performance.as_ref().and_then(get))
}

/// One row per actuator at the latency `index`: tuned at hover, or one gain set for the range.
fn roll_table(study: &Study, airframe: &Airframe, index: usize, is_range: bool) -> Table {
    let at = &study.latencies[index];
    let rows = if is_range { &at.range } else { &at.hover };
    let bare = &rows[0];
    let (name, tuned) = if is_range {
        let [from, to] = airframe.hover.range;
        ("range", format!("one gain set for {from:.2} to {to:.2}, the worst of each"))
    } else {
        ("hover", format!("tuned for {:.2} alone", airframe.hover.command))
    };
    let over_none = |key, get: fn(Ratios) -> Option<f64>| {
        ColumnSpec::new(key, "over none", Unit::NONE, 2, move |row: &Row| row.ratios(bare).and_then(get))
    };
    let worth = |row: &Row| match row.benefit(bare) {
        _ if row.performance.is_none() => "no gains",
        _ if row.actuator == bare.actuator => "",
        worth => worth.map_or("", Benefit::word),
    };
    let columns = [
        actuator(|row: &Row| row.actuator),
        reached("bandwidth_rad_s", "bandwidth", Unit::RAD_S, 1, |own| Some(own.margins.bandwidth_rad_s)),
        over_none("bandwidth_over_none", |ratios| Some(ratios.bandwidth)),
        reached("disturbance_peak_deg", "peak", DEGREES, 2, |own| Some(own.disturbance_peak_deg)),
        over_none("disturbance_peak_over_none", |ratios| Some(ratios.disturbance_peak)),
        reached("settling_ms", "settling", MILLISECONDS, 0, |own| Some(1e3 * own.settling_s?)),
        over_none("settling_over_none", |ratios| ratios.settling),
        ColumnSpec::words("verdict", "than none", worth),
    ];
    let caption = format!(
        "Roll axis, latency {}, {tuned}: the angle's peak after {} N m",
        milliseconds(at),
        airframe.roll.disturbance_n_m
    );
    build_table(&format!("vehicle_{name}_latency_{}", index + 1), caption, &columns, rows)
}

/// One row per actuator at the latency `index`: without a D term, and with the gains of the first latency.
fn other_table(study: &Study, airframe: &Airframe, index: usize) -> Table {
    let (at, first) = (&study.latencies[index], &study.latencies[0]);
    let sensitivity = |row: &Row| match at.kept_gains.iter().find(|kept| kept.actuator == row.actuator) {
        None => CellValue::Unknown("-".into()),
        Some(kept) => kept.max_sensitivity.map_or_else(|| CellValue::Words("unstable".to_owned()), CellValue::Number),
    };
    let mut caption = format!(
        "Latency {}, {:.2} alone: without a D term (- where no gains keep the margins)",
        milliseconds(at),
        airframe.hover.command
    );
    let mut columns = vec![
        actuator(|row: &Row| row.actuator),
        reached("without_d_bandwidth_rad_s", "bandwidth without D", Unit::RAD_S, 1, |own| {
            Some(own.margins.bandwidth_rad_s)
        }),
        reached("without_d_disturbance_peak_deg", "peak without D", DEGREES, 2, |own| Some(own.disturbance_peak_deg)),
    ];
    // At the first latency these are the gains that were tuned for it.
    if index > 0 {
        let heading = "sensitivity with those gains";
        columns.push(ColumnSpec::new("kept_gains_max_sensitivity", heading, Unit::NONE, 2, sensitivity));
        caption += &format!(", and the largest sensitivity with the gains for {}", milliseconds(first));
    }
    build_table(&format!("vehicle_without_d_latency_{}", index + 1), caption, &columns, &at.without_d)
}

/// The gain sets at the latency `index`, with what they keep.
fn gains_table(study: &Study, airframe: &Airframe, index: usize) -> Table {
    type Set<'a> = (&'static str, MotorControlKind, &'a Performance);
    let at = &study.latencies[index];
    let sets = [("hover", &at.hover), ("range", &at.range), ("hover, no D", &at.without_d)];
    let sets = sets.into_iter().flat_map(|(name, rows)| {
        rows.iter().filter_map(move |row| Some((name, row.actuator, row.performance.as_ref()?)))
    });
    let number = |key, heading: &str, unit, decimals, get: fn(&Performance) -> f64| {
        ColumnSpec::new(key, heading, unit, decimals, move |(_, _, own): &Set| get(own))
    };
    let columns = [
        actuator(|(_, actuator, _): &Set| *actuator),
        ColumnSpec::words("tuned_for", "tuned for", |(name, ..): &Set| *name),
        number("rate_p_1_s", "rate P", Unit::plain("1/s"), 1, |own| own.gains.rate_p_1_s),
        number("derivative_time_ms", "Td", MILLISECONDS, 2, |own| 1e3 * own.gains.derivative_time_s),
        number("attitude_p_1_s", "attitude P", Unit::plain("1/s"), 2, |own| own.gains.attitude_p_1_s),
        number("max_sensitivity", "Ms", Unit::NONE, 2, |own| own.margins.max_sensitivity),
        number("phase_margin_deg", "phase margin", DEGREES, 1, |own| own.margins.phase_margin_deg),
        number("actuator_noise", "noise", Unit::NONE, 4, |own| own.margins.actuator_noise),
    ];
    let name = format!("vehicle_gains_latency_{}", index + 1);
    let caption = format!("Gain sets at a latency of {}, and the margins that they keep", milliseconds(at));
    let table = build_table(&name, caption, &columns, &sets.collect::<Vec<_>>());
    // The rule is one for all latencies.
    Table { notes: (index == 0).then(|| rule_said(&study.rule, airframe)).into_iter().collect(), ..table }
}

/// One row per actuator: how it follows a lateral force; `None` where there is none.
fn force_table(study: &Study, airframe: &Airframe) -> Option<Table> {
    let (lateral, bare) = (airframe.lateral?, study.lateral.first()?.performance);
    let columns = [
        actuator(|row: &ForceRow| row.actuator),
        ColumnSpec::new("rise_ms", "rise", MILLISECONDS, 1, |row: &ForceRow| {
            row.performance.rise_s.map(|rise_s| 1e3 * rise_s)
        }),
        ColumnSpec::new("rise_over_none", "over none", Unit::NONE, 2, |row: &ForceRow| {
            row.performance.rise_s.zip(bare.rise_s).map(|(own, bare)| own / bare)
        }),
        ColumnSpec::new("tracking_error_percent", "tracking error", Unit::PERCENT, 1, |row: &ForceRow| {
            100.0 * row.performance.tracking_error
        }),
        ColumnSpec::new("tracking_error_over_none", "over none", Unit::NONE, 2, |row: &ForceRow| {
            row.performance.tracking_error / bare.tracking_error
        }),
    ];
    let caption = format!(
        "Hexarotor with rotors tilted by {} degrees, at {:.2}: rise of a lateral force of {} N, and RMS error of a sine of {} N at \
         {} Hz",
        lateral.tilt_deg, airframe.hover.command, lateral.step_n, lateral.sine_n, lateral.sine_hz
    );
    Some(build_table("vehicle_lateral_force", caption, &columns, &study.lateral))
}

fn milliseconds(at: &AtLatency) -> String {
    format!("{:.1} ms", 1e3 * at.latency_s)
}
