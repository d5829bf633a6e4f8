//! The section with limits of its output in its state.

use super::{Coefficients, HALF, Section};
use crate::inverse::SlewLimit;
use crate::multiply::signed;
use crate::throttle::Command;

/// Bits after the binary point of [`LimitedCoefficients::retained`].
const RETAINED_BITS: u32 = 31;

/// Coefficients of a [`LimitedSection`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LimitedCoefficients {
    section: Coefficients,
    /// Part of what a limit cuts off that stays in the output increment, Q0.31; see [`Self::retained`].
    retained: i32,
}

impl LimitedCoefficients {
    /// The coefficients of the section.
    #[must_use]
    pub const fn section(&self) -> &Coefficients {
        &self.section
    }

    /// Part of what a limit cuts off that stays in the output increment, `r = (|k| - d) / (1 - |k|)` in Q0.31, with
    /// `d = c / (2 (c + g0))`. Within (-1/2, 1).
    ///
    /// The zeros of a section that [`LeadDesign`](crate::design::LeadDesign) makes are at -1 and at `1 - d`: the pole of
    /// the rotor that the lead is for. `(1 + r) (1 + k) = 1 - d`, so what is cut off is forgotten as fast as that rotor
    /// follows its command.
    #[must_use]
    pub const fn retained(&self) -> i32 {
        self.retained
    }
}

impl From<Coefficients> for LimitedCoefficients {
    fn from(section: Coefficients) -> Self {
        let one = 1_i64 << super::COEFFICIENT_BITS;
        let (damping, c) = (-i64::from(section.k), i64::from(section.c));
        // A checked design has a positive g0. Any other does no harm: the rate is at most 1/2. Neither divisor is below 1, by
        // the limits of `Coefficients`, which the compiler does not see everywhere.
        let first_gain = (c + i64::from(section.g0.max(0))).max(1);
        let rate = ((c << RETAINED_BITS) + first_gain / 2) / first_gain;
        let retained = ((damping - rate) << RETAINED_BITS) / (one - damping).max(1);
        Self { section, retained: retained.min(i32::MAX.into()) as i32 }
    }
}

/// A [`Section`] whose output stays within a range and a slew limit, and which knows it: 32 bytes.
///
/// ```text
/// dy* = (1 + k) dy[n-1] + c (x[n] - y[n-1]) + g0 dx[n] + g1 dx[n-1]      as in a section
/// y*  = y[n-1] + dy*
/// y   = y* within [max(min, y[n-1] - s), min(max, y[n-1] + s)]
/// dy  = dy* + r (y* - y) where that limits, else dy*
/// ```
///
/// `s` is the largest change of the output per tick, and `r` is [`LimitedCoefficients::retained`]. `dy` is then more than the output
/// moved by: it holds what the output has yet to make up for, less what a rotor that got the limited output no longer needs. So
/// nothing winds up. A plain limiter behind a section loses what it cuts off, and the rotor is as slow as without a lead.
///
/// In the product the difference `y* - y` is one step of 2^-29 closer to 0, so that rounding cannot hold the output at a limit.
/// `docs/fixed-point.md` shows that the state is that of such a rotor, that the steady output is exact, and that nothing overflows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LimitedSection {
    /// Its output is within the range.
    section: Section,
    /// Lowest output, Q2.29.
    min: i32,
    /// From there to the highest output.
    span: i32,
    /// Largest change of the output per tick, Q2.29.
    slew: i32,
}

/// Marks the path that calls it as unlikely, as `core::hint::cold_path` of newer compilers does.
#[cold]
#[inline(always)]
const fn cold_path() {}

impl LimitedSection {
    /// A section at rest at `level`, whose outputs are within [`min`, `max`]. If `min` is above `max`, every output is `min`.
    #[must_use]
    pub const fn at_rest(min: Command, max: Command, slew: SlewLimit, level: Command) -> Self {
        let span = max.to_bits() - min.to_bits();
        let span = if span < 0 { 0 } else { span };
        let mut limited = Self { section: Section::at_level(level), min: min.to_bits(), span, slew: slew.per_tick() };
        limited.rest(level, level);
        limited
    }

    /// Puts it at rest at the input `input` with the output `output`, confined to the range: the next outputs go on from there.
    #[inline]
    pub const fn rest(&mut self, input: Command, output: Command) {
        let y = self.confined(output.to_bits());
        self.section = Section { y, dy: 0, remainder: HALF, x: input.to_bits(), dx: 0 };
    }

    /// One control tick: takes the input `x[n]`, returns the output `y[n]`.
    // The wrappers around it would each cost a call.
    #[inline(always)]
    pub fn update(&mut self, coefficients: &LimitedCoefficients, input: Command) -> Command {
        let Section { y: last, x: last_input, .. } = self.section;
        let x = input.to_bits();
        // Neither wraps, nor do the sums below: inputs and outputs are in 0..=2^29, and |dy*| < 3 (see the page).
        let dx = x.wrapping_sub(last_input);
        let sum = self.section.increment(&coefficients.section, x.wrapping_sub(last), dx);
        self.section.x = x;
        self.section.dx = dx;

        let wanted_change = (sum >> 32) as i32;
        let wanted = last.wrapping_add(wanted_change);
        let slew = self.slew.cast_unsigned();
        // Both comparisons of unsigned numbers, and the limited ticks apart: most are not.
        let is_free = wanted_change.wrapping_add(self.slew).cast_unsigned() <= slew << 1 && self.is_within(wanted);
        let (y, sum) = if is_free { (wanted, sum) } else { self.limited(coefficients.retained, wanted_change, sum) };
        self.section.y = y;
        self.section.dy = (sum >> 32) as i32;
        self.section.remainder = sum as u32;
        Command::from_bits_in_range(y)
    }

    /// The output of a tick that a limit changes, and the accumulator then.
    #[inline(always)]
    fn limited(&self, retained: i32, wanted_change: i32, sum: i64) -> (i32, i64) {
        cold_path();
        // All of it for a change upwards: one downwards is its mirror image.
        let above = self.section.y - self.min;
        let (sign, room) = if wanted_change < 0 { (-1, above) } else { (0, self.span - above) };
        let mirrored = |bits: i32| (bits ^ sign) - sign;
        let change = room.min(self.slew);
        // More than `change`, or nothing would limit.
        let cut_off = mirrored(wanted_change) - change;
        // Twice of it fits: it is less than 2 (see the page). The product, in steps of 2^-60, fits the accumulator then.
        let product = signed(retained, mirrored((cut_off - 1) << (super::COEFFICIENT_BITS - RETAINED_BITS)));
        (self.section.y + mirrored(change), sum.wrapping_add(product))
    }

    #[inline]
    const fn is_within(&self, bits: i32) -> bool {
        bits.wrapping_sub(self.min).cast_unsigned() <= self.span.cast_unsigned()
    }

    /// The nearest number of the range.
    #[inline]
    const fn confined(&self, bits: i32) -> i32 {
        if self.is_within(bits) {
            bits
        } else if bits < self.min {
            self.min
        } else {
            self.min + self.span
        }
    }

    /// The last output.
    #[must_use]
    pub const fn output(&self) -> Command {
        Command::from_bits_in_range(self.section.y)
    }
}
