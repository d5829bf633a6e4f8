//! Effects that no catalog names. Each is a change of the plain chain's force on the fine grid, large enough to be seen.
//!
//! Sorts for tuning and sorts for the report are not the same.

use std::f64::consts::TAU;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::lag::Mode;
use super::motor::Point;

/// A sort of effect outside the catalog.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sort {
    /// The motor loses step now and then, falls, and catches itself.
    Desync,
    /// A mode whose frequency follows the nominal speed.
    SpeedFollowingMode,
    /// A slider between load cell and ground that sticks until it is pulled loose.
    Stiction,
    /// The logger repeats its last value for a while, now and then.
    MissingBlocks,
    /// The wake comes back from the walls.
    Echo,
    /// A speed controller of its own in the ESC, badly damped.
    Governor,
    /// The blades stall above a thrust and recover below a lower one.
    BladeStall,
    /// The delay wanders, slowly and periodically.
    WanderingDelay,
    /// The force first goes the wrong way.
    WrongWay,
}

impl Sort {
    /// For tuning the method.
    pub const TUNE: [Self; 4] = [Self::Desync, Self::SpeedFollowingMode, Self::Stiction, Self::MissingBlocks];
    /// For the report.
    pub const REPORT: [Self; 5] = [Self::Echo, Self::Governor, Self::BladeStall, Self::WanderingDelay, Self::WrongWay];

    /// Its name in the truth.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Desync => "desync",
            Self::SpeedFollowingMode => "speed_following_mode",
            Self::Stiction => "stiction",
            Self::MissingBlocks => "missing_blocks",
            Self::Echo => "echo",
            Self::Governor => "governor",
            Self::BladeStall => "blade_stall",
            Self::WanderingDelay => "wandering_delay",
            Self::WrongWay => "wrong_way",
        }
    }

    /// One of this sort, the same over all records of a case.
    #[must_use]
    pub fn draw(self, rng: &mut ChaCha8Rng) -> Outside {
        let mut within = |low: f64, high: f64| rng.random_range(low..high);
        let values = match self {
            // Events per second, part of the thrust lost, seconds until it is back.
            Self::Desync => [within(0.1, 0.4), within(0.15, 0.5), within(0.1, 0.4)],
            // Hertz at a command of 0.5, damping, participation.
            Self::SpeedFollowingMode => [within(5.0, 12.0), within(0.1, 0.3), within(0.5, 1.0)],
            // Newtons of friction per newton of swing, seconds of creep, nothing.
            Self::Stiction => [within(0.08, 0.2), within(0.5, 1.5), 0.0],
            // Blocks per second, shortest and longest seconds.
            Self::MissingBlocks => [within(0.3, 1.0), 0.02, within(0.1, 0.3)],
            // Seconds, part.
            Self::Echo => [within(0.15, 0.6), within(0.15, 0.4), 0.0],
            // Hertz at a command of 0.5, damping, nothing.
            Self::Governor => [within(2.0, 6.0), within(0.2, 0.4), 0.0],
            // Where in the swing stall begins and ends, part of the swing lost.
            Self::BladeStall => [within(0.2, 0.4), within(-0.2, 0.0), within(0.15, 0.3)],
            // Seconds of delay from none to this, seconds of a swing, nothing.
            Self::WanderingDelay => [within(0.02, 0.06), within(2.0, 7.0), 0.0],
            // Seconds of the zero in the right half plane.
            Self::WrongWay => [within(0.02, 0.05), 0.0, 0.0],
        };
        Outside { sort: self, values }
    }
}

/// An effect outside the catalog.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outside {
    /// What it is.
    pub sort: Sort,
    /// Its numbers; what they mean is said where they are drawn.
    pub values: [f64; 3],
}

impl Outside {
    /// Whether it happens in the logger, to the rows with their noise, and not to the force.
    #[must_use]
    pub fn is_in_the_logger(&self) -> bool {
        self.sort == Sort::MissingBlocks
    }

