//! Plain tables: any logger's rows of numbers, with or without lines above them, separated by commas, semicolons or tabs.
//!
//! `plain_layout` finds the table, `plain_columns` says which column is what. Stamps are kept as they are, from the first row
//! taken; a row with the stamp of the row before it is left out.

use super::plain_columns::{Pick, Picks, option};
use super::plain_layout::PlainTable;
use super::quantity::{Quantity, Scale, Unit};
use super::rows::{normalized, rows_under_command};
use super::stamps::typical_and_longest;
use super::summary::ColumnList;
use super::table::{Column, Table};
use super::{DroppedRows, ImportError, ImportOptions, ImportSummary, LogFormat, MIN_ROWS, Taken, Timing};

/// Seconds of a day.
const DAY_S: f64 = 86_400.0;
/// Share of thrust readings below zero from which on the sign is mentioned.
const MOSTLY: f64 = 0.5;

pub(super) fn take(mut plain: PlainTable, options: &ImportOptions) -> Result<Taken, ImportError> {
    let mut notes = std::mem::take(&mut plain.notes);
    let mut columns = ColumnList::new(&plain.table);
    let places: Vec<usize> =
        Picks::of(&plain, &options.columns, &mut columns)?.all().map(|pick| pick.column.index()).collect();
    if places.iter().any(|place| holds(&plain.table, *place, ',')) && plain.separator != b',' {
        plain.table.decimal_comma = !places.iter().any(|place| holds(&plain.table, *place, '.'));
        if plain.table.decimal_comma {
            notes.push(String::from("a comma in a number is its decimal mark: there is no point in any"));
        }
    }
    let table = &plain.table;
    let picks = Picks::of(&plain, &options.columns, &mut columns)?;

    let mut dropped = Vec::new();
    let rows = rows_under_command(table, picks.command.column, &mut dropped)?;
    let (rows, time_s) = times(table, picks.time, rows, &mut dropped)?;
    if rows.len() < MIN_ROWS {
        return Err(ImportError::TooFewRows { file: table.file.clone(), rows: rows.len(), needed: MIN_ROWS });
    }
    columns.taken(
        picks.time.column,
        Quantity::Time.column(),
        format!("{}, from the first row taken", picks.time.unit.name),
    );

    let signal = picks.command.column;
    let is_pulse = picks.command.unit.scale == Scale::Pulse;
    let (low, high) = match picks.command.unit.scale {
        Scale::Pulse => options.esc_signal_us,
        Scale::Ratio(times, over) => (0.0, over / times),
        // Of a time alone.
        Scale::Clock => (0.0, 1.0),
    };
    let command = normalized(table, signal, &rows, (low, high))?;
    let stated = if is_pulse { " µs become 0..1, stated and not measured" } else { " become 0..1" };
    columns.taken(signal, Quantity::Command.column(), format!("{low}..{high}{stated}"));

    let mut optional = |pick: Option<Pick<'_>>| -> Result<Option<Vec<f64>>, ImportError> {
        let Some(pick) = pick else { return Ok(None) };
        let (values, filled) = pick.column.where_filled(&rows)?;
        match values {
            Some(_) => columns.taken(pick.column, pick.unit.quantity.column(), conversion(pick)),
            None => columns.left(pick.column, format!("filled in {filled} of {} rows", rows.len())),
        }
        let Some(mut values) = values else { return Ok(None) };
        for (value, &row) in values.iter_mut().zip(&rows) {
            *value = finite(table, pick, row, converted(pick, *value))?;
        }
        Ok(Some(values))
    };
    let thrust_n = optional(picks.thrust)?;
    let rpm = optional(picks.speed)?;
    let voltage_v = optional(picks.voltage)?;
    let current_a = optional(picks.current)?;
    if thrust_n.is_none() && rpm.is_none() {
        // One of the two is there, and has a hole.
        for pick in [picks.thrust, picks.speed].into_iter().flatten() {
            rows.iter().try_for_each(|&row| pick.column.required(row).map(drop))?;
        }
    }
    if let (Some(pick), Some(thrust_n)) = (picks.thrust, &thrust_n) {
        notes.extend(reversed(pick, thrust_n));
    }

    Ok(Taken {
        summary: ImportSummary {
            file: table.file.clone(),
            format: LogFormat::Plain,
            rows_read: table.rows.len(),
            rows_taken: rows.len(),
            columns: columns.into_vec(),
            dropped,
            timing: timing(&time_s),
            pulse_widths: is_pulse,
            notes,
        },
        time_s,
        command,
        thrust_n,
        rpm,
        voltage_v,
        current_a,
        sample_rate_hz: None,
    })
}

/// Whether a cell of the column at `place` has the character in it.
fn holds(table: &Table, place: usize, mark: char) -> bool {
    let column = Column::at(table, place);
    (0..table.rows.len()).any(|row| column.text(row).contains(mark))
}

