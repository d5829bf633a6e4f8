//! The reference model and the rotor's curve, as the tick uses them.

use super::fixed_point::{product, shift_rounded};
use crate::throttle::FRACTION_BITS;

/// Bits after the binary point of `A`, `B` and `h`.
pub const COEFFICIENT_BITS: u32 = 30;
/// Bits after the binary point of the gain `g`.
pub const GAIN_BITS: u32 = 22;
/// Points of the table: `v = i / 32`, `i = 0..=32`.
pub const TABLE_POINTS: usize = 33;

/// Bits of `v` below the index of the table.
const FRACTION_SHIFT: u32 = FRACTION_BITS - (TABLE_POINTS as u32 - 1).ilog2();

/// Coefficients of a [`ConditionedInverse`](super::ConditionedInverse): 272 bytes. They are apart from the state, so that
/// motors with one curve can share them.
///
/// Only a checked design ([`crate::design::InverseDesign`]) makes them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Coefficients {
    a: i32,
    b: i32,
    table: [Gain; TABLE_POINTS],
}

/// One point of the table.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Gain {
    /// Q9.22, within (1/2, 512).
    g: i32,
    /// `1 / g` in Q1.30.
    h: i32,
}

/// Why gains make no table: the first point that is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum TableError {
    /// `g` is at most 1/2: `h` does not fit its format.
    TooLow { index: usize },
    /// `g` is at least 512, and does not fit its format.
    TooHigh { index: usize },
    /// `g` differs from that of the next point by more than a factor of 1.25.
    TooSteep { index: usize },
}

impl Coefficients {
    /// Coefficients from `A` in (0, 1/2) and `B` in (0, 1], both Q1.30, and the gains `g` in steps of 2^-22.
    pub(crate) fn new(a: i32, b: i32, gains: [i64; TABLE_POINTS]) -> Result<Self, TableError> {
        debug_assert!(0 < a && a < 1 << (COEFFICIENT_BITS - 1) && 0 < b && b <= 1 << COEFFICIENT_BITS);
        let mut table = [Gain::default(); TABLE_POINTS];
        for (index, (point, &gain)) in table.iter_mut().zip(&gains).enumerate() {
            if gain <= 1 << (GAIN_BITS - 1) {
                return Err(TableError::TooLow { index });
            }
            let g = i32::try_from(gain).map_err(|_| TableError::TooHigh { index })?;
            let one = 1_i64 << (COEFFICIENT_BITS + GAIN_BITS);
            // At most 2^31 - 1: the least gain is a step above 1/2.
            *point = Gain { g, h: ((one + gain / 2) / gain) as i32 };
        }
        for (index, (&gain, &next)) in gains.iter().zip(gains.iter().skip(1)).enumerate() {
            if 4 * gain > 5 * next || 4 * next > 5 * gain {
                return Err(TableError::TooSteep { index });
            }
        }
        Ok(Self { a, b, table })
    }

    /// `A`, the gain of the reference model, about `omega_f T`. Q1.30, within (0, 1/2).
    #[must_use]
    pub const fn a(&self) -> i32 {
        self.a
    }

    /// `B`, the damping of the reference model, about `2 zeta omega_f T`. Q1.30, within (0, 1].
    #[must_use]
    pub const fn b(&self) -> i32 {
        self.b
    }

    /// The gains `g_i` of the inverse at `v = i / 32`, about `omega_f tau`. Q9.22, within (1/2, 512).
    #[must_use]
    pub fn gains(&self) -> [i32; TABLE_POINTS] {
        self.table.map(|point| point.g)
    }

    /// Where `v` lies in the table; `v` is in Q2.29, within 0..=2^29.
    #[inline]
    pub(super) fn at(&self, v: i32) -> Interval {
        // The last interval includes its upper end.
        let index = (v >> FRACTION_SHIFT).clamp(0, TABLE_POINTS as i32 - 2);
        let fraction = v - (index << FRACTION_SHIFT);
        Interval { low: self.table[index as usize], high: self.table[index as usize + 1], fraction }
    }
}

/// A place between two points of the table.
pub(super) struct Interval {
    low: Gain,
    high: Gain,
    /// Of the way from `low` to `high`, 0..=2^24.
    fraction: i32,
}

impl Interval {
    /// `g(v)` in Q9.22.
    #[inline]
    pub fn g(&self) -> i32 {
        self.between(self.low.g, self.high.g)
    }

    /// `h(v)` in Q1.30.
    #[inline]
    pub fn h(&self) -> i32 {
        self.between(self.low.h, self.high.h)
    }

    /// Between two positive numbers, and so without overflow.
    #[inline]
    fn between(&self, low: i32, high: i32) -> i32 {
        low + shift_rounded::<FRACTION_SHIFT>(product(high - low, self.fraction)) as i32
    }
}
