//! Products of words, rounded.

pub(super) use crate::multiply::signed as product;

/// Marks the path that calls it as unlikely, as `core::hint::cold_path` of newer compilers does.
#[cold]
#[inline(always)]
pub(super) const fn cold_path() {}

/// `value / 2^SHIFT`, to the nearest integer, halves upward. `value` is at least `2^(SHIFT - 1)` below the largest `i64`.
pub(super) const fn shift_rounded<const SHIFT: u32>(value: i64) -> i64 {
    (value + (1 << (SHIFT - 1))) >> SHIFT
}

/// `sum + a b / 2^32`, rounded to the nearest integer, halves upward; the caller knows that it fits. One instruction of a
/// Cortex-M4.
#[inline]
pub(super) const fn add_high_product(sum: i32, a: i32, b: i32) -> i32 {
    ((product(a, b) + ((sum as i64) << 32) + (1 << 31)) >> 32) as i32
}

/// `value / 2^30`, rounded down and saturated to an `i32`, but for the last two bits where it saturates.
#[inline]
pub(super) fn shifted_30_saturated(value: i64) -> i32 {
    const MOST: i32 = i32::MAX >> 2;
    let high = ((value >> 32) as i32).clamp(-MOST - 1, MOST);
    high << 2 | ((value as u32) >> 30).cast_signed()
}

/// A range of integers, `min` to `min + span`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Range {
    pub min: i32,
    /// At least 0.
    pub span: i32,
}

impl Range {
    /// One comparison of unsigned numbers.
    #[inline]
    pub const fn contains(self, value: i32) -> bool {
        value.wrapping_sub(self.min).cast_unsigned() <= self.span.cast_unsigned()
    }

    /// The end that is nearer to a number outside of the range.
    #[inline]
    pub const fn nearer_end(self, outside: i32) -> i32 {
        cold_path();
        if outside < self.min { self.min } else { self.min + self.span }
    }

    /// The nearest number of the range.
    #[inline]
    pub const fn confined(self, value: i32) -> i32 {
        if self.contains(value) { value } else { self.nearer_end(value) }
    }
}
