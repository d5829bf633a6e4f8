//! What a log does not say of itself: the part of it that is one record, and what drove the command in it.

use rotorlead_numerics::sample::median;

use super::{DroppedRows, ImportError, ImportOptions, MIN_ROWS, MIN_STEADY_POINTS, Taken};
use crate::CommandShape;
use crate::experiment::Excitation;

/// Commands are distinguished to this: a microsecond of a pulse width from 1000 to 2000.
const COMMAND_STEP: f64 = 1e-3;
/// Digits beyond this are those of the arithmetic.
const DIGITS: f64 = 1e6;
/// A level half way between two is the upper one, also where noise has it a little below.
const BELOW_HALF: f64 = 0.1;

/// What a manifest says of a record's command.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Described {
    pub(super) excitation: Excitation,
    pub(super) period_s: Option<f64>,
    pub(super) nominal: f64,
    pub(super) amplitude: Option<f64>,
    /// The same in words, where it is not what every log of its format is.
    pub(super) note: Option<String>,
}

impl Taken {
    /// Leaves out what is not between the stated seconds from the first row.
    pub(super) fn cut(&mut self, options: &ImportOptions) -> Result<(), ImportError> {
        let Some((from_s, to_s)) = options.seconds else { return Ok(()) };
        let first = self.time_s.partition_point(|time| *time < from_s);
        let end = self.time_s.partition_point(|time| *time < to_s).max(first);
        let rows = self.time_s.len() - (end - first);
        if rows == 0 {
            return Ok(());
        }
        let least = if self.usual == Some(Excitation::Steady) { MIN_STEADY_POINTS } else { MIN_ROWS };
        if end - first < least {
            let lasts_s = self.time_s.last().copied().unwrap_or(0.0);
            let rows = end - first;
            return Err(ImportError::missing(
                &self.summary.file,
                format!(": {rows} row(s) from {from_s} to {to_s} s; the log ends {lasts_s:.1} s behind its first row"),
                "give --seconds a part that lies in the log; they are counted from its first row",
            ));
        }
        for column in self.columns_of_rows() {
            column.truncate(end);
            column.drain(..first);
        }
        let start = self.time_s.first().copied().unwrap_or(0.0);
        self.time_s.iter_mut().for_each(|time| *time -= start);
        self.own_command.iter_mut().for_each(|(time, _)| *time -= start);
        self.summary.rows_taken = self.time_s.len();
        let reason = format!("before {from_s} s or from {to_s} s on, counted from the first row");
        self.summary.dropped.push(DroppedRows { rows, reason });
        Ok(())
    }

    /// What the command is, as stated and as its rows say.
    pub(super) fn described(&self, options: &ImportOptions) -> Result<Described, ImportError> {
        let file = || self.summary.file.clone();
        if options.without_command {
            return Ok(self.apart(options));
        }
        let low = self.command.iter().copied().fold(f64::INFINITY, f64::min);
        let high = self.command.iter().copied().fold(0.0, f64::max);
        // A folder of it could not be written: a record says how far its command moves.
        if high <= low {
            return Err(ImportError::ConstantCommand { file: file(), command: high, rows: self.command.len() });
        }
        let shape = self.shape().filter(|_| options.excitation.is_none());
        let seen = match shape {
            Some(CommandShape::Random) => Some(Excitation::Random),
            Some(CommandShape::Ramp) => Some(Excitation::Free),
            None => None,
        };
        let excitation = options.excitation.or(seen).or(self.usual);
        let excitation = excitation.ok_or_else(|| ImportError::no_excitation(&self.summary.file))?;
        let period_s = options.period_s.filter(|_| excitation.is_periodic());
        let (found, how) = self.nominal(excitation, period_s, (low, high));
        let (nominal, how) = options.nominal.map_or((found, how), |nominal| (nominal, String::from("as stated")));
        let (found, extent) = match excitation {
            Excitation::Step => (f64::max(high - nominal, nominal - low), "how far it steps"),
            _ => ((high - low) / 2.0, "half of its range"),
        };
        let found = Some((found * DIGITS).round() / DIGITS).filter(|rounded| *rounded > 0.0).unwrap_or(found);
        let (amplitude, extent) = options.amplitude.map_or((found, extent), |amplitude| (amplitude, "as stated"));
        let period = period_s.map(|period_s| format!(" with a period of {period_s} s")).unwrap_or_default();
        let seen = match shape {
            Some(CommandShape::Random) => ", as its switching shows",
            Some(CommandShape::Ramp) => ": the command is a ramp, behind which no lag is told from a dead time",
            None => "",
        };
        let note = format!(
            "{}{seen}{period}, nominal {nominal:.3} ({how}), amplitude {amplitude:.3} ({extent})",
            excitation.name()
        );
        let is_usual =
            options.excitation.is_none() && shape.is_none() && options.nominal.is_none() && options.amplitude.is_none();
        let amplitude = Some(amplitude);
        Ok(Described { excitation, period_s, nominal, amplitude, note: (!is_usual).then_some(note) })
    }