    /// Changes the force of one record, on a grid of `step_s`, at `point` with a static swing of `swing_n`.
    pub fn apply(&self, force: &mut [f64], step_s: f64, point: &Point, swing_n: f64, rng: &mut ChaCha8Rng) {
        let [first, second, third] = self.values;
        let rest = point.rest_n;
        let speed = point.nominal / 0.5;
        match self.sort {
            Sort::Desync => {
                let (mut lost, decay) = (0.0, (-step_s / third).exp());
                for value in force {
                    if rng.random_bool((first * step_s).min(1.0)) {
                        lost = second;
                    }
                    *value *= 1.0 - lost;
                    lost *= decay;
                }
            }
            Sort::SpeedFollowingMode => {
                let mut mode = Mode::at_rest(first * speed, second, step_s, rest);
                over_pairs(force, |from, to| (1.0 - third) * to + third * mode.step(from, to));
            }
            Sort::Stiction => {
                let limit = first * swing_n;
                let (mut slider, creep) = (0.0_f64, (-step_s / second).exp());
                over_pairs(force, |from, to| {
                    slider = (slider * creep + to - from).clamp(-limit, limit);
                    to - slider
                });
            }
            Sort::MissingBlocks => {
                let mut left = 0_usize;
                over_pairs_out(force, |before, to| {
                    if left > 0 {
                        left -= 1;
                        return before;
                    }
                    if rng.random_bool((first * step_s).min(1.0)) {
                        left = (rng.random_range(second..third) / step_s) as usize;
                    }
                    to
                });
            }
            Sort::Echo => {
                let behind = (first / step_s) as usize;
                let dry = force.to_vec();
                for (index, value) in force.iter_mut().enumerate() {
                    let old = index.checked_sub(behind).map_or(rest, |index| dry[index]);
                    *value += second * (old - rest);
                }
            }
            Sort::Governor => {
                let mut mode = Mode::at_rest(first * speed, second, step_s, rest);
                over_pairs(force, |from, to| mode.step(from, to));
            }
            Sort::BladeStall => {
                let (mut stalled, mut lost, decay) = (false, 0.0, (-step_s / 0.03).exp());
                for value in force {
                    let place = (*value - rest) / swing_n;
                    stalled = if stalled { place > second } else { place > first };
                    let goal = if stalled { third * swing_n } else { 0.0 };
                    lost = goal + (lost - goal) * decay;
                    *value -= lost;
                }
            }
            Sort::WanderingDelay => {
                let dry = force.to_vec();
                let phase: f64 = rng.random_range(0.0..TAU);
                for (index, value) in force.iter_mut().enumerate() {
                    let time_s = index as f64 * step_s;
                    let delay_s = first * 0.5 * (1.0 + (TAU * time_s / second + phase).sin());
                    let behind = (delay_s / step_s).round() as usize;
                    *value = index.checked_sub(behind).map_or(rest, |index| dry[index]);
                }
            }
            Sort::WrongWay => {
                let mut lag = super::lag::Lag::at_rest(first, step_s, rest);
                over_pairs(force, |from, to| 2.0 * lag.step(from, to) - to);
            }
        }
    }
}

fn over_pairs(signal: &mut [f64], mut step: impl FnMut(f64, f64) -> f64) {
    let Some(mut from) = signal.first().copied() else { return };
    for value in &mut signal[1..] {
        let to = *value;
        *value = step(from, to);
        from = to;
    }
}

/// As above, with what came out before instead of what came in.
fn over_pairs_out(signal: &mut [f64], mut step: impl FnMut(f64, f64) -> f64) {
    let Some(mut before) = signal.first().copied() else { return };
    for value in &mut signal[1..] {
        before = step(before, *value);
        *value = before;
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;

    #[test]
    fn tuning_and_report_share_no_sort() {
        assert!(Sort::TUNE.iter().all(|sort| !Sort::REPORT.contains(sort)));
    }

    #[test]
    fn every_sort_leaves_more_than_the_largest_noise_somewhere() {
        let point = Point { nominal: 0.55, gain_n: 10.0, time_constant_s: 0.1, rest_n: 2.5 };
        // 0.4 N up and down in a second, and 0.15 N six times in one.
        let wave = |time_s: f64| 0.4 * (TAU * time_s).sin() + 0.15 * (TAU * 6.0 * time_s).sin();
        let plain: Vec<f64> = (0..60_000).map(|index| 2.5 + wave(f64::from(index) * 5e-4)).collect();
        for sort in Sort::TUNE.into_iter().chain(Sort::REPORT) {
            let mut rng = ChaCha8Rng::seed_from_u64(3);
            for _ in 0..4 {
                let mut force = plain.clone();
                sort.draw(&mut rng).apply(&mut force, 5e-4, &point, 1.0, &mut rng);
                let off = force.iter().zip(&plain).fold(0.0_f64, |off, (a, b)| off.max((a - b).abs()));
                assert!(off > 0.05, "{}: {off}", sort.name());
            }
        }
    }
}
