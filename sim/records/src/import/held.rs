//! A command and a response that were logged at times of their own.

use std::path::Path;

use super::ImportError;
use super::binary_columns::normalized;
use super::stamps::typical_and_longest;
use super::summary::DroppedRows;

/// A command that is logged this many times more seldom than the response is worth a word.
const SELDOM: f64 = 2.0;

/// The rows of the response that have a command, and which.
pub(super) struct Held {
    pub(super) rows: Vec<usize>,
    /// Of each row the place of its command.
    commands: Vec<usize>,
    pub(super) dropped: Vec<DroppedRows>,
}

/// The commands of these rows.
pub(super) struct HeldCommand {
    /// At the rows, 0..1.
    pub(super) at_rows: Vec<f64>,
    /// On stamps of its own, seconds from the first row: from the one in force there to the last.
    pub(super) own: Vec<(f64, f64)>,
}

impl Held {
    /// The commands, of which the numbers of `range` are 0..1, and `bent` is what is done to those.
    ///
    /// # Errors
    /// [`ImportError::Value`].
    pub(super) fn command(
        &self,
        file: &Path,
        name: &str,
        command: &[(f64, f64)],
        response: &[(f64, f64)],
        range: (f64, f64),
        bent: impl Fn(f64) -> f64,
    ) -> Result<HeldCommand, ImportError> {
        let (Some(&first), Some(&last)) = (self.commands.first(), self.commands.last()) else {
            return Ok(HeldCommand { at_rows: Vec::new(), own: Vec::new() });
        };
        // Beside rows that are left out a motor may be switched off, or not be armed yet.
        let is_on = |place: &usize| !command[*place].1.is_nan();
        let places: Vec<usize> = (first..=last).filter(is_on).collect();
        let raw = places.iter().map(|&place| command[place].1).collect();
        let values: Vec<f64> = normalized(file, name, &places, raw, range)?.into_iter().map(bent).collect();
        // A row's command is on.
        let value_at = |place: &usize| values[places.partition_point(|on| on < place)];
        let origin_us = response[self.rows[0]].0;
        // As the rows count theirs: stamps that are equal stay so.
        let seconds = |place: &usize| command[*place].0 * 1e-6 - origin_us * 1e-6;
        Ok(HeldCommand {
            at_rows: self.commands.iter().map(value_at).collect(),
            own: places.iter().map(seconds).zip(values.iter().copied()).collect(),
        })
    }

    /// What it means that the command was logged more seldom than the response. Stamps in microseconds.
    pub(super) fn note(&self, command: &[(f64, f64)], response: &[(f64, f64)]) -> Option<String> {
        let usual_ms = |stamps: Vec<f64>| 1e-3 * typical_and_longest(&stamps).0;
        let command_ms = usual_ms(command.iter().map(|sample| sample.0).collect());
        let response_ms = usual_ms(self.rows.iter().map(|&row| response[row].0).collect());
        (command_ms > SELDOM * response_ms).then(|| {
            format!(
                "the command was logged every {command_ms:.0} ms and the response every {response_ms:.0} ms: a change of the command \
                 may show {command_ms:.0} ms late, and a lag that is not much longer cannot be told from that"
            )
        })
    }
}

/// Holds the last command to each stamp of the response. After the last command it is held for the
/// longest interval between commands, and no longer. A command of NaN is none: PX4 writes it for a
/// motor that is switched off.
pub(super) fn hold(command: &[(f64, f64)], response: &[(f64, f64)]) -> Held {
    let longest = command.windows(2).map(|w| w[1].0 - w[0].0).fold(0.0, f64::max);
    let end = command.last().map_or(f64::NEG_INFINITY, |last| last.0 + longest);
    let mut held = Held { rows: Vec::new(), commands: Vec::new(), dropped: Vec::new() };
    let (mut early, mut late, mut off, mut same, mut none) = (0, 0, 0, 0, 0);
    let mut next = 0;
    let mut before = f64::NAN;
    for (row, &(stamp, speed)) in response.iter().enumerate() {
        while command.get(next).is_some_and(|c| c.0 <= stamp) {
            next += 1;
        }
        // A stamp of zero is that of an ESC that has not reported yet.
        if stamp == 0.0 || !speed.is_finite() {
            none += 1;
        } else if stamp == before {
            same += 1;
        } else if next == 0 {
            early += 1;
        } else if stamp > end {
            late += 1;
        } else if command[next - 1].1.is_nan() {
            off += 1;
        } else {
            held.rows.push(row);
            held.commands.push(next - 1);
        }
        before = stamp;
    }
    let reasons = [
        (none, "the ESC had not reported yet"),
        (same, "the same report as in the row before"),
        (early, "no command yet"),
        (late, "no command any more"),
        (off, "the motor is switched off"),
    ];
    held.dropped.extend(
        reasons
            .into_iter()
            .filter(|(rows, _)| *rows > 0)
            .map(|(rows, reason)| DroppedRows { rows, reason: reason.into() }),
    );
    held
}
