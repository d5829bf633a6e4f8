//! Samples between those of a grid.
//!
//! Lines far below the loop rate need not be summed in every tick: a polynomial through the sums at twelve points of a
//! grid, six on either side, gives those between to as many digits. Which ticks are points of the grid, and so every
//! bit of a sample, follows from loop rate and lines alone. A point is summed anew from its turn, so that no error
//! outlives the points that it comes from: nothing grows, however long it plays.

use super::Lines;

/// Points that a sample is interpolated from: see [`POINTS_PER_TOP_PERIOD`].
pub(super) const POINTS: usize = 12;

/// Of them, how many are before a sample's own.
const BEFORE: usize = POINTS / 2 - 1;

/// The grid has at least so many points in a period of the highest line. Derived: the polynomial through twelve of
/// them misses a cosine by 8.2e-9, less than the cosine itself is off (1e-8), and a slower one by less.
const POINTS_PER_TOP_PERIOD: u32 = 13;

/// The most ticks from one point to the next, by their power of 2. Chosen: up to a `loop_rate_hz` of 10000 no more fit.
const MAX_SHIFT: u32 = 4;

/// Fraction bits of [`WEIGHTS`], of which one is 1.
const WEIGHT_FRACTION_BITS: u32 = 30;

/// Lagrange's weights of the points for a sample at each 16th of the way from its point to the next.
const WEIGHTS: [[i32; POINTS]; 1 << MAX_SHIFT] = {
    let mut weights = [[0; POINTS]; 1 << MAX_SHIFT];
    let mut i = 0;
    while i < weights.len() {
        let x = BEFORE as f64 + i as f64 / weights.len() as f64;
        let mut k = 0;
        while k < POINTS {
            let mut weight = 1.0;
            let mut m = 0;
            while m < POINTS {
                if m != k {
                    weight *= (x - m as f64) / (k as f64 - m as f64);
                }
                m += 1;
            }
            let half = if weight < 0.0 { -0.5 } else { 0.5 };
            weights[i][k] = (weight * (1_u32 << WEIGHT_FRACTION_BITS) as f64 + half) as i32;
            k += 1;
        }
        i += 1;
    }
    weights
};

/// The ticks of a period that are points of the grid: each so many, by their power of 2.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Grid {
    shift: u32,
    ticks_per_period: u32,
}

impl Grid {
    /// The coarsest one for these lines of which a period has a whole number.
    pub(super) const fn new(lines: &Lines<'_>, ticks_per_period: u32) -> Self {
        // At most 13 times 1023.
        let least = POINTS_PER_TOP_PERIOD * lines.top_harmonic();
        let mut shift = 0;
        while shift < MAX_SHIFT && ticks_per_period.trailing_zeros() > shift && ticks_per_period >> (shift + 1) >= least
        {
            shift += 1;
        }
        Self { shift, ticks_per_period }
    }

    /// Ticks in one period.
    pub(super) const fn ticks_per_period(self) -> u32 {
        self.ticks_per_period
    }

    /// Ticks from one point to the next.
    pub(super) const fn step(self) -> u32 {
        1 << self.shift
    }

    /// Whether it has this tick.
    pub(super) const fn has(self, tick: u32) -> bool {
        tick & (self.step() - 1) == 0
    }

    /// The point behind this one; the period's first behind its last.
    pub(super) const fn next(self, point: u32) -> u32 {
        let next = point.wrapping_add(self.step());
        if next < self.ticks_per_period { next } else { 0 }
    }

    /// The first point that a sample at the period's start is interpolated from.
    pub(super) const fn first(self) -> u32 {
        let mut point = 0;
        let mut i = 0;
        while i < BEFORE {
            point = (if point == 0 { self.ticks_per_period } else { point }).wrapping_sub(self.step());
            i += 1;
        }
        point
    }

    /// The sample at a tick, from the sums at the points around it. It has their fraction bits, rounded down, and is
    /// the sum itself where the tick is a point.
    #[inline(always)]
    pub(super) fn sample(self, tick: u32, sums: &[i32; POINTS]) -> i64 {
        let sixteenth = tick << (MAX_SHIFT - self.shift);
        let weights = &WEIGHTS[sixteenth as usize % WEIGHTS.len()];
        // The weights' magnitudes add up to 1.7 at most: 2^62 is not reached.
        let products = weights.iter().zip(sums).map(|(&weight, &sum)| crate::multiply::signed(weight, sum));
        products.fold(0_i64, i64::wrapping_add) >> WEIGHT_FRACTION_BITS
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    #[test]
    fn a_cosine_is_met_to_1e_8_at_every_frequency_that_a_grid_may_have() {
        let grid = Grid { shift: MAX_SHIFT, ticks_per_period: 1 << 20 };
        let scale = f64::from(1 << 27);
        let mut worst = 0.0_f64;
        for step in 0..=100 {
            let turn_per_point = f64::from(step) / 100.0 / f64::from(POINTS_PER_TOP_PERIOD);
            for phase in 0..50 {
                let cosine = |point: f64| (TAU * (turn_per_point * point + f64::from(phase) / 50.0)).cos();
                // Eight times 1, for more digits.
                let sums = core::array::from_fn(|k| (8.0 * scale * cosine(k as f64 - BEFORE as f64)).round() as i32);
                for tick in 0..16 {
                    let sample = (grid.sample(tick, &sums) as f64 + 0.5) / (8.0 * scale);
                    worst = worst.max((sample - cosine(f64::from(tick) / 16.0)).abs());
                }
            }
        }
        std::println!("a cosine is met to {worst:.1e}");
        // Above what is derived by the roundings of the points, of the weights, and of the sample.
        assert!(worst < 1e-8, "{worst:e}");
    }

    #[test]
    fn a_grid_divides_the_period_and_has_enough_points() {
        let phases = [0; 150];
        let lines = Lines::odd(10, &phases, 1.0).unwrap();
        for (ticks_per_period, step) in [(100_000, 16), (50_000, 8), (10_000, 2), (49_990, 2), (49_995, 1), (625, 1)] {
            let grid = Grid::new(&lines, ticks_per_period);
            assert_eq!(grid.step(), step, "{ticks_per_period}");
            let mut point = grid.first();
            (0..BEFORE).for_each(|_| point = grid.next(point));
            assert_eq!(point, 0);
            let points = 1 + std::iter::successors(Some(grid.next(0)), |point| Some(grid.next(*point)))
                .take_while(|point| *point != 0)
                .count();
            assert_eq!(points as u32 * step, ticks_per_period);
        }
    }
}
