//! The reference model and the rotor's curve, as the tick uses them.

use super::fixed_point::add_high_product;
use crate::throttle::FRACTION_BITS;

/// Bits after the binary point of `A`, `B` and `h`.
pub const COEFFICIENT_BITS: u32 = 30;
/// Bits after the binary point of the gain `g`.
pub const GAIN_BITS: u32 = 22;
/// Points of the table: `v = i / 32`, `i = 0..=32`.
pub const TABLE_POINTS: usize = 33;

/// Bits of `v` below the index of the table.
const FRACTION_SHIFT: u32 = FRACTION_BITS - (TABLE_POINTS as u32 - 1).ilog2();

/// From there to Q1.30.
const PART_SHIFT: u32 = 30 - FRACTION_SHIFT;

/// Coefficients of a [`ConditionedInverse`](super::ConditionedInverse): 272 bytes. They are apart from the state, so that
/// motors with one curve can share them.
///
/// Only a checked design ([`crate::design::InverseDesign`]) makes them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Coefficients {
    a: i32,
    /// `1 - B` in Q1.30, within [0, 1).
    one_less_b: i32,
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
    GainTooLow { index: usize },
    /// `g` is at least 512, and does not fit its format.
    GainTooHigh { index: usize },
    /// `g` differs from that of the next point by more than a factor of 1.25.
    StepTooLarge { index: usize },
}

impl Coefficients {
    /// Coefficients from `A` in (0, 1/2) and `B` in (0, 1], both Q1.30, and the gains `g` in steps of 2^-22.
    pub(crate) fn new(a: i32, b: i32, gains: [i64; TABLE_POINTS]) -> Result<Self, TableError> {
        debug_assert!(0 < a && a < 1 << (COEFFICIENT_BITS - 1) && 0 < b && b <= 1 << COEFFICIENT_BITS);
        let mut table = [Gain::default(); TABLE_POINTS];
        for (index, (point, &gain)) in table.iter_mut().zip(&gains).enumerate() {
            if gain <= 1 << (GAIN_BITS - 1) {
                return Err(TableError::GainTooLow { index });
            }
            let g = i32::try_from(gain).map_err(|_| TableError::GainTooHigh { index })?;
            let one = 1_i64 << (COEFFICIENT_BITS + GAIN_BITS);
            // At most 2^31 - 1: the least gain is a step above 1/2.
            *point = Gain { g, h: ((one + gain / 2) / gain) as i32 };
        }
        for (index, (&gain, &next)) in gains.iter().zip(gains.iter().skip(1)).enumerate() {
            if 4 * gain > 5 * next || 4 * next > 5 * gain {
                return Err(TableError::StepTooLarge { index });
            }
        }
        Ok(Self { a, one_less_b: (1 << COEFFICIENT_BITS) - b, table })
    }

    /// `A`, the gain of the reference model, about `omega_f T`. Q1.30, within (0, 1/2).
    #[must_use]
    pub const fn a(&self) -> i32 {
        self.a
    }

    /// `B`, the damping of the reference model, about `2 zeta omega_f T`. Q1.30, within (0, 1].
    #[must_use]
    pub const fn b(&self) -> i32 {
        (1 << COEFFICIENT_BITS) - self.one_less_b
    }

    /// `1 - B`. Q1.30, within [0, 1).
    #[inline]
    pub(super) const fn one_less_b(&self) -> i32 {
        self.one_less_b
    }

    /// The gains `g_i` of the inverse at `v = i / 32`, about `omega_f tau`. Q9.22, within (1/2, 512).
    #[must_use]
    pub fn gains(&self) -> [i32; TABLE_POINTS] {
        self.table.map(|point| point.g)
    }

    /// Where `v` lies in the table; `v` is in Q2.29, within 0..=2^29.
    #[inline]
    pub(super) fn at(&self, v: i32) -> Interval<'_> {
        // The last interval includes its upper end.
        let index = (v >> FRACTION_SHIFT).clamp(0, TABLE_POINTS as i32 - 2);
        let part = (v - (index << FRACTION_SHIFT)) << PART_SHIFT;
        Interval { ends: [&self.table[index as usize], &self.table[index as usize + 1]], part }
    }
}

/// A place between two points of the table.
pub(super) struct Interval<'a> {
    ends: [&'a Gain; 2],
    /// Of the way from the first to the second, Q1.30, 0..=2^30.
    part: i32,
}

impl Interval<'_> {
    /// `g(v)` in Q9.22.
    #[inline]
    pub fn g(&self) -> i32 {
        let [low, high] = self.ends;
        self.between(low.g, high.g)
    }

    /// `h(v)` in Q1.30.
    #[inline]
    pub fn h(&self) -> i32 {
        let [low, high] = self.ends;
        self.between(low.h, high.h)
    }

    /// Between two positive numbers within a factor of 1.25: four times their difference is under 2^31.
    #[inline]
    fn between(&self, low: i32, high: i32) -> i32 {
        add_high_product(low, (high - low) << 2, self.part)
    }
}

#[cfg(test)]
mod tests {
    use super::super::fixed_point::product;
    use super::*;

    const LOWEST: i64 = (1 << (GAIN_BITS - 1)) + 1;
    const HIGHEST: i64 = i32::MAX as i64;

    fn table(gains: [i64; TABLE_POINTS]) -> Result<Coefficients, TableError> {
        Coefficients::new(1 << 20, 1 << 21, gains)
    }

    #[test]
    fn a_table_is_refused_at_the_first_gain_out_of_range() {
        let with = |gain| core::array::from_fn(|i| if i == 7 { gain } else { 1 << GAIN_BITS });
        assert_eq!(table([LOWEST - 1; TABLE_POINTS]), Err(TableError::GainTooLow { index: 0 }));
        assert_eq!(table([HIGHEST + 1; TABLE_POINTS]), Err(TableError::GainTooHigh { index: 0 }));
        assert_eq!(table(with(i64::MAX)), Err(TableError::GainTooHigh { index: 7 }));
        assert_eq!(table(with(i64::MIN)), Err(TableError::GainTooLow { index: 7 }));
        assert_eq!(table(with((5 << GAIN_BITS) / 4 + 1)), Err(TableError::StepTooLarge { index: 6 }));
        assert!(table(with((5 << GAIN_BITS) / 4)).is_ok());
        assert!(table([LOWEST; TABLE_POINTS]).is_ok() && table([HIGHEST; TABLE_POINTS]).is_ok());
    }

    /// Their product is what keeps the conditioning within 64 bits.
    #[test]
    fn g_and_h_are_inverse_at_the_points_and_within_a_part_in_80_between() {
        for low in [LOWEST, 4 << GAIN_BITS, HIGHEST / 5 * 4] {
            let coefficients = table(core::array::from_fn(|i| low + low / 4 * (i as i64 % 2))).unwrap();
            for v in (0..=1 << FRACTION_BITS).step_by(1 << 16) {
                let place = coefficients.at(v);
                let product = product(place.g(), place.h()) as f64 / (1_u64 << (GAIN_BITS + COEFFICIENT_BITS)) as f64;
                assert!((0.999_999..1.0126).contains(&product), "{product} at {v}");
                if v % (1 << FRACTION_SHIFT) == 0 {
                    assert!(product < 1.000_001, "{product} at {v}");
                    assert_eq!(place.g(), coefficients.gains()[(v >> FRACTION_SHIFT) as usize]);
                }
            }
        }
    }
}
