//! The command of a record on stamps of its own.
//!
//! An autopilot logs its output every few milliseconds and what an ESC reports every twenty: at the rows of the response alone, a step of
//! the command is known to a row. Its own stamps say when it was: in a log that repeats a command that stands still, after the stamp before
//! and not after its own, which is taken as half an interval before its own.

use rotorlead_numerics::sample::median;

use super::Excitation;

/// A command at the row of a record and in its command log are one within this. Chosen: far above the rounding of a mean, far below a
/// step of a command, 5e-4 of DSHOT.
pub(super) const SAME_COMMAND: f64 = 1e-6;

/// Commands, each of which holds from its stamp to the next.
#[derive(Clone, Debug, PartialEq)]
pub struct CommandLog {
    /// File name, relative to the experiment's folder.
    pub file: String,
    /// Stamps in seconds on the clock of the record's rows, strictly increasing; the first is not after the first row.
    pub time_s: Vec<f64>,
    /// Commands, 0..1.
    pub command: Vec<f64>,
}

impl CommandLog {
    /// The commands as the rows of a record have them: of steps and whatever else holds the one in force at the row; of a periodic record
    /// or a chirp, whose command moves all the time, the mean from a row to the next, which keeps its phase.
    #[must_use]
    pub fn at_rows(&self, time_s: &[f64], excitation: Excitation) -> Vec<f64> {
        if !Self::holds(excitation) {
            let ends = time_s.iter().skip(1).chain(time_s.last());
            return time_s.iter().zip(ends).map(|(from, to)| self.mean(*from, *to)).collect();
        }
        time_s.iter().map(|time| self.command[self.place(*time)]).collect()
    }

    /// Whether such a command holds from one change to the next.
    pub(super) fn holds(excitation: Excitation) -> bool {
        !excitation.is_periodic() && !excitation.is_broadband()
    }

    /// The entry that brought the command which is in force at `at_s`; the first where it has not changed before.
    #[must_use]
    pub fn last_change(&self, at_s: f64) -> usize {
        (1..=self.place(at_s)).rev().find(|&place| self.is_change(place)).unwrap_or(0)
    }

    /// How late a stamp may be behind its change, seconds: the usual interval of a log that repeats a command that stands still, none of
    /// one that has a row for each change.
    #[must_use]
    pub fn resolution_s(&self) -> f64 {
        let changes = (1..self.time_s.len()).filter(|&place| self.is_change(place)).count();
        if 2 * changes > self.time_s.len() {
            return 0.0;
        }
        median(self.time_s.windows(2).map(|pair| pair[1] - pair[0])).unwrap_or(0.0)
    }

    fn is_change(&self, place: usize) -> bool {
        self.command[place] != self.command[place - 1]
    }

    /// When its commands changed, and to what, from the one in force at `from_s` to the last before `to_s`: half of [`Self::resolution_s`]
    /// before their stamps.
    #[must_use]
    pub fn changes(&self, from_s: f64, to_s: f64) -> (Vec<f64>, Vec<f64>) {
        let late_s = 0.5 * self.resolution_s();
        let first = self.place(from_s + late_s);
        let end = self.time_s.partition_point(|time| *time < to_s + late_s).max(first + 1);
        let places = (first..end).filter(|&place| place == first || self.is_change(place));
        // What is in force at the beginning was so before, and counts from there.
        places.map(|place| ((self.time_s[place] - late_s).max(from_s), self.command[place])).unzip()
    }

    /// The entry in force at a time; the first one before its stamp too.
    fn place(&self, at_s: f64) -> usize {
        self.time_s.partition_point(|time| *time <= at_s).saturating_sub(1)
    }

    /// The mean over a time; what is in force where it has no length.
    fn mean(&self, from_s: f64, to_s: f64) -> f64 {
        let mut place = self.place(from_s);
        let (mut at, mut sum) = (from_s, 0.0);
        let (mut low, mut high) = (self.command[place], self.command[place]);
        while at < to_s {
            let until = self.time_s.get(place + 1).map_or(to_s, |next| next.min(to_s));
            let command = self.command[place];
            (low, high) = (low.min(command), high.max(command));
            sum += command * (until - at);
            at = until;
            place += usize::from(at < to_s);
        }
        // Rounding may lead beyond the range of a duty.
        if to_s > from_s { (sum / (to_s - from_s)).clamp(low, high) } else { low }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn log() -> CommandLog {
        CommandLog {
            file: "commands.csv".into(),
            time_s: vec![-0.01, 0.0125, 0.015, 0.0425, 0.05],
            command: vec![0.2, 0.2, 0.4, 0.6, 0.6],
        }
    }

    #[test]
    fn a_step_holds_at_the_rows_and_keeps_its_moment() {
        let rows = [0.0, 0.02, 0.04, 0.06];
        assert_eq!(log().at_rows(&rows, Excitation::Staircase), [0.2, 0.4, 0.4, 0.6]);
        assert_eq!(rows.map(|row| log().last_change(row)), [0, 2, 2, 3]);
        // Stamps are 22.5 ms apart as a rule, and a change is half of that before its own.
        let (times, commands) = log().changes(0.0, 0.06);
        assert_eq!(commands, [0.2, 0.4, 0.6]);
        assert!(
            times.iter().zip([0.0, 0.00375, 0.03125]).all(|(time, exact)| (time - exact).abs() < 1e-12),
            "{times:?}"
        );
        assert_eq!(log().changes(0.01, 0.03), (vec![0.01], vec![0.4]));
    }

    #[test]
    fn a_log_that_repeats_its_command_knows_a_change_to_its_interval() {
        let log = |command: &[f64]| CommandLog {
            file: "commands.csv".into(),
            time_s: (0..command.len()).map(|place| place as f64).collect(),
            command: command.to_vec(),
        };
        assert_eq!(log(&[0.2, 0.2, 0.2, 0.4, 0.4, 0.4]).resolution_s(), 1.0);
        assert_eq!(log(&[0.2, 0.4, 0.6, 0.4, 0.2]).resolution_s(), 0.0);
    }

    #[test]
    fn what_moves_all_the_time_has_the_mean_of_each_row() {
        let means = log().at_rows(&[0.0, 0.02, 0.04, 0.06], Excitation::Chirp);
        let exact = [(0.2 * 0.015 + 0.4 * 0.005) / 0.02, 0.4, (0.4 * 0.0025 + 0.6 * 0.0175) / 0.02, 0.6];
        for (mean, exact) in means.iter().zip(exact) {
            assert!((mean - exact).abs() < 1e-12, "{means:?}");
        }
    }
}
