//! What of a log is compared, and how much it is off.
//!
//! What a model misses of a log is mostly its own error, not noise: a static map is off by the same for as long as a level is
//! held, and thousands of rows then say one thing. So each plateau is compared in two ways:
//!
//! ```text
//! level      the mean of what is left of the settled rows: one number
//! moving     what is left of the rows after a step, less what the levels are off by:
//!            r(t) - (1 - p) level_before - p level,   p the part of the way that the response has gone
//! ```
//!
//! over the size of the step, since a model of the motion is off in proportion to it. Levels say what the static map is, the rest
//! says how the motor moves, and neither stands in the other's way. What moves counts as [`PER_STEP`] independent numbers a step.
//! Where the plateau before a step is held out and the one after it is fitted, the row on which the command changes stands for the
//! former: it belongs to the latter, and the response is still on the level before.
//!
//! How large both errors are is not known beforehand, and is estimated from what is left.

use std::ops::Range;

use rotorlead_numerics::sample::median;

/// Independent numbers that the motion after a step is worth. Chosen: how late it is, how fast, and how curved. Their number scales the log
/// likelihood of the motion: higher overrates what fits the model's own error.
pub(crate) const PER_STEP: f64 = 3.0;
/// The same of a tenth of a record without plateaus. Chosen: as much as some seven steps, which such a part may well go through. It scales
/// as above.
const PER_BLOCK: f64 = 20.0;
/// Mean squares below this are this, in squares of the response's unit, or of the step's size for its motion. Chosen: far below any
/// reading, it only keeps weights finite where nothing is left.
const LEAST: f64 = 1e-20;

/// Standard deviations of the errors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Errors {
    /// Of a level.
    pub level: f64,
    /// Of an independent number of the motion, over the size of the step.
    pub moving: f64,
}

impl Default for Errors {
    fn default() -> Self {
        Self { level: 1.0, moving: 1.0 }
    }
}

/// What of a group is compared.
#[derive(Clone, Debug)]
pub(crate) struct ComparedRows {
    /// Settled rows, without those that are not compared; empty without a level.
    pub settled: Vec<usize>,
    /// The same of the plateau before.
    pub before: Vec<usize>,
    /// Rows after the step, with the part of the way that the response has gone.
    pub moving: Vec<(usize, f64)>,
    /// Size of the step that leads there, as measured.
    pub size: f64,
    /// By how much the response may have left the level before on the row on which the command changes: a standard deviation.
    pub departure_std: f64,
    /// That row, and its standard deviation, where it stands for the level before.
    pub enters: Option<(usize, f64)>,
    /// How many independent numbers the level is.
    pub independent_level: f64,
    /// Standard error of the level by its own scatter, where it cannot be known better.
    pub level_std: f64,
    /// The part of the motion that is compared.
    pub shown: f64,
    /// Rows of the motion before which the logger stood still, up to where it has settled.
    pub stalled: Range<usize>,
}

impl Default for ComparedRows {
    fn default() -> Self {
        Self {
            settled: Vec::new(),
            before: Vec::new(),
            moving: Vec::new(),
            size: 1.0,
            departure_std: 0.0,
            enters: None,
            independent_level: 1.0,
            level_std: 0.0,
            shown: 1.0,
            stalled: 0..0,
        }
    }
}

impl ComparedRows {
    /// Leaves out the motion after the logger stood still: such a logger reads what is old when it goes on, and catches up
    /// faster than any motor. Gives the number of rows.
    pub fn cut_after_stall(&mut self) -> usize {
        let all = self.moving.len();
        self.moving.retain(|(row, _)| !self.stalled.contains(row));
        if all > 0 {
            self.shown = self.moving.len() as f64 / all as f64;
        }
        all - self.moving.len()
    }

    /// As one whose plateau before is held out: on the row on which the command changes, which is `first`, the response is still
    /// on the level before, and that row says by how much that is off.
    pub fn entered(self, first: usize, noise: f64) -> Self {
        let is_step = !self.settled.is_empty() && !self.before.is_empty();
        let is_kept = self.moving.first().is_some_and(|(row, _)| *row == first);
        Self { enters: (is_step && is_kept).then_some((first, noise.hypot(self.departure_std))), ..self }
    }

    /// How far a response goes.
    pub fn step(&self, response: &[f64]) -> f64 {
        (mean(response, &self.settled) - mean(response, &self.before)).abs()
    }

    /// Sets the way that a simulated response goes.
    pub fn follow(&mut self, simulated: &[f64]) {
        let (from, to) = (mean(simulated, &self.before), mean(simulated, &self.settled));
        for (row, part) in &mut self.moving {
            let way = (simulated[*row] - from) / (to - from);
            *part = if way.is_finite() { way.clamp(0.0, 1.0) } else { 1.0 };
        }
    }

    fn independent(&self) -> f64 {
        match (self.moving.is_empty(), self.settled.is_empty()) {
            (true, _) => 0.0,
            (false, true) => PER_BLOCK,
            (false, false) => PER_STEP * self.shown,
        }
    }
}

