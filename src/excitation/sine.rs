//! The cosine of a 32-bit turn, as a polynomial in integers.
//!
//! A table would be as short to write, but its reads are random: on an STM32F405 each one that
//! misses the flash accelerator's few data lines waits for the flash. The polynomial reads nothing.
//!
//! A quarter wave is expanded in Chebyshev polynomials (Jacobi-Anger; Abramowitz & Stegun 9.1.45),
//!
//! `sin(h x) = 2 sum_k (-1)^k J_{2k+1}(h) T_{2k+1}(x)`, `h = pi/2`, `|x| <= 1`,
//!
//! cut after `T_9` and sorted by powers of x: `x (c_0 - c_1 x^2 + c_2 x^4 - ...)` with all `c`
//! positive. What is cut off is 2 J_11(h) = 3.5e-9, about what the fixed point rounds.

/// Coefficients of the polynomial in x^2: those of x, x^3, ..., x^9.
const COEFFICIENTS: usize = 5;

/// Fraction bits of the polynomial in x^2, and so of its first coefficient, pi/2. With the 31 of `x`
/// a cosine has 59, which leaves room for a sum up to 16.
const FRACTION_BITS: u32 = 28;

/// Each step of Horner's scheme multiplies by x^2, which has 30 fraction bits, and keeps the high
/// word: a coefficient needs two fraction bits more than the one before it.
const FRACTION_BITS_PER_STEP: u32 = 2;

/// Fraction bits of what [`QuarterWave::cosine`] returns.
pub(super) const COSINE_FRACTION_BITS: u32 = FRACTION_BITS + 31;

/// Bessel function of the first kind `J_order(argument)`, by its power series.
const fn bessel_j(order: u32, argument: f64) -> f64 {
    let half = argument / 2.0;
    // (half^order) / order!
    let mut term = 1.0;
    let mut i = 1;
    while i <= order {
        term *= half / i as f64;
        i += 1;
    }
    // At half < 1 the terms fall faster than 1/j!^2: twelve are far below the rounding of f64.
    let mut sum = 0.0;
    let mut j = 0;
    while j < 12 {
        sum += term;
        j += 1;
        term *= -half * half / (j as f64 * (j + order) as f64);
    }
    sum
}

/// The coefficients of x, x^3, ... of the truncated Chebyshev series of sin(pi/2 x).
const fn quarter_wave() -> [f64; COEFFICIENTS] {
    const DEGREE: usize = 2 * COEFFICIENTS;
    // Chebyshev polynomials by powers of x: T_{n+1} = 2 x T_n - T_{n-1}.
    let mut previous = [0.0; DEGREE];
    previous[0] = 1.0;
    let mut current = [0.0; DEGREE];
    current[1] = 1.0;
    let mut sum = [0.0; COEFFICIENTS];
    let mut sign = 1.0;
    let mut n = 1;
    while n < DEGREE {
        if n % 2 == 1 {
            let weight = sign * 2.0 * bessel_j(n as u32, core::f64::consts::FRAC_PI_2);
            let mut k = 0;
            while k < COEFFICIENTS {
                sum[k] += weight * current[2 * k + 1];
                k += 1;
            }
            sign = -sign;
        }
        let mut next = [0.0; DEGREE];
        let mut i = 0;
        while i < DEGREE {
            let shifted = if i == 0 { 0.0 } else { current[i - 1] };
            next[i] = 2.0 * shifted - previous[i];
            i += 1;
        }
        previous = current;
        current = next;
        n += 1;
    }
    sum
}

/// The magnitudes of [`quarter_wave`] in fixed point.
const COEFFICIENT_BITS: [i32; COEFFICIENTS] = {
    let exact = quarter_wave();
    let mut bits = [0; COEFFICIENTS];
    let mut k = 0;
    while k < COEFFICIENTS {
        let scale = (1_u64 << (FRACTION_BITS + FRACTION_BITS_PER_STEP * k as u32)) as f64;
        let scaled = (if k % 2 == 0 { exact[k] } else { -exact[k] }) * scale;
        // Half a unit rounds to nearest. The product that is added to each but the last is rounded
        // down, by half a unit on average: another half makes up for it.
        let half_units = if k + 1 < COEFFICIENTS { 2.0 } else { 1.0 };
        assert!(0.0 < scaled && scaled < (1_u32 << 30) as f64, "no room for the sums of Horner");
        bits[k] = (scaled + half_units / 2.0) as i32;
        k += 1;
    }
    bits
};

