//! Rounding and narrowing.

/// The 64-bit product of two words.
pub(super) const fn product(a: i32, b: i32) -> i64 {
    a as i64 * b as i64
}

/// `value / 2^SHIFT`, to the nearest integer, halves upward. `value` is at least `2^(SHIFT - 1)` below the largest `i64`.
pub(super) const fn shift_rounded<const SHIFT: u32>(value: i64) -> i64 {
    (value + (1 << (SHIFT - 1))) >> SHIFT
}

/// The nearest `i32`.
pub(super) const fn saturated(value: i64) -> i32 {
    if value < i32::MIN as i64 {
        i32::MIN
    } else if value > i32::MAX as i64 {
        i32::MAX
    } else {
        value as i32
    }
}