    /// What the command looks like, where nothing else says what it is: a format whose logs are of chirps or steady points does.
    fn shape(&self) -> Option<CommandShape> {
        if !matches!(self.usual, None | Some(Excitation::Staircase)) {
            return None;
        }
        if self.own_command.is_empty() {
            return CommandShape::from_command(&self.time_s, &self.command);
        }
        let (time_s, command): (Vec<f64>, Vec<f64>) = self.own_command.iter().copied().unzip();
        CommandShape::from_command(&time_s, &command)
    }

    /// What is stated of a command that is in another log.
    fn apart(&self, options: &ImportOptions) -> Described {
        let excitation = options.excitation.or(self.usual).unwrap_or(Excitation::Staircase);
        Described {
            excitation,
            period_s: options.period_s.filter(|_| excitation.is_periodic()),
            nominal: options.nominal.unwrap_or(0.0),
            amplitude: options.amplitude,
            note: Some(String::from(
                "taken without a command, as one that was logged apart: `rotorlead identify --align LOG` merges the two",
            )),
        }
    }

    /// The command around which a record was run, and how it was found.
    fn nominal(&self, excitation: Excitation, period_s: Option<f64>, (low, high): (f64, f64)) -> (f64, String) {
        let middle = (low + high) / 2.0;
        match (excitation, period_s) {
            (Excitation::Multisine, Some(period_s)) => {
                let rows = self.time_s.len();
                let row_s = self.time_s.last().copied().unwrap_or(0.0) / (rows.max(2) - 1) as f64;
                // Half a row more or less is none: the last row is as long as the others.
                let periods = ((rows as f64 + 0.5) * row_s / period_s).floor();
                if periods < 1.0 {
                    return (rounded(middle), String::from("middle of its range"));
                }
                let whole = self.time_s.partition_point(|time| *time < periods * period_s - 0.5 * row_s);
                let mean = self.command[..whole].iter().sum::<f64>() / whole as f64;
                (rounded(mean), format!("mean of {periods} whole periods"))
            }
            (Excitation::Multisine | Excitation::Square | Excitation::Triangle, _) => {
                (rounded(middle), String::from("middle of its range"))
            }
            (Excitation::Step, _) => (self.command[0], String::from("before the step")),
            (Excitation::Flight, _) => {
                let usual = median(self.command.iter().copied()).unwrap_or(middle);
                ((usual * DIGITS).round() / DIGITS, String::from("its median"))
            }
            _ => ((middle * DIGITS).round() / DIGITS, String::from("middle of its range")),
        }
    }
}

/// A nominal command that two records of one level have in common, whatever their noise.
fn rounded(nominal: f64) -> f64 {
    // Divided, so that 0.4 is the number that `0.4` is.
    (nominal / COMMAND_STEP + BELOW_HALF).round() / COMMAND_STEP.recip().round()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_that_are_the_same_get_the_same_number() {
        assert_eq!(rounded(0.4), 0.4);
        assert_eq!(rounded(0.399_999_6), 0.4);
        assert_eq!(rounded(0.400_3), 0.4);
        assert_eq!(rounded(0.400_499_99), rounded(0.400_500_01));
        assert_eq!(rounded(0.0), 0.0);
        assert_eq!(rounded(1.0), 1.0);
    }
}