/// `sum + a b / 2^32`, rounded down: one instruction (SMMLA) on a Cortex-M4.
#[inline(always)]
const fn multiply_accumulate_high(sum: i32, a: i32, b: i32) -> i32 {
    sum.wrapping_add((crate::multiply::signed(a, b) >> 32) as i32)
}

/// What [`Self::cosine`] needs to know of a quarter wave.
#[derive(Clone, Copy)]
pub(super) struct QuarterWave {
    /// One unit below 1, Q31.
    one: i32,
    coefficients: [i32; COEFFICIENTS],
}

impl QuarterWave {
    /// To be taken once per sum. The compiler is kept from seeing the numbers: knowing their signs,
    /// it turns the signed multiplications, of one instruction each, into unsigned ones of three.
    /// The result is the same either way.
    #[inline(always)]
    pub(super) fn new() -> Self {
        core::hint::black_box(Self { one: i32::MAX, coefficients: COEFFICIENT_BITS })
    }

    /// `cos(2 pi (turn + 1/2) / 2^32)` with [`COSINE_FRACTION_BITS`] fraction bits, off by less than
    /// 1e-8.
    ///
    /// The half unit makes folding exact: `turn` and `!turn` are mirror images.
    #[inline(always)]
    pub(super) fn cosine(&self, turn: u32) -> i64 {
        let signed = turn as i32;
        // The distance from turn zero is 2 folded + 1 in halves of 2^-32 turn, whatever the sign.
        let folded = signed ^ (signed >> 31);
        // cos(d) = sin(pi/2 - d): x = 1 - (2 folded + 1) / 2^31, Q31, from -1 to 1, both excluded.
        let x = self.one.wrapping_sub(folded.wrapping_mul(2));
        // -x^2, Q30, off by no more than its last bit; negative, so that all terms are added.
        let minus_square = multiply_accumulate_high(0, x, !x);
        let [c0, c1, c2, c3, c4] = self.coefficients;
        let mut p = multiply_accumulate_high(c3, minus_square, c4);
        p = multiply_accumulate_high(c2, minus_square, p);
        p = multiply_accumulate_high(c1, minus_square, p);
        p = multiply_accumulate_high(c0, minus_square, p);
        crate::multiply::signed(x, p)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    fn error(turn: u32) -> f64 {
        let scale = (1_u64 << COSINE_FRACTION_BITS) as f64;
        let angle = 2.0 * PI * (f64::from(turn) + 0.5) / 4_294_967_296.0;
        QuarterWave::new().cosine(turn) as f64 / scale - angle.cos()
    }

    #[test]
    fn the_cosine_is_within_1e_8_everywhere() {
        // A step that is odd and prime visits every part of the turn and every low bit.
        let turns = (0..2_000_003_u32).map(|i| i.wrapping_mul(2_147_483_629));
        let corners = (0..32).flat_map(|bit| {
            let corner = 1_u32 << bit;
            [corner.wrapping_sub(1), corner, !corner, corner.wrapping_neg()]
        });
        let (mut worst, mut squares, mut count) = (0.0_f64, 0.0, 0.0);
        for turn in turns.chain(corners) {
            let error = error(turn);
            worst = worst.max(error.abs());
            squares += error * error;
            count += 1.0;
        }
        let rms = f64::sqrt(squares / count);
        std::println!("cosine: worst {worst:.2e}, rms {rms:.2e}");
        assert!(worst < 1e-8, "worst {worst:e}");
        assert!(rms < 3e-9, "rms {rms:e}");
    }

    #[test]
    fn mirror_images_are_equal_and_half_a_turn_negates() {
        let wave = QuarterWave::new();
        for i in 0..100_000_u32 {
            let turn = i.wrapping_mul(2_654_435_761);
            let value = wave.cosine(turn);
            assert_eq!(value, wave.cosine(!turn));
            // The last bit of the polynomial, times at most 1 in Q31.
            let sum = value + wave.cosine(turn.wrapping_add(1 << 31));
            assert!(sum.abs() < 1 << 31, "{turn}: {sum}");
        }
    }
}
