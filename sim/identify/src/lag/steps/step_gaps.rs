//! Steps that a gap of the log hides.
//!
//! A logger that stalls goes on with what it has in store: its next readings may be from any moment of the gap, so that nobody knows how
//! much of the way was in it. A gap of `g` seconds that begins when the share `r` of the way is still to come hides up to
//!
//! ```text
//! r (1 - e^(-g / tau))
//! ```
//!
//! of it, with `tau` the lag of the channel, or as much as the response has moved behind it if that is more. While the dead time lasts all
//! of the way is still to come: a gap counts from the command on, however late the channel answers.

use rotorlead_numerics::sample::median;

use super::Run;
use super::step::{Step, StepFault};
use crate::rows::gaps::rows_after_gaps;

/// A step of whose way a gap may hide more than this share shows no lag. Chosen: a fifth of the way shifts the onset by 0.22 time
/// constants, `-ln 0.8`.
const MOST_IN_GAP: f64 = 0.2;

/// Marks the steps that a gap hides, of those that have no other fault.
pub(super) fn mark_hidden_steps(time_s: &[f64], runs: &[Run], steps: &mut [Step]) {
    let after_gaps = rows_after_gaps(time_s);
    let Some(y) = runs.first().map(|run| &run.clean[..]).filter(|_| !after_gaps.is_empty()) else { return };
    let sound: Vec<usize> = (0..steps.len()).filter(|&k| steps[k].fault.is_none()).collect();
    let transitions: Vec<Transition> =
        sound.iter().map(|&k| Transition::new(time_s, y, &after_gaps, &steps[k])).collect();
    // Where each step has a gap, those whose readings come all at once make the lag short, and the gaps long against it.
    let without_gap = transitions.iter().filter(|transition| transition.gaps.is_empty());
    let tau_s = median(without_gap.filter_map(Transition::tau_s))
        .or_else(|| median(transitions.iter().filter_map(Transition::tau_s)));
    let Some(tau_s) = tau_s else { return };
    for (&k, transition) in sound.iter().zip(&transitions) {
        let step = &steps[k];
        let worst = transition.gaps.iter().map(|&gap| (gap, transition.hidden(gap, step, tau_s)));
        let worst = worst.max_by(|a, b| a.1.total_cmp(&b.1)).filter(|(_, share)| *share > MOST_IN_GAP);
        if let Some((gap, share)) = worst {
            steps[k].fault = Some(StepFault::ResponseInGap {
                after_s: (time_s[gap - 1] - step.at_s).max(0.0),
                gap_s: time_s[gap] - time_s[gap - 1],
                share,
            });
        }
    }
}

/// The way of a response from one level to the next.
struct Transition<'a> {
    time_s: &'a [f64],
    y: &'a [f64],
    /// The rows that come after a gap, of the gaps that begin before most of the way is done.
    gaps: &'a [usize],
    /// When the first row and most of the way are done, seconds.
    first_s: Option<f64>,
    most_s: Option<f64>,
}

impl<'a> Transition<'a> {
    fn new(time_s: &'a [f64], y: &'a [f64], after_gaps: &'a [usize], step: &Step) -> Self {
        let crossing = |share: f64| {
            let row = (step.row..step.window.end).find(|&row| done(y, step, row) >= share)?;
            let (before, after) = (done(y, step, row - 1).min(share), done(y, step, row));
            let part = if after > before { (share - before) / (after - before) } else { 1.0 };
            Some((row, time_s[row - 1] + part * (time_s[row] - time_s[row - 1])))
        };
        let (first, most) = (crossing(MOST_IN_GAP), crossing(1.0 - MOST_IN_GAP));
        // Where it never gets there by a single row, all of the level counts.
        let until = most.map_or(step.window.end - 1, |(row, _)| row);
        let gaps = &after_gaps
            [after_gaps.partition_point(|gap| *gap < step.row)..after_gaps.partition_point(|gap| *gap <= until)];
        Self { time_s, y, gaps, first_s: first.map(|(_, at_s)| at_s), most_s: most.map(|(_, at_s)| at_s) }
    }

    /// The lag, seconds. Derived: an exponential takes `ln(0.8 / 0.2)` time constants from a fifth of its way to four fifths.
    fn tau_s(&self) -> Option<f64> {
        Some((self.most_s? - self.first_s?) / ((1.0 - MOST_IN_GAP) / MOST_IN_GAP).ln())
    }

    /// The share of the way that may be in the gap before this row.
    fn hidden(&self, gap: usize, step: &Step, tau_s: f64) -> f64 {
        let done = |row: usize| done(self.y, step, row);
        let gap_s = self.time_s[gap] - self.time_s[gap - 1];
        let to_come = (1.0 - done(gap - 1)).clamp(0.0, 1.0);
        // The reading after a gap may be from before it.
        let moved = done((gap + 1).min(step.window.end - 1)) - done(gap - 1);
        (-to_come * (-gap_s / tau_s).exp_m1()).max(moved.min(1.0))
    }
}

/// The share of a step's way that the response has done at a row.
fn done(y: &[f64], step: &Step, row: usize) -> f64 {
    (y[row] - step.before) / (step.after - step.before)
}
