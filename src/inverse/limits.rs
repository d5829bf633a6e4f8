//! What the output can do: its range, its slew and its step.

use super::fixed_point::shift_rounded;
use crate::throttle::{Command, FRACTION_BITS, Throttle};

/// Bits after the binary point of the output: its step is 2^-16.
pub const OUTPUT_BITS: u32 = 16;

/// Steps of a [`Command`] per step of the output, as a power of two.
const STEP_SHIFT: u32 = FRACTION_BITS - OUTPUT_BITS;

/// The nearest multiple of the output's step, halves upward. `value` is in 2^-29, of a magnitude under 2^62.
pub(super) const fn to_output_step(value: i64) -> i64 {
    shift_rounded::<STEP_SHIFT>(value) << STEP_SHIFT
}

/// Largest change of the output per tick, a multiple of its step of 2^-16. Made by
/// [`InverseDesign::slew_limit`](crate::design::InverseDesign::slew_limit).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SlewLimit {
    /// In 2^-29, at least one step of the output.
    per_tick: i32,
}

impl SlewLimit {
    /// The whole range in a tick: nothing is limited.
    pub const NONE: Self = Self { per_tick: Command::ONE.to_bits() };

    /// So many steps of the output per tick; `None` for 0.
    pub(crate) fn from_steps(steps: u32) -> Option<Self> {
        let steps = steps.min(1 << OUTPUT_BITS);
        (steps > 0).then_some(Self { per_tick: (steps << STEP_SHIFT) as i32 })
    }

    /// The change per tick in 2^-29; 2^29 where there is no limit.
    #[must_use]
    pub const fn per_tick(self) -> i32 {
        self.per_tick
    }
}

/// The range of the output, in multiples of its step of 2^-16, and its slew.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    min: Command,
    /// At least `min`.
    max: Command,
    slew: SlewLimit,
}

impl Limits {
    /// The steps of the output from `min` to `max`. Where there is none, as where `min` is above `max`, the one nearest to
    /// `min` alone.
    #[must_use]
    pub const fn new(min: Command, max: Command, slew: SlewLimit) -> Self {
        const STEP: i32 = 1 << STEP_SHIFT;
        // Cannot wrap: commands are at most 2^29.
        let (low, high) = ((min.to_bits() + STEP - 1) & -STEP, max.to_bits() & -STEP);
        let nearest = to_output_step(min.to_bits() as i64) as i32;
        let (low, high) = if low <= high { (low, high) } else { (nearest, nearest) };
        Self { min: Command::saturating_from_bits(low), max: Command::saturating_from_bits(high), slew }
    }

    /// The lowest output.
    #[must_use]
    pub const fn min(&self) -> Command {
        self.min
    }

    /// The highest output.
    #[must_use]
    pub const fn max(&self) -> Command {
        self.max
    }

    /// The largest change of the output per tick.
    #[must_use]
    pub const fn slew(&self) -> SlewLimit {
        self.slew
    }

    /// The nearest command in the range.
    #[inline]
    pub(super) const fn confined(&self, bits: i32) -> Command {
        Throttle::from_bits(bits).clamp_in_order(self.min, self.max)
    }

    /// The nearest output: a multiple of the step, in the range.
    #[inline]
    pub(super) const fn nearest_output(&self, command: Command) -> Command {
        self.confined(to_output_step(command.to_bits() as i64) as i32)
    }

    /// The nearest output in the range and within the slew of `last`, which is an output.
    #[inline]
    pub(super) fn reachable(&self, bits: i32, last: Command) -> Command {
        // Cannot wrap: both terms are in 0..=2^29.
        let low = Command::saturating_from_bits(last.to_bits() - self.slew.per_tick);
        let high = Command::saturating_from_bits(last.to_bits() + self.slew.per_tick);
        Throttle::from_bits(bits).clamp_in_order(low.max(self.min), high.min(self.max))
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
