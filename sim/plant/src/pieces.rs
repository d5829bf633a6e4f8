//! A drive as pieces, some at a time.

use super::Segment;
use super::command_signal::{CommandSignal, Interpolation};

/// What of a drive is to come.
pub(super) struct Pieces<'a> {
    drive: CommandSignal<'a>,
    interpolation: Interpolation,
    /// The first command takes effect here and the last one ends there, seconds.
    begin_s: f64,
    end_s: f64,
    /// Up to here it is past.
    now_s: f64,
    /// The command of the moment.
    place: usize,
}

impl<'a> Pieces<'a> {
    /// From `now_s` on, which is not before `begin_s`, of a drive that begins at `begin_s` and ends at `end_s`; each with one
    /// command at least. Where it ends it goes back to its first command.
    pub fn new(
        drive: CommandSignal<'a>,
        interpolation: Interpolation,
        (begin_s, end_s): (f64, f64),
        now_s: f64,
    ) -> Self {
        let mut pieces = Self { drive, interpolation, begin_s, end_s, now_s, place: 0 };
        pieces.place = drive.time_s.partition_point(|time_s| pieces.moment(*time_s) <= now_s).saturating_sub(1);
        pieces
    }

    /// When a command takes effect that does so at `time_s` of the drive.
    #[inline]
    fn moment(&self, time_s: f64) -> f64 {
        time_s - self.drive.time_s[0] + self.begin_s
    }

    /// Gives those that come up to `until_s`, of so many commands at most; one that ends later is cut there, and goes on after it.
    pub fn take(&mut self, until_s: f64, most: usize, pieces: &mut Vec<Segment>) {
        let levels = &self.drive.command[self.place..];
        let ends = &self.drive.time_s[self.place + 1..];
        let ends = &ends[..ends.len().min(most)];
        let whole = ends.partition_point(|time_s| self.moment(*time_s) <= until_s);
        match self.interpolation {
            Interpolation::ZeroOrderHold => {
                let held = |(level, end): (&f64, &f64)| Segment::constant(*level, self.moment(*end));
                Segment::join_all(levels.iter().zip(&ends[..whole]).map(held), pieces);
                self.go_on(whole);
            }
            Interpolation::FirstOrderHold => {
                for end in &ends[..whole] {
                    self.ramp(self.moment(*end)).join(pieces);
                    self.go_on(1);
                }
            }
        }
        // That in which it ends.
        let cut_s = until_s.min(self.end_s);
        if whole < most && cut_s > self.now_s {
            let end_s = self.drive.time_s.get(self.place + 1).map_or(self.end_s, |time_s| self.moment(*time_s));
            let piece = match self.interpolation {
                Interpolation::ZeroOrderHold => Segment::constant(self.drive.command[self.place], cut_s),
                Interpolation::FirstOrderHold => Segment { until_s: cut_s, ..self.ramp(end_s) },
            };
            piece.join(pieces);
            self.now_s = cut_s;
        }
    }

    /// Goes on by so many commands, to where the last of them ends.
    fn go_on(&mut self, commands: usize) {
        if commands > 0 {
            self.place += commands;
            self.now_s = self.moment(self.drive.time_s[self.place]);
        }
    }

    /// The rest of the piece of the moment, which ends at `end_s`.
    fn ramp(&self, end_s: f64) -> Segment {
        let level = self.drive.command[self.place];
        if end_s.is_infinite() {
            return Segment::constant(level, end_s);
        }
        let begin_s = self.moment(self.drive.time_s[self.place]);
        let next = self.drive.command.get(self.place + 1).unwrap_or(&self.drive.command[0]);
        let slope_per_s = (next - level) / (end_s - begin_s);
        Segment { level: level + slope_per_s * (self.now_s - begin_s), slope_per_s, until_s: end_s }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DRIVE: CommandSignal = CommandSignal { time_s: &[1.0, 2.0, 3.0, 4.0], command: &[0.2, 0.2, 0.4, 0.6] };

    fn all(mut pieces: Pieces, ends_s: &[f64], most: usize) -> Vec<Segment> {
        let mut found = Vec::new();
        for &end_s in ends_s {
            loop {
                let mut some = Vec::new();
                pieces.take(end_s, most, &mut some);
                if some.is_empty() {
                    break;
                }
                found.append(&mut some);
            }
        }
        found
    }

    #[test]
    fn commands_come_as_they_are_told_and_cut_where_asked() {
        let pieces = || Pieces::new(DRIVE, Interpolation::ZeroOrderHold, (0.0, f64::INFINITY), 0.0);
        let held = |of: &[(f64, f64)]| of.iter().map(|of| Segment::constant(of.0, of.1)).collect::<Vec<_>>();
        assert_eq!(all(pieces(), &[9.0], 99), held(&[(0.2, 2.0), (0.4, 3.0), (0.6, 9.0)]));
        assert_eq!(all(pieces(), &[9.0], 1), held(&[(0.2, 1.0), (0.2, 2.0), (0.4, 3.0), (0.6, 9.0)]));
        assert_eq!(all(pieces(), &[2.5, 3.0], 99), held(&[(0.2, 2.0), (0.4, 2.5), (0.4, 3.0)]));
    }

    #[test]
    fn the_end_of_a_period_before_the_record_leads_to_its_first_command() {
        let found = all(Pieces::new(DRIVE, Interpolation::FirstOrderHold, (-4.0, 0.0), -1.75), &[0.0], 99);
        let line = |level, slope_per_s, until_s| Segment { level, slope_per_s, until_s };
        let expected = [line(0.45, 0.2, -1.0), line(0.6, -0.4, 0.0)];
        for (found, expected) in found.iter().zip(expected) {
            assert!((found.level - expected.level).abs() < 1e-12 && found.until_s == expected.until_s, "{found:?}");
            assert!((found.slope_per_s - expected.slope_per_s).abs() < 1e-12, "{found:?}");
        }
        assert_eq!(found.len(), 2);
    }
}
