//! Which rows of a log of text are taken, and their numbers as a record has them.

use super::table::{Column, Table};
use super::{DroppedRows, ImportError};

/// The rows from the first to the last that has a command; one without between them is an error.
pub(super) fn rows_under_command(
    table: &Table,
    signal: Column<'_>,
    dropped: &mut Vec<DroppedRows>,
) -> Result<Vec<usize>, ImportError> {
    let has = |row: &usize| !signal.text(*row).is_empty();
    let all = 0..table.rows.len();
    let first = all.clone().find(has).unwrap_or(all.end);
    let end = all.clone().rev().find(has).map_or(first, |row| row + 1);
    for (rows, reason) in [(first, "no command yet"), (all.end - end, "no command any more")] {
        if rows > 0 {
            dropped.push(DroppedRows { rows, reason: reason.into() });
        }
    }
    let rows: Vec<usize> = (first..end).collect();
    for &row in &rows {
        signal.required(row)?;
    }
    Ok(rows)
}

/// Commands with `low..high` put on 0..1.
pub(super) fn normalized(
    table: &Table,
    signal: Column<'_>,
    rows: &[usize],
    (low, high): (f64, f64),
) -> Result<Vec<f64>, ImportError> {
    rows.iter()
        .map(|&row| {
            let value = signal.required(row)?;
            if value < low || value > high {
                return Err(ImportError::OutOfRange {
                    file: table.file.clone(),
                    line: signal.line(row),
                    column: signal.name().into(),
                    value,
                    low,
                    high,
                });
            }
            Ok((value - low) / (high - low))
        })
        .collect()
}
