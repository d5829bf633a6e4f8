//! The fixed-point second-order section.
//!
//! # Form
//!
//! With `x` the input, `y` the output and `u` the step of the output, the section computes once per tick
//!
//! ```text
//! u[n] = u[n-1] + k u[n-1] + c (x[n] - y[n-1]) + g0 (x[n] - x[n-1]) + g1 (x[n-1] - x[n-2])
//! y[n] = y[n-1] + u[n]
//!
//!             c + g0 (1 - z^-1) + g1 z^-1 (1 - z^-1)
//! H(z) = ------------------------------------------------
//!         (1 - z^-1) (1 - (1 + k) z^-1)  +  c z^-1
//! ```
//!
//! Any section with unit static gain can be written so: with the usual normalized coefficients, `k = a2 - 1`,
//! `c = 1 + a1 + a2`, `g0 = b0 - c` and `g1 = -b2`. Two properties make it the form for slow filters at high rates:
//!
//! - The static gain is 1 for *any* rounding of the coefficients, since `c` multiplies `x - y` as a whole.
//! - The coefficients are the small differences that matter (2.6 % and 0.035 % for the paper's compensator at 5 kHz)
//!   and not numbers next to 2 and 1, so that Q0.32 holds them with 20 to 28 significant bits.
//!
//! The sum is formed exactly in 64 bits: its high word is the new `u` and its low word, which a plain section would
//! drop, is the next tick's start. This error feedback puts a zero at 0 Hz into the response to the rounding error,
//! which is `(1 - z^-1) / ((1 - z^-1)(1 - (1 + k) z^-1) + c z^-1)`.
//!
//! On the paper's multisine the output is within -150 dB RMS of what the same coefficients give in `f64`. Rounding the
//! coefficients is the larger error: with it the output is -136 dB from the unrounded design. `host-tests` measures both.
//!
//! The incremental form `y[n] = 2 y[n-1] - y[n-2] + ...` has the same response to rounding and as much state. It needs
//! a fifth coefficient, and its static gain is 1 only where the rounded coefficients happen to add up. `cargo xtask
//! bench` runs both, where on an x86-64 host it takes somewhat less time: saturation costs several instructions there, and
//! one on a Cortex-M4. `cargo xtask bench --firmware` counts this form's instructions there, and `cargo xtask test` holds
//! them: at most 22 a call, and 13.1 a sample in a block of 32.
//!
//! # The steady output is exact
//!
//! For a constant input, and coefficients with `0 < 4 c <= 3 |k|` and `-1/2 <= k < 0` (which [`Coefficients`]
//! guarantees), the output reaches the input exactly, from any state that inputs can bring about, after finitely many
//! ticks, and stays: there is neither a limit cycle nor a dead band. Let `w = y - x` in steps of 2^-29, `V` the
//! accumulator (high and low word together) minus one half, `r(V)` the integer nearest to `V`, which is `u`, and
//! `q = |k|`. Once the steps of the input have passed,
//!
//! ```text
//! V' = V - q r(V) - c w        w' = w + r(V')
//! ```
//!
//! is a symplectic Euler step of a damped oscillator whose energy is `H = c w^2 / 2 + R(V)`, `R` the convex
//! integral of `r` from 0. With `p = r(V)`, `s = r(V')` and `n = |p - s|`, convexity gives
//!
//! ```text
//! H' - H <= B(p, s) = c s^2 / 2 - q p s - n (n - 1) / 2
//! ```
//!
//! 1. While the output moves, energy is lost: `B <= -2 c / 3` for all integers `p` and `s` that are not 0. `B` does not
//!    change when both change sign, so take `p > 0`. For `0 < s <= p + 1`, `q >= 4 c / 3` leaves at most
//!    `c s (1/2 - 5 p / 6)`, which is largest at `p = 1`, `s = 2`. For `s >= p + 2` the same and `c <= 3/8` leave less
//!    than -1/2. For `s < 0`, `c <= 3/8` and `q <= 1/2` leave at most `-5 s^2 / 16`. And `2 c / 3` is at most 1/4.
//! 2. Coming to rest costs nothing: `B(p, 0) <= 0`. So from any state `r(V) = 0` is reached in finitely many ticks.
//! 3. At rest (`r = 0`, `R = 0`) with `w` not 0, `V` drifts by `-c w` a tick and so starts an excursion, whose first
//!    step `s` has the sign of `-w`. Its energy grows there by `B(0, s)`: at most `c / 2` for `s = 1` or `-1`, and less
//!    than 0 for longer steps.
//! 4. By (1) and (2) the excursion ends at rest, where `R = 0` again, and `w^2` is less than it was: if the output took
//!    one step of 1, because `w` is one closer to 0; if it took one longer step, by (3); if it took several, because
//!    `c / 2 - 2 c / 3 < 0`.
//!
//! Hence the integer `w^2` falls to 0 in finitely many excursions, and `w = 0`, `r = 0` is a fixed point. `host-tests`
//! checks the inequalities on integers, and the claim on random designs from random states.
//!
//! # No overflow
//!
//! Inputs are [`Command`]s, 0..=1, and a design is accepted only if the sum of its impulse response's magnitudes (the
//! L1 gain `g`) is under 7. So `y` stays in `[(1 - g)/2, (1 + g)/2]`, within (-3, 4), and `x - y` within (-4, 4): both
//! fit Q2.29. The steps of the input, weighted by the powers of `1 + k`, sum to within [-1, 1], because the input itself
//! stays in [0, 1]. So with `4 c <= 3 |k|` and `|g0|, |g1| < 1/2`, `u` stays within `4 c / |k| + |g0| + |g1| < 4`. The
//! remaining sums saturate (one instruction each on a Cortex-M4), should a state ever be outside all this.

