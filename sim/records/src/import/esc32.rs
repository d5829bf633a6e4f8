//! Telemetry logs of the AutoQuad ESC32, as its ground station writes them.
//!
//! - The command is `Duty` in percent of the supply voltage, the response `RPM` as the ESC computes it
//!   from its commutation period and the number of poles in its settings.
//! - The ESC sends rows evenly spaced (100 Hz unless set otherwise); the ground station stamps them
//!   when it reads its port, several at a time, to the millisecond of its own clock. The rows are put
//!   back on their grid, and rows that were lost on the way leave a gap.

use std::borrow::Cow;
use std::path::Path;

use jiff::civil::DateTime;

use super::format::{Dialect, LogFormat, Names, Reader, UNCOMPRESSED};
use super::quantity::Quantity;
use super::stamps::{EvenGrid, even_grid};
use super::summary::ColumnList;
use super::table::{CellFormat, Table};
use super::{DroppedRows, ImportError, ImportOptions, ImportSummary, MIN_ROWS, Taken, Timing};
use crate::experiment::{Excitation, Output, Setpoints};

const TIME: &str = "Timestamp";
const COMMAND: &str = "Duty";
const SPEED: &str = "RPM";
const VOLTAGE: &str = "Batt. Volts";
const CURRENT: &str = "Amps";

/// The same for who looks at it as a table.
const NAMES: Names = &[
    (Quantity::Time, "", &["timestamp"]),
    (Quantity::Command, "percent", &["duty"]),
    (Quantity::Speed, "rpm", &["rpm"]),
    (Quantity::Voltage, "V", &["batt. volts"]),
    (Quantity::Current, "A", &["amps"]),
];
pub(super) const DIALECT: Dialect = Dialect { names: NAMES, ..Dialect::PLAIN };

/// RMS distance from the grid, in intervals, beyond which the stamps say that the rows are not even.
const MAX_RESIDUAL_INTERVALS: f64 = 5.0;

/// The log, where its header is that of one.
pub(super) fn table<'a>(file: &Path, text: &'a str) -> Option<Table<'a>> {
    let (names, rows) = text.split_once('\n').unwrap_or((text, ""));
    let header: Vec<String> = names.split(',').map(|name| name.trim().to_owned()).collect();
    let has = |name: &str| header.iter().any(|column| column == name);
    (has(TIME) && has(COMMAND)).then(|| Table::new(file, header, Cow::Borrowed(rows), b',', 1))
}

fn take(table: &Table<'_>) -> Result<Taken, ImportError> {
    let mut columns = ColumnList::new(table, &[]);
    let need = |name: &str| {
        table.find(name).ok_or_else(|| {
            let remedy = format!(
                "record the log again with this column switched on, or say with --column which is what; the columns are `{}`",
                table.header.join("`, `")
            );
            ImportError::missing(&table.file, format!(", line 1: column `{name}` is missing"), remedy)
        })
    };
    let (time, duty, speed) = (need(TIME)?, need(COMMAND)?, need(SPEED)?);
    let (voltage, current) = (table.find(VOLTAGE), table.find(CURRENT));
    let read: Vec<_> =
        [Some(duty), Some(speed), voltage, current].into_iter().flatten().map(|c| (c, CellFormat::Decimal)).collect();
    let mut numbers = table.numbers(&read)?.into_iter();
    let mut values = || numbers.next().unwrap_or_default();
    let (mut command, rpm) = (values(), values());
    let rows = command.len();
    if rows < MIN_ROWS {
        return Err(ImportError::TooFewRows { file: table.file.clone(), rows, needed: MIN_ROWS });
    }
    let grid = times(table, time)?;
    for (column, values) in [(duty, &command), (speed, &rpm)] {
        if let Some(blank) = values.iter().position(|value| value.is_nan()) {
            return Err(table.blank(blank, column));
        }
    }
    for (row, value) in command.iter_mut().enumerate() {
        if !(0.0..=100.0).contains(value) {
            return Err(ImportError::out_of_range(&table.file, table.line(row), COMMAND, *value, (0.0, 100.0)));
        }
        *value /= 100.0;
    }
    columns.taken(time, "time_s", "put on an even grid, from the first row taken");
    columns.taken(duty, "command", "percent / 100");
    columns.taken(speed, "rpm", "as the ESC gives it");
    let mut optional = |column: Option<usize>, taken_as: &str| {
        let (column, values) = (column?, numbers.next()?);
        let filled = values.iter().filter(|value| !value.is_nan()).count();
        if filled < rows {
            columns.left(column, format!("filled in {filled} of {rows} rows"));
            return None;
        }
        columns.taken(column, taken_as, "as it stands");
        Some(values)
    };
    let voltage_v = optional(voltage, "voltage_v");
    let current_a = optional(current, "current_a");

    let rate_hz = grid.interval_s.recip();
    Ok(Taken {
        summary: ImportSummary {
            file: table.file.clone(),
            format: &FORMAT,
            rows_read: rows,
            rows_taken: rows,
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
            is_electrical: false,
            has_motors: false,
            notes: vec![
                "speed is `RPM` as the ESC computes it, which is right for the rotor only if the number of poles is set in \
                 the ESC"
                    .into(),
            ],
        },
        // A gap ends evenness: then the times speak, not a rate.
        sample_rate_hz: (grid.rows_missing == 0).then_some(rate_hz),
        output: Output::Rpm,
        usual: Some(Excitation::Staircase),
        time_s: grid.time_s,
        command,
        own_command: Vec::new(),
        thrust_n: None,
        rpm: Some(rpm),
        voltage_v,
        current_a,
        setpoints: Setpoints::default(),
        loop_rate_hz: None,
    })
}

