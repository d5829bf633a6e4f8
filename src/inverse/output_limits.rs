//! What the output can do: its range, its slew and its step.

use super::fixed_point::Range;
use crate::throttle::{Command, FRACTION_BITS};

/// Bits after the binary point of the output: its step is 2^-16.
pub const OUTPUT_BITS: u32 = 16;

/// Steps of a [`Command`] per step of the output, as a power of two.
pub(super) const STEP_SHIFT: u32 = FRACTION_BITS - OUTPUT_BITS;
/// Half a step of the output.
pub(super) const HALF_STEP: i32 = 1 << (STEP_SHIFT - 1);

/// So many steps of the output, which are a command.
#[inline]
pub(super) const fn command_from_steps(steps: i32) -> Command {
    Command::from_bits_in_range(steps << STEP_SHIFT)
}

/// The nearest number of steps of the output, halves upward.
#[inline]
pub(super) const fn nearest_steps(command: Command) -> i32 {
    // Cannot wrap: commands are at most 2^29.
    (command.to_bits() + HALF_STEP) >> STEP_SHIFT
}

/// Largest change of the output of a compensator per tick, a multiple of 2^-16, the step of an inverse's output. Made by
/// [`slew_limit`](crate::design::slew_limit).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SlewLimit {
    /// 1 to 2^16 steps of the output.
    steps: i32,
}

impl SlewLimit {
    /// The whole range in a tick: nothing is limited.
    pub const NONE: Self = Self { steps: 1 << OUTPUT_BITS };

    /// So many steps of the output per tick; `None` for 0.
    pub(crate) fn from_steps(steps: u32) -> Option<Self> {
        let steps = steps.min(1 << OUTPUT_BITS);
        (steps > 0).then_some(Self { steps: steps.cast_signed() })
    }

    /// What [`Self::per_tick`] gave; `None` for what it never gives.
    #[cfg(feature = "controller")]
    pub(crate) const fn from_per_tick(per_tick: i32) -> Option<Self> {
        let steps = per_tick >> STEP_SHIFT;
        if steps > 0 && steps <= 1 << OUTPUT_BITS { Some(Self { steps }) } else { None }
    }

    /// The change per tick in 2^-29; 2^29 where there is no limit.
    #[must_use]
    pub const fn per_tick(self) -> i32 {
        self.steps << STEP_SHIFT
    }

    /// The same in steps of the output.
    #[inline]
    pub(super) const fn steps(self) -> i32 {
        self.steps
    }
}

/// The range of the output, in multiples of its step of 2^-16, and its slew.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// In steps of the output, within 0..=2^16.
    range: Range,
    slew: SlewLimit,
}

impl Limits {
    /// The steps of the output from `min` to `max`. Where there is none, as where `min` is above `max`, the one nearest to
    /// `min` alone.
    #[must_use]
    pub const fn new(min: Command, max: Command, slew: SlewLimit) -> Self {
        // Cannot wrap: commands are at most 2^29.
        let low = (min.to_bits() + 2 * HALF_STEP - 1) >> STEP_SHIFT;
        let high = max.to_bits() >> STEP_SHIFT;
        let range =
            if low <= high { Range { min: low, span: high - low } } else { Range { min: nearest_steps(min), span: 0 } };
        Self { range, slew }
    }

    /// The lowest output.
    #[must_use]
    pub const fn min(&self) -> Command {
        command_from_steps(self.range.min)
    }

    /// The highest output.
    #[must_use]
    pub const fn max(&self) -> Command {
        command_from_steps(self.range.min + self.range.span)
    }

    /// The largest change of the output per tick.
    #[must_use]
    pub const fn slew(&self) -> SlewLimit {
        self.slew
    }

    /// The range in steps of the output.
    #[inline]
    pub(super) const fn steps(&self) -> Range {
        self.range
    }

    /// The range in LSB of a command.
    #[inline]
    pub(super) const fn bits(&self) -> Range {
        Range { min: self.range.min << STEP_SHIFT, span: self.range.span << STEP_SHIFT }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_are_rounded_inward_and_the_slew_is_in_steps() {
        let command = Command::saturating_from_bits;
        let slew = SlewLimit::from_steps(3).unwrap();
        let ends = |low, high| {
            let limits = Limits::new(command(low), command(high), slew);
            (limits.min().to_bits(), limits.max().to_bits())
        };
        const STEP: i32 = 1 << STEP_SHIFT;
        assert_eq!(ends(5 * STEP + 1, 9 * STEP + STEP - 1), (6 * STEP, 9 * STEP));
        assert_eq!(ends(0, Command::ONE.to_bits()), (0, Command::ONE.to_bits()));
        // Nothing between them, and the wrong way round.
        assert_eq!(ends(5 * STEP + 1, 5 * STEP + 2), (5 * STEP, 5 * STEP));
        assert_eq!(ends(Command::ONE.to_bits() - 1, Command::ONE.to_bits() - 1), [Command::ONE.to_bits(); 2].into());
        assert_eq!(ends(9 * STEP, 5 * STEP), (9 * STEP, 9 * STEP));
        assert_eq!(slew.per_tick(), 3 * STEP);
        assert_eq!(SlewLimit::from_steps(u32::MAX), Some(SlewLimit::NONE));
        assert_eq!(SlewLimit::from_steps(0), None);
    }
}
