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
//! - The coefficients are the small differences that matter (2.7 % and 0.036 % for the paper's compensator at 5 kHz)
//!   and not numbers next to 2 and 1, so that Q0.32 holds them with 20 to 28 significant bits.
//!
//! The sum is formed exactly in 64 bits: its high word is the new `u` and its low word, which a plain section would
//! drop, is the next tick's start. This error feedback puts a zero at 0 Hz into the response to the rounding error,
//! which is `(1 - z^-1) / ((1 - z^-1)(1 - (1 + k) z^-1) + c z^-1)`.
//!
//! The incremental form `y[n] = 2 y[n-1] - y[n-2] + ...` has the same response to rounding and one state word more,
//! and its static gain is 1 only where the rounded coefficients happen to add up. Measured side by side with
//! `cargo xtask bench`, neither is faster by a margin that would pay for that.
//!
//! # The steady output is exact
//!
//! For a constant input, and coefficients with `0 < 4 c <= 3 |k|` and `-1/2 <= k < 0` (which [`Coefficients`]
//! guarantees), the output reaches the input exactly, from any state, after finitely many ticks, and stays: there is
//! neither a limit cycle nor a dead band. Let `w = y - x` in steps of 2^-29, `V` the accumulator (high and low word
//! together) minus one half, `r(V)` the integer nearest to `V`, which is `u`, and `q = |k|`. Then
//!
//! ```text
//! V' = V - q r(V) - c w        w' = w + r(V')
//! ```
//!
//! is a symplectic Euler step of a damped oscillator whose energy is `H = c w^2 / 2 + R(V)`, `R` the convex
//! integral of `r` from 0. With `p = r(V)`, `s = r(V')` and `n = |p - s|`, convexity gives
//!
//! ```text
//! H' - H <= c s^2 / 2 - q p s - n (n - 1) / 2
//! ```
//!
//! 1. If `p` is not 0, this is at most 0 for all integers `s` (cases by sign and size, with `c <= 3q/4` and
//!    `q <= 1/2`), and it is at most `-c/4` when `p = s`.
//! 2. An excursion leaves `r = 0`, and comes back to it, since by (1) the energy falls while the output moves. At both
//!    ends `R = 0`. If its first step is to `s = 1` or `-1`, the energy grows there by less than `c / 2`; a longer first
//!    step does not raise it (`c <= 1/2`). So `w^2` grows by less than 1 over an excursion, and being an integer it
//!    does not grow at all.
//! 3. `w^2` does not stay either. A single step takes `w` one closer to 0, because the sign of `c w` is what started
//!    it. A longer excursion that keeps moving loses energy by (1), and one that turns round without resting would
//!    need `q + c |w| > 1` with `w` on the far side already, which takes a step of the kind that loses.
//! 4. At rest (`r = 0`) with `w` not 0, `V` drifts by `c w` a tick and so starts the next excursion.
//!
//! Hence `w^2` falls to 0 in finitely many excursions, and `w = 0`, `r = 0` is a fixed point. Saturation of the output
//! only helps: it moves `y` towards the range that holds `x`. `host-tests` checks the claim on random designs from
//! random states.
//!
//! # No overflow
//!
//! Inputs are [`Command`]s, 0..=1, and a design is accepted only if the sum of its impulse response's magnitudes (the
//! L1 gain `g`) is under 7. So `y` stays in `[(1 - g)/2, (1 + g)/2]`, within (-3, 4), and `x - y` within (-4, 4): both
//! fit Q2.29. With `4 c <= 3 |k|` and `|g0|, |g1| <= 1/2`, `u` stays within `4 c / |k| + |g0| + |g1| <= 4`. The remaining
//! sums saturate (one instruction each on a Cortex-M4), should a state ever be outside all this.

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

    /// The last output.
    #[must_use]
    pub const fn output(&self) -> Throttle {
        Throttle::from_bits(self.y)
    }
}
