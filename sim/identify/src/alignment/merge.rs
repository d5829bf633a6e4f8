//! One record out of two logs.

use super::{Alignment, AlignmentError, CommandLog, LEAST_ROWS, ResponseLog};

/// Which rows the merged record has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MergedRows {
    /// Those of the command log, with the response interpolated: even where the command's are even, which periodic
    /// records need.
    OfCommand,
    /// Those of the response log as measured, and one more at each change of the command with the response interpolated
    /// there, so that no change is moved to a later row: for steps.
    OfResponse,
}

/// The merged columns, on the command's clock.
#[derive(Clone, Debug, PartialEq)]
pub struct Merged {
    /// Times in seconds, increasing.
    pub time_s: Vec<f64>,
    /// The command that holds from each row on.
    pub command: Vec<f64>,
    /// The response at each row.
    pub response: Vec<f64>,
    /// The other columns of the response log at each row, in their order.
    pub other_columns: Vec<Vec<f64>>,
    /// Rows of the chosen log for which the other has nothing, left out.
    pub left_out: usize,
    /// Gaps of the response log within the merged time.
    pub gaps: usize,
}

/// Puts both logs on the command's clock, moved together by the delay: what comes out shows `keep_s` of dead time, zero
/// unless the actuator's own is known from elsewhere (it cannot be distinguished from the latency of the logs). `other_columns` are other
/// columns of the response log, as long as its response.
///
/// Between rows a column is the cubic through the four around, two at the ends of a segment; through a gap it is
/// nothing, and the row is left out. The cubic is off by less than `0.03 (2 pi f T)^4` of a sine of frequency `f` between
/// rows `T` apart: 1e-4 at a twenty-fifth of the row rate.
///
/// # Errors
/// [`AlignmentError::NothingMerged`] with fewer than 50 rows.
pub fn merge(
    command: &CommandLog<'_>,
    response: &ResponseLog<'_>,
    other_columns: &[&[f64]],
    alignment: &Alignment,
    rows: MergedRows,
    keep_s: f64,
) -> Result<Merged, AlignmentError> {
    let (from_s, to_s) = command.span_s();
    // The response's rows on the command's clock.
    let time_s: Vec<f64> = response.time_s.iter().map(|&t| alignment.command_time_s(t) + keep_s).collect();
    let runs = response.runs();
    let columns: Vec<&[f64]> = std::iter::once(response.response).chain(other_columns.iter().copied()).collect();
    let held_at = |s: f64| -> Option<Vec<f64>> {
        let after = time_s.partition_point(|&t| t <= s);
        let row = after.checked_sub(1)?;
        let run = runs.iter().find(|run| run.contains(&row))?;
        // The last row of a segment is on it, what follows is not.
        if time_s[row] == s {
            return Some(columns.iter().map(|column| column[row]).collect());
        }
        (after < run.end).then(|| {
            let cubic = row.saturating_sub(1).max(run.start)..(row + 3).min(run.end);
            let around = if cubic.len() == 4 { cubic } else { row..row + 2 };
            columns.iter().map(|column| lagrange(&time_s[around.clone()], &column[around.clone()], s)).collect()
        })
    };
    let mut merged = Merged {
        time_s: Vec::new(),
        command: Vec::new(),
        response: Vec::new(),
        other_columns: Vec::new(),
        left_out: 0,
        gaps: 0,
    };
    let mut rows_of: Vec<Vec<f64>> = vec![Vec::new(); columns.len()];
    let mut push = |s: f64, u: f64, values: Vec<f64>| {
        if merged.time_s.last().is_none_or(|&last| s > last) {
            merged.time_s.push(s);
            merged.command.push(u);
            rows_of.iter_mut().zip(values).for_each(|(column, value)| column.push(value));
        }
    };
    let mut left_out = 0;
    match rows {
        MergedRows::OfCommand => {
            for (&s, &u) in command.time_s.iter().zip(command.command) {
                match held_at(s) {
                    Some(values) => push(s, u, values),
                    None => left_out += 1,
                }
            }
        }
        MergedRows::OfResponse => {
            let mut changes = (1..command.time_s.len())
                .filter(|&k| command.command[k] != command.command[k - 1])
                .map(|k| (command.time_s[k], command.command[k]))
                .peekable();
            for (row, &s) in time_s.iter().enumerate() {
                while let Some((at_s, u)) = changes.next_if(|change| change.0 < s) {
                    if let Some(values) = held_at(at_s) {
                        push(at_s, u, values);
                    }
                }
                if (from_s..=to_s).contains(&s) {
                    push(s, command.at(s), columns.iter().map(|column| column[row]).collect());
                } else {
                    left_out += 1;
                }
            }
        }
    }
    merged.response = rows_of.remove(0);
    merged.other_columns = rows_of;
    merged.left_out = left_out;
    let within = |run: &&std::ops::Range<usize>| (from_s..=to_s).contains(&time_s[run.start]) && run.start > 0;
    merged.gaps = runs.iter().filter(within).count();
    if merged.time_s.len() < LEAST_ROWS {
        return Err(AlignmentError::NothingMerged { log: response.name.into(), rows: merged.time_s.len() });
    }
    Ok(merged)
}

/// The polynomial through the points, at `x`.
fn lagrange(xs: &[f64], ys: &[f64], x: f64) -> f64 {
    let weight = |k: usize| {
        let others = xs.iter().enumerate().filter(|(i, _)| *i != k);
        others.map(|(_, other)| (x - other) / (xs[k] - other)).product::<f64>()
    };
    ys.iter().enumerate().map(|(k, y)| y * weight(k)).sum()
}