/// The rows' times on their grid.
fn times(table: &Table<'_>, column: usize) -> Result<EvenGrid, ImportError> {
    let mut stamps: Vec<f64> = Vec::new();
    let mut first = None;
    table.each(|row| {
        let text = row.text(column);
        let Some((moment, fraction)) = parse(text) else {
            let remedy = "expected `YYYY-MM-DD hh:mm:ss:mmm`; correct it or delete the row";
            return Err(ImportError::cell(
                &table.file,
                row.line,
                TIME,
                format!("`{text}` is not a time stamp"),
                remedy,
            ));
        };
        let origin = *first.get_or_insert(moment);
        let stamp = moment.duration_since(origin).as_secs_f64() + fraction;
        if let Some(&before) = stamps.last()
            && stamp < before
        {
            return Err(ImportError::time_runs_back(&table.file, row.line, TIME, before - stamp));
        }
        stamps.push(stamp);
        Ok(())
    })?;
    let grid = even_grid(&stamps);
    let bound = MAX_RESIDUAL_INTERVALS * grid.interval_s;
    if !(grid.interval_s > 0.0 && grid.residual_rms_s <= bound) {
        let (interval_s, rms_s) = (grid.interval_s, grid.residual_rms_s);
        return Err(ImportError::value(
            &table.file,
            format!("column `{TIME}`"),
            format!("the time stamps miss an even grid of {interval_s} s by {rms_s} s RMS"),
            "rows are missing in many places; record again with a faster link, or cut out the good part",
        ));
    }
    Ok(grid)
}

/// `2019-11-07 18:45:58:868`: whole seconds, and the fraction behind the last colon.
pub(super) fn parse(text: &str) -> Option<(DateTime, f64)> {
    let (seconds, fraction) = text.rsplit_once(':')?;
    if fraction.is_empty() || fraction.len() > 9 || !fraction.bytes().all(|b| b.is_ascii_digit()) {
        return None;
    }
    let moment = DateTime::strptime("%Y-%m-%d %H:%M:%S", seconds).ok()?;
    let fraction = fraction.parse::<f64>().ok()? / 10f64.powi(fraction.len() as i32);
    Some((moment, fraction))
}

/// Text as a log, where its header is that of one. A log whose columns are stated is a table like any other.
fn read(file: &Path, text: &str, options: &ImportOptions) -> Result<Option<Taken>, ImportError> {
    table(file, text).filter(|_| options.columns.is_empty()).map(|table| take(&table)).transpose()
}

/// The format.
pub(super) const FORMAT: LogFormat = LogFormat {
    name: "esc32",
    title: "AutoQuad ESC32",
    has_motors: false,
    has_several_logs: false,
    has_stated_columns: false,
    memory_per_byte: UNCOMPRESSED,
    reader: Reader::Text(read),
};
