//! Telemetry logs of the AutoQuad ESC32, as its ground station writes them.
//!
//! - The command is `Duty` in percent of the supply voltage, the response `RPM` as the ESC computes it
//!   from its commutation period and the number of poles in its settings.
//! - The ESC sends rows evenly spaced (100 Hz unless set otherwise); the ground station stamps them
//!   when it reads its port, several at a time, to the millisecond of its own clock. The rows are put
//!   back on their grid, and rows that were lost on the way leave a gap.

use jiff::civil::DateTime;

use super::stamps::{EvenGrid, even_grid};
use super::summary::ColumnList;
use super::table::{Column, Table};
use super::{DroppedRows, ImportError, ImportSummary, LogFormat, MIN_ROWS, Taken, Timing};

pub(super) const TIME: &str = "Timestamp";
pub(super) const COMMAND: &str = "Duty";
const SPEED: &str = "RPM";
const VOLTAGE: &str = "Batt. Volts";
const CURRENT: &str = "Amps";

/// RMS distance from the grid, in intervals, beyond which the stamps say that the rows are not even.
const MAX_RESIDUAL_INTERVALS: f64 = 5.0;

pub(super) fn take(table: &Table) -> Result<Taken, ImportError> {
    let mut columns = ColumnList::new(table);
    let time = table.need(TIME)?;
    let duty = table.need(COMMAND)?;
    let speed = table.need(SPEED)?;
    let rows: Vec<usize> = (0..table.rows.len()).collect();
    if rows.len() < MIN_ROWS {
        return Err(ImportError::TooFewRows { file: table.file.clone(), rows: rows.len(), needed: MIN_ROWS });
    }
    let grid = times(table, time, &rows)?;
    let mut command = Vec::with_capacity(rows.len());
    for &row in &rows {
        let value = duty.required(row)?;
        if !(0.0..=100.0).contains(&value) {
            return Err(ImportError::OutOfRange {
                file: table.file.clone(),
                line: duty.line(row),
                column: duty.name().into(),
                value,
                low: 0.0,
                high: 100.0,
            });
        }
        command.push(value / 100.0);
    }
    let rpm = rows.iter().map(|&row| speed.required(row)).collect::<Result<Vec<_>, _>>()?;
    columns.taken(time, "time_s", "put on an even grid, from the first row taken");
    columns.taken(duty, "command", "percent / 100");
    columns.taken(speed, "rpm", "as the ESC gives it");
    let mut optional = |name: &str, taken_as: &str| -> Result<Option<Vec<f64>>, ImportError> {
        let Some(column) = table.find(name) else {
            return Ok(None);
        };
        let (values, filled) = column.where_filled(&rows)?;
        match values {
            Some(_) => columns.taken(column, taken_as, "as it stands"),
            None => columns.left(column, format!("filled in {filled} of {} rows", rows.len())),
        }
        Ok(values)
    };
    let voltage_v = optional(VOLTAGE, "voltage_v")?;
    let current_a = optional(CURRENT, "current_a")?;

    let rate_hz = grid.interval_s.recip();
    Ok(Taken {
        summary: ImportSummary {
            file: table.file.clone(),
            format: LogFormat::Esc32,
            rows_read: table.rows.len(),
            rows_taken: rows.len(),
            columns: columns.into_vec(),
            dropped: Vec::<DroppedRows>::new(),
            timing: Timing {
                method: "rows are sent evenly and stamped in bursts: least-squares line through the stamps, with whole \
                         rows missing where the stamps jump and do not come back"
                    .into(),
                rate_hz,
                rows_reordered: 0,
                rows_missing: grid.rows_missing,
                residual_rms_s: Some(grid.residual_rms_s),
                residual_max_s: Some(grid.residual_max_s),
            },
            pulse_widths: false,
            notes: vec![
                "speed is `RPM` as the ESC computes it, which is right for the rotor only if the number of poles is set in \
                 the ESC"
                    .into(),
            ],
        },
        // A gap ends evenness: then the times speak, not a rate.
        sample_rate_hz: (grid.rows_missing == 0).then_some(rate_hz),
        time_s: grid.time_s,
        command,
        thrust_n: None,
        rpm: Some(rpm),
        voltage_v,
        current_a,
    })
}

/// The rows' times on their grid.
fn times(table: &Table, time: Column<'_>, rows: &[usize]) -> Result<EvenGrid, ImportError> {
    let mut stamps: Vec<f64> = Vec::with_capacity(rows.len());
    let mut first = None;
    for &row in rows {
        let text = time.text(row);
        let (moment, fraction) = parse(text).ok_or_else(|| ImportError::TimeStamp {
            file: table.file.clone(),
            line: time.line(row),
            column: time.name().into(),
            text: text.into(),
        })?;
        let origin = *first.get_or_insert(moment);
        let stamp = moment.duration_since(origin).as_secs_f64() + fraction;
        if let Some(&before) = stamps.last()
            && stamp < before
        {
            return Err(ImportError::TimeRunsBack {
                file: table.file.clone(),
                line: time.line(row),
                column: time.name().into(),
                by_s: before - stamp,
            });
        }
        stamps.push(stamp);
    }
    let grid = even_grid(&stamps);
    let bound = MAX_RESIDUAL_INTERVALS * grid.interval_s;
    if !(grid.interval_s > 0.0 && grid.residual_rms_s <= bound) {
        return Err(ImportError::NotEven {
            file: table.file.clone(),
            interval_s: grid.interval_s,
            residual_rms_s: grid.residual_rms_s,
        });
    }
    Ok(grid)
}

/// `2019-11-07 18:45:58:868`: whole seconds, and the fraction behind the last colon.
fn parse(text: &str) -> Option<(DateTime, f64)> {
    let (seconds, fraction) = text.rsplit_once(':')?;
    if fraction.is_empty() || fraction.len() > 9 || !fraction.bytes().all(|b| b.is_ascii_digit()) {
        return None;
    }
    let moment = DateTime::strptime("%Y-%m-%d %H:%M:%S", seconds).ok()?;
    let fraction = fraction.parse::<f64>().ok()? / 10f64.powi(fraction.len() as i32);
    Some((moment, fraction))
}