pub(crate) fn mean(values: &[f64], rows: &[usize]) -> f64 {
    rows.iter().map(|&row| values[row]).sum::<f64>() / rows.len().max(1) as f64
}

/// The parts of one split with their errors.
#[derive(Clone, Debug, Default)]
pub(crate) struct Filter {
    parts: Vec<ComparedRows>,
    errors: Errors,
}

impl Filter {
    /// `relative` where the size of the step counts.
    pub fn new(errors: Errors, parts: impl Iterator<Item = ComparedRows>, relative: bool) -> Self {
        let alone = |part| ComparedRows { size: 1.0, independent_level: 1.0, level_std: 0.0, ..part };
        let sized = parts.map(|part| if relative { part } else { alone(part) });
        Self { parts: sized.collect(), errors }
    }

    /// All that is compared of values at each row of a record, over the standard deviations.
    pub fn apply(&self, values: &[f64]) -> Vec<f64> {
        let count = self.parts.iter().map(|part| 2 + part.moving.len()).sum();
        let mut all = Vec::with_capacity(count);
        for part in &self.parts {
            let level = mean(values, &part.settled);
            let before = mean(values, &part.before);
            if !part.settled.is_empty() {
                all.push(level / self.errors.level);
            }
            if let Some((row, noise)) = part.enters {
                all.push(values[row] / self.errors.level.hypot(noise));
            }
            let scale = (part.independent() / part.moving.len() as f64).sqrt() / (self.errors.moving * part.size);
            all.extend(
                part.moving.iter().map(|(row, way)| scale * (values[*row] - (1.0 - way) * before - way * level)),
            );
        }
        all
    }

    /// How many independent numbers levels and motion are, and the mean squares of both.
    fn mean_squares(&self, values: &[f64]) -> [(f64, f64); 2] {
        let unit = Self { errors: Errors::default(), parts: self.parts.clone() };
        let mut white = unit.apply(values).into_iter();
        let (mut level, mut moving, mut least) = ((0.0, 0.0), (0.0, 0.0), 0.0);
        for part in &self.parts {
            if !part.settled.is_empty() {
                level = (
                    level.0 + part.independent_level,
                    level.1 + white.next().map_or(0.0, |residual| residual * residual),
                );
                least += part.independent_level * part.level_std.powi(2);
            }
            // A row is off by its noise, too, and says little of how far levels are off.
            let _ = part.enters.and_then(|_| white.next());
            let squares: f64 = white.by_ref().take(part.moving.len()).map(|residual| residual * residual).sum();
            moving = (moving.0 + part.independent(), moving.1 + squares);
        }
        level.1 = level.1.max(least);
        [level, moving].map(|(count, sum)| (count, if count > 0.0 { (sum / count).max(LEAST) } else { 1.0 }))
    }

    /// How many independent numbers are compared.
    pub fn numbers(&self) -> f64 {
        let of_part = |part: &ComparedRows| {
            part.independent() + if part.settled.is_empty() { 0.0 } else { part.independent_level }
        };
        self.parts.iter().map(of_part).sum()
    }

    /// The errors that values have.
    pub fn errors(&self, values: &[f64]) -> Errors {
        let [level, moving] = self.mean_squares(values).map(|(_, square)| square.sqrt());
        Errors { level, moving }
    }

    /// Number and sum of squares of levels, and the mean square of each step's motion.
    pub fn squares(&self, values: &[f64]) -> ((f64, f64), Vec<f64>) {
        let [(count, level), _] = self.mean_squares(values);
        let moving = self.parts.iter().filter(|part| !part.moving.is_empty()).map(|part| {
            let alone = Self { errors: Errors::default(), parts: vec![part.clone()] };
            alone.mean_squares(values)[1].1
        });
        ((count, count * level), moving.collect())
    }
}

/// Steps smaller than this part of the usual one count as one of this size: of a step that is hardly one no motion is seen. Chosen: lower,
/// noise over a small size weighs too much; higher, steps that show their motion are weighed down.
const LEAST_SIZE: f64 = 0.5;

/// Of a plateau so many times the time are compared in which the response goes most of the usual step; later it hardly moves, and
/// there are many such rows. Derived: `e^-6` is 0.25 % of the step, which few logs show.
const MOVES_FOR: f64 = 6.0;
/// Most of the step. Derived: `1 - 1/e`, where a first-order lag is after its time constant.
const MOST_OF_THE_WAY: f64 = 0.63;