use crate::throttle::{Command, Throttle};

/// Bits after the binary point of the coefficients.
pub const COEFFICIENT_BITS: u32 = 32;

/// Low word of an accumulator at rest: one half, so that the high word is the nearest integer.
const HALF: u32 = 1 << 31;

/// Coefficients of a [`Section`] in Q0.32. They come from a checked design ([`crate::design::LeadDesign`]); there is
/// no other way to make them, and so no section with coefficients that its arithmetic cannot hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Coefficients {
    k: i32,
    c: i32,
    g0: i32,
    g1: i32,
}

impl Coefficients {
    /// Coefficients that satisfy the conditions of the module's proofs; `None` for any others.
    ///
    /// The headroom is a property of the response and not of single coefficients: the design checks it.
    pub(crate) const fn new(k: i32, c: i32, g0: i32, g1: i32) -> Option<Self> {
        if k < 0 && c > 0 && 4 * (c as i64) <= -3 * (k as i64) { Some(Self { k, c, g0, g1 }) } else { None }
    }

    /// Damping of the output's step, `a2 - 1`; negative.
    #[must_use]
    pub const fn k(&self) -> i32 {
        self.k
    }

    /// Pull of the input on the output, `1 + a1 + a2`.
    #[must_use]
    pub const fn c(&self) -> i32 {
        self.c
    }

    /// Weight of the input's newest step, `b0 - c`.
    #[must_use]
    pub const fn g0(&self) -> i32 {
        self.g0
    }

    /// Weight of the input's step before that, `-b2`.
    #[must_use]
    pub const fn g1(&self) -> i32 {
        self.g1
    }
}

/// The state of one section: 20 bytes, apart from the coefficients, which several motors share.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Section {
    /// Last output.
    y: i32,
    /// Last step of the output.
    u: i32,
    /// Low word of the last sum.
    remainder: u32,
    /// Last input.
    x: i32,
    /// Last step of the input.
    dx: i32,
}

impl Section {
    /// At rest at `level`: a constant input of that level gives that level from the first tick on.
    #[must_use]
    pub const fn at_level(level: Command) -> Self {
        Self { y: level.to_bits(), u: 0, remainder: HALF, x: level.to_bits(), dx: 0 }
    }

    /// One tick: takes the input `x[n]`, gives the output `y[n]`.
    #[inline]
    pub fn update(&mut self, coefficients: &Coefficients, input: Command) -> Throttle {
        let x = input.to_bits();
        // Both inputs are in 0..=2^29.
        let dx = x.wrapping_sub(self.x);
        let error = x.saturating_sub(self.y);
        let product = |a: i32, b: i32| i64::from(a) * i64::from(b);
        // What depends on the last output comes last: it is on the critical path from tick to tick.
        // Magnitudes (see the module): the preload is under 2^63, and the sum is the next u, for which the same holds.
        let sum = (i64::from(self.u) << 32 | i64::from(self.remainder))
            .wrapping_add(product(coefficients.g1, self.dx).wrapping_add(product(coefficients.g0, dx)))
            .wrapping_add(product(coefficients.k, self.u))
            .wrapping_add(product(coefficients.c, error));
        self.u = (sum >> 32) as i32;
        self.remainder = sum as u32;
        self.y = self.y.saturating_add(self.u);
        self.x = x;
        self.dx = dx;
        Throttle::from_bits(self.y)
    }

    /// One tick for each input, with their outputs: the same as so many [`Self::update`]s, in about half the instructions.
    /// Ends with the shorter one of the two slices.
    // Always: compiled by itself, it has its coefficients widened once for all, and loses the core's multiply-accumulate.
    #[inline(always)]
    pub fn update_block(&mut self, coefficients: &Coefficients, inputs: &[Command], outputs: &mut [Throttle]) {
        // In registers for the whole block.
        let (mut section, coefficients) = (*self, *coefficients);
        let length = inputs.len().min(outputs.len());
        let (fours, rest) = inputs.get(..length).unwrap_or_default().as_chunks::<4>();
        let (fours_out, rest_out) = outputs.get_mut(..length).unwrap_or_default().as_chunks_mut::<4>();
        for (inputs, outputs) in fours.iter().zip(fours_out) {
            for (input, output) in inputs.iter().zip(outputs) {
                *output = section.update(&coefficients, *input);
                // Nothing is loaded ahead of its tick: the registers are taken.
                core::hint::black_box(());
            }
        }
        for (input, output) in rest.iter().zip(rest_out) {
            *output = section.update(&coefficients, *input);
        }
        *self = section;
    }

    /// The last output.
    #[must_use]
    pub const fn output(&self) -> Throttle {
        Throttle::from_bits(self.y)
    }
}
