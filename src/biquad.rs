//! The fixed-point second-order section.
//!
//! With the input `x`, the output `y` and their increments `dx[n] = x[n] - x[n-1]` and `dy[n] = y[n] - y[n-1]`, the
//! section computes once per control tick
//!
//! ```text
//! dy[n] = (1 + k) dy[n-1] + c (x[n] - y[n-1]) + g0 dx[n] + g1 dx[n-1]
//! y[n]  = y[n-1] + dy[n]
//!
//!             c + g0 (1 - z^-1) + g1 z^-1 (1 - z^-1)
//! H(z) = ------------------------------------------------
//!         (1 - z^-1) (1 - (1 + k) z^-1)  +  c z^-1
//! ```
//!
//! `x`, `y` and their increments are in Q2.29, coefficients in Q0.32. The sum is exact in 64 bits, and its low word
//! is added to the sum of the next tick (error feedback).
//!
//! - **The steady output is exact.** At a constant input the output reaches the input to the last bit after finitely
//!   many ticks, and stays: no limit cycle, no dead band. Condition: `0 < 4 c <= 3 |k|` and `-1/2 <= k < 0`, which
//!   [`Coefficients`] guarantees. The proof is by an energy, `c (y - x)^2 / 2` plus a function of the accumulator,
//!   that every excursion from rest reduces.
//! - **Nothing overflows.** Condition: also `|g0|, |g1| < 1/2`, inputs in [0, 1], which [`Command`] guarantees, and
//!   an L1 gain (sum of the magnitudes of the impulse response) below 7, which [`crate::design::LeadDesign`] checks.
//!   Then `y` is within (-3, 4), and `x - y` and `dy` within (-4, 4).
//!
//! A [`LimitedSection`] has a range and a slew limit of its output in its state.
//!
//! `docs/fixed-point.md` has the proofs, the reasons for this form, and its precision.

mod limited;

pub use limited::{LimitedCoefficients, LimitedSection};

use crate::multiply::signed;
use crate::throttle::{Command, Throttle};

/// Bits after the binary point of the coefficients.
pub const COEFFICIENT_BITS: u32 = 32;

/// Low word of the accumulator at rest: one half, so that the high word is the nearest integer.
const HALF: u32 = 1 << 31;

/// Coefficients of a [`Section`] in Q0.32, within [-1/2, 1/2).
///
/// Only a checked design ([`crate::design::LeadDesign`]) makes them, so every section meets the conditions of the
/// [module](self).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Coefficients {
    k: i32,
    c: i32,
    g0: i32,
    g1: i32,
}

impl Coefficients {
    /// Coefficients for which the steady output is exact, `k < 0` and `0 < 4 c <= 3 |k|`; `None` for any others. The
    /// remaining condition, `-1/2 <= k`, holds by the format.
    ///
    /// The L1 gain depends on all coefficients together: the design checks it.
    pub(crate) const fn new(k: i32, c: i32, g0: i32, g1: i32) -> Option<Self> {
        if k < 0 && c > 0 && 4 * (c as i64) <= -3 * (k as i64) { Some(Self { k, c, g0, g1 }) } else { None }
    }

    /// Damping of the output increment, `a2 - 1`; negative.
    #[must_use]
    pub const fn k(&self) -> i32 {
        self.k
    }

    /// Gain from `x[n] - y[n-1]` to the output increment, `1 + a1 + a2`; positive.
    #[must_use]
    pub const fn c(&self) -> i32 {
        self.c
    }

    /// Gain of the newest input increment `dx[n]`, `b0 - c`.
    #[must_use]
    pub const fn g0(&self) -> i32 {
        self.g0
    }

    /// Gain of the input increment before that, `dx[n-1]`, `-b2`.
    #[must_use]
    pub const fn g1(&self) -> i32 {
        self.g1
    }
}

/// The state of one section: 20 bytes. The coefficients are separate, so that several sections can share them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Section {
    /// Last output `y[n-1]`, Q2.29.
    y: i32,
    /// Last output increment `dy[n-1]`, Q2.29: high word of the accumulator.
    dy: i32,
    /// Low word of the accumulator, in 2^-61.
    remainder: u32,
    /// Last input `x[n-1]`, Q2.29.
    x: i32,
    /// Last input increment `dx[n-1]`, Q2.29.
    dx: i32,
}

impl Section {
    /// A section at rest at `level`: as long as the input is `level`, so is every output.
    #[must_use]
    pub const fn at_level(level: Command) -> Self {
        Self { y: level.to_bits(), dy: 0, remainder: HALF, x: level.to_bits(), dx: 0 }
    }

    /// One control tick: takes the input `x[n]`, returns the output `y[n]`.
    #[inline]
    pub fn update(&mut self, coefficients: &Coefficients, input: Command) -> Throttle {
        let x = input.to_bits();
        // Cannot wrap: both inputs are in 0..=2^29.
        let dx = x.wrapping_sub(self.x);
        let sum = self.increment(coefficients, x.saturating_sub(self.y), dx);
        self.dy = (sum >> 32) as i32;
        self.remainder = sum as u32;
        self.y = self.y.saturating_add(self.dy);
        self.x = x;
        self.dx = dx;
        Throttle::from_bits(self.y)
    }

    /// The accumulator of the next output increment, Q2.61.
    #[inline(always)]
    fn increment(&self, coefficients: &Coefficients, error: i32, dx: i32) -> i64 {
        // The terms that depend on the last output come last: they are on the critical path from tick to tick.
        // Partial sums may wrap. The complete sum fits: its high word is the next dy, and |dy| < 4 (see the module).
        (i64::from(self.dy) << 32 | i64::from(self.remainder))
            .wrapping_add(signed(coefficients.g1, self.dx).wrapping_add(signed(coefficients.g0, dx)))
            .wrapping_add(signed(coefficients.k, self.dy))
            .wrapping_add(signed(coefficients.c, error))
    }

    /// One control tick per input: writes the output of `inputs[i]` to `outputs[i]`. Equal to as many calls of
    /// [`Self::update`], in about half the instructions. If the slices differ in length, the excess of the longer one
    /// is ignored.
    // Always: compiled on its own, the function widens the coefficients to 64 bits before the loop, and the core's
    // multiply-accumulate of 32 bits is not used.
    #[inline(always)]
    pub fn update_block(&mut self, coefficients: &Coefficients, inputs: &[Command], outputs: &mut [Throttle]) {
        // Local copies stay in registers for the whole block.
        let (mut section, coefficients) = (*self, *coefficients);
        let length = inputs.len().min(outputs.len());
        let (fours, rest) = inputs.get(..length).unwrap_or_default().as_chunks::<4>();
        let (fours_out, rest_out) = outputs.get_mut(..length).unwrap_or_default().as_chunks_mut::<4>();
        for (inputs, outputs) in fours.iter().zip(fours_out) {
            for (input, output) in inputs.iter().zip(outputs) {
                *output = section.update(&coefficients, *input);
                // Keeps the compiler from loading later inputs early: no register is free for them.
                core::hint::black_box(());
            }
        }
        for (input, output) in rest.iter().zip(rest_out) {
            *output = section.update(&coefficients, *input);
        }
        *self = section;
    }

    /// The last output, unclamped.
    #[must_use]
    pub const fn output(&self) -> Throttle {
        Throttle::from_bits(self.y)
    }
}