/// Sets the sizes of steps, and for how long they are compared, from the response that was measured; `after_gaps` are the rows
/// before which the logger stood still. Gives the time in which the response goes most of the usual step.
pub(crate) fn measure(
    parts: &mut [ComparedRows],
    time_s: &[f64],
    measured: &[f64],
    after_gaps: &[usize],
) -> Option<f64> {
    let is_step = |part: &&ComparedRows| !part.settled.is_empty() && !part.before.is_empty();
    let sizes = parts.iter().filter(is_step).map(|part| part.step(measured));
    let usual = median(sizes).filter(|usual| *usual > 0.0)?;
    let since =
        |part: &ComparedRows, row: usize| part.moving.first().map_or(0.0, |(first, _)| time_s[row] - time_s[*first]);
    let first_gap = |part: &ComparedRows| {
        let (first, last) = (part.moving.first()?.0, part.moving.last()?.0);
        after_gaps.iter().copied().find(|row| (first..=last).contains(row))
    };
    let most_of_the_way = |part: &ComparedRows| {
        let (before, most) = (mean(measured, &part.before), MOST_OF_THE_WAY * part.step(measured));
        let (there, _) = part.moving.iter().find(|(row, _)| (measured[*row] - before).abs() > most)?;
        let stalls = first_gap(part).is_some_and(|gap| gap <= *there);
        Some((stalls, since(part, *there)))
    };
    let large = parts.iter().filter(is_step).filter(|part| part.step(measured) >= LEAST_SIZE * usual);
    let rises: Vec<(bool, f64)> = large.filter_map(most_of_the_way).collect();
    // Steps during which the logger stood still say little of how long they take.
    let shown = median(rises.iter().filter(|(stalls, _)| !stalls).map(|(_, rise_s)| *rise_s));
    let rise_s = shown.or_else(|| median(rises.iter().map(|(_, rise_s)| *rise_s))).filter(|time_s| *time_s > 0.0);
    for part in parts.iter_mut().filter(|part| is_step(&&**part)) {
        part.size = part.step(measured).max(LEAST_SIZE * usual);
        let Some(rise_s) = rise_s else { continue };
        // Nobody knows where in its interval a row was taken: a uniform error of one row has this standard deviation.
        let interval_s = part.moving.first().map_or(0.0, |(first, _)| time_s[*first] - time_s[first.saturating_sub(1)]);
        part.departure_std = part.step(measured) * (interval_s / 12_f64.sqrt() / rise_s).min(1.0);
        let moves = part.moving.iter().take_while(|(row, _)| since(part, *row) <= MOVES_FOR * rise_s).count();
        part.moving.truncate(moves);
        if let Some(gap) = first_gap(part) {
            part.stalled = gap..part.settled[0];
        }
    }
    rise_s
}

/// The rows of a range that are compared.
pub(crate) fn kept_rows(range: Range<usize>, kept: &[bool]) -> Vec<usize> {
    range.filter(|row| kept[*row]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two plateaus of ten rows, and the way between them in five.
    fn filter() -> Filter {
        let moving = (10..15).map(|row| (row, 0.0)).collect();
        let mut part =
            ComparedRows { settled: (15..20).collect(), before: (0..10).collect(), moving, ..ComparedRows::default() };
        let simulated: Vec<f64> = (0..20).map(|row| f64::from((row - 9).clamp(0, 5)) * 0.2).collect();
        part.follow(&simulated);
        Filter::new(Errors { level: 0.5, moving: 1.0 }, std::iter::once(part), true)
    }

    #[test]
    fn a_level_that_is_off_is_one_number_and_no_motion() {
        let off: Vec<f64> = (0..20).map(|row| 0.1 + 0.2 * f64::from((row - 9).clamp(0, 5)) * 0.2).collect();
        let white = filter().apply(&off);
        assert_eq!(white.len(), 6);
        assert!((white[0] - 0.3 / 0.5).abs() < 1e-12, "{white:?}");
        assert!(white[1..].iter().all(|residual| residual.abs() < 1e-12), "{white:?}");
    }

    #[test]
    fn where_the_plateau_before_is_held_out_the_row_at_the_change_stands_for_its_level() {
        let Filter { parts, errors } = filter();
        let part = parts[0].clone().entered(10, 1.2);
        assert!(parts[0].clone().entered(9, 1.2).enters.is_none());
        let entered = Filter::new(errors, std::iter::once(part), true);
        let mut off = vec![0.3; 20];
        off[10] = 2.6;
        let white = entered.apply(&off);
        // Over the error of a level and the noise of a row: the root of 0.25 + 1.44.
        assert!((white[0] - 0.6).abs() < 1e-12 && (white[1] - 2.0).abs() < 1e-12 && white.len() == 7, "{white:?}");
        assert!((entered.errors(&off).level - 0.3).abs() < 1e-12);
    }

    #[test]
    fn the_motion_counts_as_so_many_numbers_however_many_rows_it_has() {
        let mut off = vec![0.0; 20];
        off[10..15].fill(0.1);
        let sum: f64 = filter().apply(&off).iter().map(|residual| residual * residual).sum();
        assert!((sum - PER_STEP * 0.01).abs() < 1e-12, "{sum}");
        assert!((filter().errors(&off).moving - 0.1).abs() < 1e-12);
    }
}