/// The rows without those that repeat a stamp, and their times from the first.
fn times(
    table: &Table,
    time: Pick<'_>,
    rows: Vec<usize>,
    dropped: &mut Vec<DroppedRows>,
) -> Result<(Vec<usize>, Vec<f64>), ImportError> {
    let mut kept: Vec<usize> = Vec::with_capacity(rows.len());
    let mut stamps: Vec<f64> = Vec::with_capacity(rows.len());
    let mut days_s = 0.0;
    for &row in &rows {
        let stamp = match time.unit.scale {
            Scale::Clock => days_s + time.column.clock_s(row)?,
            _ => time.column.required(row)?,
        };
        // A clock that runs back by more than half a day has passed midnight.
        let is_past_midnight = |before: &&f64| time.unit.scale == Scale::Clock && **before - stamp > DAY_S / 2.0;
        let stamp = match stamps.last().filter(is_past_midnight) {
            Some(_) => {
                days_s += DAY_S;
                stamp + DAY_S
            }
            None => stamp,
        };
        match stamps.last() {
            Some(&before) if stamp < before => {
                return Err(ImportError::TimeRunsBack {
                    file: table.file.clone(),
                    line: time.column.line(row),
                    column: time.column.name().into(),
                    by_s: converted(time, before - stamp),
                });
            }
            Some(&before) if stamp == before => {}
            _ => {
                stamps.push(stamp);
                kept.push(row);
            }
        }
    }
    if kept.len() < rows.len() {
        let reason = String::from("same time stamp as the row before");
        dropped.push(DroppedRows { rows: rows.len() - kept.len(), reason });
    }
    let start = stamps.first().copied().unwrap_or(0.0);
    let since_start =
        stamps.iter().zip(&kept).map(|(stamp, row)| finite(table, time, *row, converted(time, stamp - start)));
    let time_s = since_start.collect::<Result<Vec<f64>, _>>()?;
    // Stamps that differ in their last digit may be the same in seconds.
    match time_s.windows(2).position(|pair| pair[1] <= pair[0]) {
        Some(at) => Err(ImportError::TimeRunsBack {
            file: table.file.clone(),
            line: time.column.line(kept[at + 1]),
            column: time.column.name().into(),
            by_s: 0.0,
        }),
        None => Ok((kept, time_s)),
    }
}

fn timing(time_s: &[f64]) -> Timing {
    let (typical, longest) = typical_and_longest(time_s);
    let span = time_s.last().copied().unwrap_or(0.0);
    Timing {
        method: format!(
            "stamps of the log; intervals of {:.3} ms (median) to {:.3} ms (longest)",
            typical * 1e3,
            longest * 1e3
        ),
        rate_hz: (time_s.len() - 1) as f64 / span,
        rows_reordered: 0,
        rows_missing: 0,
        residual_rms_s: None,
        residual_max_s: None,
    }
}

/// A number as a record has it; that of a pulse width is not one of these.
fn converted(pick: Pick<'_>, value: f64) -> f64 {
    let sign = if pick.is_reversed { -1.0 } else { 1.0 };
    match pick.unit.scale {
        Scale::Ratio(times, over) => sign * value * times / over,
        Scale::Pulse | Scale::Clock => sign * value,
    }
}

/// `value`, which came of the cell of `row`, unless it has become too large.
fn finite(table: &Table, pick: Pick<'_>, row: usize, value: f64) -> Result<f64, ImportError> {
    if value.is_finite() {
        return Ok(value);
    }
    Err(ImportError::NotANumber {
        file: table.file.clone(),
        line: pick.column.line(row),
        column: pick.column.name().into(),
        text: pick.column.text(row).into(),
    })
}

/// What [`converted`] does, in words.
fn conversion(pick: Pick<'_>) -> String {
    let Unit { name, scale, .. } = pick.unit;
    let factor = match scale {
        Scale::Ratio(1.0, 1.0) | Scale::Pulse | Scale::Clock => String::new(),
        Scale::Ratio(times, 1.0) => format!(", times {times}"),
        Scale::Ratio(times, over) => format!(", times {}", times / over),
    };
    format!("in {name}{factor}{}", if pick.is_reversed { ", sign turned" } else { "" })
}

/// What is to be said of a thrust that pulls where it should push.
fn reversed(pick: Pick<'_>, thrust_n: &[f64]) -> Option<String> {
    let below = thrust_n.iter().filter(|thrust| **thrust < 0.0).count();
    let other_sign = if pick.is_reversed { "" } else { "-" };
    (below as f64 > MOSTLY * thrust_n.len() as f64).then(|| {
        format!(
            "thrust is below zero in {below} of {} rows; where the sensor reads the other way round, turn its sign by \
             `{}`",
            thrust_n.len(),
            option(Quantity::Thrust, pick.column.name(), &format!("{other_sign}{}", pick.unit.name))
        )
    })
}
