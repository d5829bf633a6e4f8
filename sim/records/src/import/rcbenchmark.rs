//! Continuous logs of an RCbenchmark thrust stand (1520/1580 series).
//!
//! - The command is `ESC signal (µs)`; it is empty until the output is switched on.
//! - `Motor Electrical Speed (RPM)` is the speed that the stand derives from the motor's phase voltage
//!   and the number of poles set in its software. It is taken as it stands: if that number was wrong,
//!   all speeds are off by one constant factor, which changes gains but no time constant and no
//!   compensator.
//! - Each row carries the host's stamp for its own reading. Stamps are kept; a few rows overtake each
//!   other on their way and are sorted.
//! - Thrust and torque come from slower converters and fill about one row in twenty (7 Hz). A lag of
//!   50 ms cannot be seen through readings 140 ms apart, so such a column is not taken: one that does
//!   not fill every row never is.

use super::rows::{normalized, rows_under_command};
use super::stamps::typical_and_longest;
use super::summary::ColumnList;
use super::table::{Column, Table};
use super::{DroppedRows, ImportError, ImportOptions, ImportSummary, LogFormat, MIN_ROWS, Taken, Timing};

pub(super) const TIME: &str = "Time (s)";
pub(super) const COMMAND: &str = "ESC signal (µs)";
const ELECTRICAL_SPEED: &str = "Motor Electrical Speed (RPM)";
const OPTICAL_SPEED: &str = "Motor Optical Speed (RPM)";
const VOLTAGE: &str = "Voltage (V)";
const CURRENT: &str = "Current (A)";
const THRUST: [&str; 3] = ["Thrust (gf)", "Thrust (kgf)", "Thrust (N)"];

/// Rows that overtake each other do so by a row or two. More is another log.
const MAX_OVERTAKING_S: f64 = 0.1;

pub(super) fn take(table: &Table, options: &ImportOptions) -> Result<Taken, ImportError> {
    let mut columns = ColumnList::new(table);
    let mut dropped = Vec::new();
    let mut notes = Vec::new();
    let time = table.need(TIME)?;
    let signal = table.need(COMMAND)?;

    let rows = rows_under_command(table, signal, &mut dropped)?;
    let Ordered { rows, time_s, reordered, repeated } = in_order_of_time(table, time, &rows)?;
    if repeated > 0 {
        dropped.push(DroppedRows { rows: repeated, reason: "same time stamp as the row before".into() });
    }
    if rows.len() < MIN_ROWS {
        return Err(ImportError::TooFewRows { file: table.file.clone(), rows: rows.len(), needed: MIN_ROWS });
    }

    let command = normalized(table, signal, &rows, options.esc_signal_us)?;
    let (low, high) = options.esc_signal_us;
    columns.taken(time, "time_s", "seconds, from the first row taken");
    columns.taken(signal, "command", format!("{low}..{high} µs become 0..1, stated and not measured"));

    let (speed, rpm) = speed(table, &rows, &mut columns)?;
    columns.taken(speed, "rpm", "as the stand gives it");
    if speed.name() == ELECTRICAL_SPEED {
        notes.push(
            "speed is `Motor Electrical Speed (RPM)` as it stands, which is right for the rotor only if the number of \
             poles was set in the stand's software"
                .into(),
        );
    }
    let mut optional = |name: &str, taken_as: &str| -> Result<Option<Vec<f64>>, ImportError> {
        let Some(column) = table.find(name) else {
            return Ok(None);
        };
        let (values, filled) = column.where_filled(&rows)?;
        match values {
            Some(_) => columns.taken(column, taken_as, "as it stands"),
            None => columns.left(column, partly(filled, rows.len())),
        }
        Ok(values)
    };
    let voltage_v = optional(VOLTAGE, "voltage_v")?;
    let current_a = optional(CURRENT, "current_a")?;

    let span = time_s.last().copied().unwrap_or(0.0);
    for column in THRUST.iter().filter_map(|name| table.find(name)) {
        let (_, filled) = column.where_filled(&rows)?;
        let rate = filled as f64 / span;
        columns.left(column, format!("{} ({rate:.1} Hz): too slow to show the lag", partly(filled, rows.len())));
    }

    let (typical, longest) = typical_and_longest(&time_s);
    let timing = Timing {
        method: format!(
            "stamps of the log, sorted; intervals of {:.1} ms (median) to {:.1} ms (longest)",
            typical * 1e3,
            longest * 1e3
        ),
        rate_hz: (time_s.len() - 1) as f64 / span,
        rows_reordered: reordered,
        rows_missing: 0,
        residual_rms_s: None,
        residual_max_s: None,
    };
    Ok(Taken {
        summary: ImportSummary {
            file: table.file.clone(),
            format: LogFormat::RcBenchmark,
            rows_read: table.rows.len(),
            rows_taken: rows.len(),
            columns: columns.into_vec(),
            dropped,
            timing,
            pulse_widths: true,
            notes,
        },
        time_s,
        command,
        thrust_n: None,
        rpm: Some(rpm),
        voltage_v,
        current_a,
        sample_rate_hz: None,
    })
}

