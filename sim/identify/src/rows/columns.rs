//! The columns of a record as identification needs them: the response, the rate of its rows, its period in rows.

use rotorlead_records::{Output, Record};

use crate::error::IdentifyError;

/// The response column of a record, checked to be as long as its time and command.
pub fn response_column(record: &Record, output: Output) -> Result<&[f64], IdentifyError> {
    let rows = record.time_s.len();
    record
        .response(output)
        .filter(|response| response.len() == rows && record.command.len() == rows)
        .ok_or_else(|| IdentifyError::NoResponse { file: record.file.clone(), column: output.column(), rows })
}

/// Rows per second of a record: as stated, or as its times say.
///
/// # Errors
/// [`IdentifyError::UnevenRows`] when a row is more than a tenth of a row away from even spacing,
/// [`IdentifyError::TooShort`] when there are fewer than two rows.
pub(crate) fn row_rate_hz(record: &Record, stated_hz: Option<f64>) -> Result<f64, IdentifyError> {
    let (Some(&first), Some(&last)) = (record.time_s.first(), record.time_s.last()) else {
        return Err(IdentifyError::TooShort { file: record.file.clone(), rows: 0, period_rows: 2 });
    };
    if record.time_s.len() == 1 {
        return Err(IdentifyError::TooShort { file: record.file.clone(), rows: 1, period_rows: 2 });
    }
    let rate = mean_row_rate_hz(stated_hz, record.time_s.len(), first, last);
    let worst = record
        .time_s
        .iter()
        .enumerate()
        .map(|(row, t)| (row, ((t - first) * rate - row as f64).abs()))
        .fold((0, 0.0), |a, b| if b.1 > a.1 || b.1.is_nan() { b } else { a });
    check_even_rows(worst, &record.file)?;
    Ok(rate)
}

/// Rows per second: as stated, or as the times of the first and the last of `rows` rows, two or more, say.
pub(crate) fn mean_row_rate_hz(stated_hz: Option<f64>, rows: usize, first_s: f64, last_s: f64) -> f64 {
    stated_hz.unwrap_or(rows.saturating_sub(1) as f64 / (last_s - first_s))
}

/// Refuses rows of which the farthest from an even spacing, `(row, off_by)`, is farther than a tenth of a row. Chosen: that turns the phase
/// by 4 degrees at a tenth of the row rate; less refuses the jitter of usual loggers.
pub(crate) fn check_even_rows((row, off_by): (usize, f64), file: &str) -> Result<(), IdentifyError> {
    if off_by.is_nan() || off_by > 0.1 {
        return Err(IdentifyError::UnevenRows { file: file.to_owned(), row, off_by });
    }
    Ok(())
}

/// Period in seconds and in rows.
///
/// # Errors
/// [`IdentifyError::NoPeriod`], or [`IdentifyError::PeriodRows`] when it is not a whole number of rows.
pub(crate) fn period_rows(record: &Record, row_rate_hz: f64) -> Result<(f64, usize), IdentifyError> {
    let file = || record.file.clone();
    let period_s = record.period_s.ok_or_else(|| IdentifyError::NoPeriod { file: file() })?;
    let rows = period_s * row_rate_hz;
    let length = rows.round();
    // Chosen: a thousandth of a row is what a period in decimals is rounded by; fewer than four rows show no shape, and up to 1e9 the
    // cast is exact.
    if !((rows - length).abs() <= 1e-3 && (4.0..=1e9).contains(&length)) {
        return Err(IdentifyError::PeriodRows { file: file(), period_s, rows });
    }
    Ok((period_s, length as usize))
}
