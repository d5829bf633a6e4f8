//! A command of many pieces at a time.

use super::{Actuator, Rotor};
use crate::passage::{Intervals, Passage, Readings, Wanted};
use crate::pieces::Pieces;

/// Pieces that are passed on at a time, and about as many intervals: few enough to stay near the processor. Chosen: 512 of 24 and 48 bytes
/// are 37 kB, about a cache of the first level; fewer call every stage more often.
const AT_ONCE: usize = 512;

impl Actuator {
    /// Lets commands pass up to `until_s`, and adds the response at `moments_s` to `read`: after now, increasing, none after
    /// `until_s`. The same as [`Actuator::advance`] from moment to moment, but for what rounding and the steps of an integrated
    /// rotor leave, which is not stopped where it is read.
    pub(crate) fn pass(&mut self, commands: &mut Pieces, until_s: f64, moments_s: &[f64], read: &mut Vec<f64>) {
        // What lies behind the rotor takes intervals, of which a long piece may have many.
        let most_s = if self.after.is_empty() { f64::INFINITY } else { AT_ONCE as f64 * self.longest_s };
        let mut rest = moments_s;
        let (mut pieces, mut passed) = (Vec::with_capacity(AT_ONCE), Vec::with_capacity(AT_ONCE));
        let mut intervals = Intervals { longest_s: self.longest_s, ..Intervals::default() };
        loop {
            pieces.clear();
            commands.take(until_s.min(self.time_s + most_s), AT_ONCE, &mut pieces);
            let Some(last) = pieces.last() else { return };
            let until_s = last.until_s;
            let (here, later) = rest.split_at(rest.partition_point(|moment_s| *moment_s <= until_s));
            rest = later;
            for stage in &mut self.stages {
                passed.clear();
                stage.pass(self.time_s, &pieces, &mut passed);
                std::mem::swap(&mut pieces, &mut passed);
            }
            if self.after.is_empty() {
                let wanted = Wanted::Readings(Readings { moments_s: here, read });
                self.pass_rotor(Passage { from_s: self.time_s, pieces: &pieces, wanted });
                self.output = self.rotor.response();
            } else {
                here.clone_into(&mut intervals.moments_s);
                self.pass_rotor(Passage {
                    from_s: self.time_s,
                    pieces: &pieces,
                    wanted: Wanted::Intervals(&mut intervals),
                });
                self.after.iter_mut().for_each(|stage| stage.pass(&mut intervals.intervals));
                let before = self.output;
                let at = |mark: &usize| match mark.checked_sub(1) {
                    Some(place) => intervals.intervals[place].end,
                    None => before,
                };
                read.extend(intervals.marks.iter().map(at));
                self.output = intervals.intervals.last().map_or(before, |last| last.end);
            }
            self.time_s = until_s;
        }
    }

    fn pass_rotor(&mut self, mut passage: Passage) {
        match &mut self.rotor {
            Rotor::Exact(lag) => lag.pass(&mut passage),
            Rotor::Integrated(rotor) => rotor.pass(&mut passage),
        }
    }
}
