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

/// The range of the output and its largest change per tick, in multiples of its step of 2^-16. Made by
/// [`InverseDesign::limits`](crate::design::InverseDesign::limits).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    min: Command,
    /// At least `min`.
    max: Command,
    /// In 2^-29, at least one step of the output. 2^29 where there is no limit.
    slew_per_tick: i32,
}

impl Limits {
    /// The slew, in steps of the output per tick, that limits nothing: the whole range.
    pub(crate) const UNLIMITED_STEPS: u32 = 1 << OUTPUT_BITS;

    /// The range [`min`, `max`], each rounded to the nearest step of the output, and a slew of `slew_steps` of these
    /// steps per tick. `None` where `min` is above `max` or `slew_steps` is 0.
    pub(crate) fn new(min: Command, max: Command, slew_steps: u32) -> Option<Self> {
        if min > max || slew_steps == 0 {
            return None;
        }
        let slew_per_tick = slew_steps.min(Self::UNLIMITED_STEPS) << STEP_SHIFT;
        let rounded = |command: Command| Command::saturating_from_bits(to_output_step(command.to_bits().into()) as i32);
        Some(Self { min: rounded(min), max: rounded(max), slew_per_tick: slew_per_tick as i32 })
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

    /// Largest change of the output per tick, in 2^-29; 2^29 where there is no limit.
    #[must_use]
    pub const fn slew_per_tick(&self) -> i32 {
        self.slew_per_tick
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
        let low = Command::saturating_from_bits(last.to_bits() - self.slew_per_tick);
        let high = Command::saturating_from_bits(last.to_bits() + self.slew_per_tick);
        Throttle::from_bits(bits).clamp_in_order(low.max(self.min), high.min(self.max))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_are_rounded_to_the_step_and_the_slew_is_in_steps() {
        let command = Command::saturating_from_bits;
        let limits = Limits::new(command((5 << STEP_SHIFT) + 4095), command((9 << STEP_SHIFT) + 4096), 3).unwrap();
        assert_eq!((limits.min().to_bits(), limits.max().to_bits()), (5 << STEP_SHIFT, 10 << STEP_SHIFT));
        assert_eq!(limits.slew_per_tick(), 3 << STEP_SHIFT);
        assert_eq!(Limits::new(Command::ZERO, Command::ONE, u32::MAX).unwrap().slew_per_tick(), Command::ONE.to_bits());
        assert_eq!(Limits::new(Command::ONE, Command::ZERO, 1), None);
        assert_eq!(Limits::new(Command::ZERO, Command::ONE, 0), None);
    }
}
