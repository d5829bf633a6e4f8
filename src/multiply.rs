//! Products of 64 bits.
//!
//! A core without an instruction for them (Cortex-M0, with a product of 32 bits only) gets them from four products of halves, in
//! line. The compiler would call a multiplication of 64 by 64 bits, which takes several times as long.

/// `a * b`.
#[inline(always)]
pub(crate) const fn signed(a: i32, b: i32) -> i64 {
    if cfg!(narrow_multiplier) { signed_from_halves(a, b) } else { a as i64 * b as i64 }
}

/// As [`from_halves`], with high halves that have a sign: `2^15 * (2^16 - 1) + 2^16 - 1 < 2^31`.
#[inline(always)]
const fn signed_from_halves(a: i32, b: i32) -> i64 {
    const LOW: i32 = 0xffff;
    let (a_low, a_high, b_low, b_high) = (a & LOW, a >> 16, b & LOW, b >> 16);
    let low = a_low.cast_unsigned() * b_low.cast_unsigned();
    let first = a_high * b_low + (low >> 16).cast_signed();
    let second = a_low * b_high + (first & LOW);
    let high = a_high * b_high + (first >> 16) + (second >> 16);
    let low = second.cast_unsigned() << 16 | low & LOW.cast_unsigned();
    (high as i64) << 32 | low as i64
}

/// `a * b`.
#[inline(always)]
pub(crate) const fn unsigned(a: u32, b: u32) -> u64 {
    if cfg!(narrow_multiplier) { from_halves(a, b) } else { a as u64 * b as u64 }
}

/// `a * b` from products of 16 by 16 bits. No sum overflows: `(2^16 - 1)^2 + 2^16 - 1 < 2^32`.
#[inline(always)]
const fn from_halves(a: u32, b: u32) -> u64 {
    const LOW: u32 = 0xffff;
    let (a_low, a_high, b_low, b_high) = (a & LOW, a >> 16, b & LOW, b >> 16);
    let low = a_low * b_low;
    let first = a_low * b_high + (low >> 16);
    let second = a_high * b_low + (first & LOW);
    let high = a_high * b_high + (first >> 16) + (second >> 16);
    (high as u64) << 32 | (second << 16 | low & LOW) as u64
}

#[cfg(test)]
mod tests {
    use super::{from_halves, signed_from_halves};

    #[test]
    fn products_from_halves_are_the_products() {
        let mut random = 1_u64;
        let mut next = || {
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (random >> 32) as u32
        };
        let ends = [0, 1, 0xffff, 0x1_0000, 0x7fff_ffff, 0x8000_0000, 0xffff_0000, u32::MAX];
        let pairs = ends.into_iter().flat_map(|a| ends.map(|b| (a, b)));
        let random = (0..1_000_000).map(|_| (next(), next()));
        for (a, b) in pairs.chain(random) {
            assert_eq!(from_halves(a, b), u64::from(a) * u64::from(b), "{a:#x} * {b:#x}");
            let (a, b) = (a.cast_signed(), b.cast_signed());
            assert_eq!(signed_from_halves(a, b), i64::from(a) * i64::from(b), "{a:#x} * {b:#x}");
        }
    }
}
