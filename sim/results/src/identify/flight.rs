//! What a flight shows.

use rotorlead_answer::{
    Audience, Axis, CellValue, Color, ColumnSpec, Figure, FigureKind, Mark, Panel, Series, Table, Unit, build_table,
};
use rotorlead_identify::flight::{FlightIdentification, MotorEstimate};
use rotorlead_numerics::sample::extent;
use rotorlead_plant::Model;

/// What the standard errors of a flight hold.
pub(super) fn basis_of_errors(found: &FlightIdentification) -> String {
    let motors = match found.motors.len() {
        1 => "of one motor without the others of its vehicle".to_owned(),
        count => format!("of {count} motors, and what they differ by"),
    };
    let (times, least) = found.structural_std();
    format!(
        "Prediction-error fit in closed loop {motors}. +- is one standard error: {times} times that of the noise, which is what gusts and telemetry \
         cost on simulated flights, and {} % at least.",
        100.0 * least
    )
}

/// Each motor by itself.
pub(super) fn motors_table(found: &FlightIdentification) -> Table {
    let by_instruments = |motor: &MotorEstimate| match &motor.instrumental {
        Some(found) => CellValue::Estimate(100.0 * found.difference, Some(100.0 * found.difference_std)),
        None => CellValue::Unknown("-".into()),
    };
    let columns = [
        ColumnSpec::words("file", "record", |motor: &MotorEstimate| motor.file.clone()),
        ColumnSpec::new("nominal", "u", Unit::DUTY, 3, |motor: &MotorEstimate| motor.nominal),
        ColumnSpec::new("time_constant_s", "tau", Unit::MILLISECONDS, 1, |motor: &MotorEstimate| {
            CellValue::Estimate(motor.time_constant_s, Some(motor.time_constant_s_std))
        }),
        ColumnSpec::new("delay_s", "dead time", Unit::MILLISECONDS, 1, |motor: &MotorEstimate| motor.delay_s),
        ColumnSpec::new("halves_percent", "halves differ by", Unit::PERCENT, 1, |motor: &MotorEstimate| {
            100.0 * motor.halves_difference
        }),
        ColumnSpec::new("instruments_percent", "by instruments", Unit::PERCENT, 1, by_instruments),
    ];
    let caption = "Each motor at the median of its command; +- is one standard error, of the noise alone";
    Table { weight: Audience::Detail, ..build_table("motors", caption, &columns, &found.motors) }
}

/// The time constant over the operating points that were flown.
pub(super) fn time_constants(model: &Model) -> Option<Figure> {
    let band = model.time_constant_curve.as_ref()?;
    let points = band.nominal.iter().zip(&band.time_constant_s).map(|(&nominal, tau)| (nominal, 1e3 * tau)).collect();
    let (low_s, _) = extent(&band.low_s);
    let (_, high_s) = extent(&band.high_s);
    // All of the band, with some room: where the interval is wide is what it shows.
    let axis = Axis::linear("time constant", "ms").within(0.95e3 * low_s, 1.05e3 * high_s);
    let interval = band.low_s.iter().zip(&band.high_s).map(|(low, high)| (1e3 * low, 1e3 * high)).collect();
    let series = Series::new("in flight", Color::Green, Mark::Line, points).with_band(interval);
    Some(Figure::new(
        FigureKind::TimeConstants,
        "Time constants over operating points",
        "The mean of the motors; the band is its 95 % interval.",
        vec![Panel::new(Axis::nominal(), axis, vec![series])],
    ))
}