fn partly(filled: usize, rows: usize) -> String {
    format!("filled in {filled} of {rows} rows")
}

struct Ordered {
    rows: Vec<usize>,
    time_s: Vec<f64>,
    reordered: usize,
    repeated: usize,
}

/// Sorts rows by their stamps, from zero, and leaves out those whose stamp was there before.
fn in_order_of_time(table: &Table, time: Column<'_>, rows: &[usize]) -> Result<Ordered, ImportError> {
    let mut stamped = Vec::with_capacity(rows.len());
    let mut latest = f64::NEG_INFINITY;
    let mut reordered = 0;
    for &row in rows {
        let stamp = time.required(row)?;
        if latest - stamp > MAX_OVERTAKING_S {
            return Err(ImportError::TimeRunsBack {
                file: table.file.clone(),
                line: time.line(row),
                column: time.name().into(),
                by_s: latest - stamp,
            });
        }
        reordered += usize::from(stamp < latest);
        latest = latest.max(stamp);
        stamped.push((stamp, row));
    }
    stamped.sort_by(|a, b| a.0.total_cmp(&b.0)); // stable: equal stamps keep the log's order
    let before = stamped.len();
    stamped.dedup_by(|later, earlier| later.0 == earlier.0);
    let start = stamped.first().map_or(0.0, |s| s.0);
    Ok(Ordered {
        rows: stamped.iter().map(|s| s.1).collect(),
        time_s: stamped.iter().map(|s| s.0 - start).collect(),
        reordered,
        repeated: before - stamped.len(),
    })
}

/// The speed column: the electrical one, or the optical one where the electrical one is not there or
/// never moves from zero (the probe was not connected).
fn speed<'a>(
    table: &'a Table,
    rows: &[usize],
    columns: &mut ColumnList,
) -> Result<(Column<'a>, Vec<f64>), ImportError> {
    let mut still = None;
    for name in [ELECTRICAL_SPEED, OPTICAL_SPEED] {
        let Some(column) = table.find(name) else {
            continue;
        };
        let (values, filled) = column.where_filled(rows)?;
        match values {
            Some(rpm) if rpm.iter().any(|&v| v != 0.0) => {
                if let Some(other) = table.find(OPTICAL_SPEED).filter(|c| c.name() != name) {
                    columns.left(other, "the electrical speed is there and was taken");
                }
                return Ok((column, rpm));
            }
            Some(rpm) => {
                columns.left(column, "zero in every row");
                still.get_or_insert((column, rpm));
            }
            None => columns.left(column, partly(filled, rows.len())),
        }
    }
    // A motor that never turned is a recording all the same.
    if let Some(still) = still {
        return Ok(still);
    }
    let electrical = table.need(ELECTRICAL_SPEED)?;
    let row = rows.iter().find(|&&row| electrical.text(row).is_empty());
    Err(ImportError::Blank {
        file: table.file.clone(),
        line: row.map_or(1, |&row| electrical.line(row)),
        column: ELECTRICAL_SPEED.into(),
    })
}
