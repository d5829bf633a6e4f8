//! The normalized command, and its conversion to and from pulse widths.
//!
//! All types count in steps of 2^-29 (Q2.29): 0 is the bottom of the pulse range and 1 its top. A tick of an 84 MHz
//! timer in a 600 Hz frame is 3800 of these steps, so a pulse survives the round trip to the tick.

use crate::multiply::unsigned;

/// Bits after the binary point of [`Command`] and [`Throttle`].
pub const FRACTION_BITS: u32 = 29;

/// 1.0 in Q2.29.
const ONE_BITS: i32 = 1 << FRACTION_BITS;

/// Half of what the high word of a product counts in, to round it.
const HALF: u64 = 1 << 31;

/// A filtered command. It may leave the range of the pulse on either side: a lead compensator answers a step of its
/// input with several times that step. Range [-4, 4) in steps of 2^-29.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[repr(transparent)]
pub struct Throttle(i32);

/// A command inside the range of the pulse, 0..=1 in steps of 2^-29. The only thing a filter accepts: its headroom
/// holds for inputs in this range.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[repr(transparent)]
pub struct Command(i32);

impl Throttle {
    /// The lowest value, -4.
    pub const MIN: Self = Self(i32::MIN);
    /// The highest value, one step under 4.
    pub const MAX: Self = Self(i32::MAX);
    /// Largest magnitude that the format holds, as a number.
    pub const HEADROOM: f64 = 4.0;

    /// From Q2.29.
    #[must_use]
    pub const fn from_bits(bits: i32) -> Self {
        Self(bits)
    }

    /// To Q2.29.
    #[must_use]
    pub const fn to_bits(self) -> i32 {
        self.0
    }

    /// The value as a number. Exact.
    #[must_use]
    pub fn to_f64(self) -> f64 {
        f64::from(self.0) / f64::from(ONE_BITS)
    }

    /// The nearest command in [`min`, `max`]. Where `min` is above `max`, `min` wins: the caller's order is wrong, and
    /// of the two answers this one does not depend on `self`.
    #[must_use]
    pub const fn clamp_to(self, min: Command, max: Command) -> Command {
        if self.0 < min.0 || max.0 < min.0 {
            min
        } else if self.0 > max.0 {
            max
        } else {
            Command(self.0)
        }
    }

    /// The same where `min` is known to be at most `max`.
    #[inline]
    pub(crate) const fn clamp_in_order(self, min: Command, max: Command) -> Command {
        let floored = if self.0 < min.0 { min.0 } else { self.0 };
        Command(if floored > max.0 { max.0 } else { floored })
    }
}

impl Command {
    /// The bottom of the pulse range.
    pub const ZERO: Self = Self(0);
    /// The top of the pulse range.
    pub const ONE: Self = Self(ONE_BITS);

    /// From Q2.29; values outside 0..=1 become the nearest end.
    #[must_use]
    pub const fn saturating_from_bits(bits: i32) -> Self {
        Throttle(bits).clamp_to(Self::ZERO, Self::ONE)
    }

    /// From Q2.29 that is known to be within 0..=1.
    #[inline]
    pub(crate) const fn from_bits_in_range(bits: i32) -> Self {
        debug_assert!(0 <= bits && bits <= ONE_BITS);
        Self(bits)
    }

    /// To Q2.29, 0..=2^29.
    #[must_use]
    pub const fn to_bits(self) -> i32 {
        self.0
    }

    /// The nearest command; values outside 0..=1 become the nearest end, and NaN becomes zero, which stops a motor.
    #[must_use]
    pub fn saturating_from_f64(value: f64) -> Self {
        if value.is_nan() {
            return Self::ZERO;
        }
        Self(libm::rint(value.clamp(0.0, 1.0) * f64::from(ONE_BITS)) as i32)
    }

    /// The same for a number of single precision, which a core with an FPU of only that converts in some instructions.
    #[must_use]
    #[inline]
    pub fn saturating_from_f32(value: f32) -> Self {
        // Exact: the factor is a power of two. Not a number fails every comparison, and a cast of it gives 0.
        let scaled = value * ONE_BITS as f32;
        if scaled >= ONE_BITS as f32 {
            Self::ONE
        } else if scaled > 0.0 {
            Self(libm::rintf(scaled) as i32)
        } else {
            Self::ZERO
        }
    }

    /// The value as a number, 0..=1. Exact.
    #[must_use]
    pub fn to_f64(self) -> f64 {
        Throttle::from(self).to_f64()
    }

    /// The nearest number of single precision, 0..=1: to 2^-25 at worst.
    #[must_use]
    #[inline]
    pub fn to_f32(self) -> f32 {
        // Exact but for the conversion: the factor is a power of two.
        self.0 as f32 * (1.0 / ONE_BITS as f32)
    }

    /// The nearest command in [`min`, `max`]; see [`Throttle::clamp_to`].
    #[must_use]
    pub const fn clamp_to(self, min: Self, max: Self) -> Self {
        Throttle(self.0).clamp_to(min, max)
    }
}

impl From<Command> for Throttle {
    fn from(command: Command) -> Self {
        Self(command.0)
    }
}

/// What an ESC gets in a frame: the pulse of a command, or no pulse, where its line stays low. No pulse is below every
/// command.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(transparent)]
pub struct EscCommand(i32);

impl EscCommand {
    /// The line stays low. An ESC takes it for a lost signal, and does not arm.
    pub const NO_PULSE: Self = Self(-1);

    /// The command, where there is a pulse.
    #[must_use]
    pub const fn command(self) -> Option<Command> {
        if self.0 < 0 { None } else { Some(Command(self.0)) }
    }

    /// The command in Q2.29, or -1 where there is no pulse.
    #[must_use]
    pub const fn to_bits(self) -> i32 {
        self.0
    }

    /// From [`Self::to_bits`]: any negative number is no pulse, and one above the range its upper end.
    #[must_use]
    pub const fn from_bits(bits: i32) -> Self {
        if bits < 0 { Self::NO_PULSE } else { Self(Command::saturating_from_bits(bits).0) }
    }
}

impl PartialEq<Command> for EscCommand {
    fn eq(&self, other: &Command) -> bool {
        *self == Self::from(*other)
    }
}

impl PartialOrd<Command> for EscCommand {
    fn partial_cmp(&self, other: &Command) -> Option<core::cmp::Ordering> {
        Some(self.cmp(&Self::from(*other)))
    }
}

impl From<Command> for EscCommand {
    #[inline]
    fn from(command: Command) -> Self {
        Self(command.0)
    }
}

/// Conversion between the pulse widths of one protocol on one timer, and commands.
///
/// `to_ticks(to_command(t)) == t` for every `t` from the shortest to the longest pulse.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PulseScale {
    low_ticks: u32,
    span_ticks: u32,
    /// `2^(FRACTION_BITS + 32) / normalizer / span_ticks`, to the nearest integer.
    reciprocal: u32,
    /// The power of two with which `reciprocal` lies in (2^30, 2^31]: 2^2 to 2^24.
    normalizer: u32,
}

impl PulseScale {
    /// Fewest ticks a pulse range may span: 100 make a resolution of one percent, the coarsest that is of use.
    pub const MIN_SPAN_TICKS: u32 = 100;
    /// Most ticks a pulse range may span: with more than 2^28 the round trip would lose ticks (see [`Self::to_ticks`]).
    pub const MAX_SPAN_TICKS: u32 = 1 << (FRACTION_BITS - 1);

    /// Every pulse means 1: for a clock that cannot tell them apart.
    pub const FULL: Self = Self { low_ticks: 0, span_ticks: 1, reciprocal: 1 << 31, normalizer: 1 << 30 };

    /// The conversion for widths from `low_ticks` to `span_ticks` above, which is within its range.
    pub(crate) const fn from_span(low_ticks: u32, span_ticks: u32) -> Self {
        let span = span_ticks as u64;
        // With floor(log2(span)) + 2 bits the reciprocal is in (2^30, 2^31], and its rounding moves a command by at
        // most span / 2 / 2^shift <= 1/4 of a step.
        let shift = span_ticks.ilog2() + 2;
        let reciprocal = ((1_u64 << (FRACTION_BITS + shift)) + span / 2) / span;
        Self { low_ticks, span_ticks, reciprocal: reciprocal as u32, normalizer: 1 << (32 - shift) }
    }

    /// Width of the pulse that means 0.
    #[must_use]
    pub const fn low_ticks(&self) -> u32 {
        self.low_ticks
    }

    /// Width of the pulse that means 1.
    #[must_use]
    pub const fn high_ticks(&self) -> u32 {
        self.low_ticks + self.span_ticks
    }

    /// The command that a pulse of `ticks` means, to 3/4 of a step of 2^-29. Pulses outside the range mean its nearer
    /// end; whether such a pulse is to be believed is for the caller to say.
    #[must_use]
    pub const fn to_command(&self, ticks: u32) -> Command {
        let above = ticks.saturating_sub(self.low_ticks);
        let above = if above < self.span_ticks { above } else { self.span_ticks };
        // above * normalizer < 2^31 and reciprocal <= 2^31: the product has 62 bits, and its high word costs no shift. At
        // the top it is within 1/4 of a step of 1, and so rounded to it.
        let product = unsigned(above.wrapping_mul(self.normalizer), self.reciprocal);
        Command(((product + HALF) >> 32) as i32)
    }

    /// The pulse that means `command`, to the nearest tick. A command that came from a pulse is off by 3/4 of a step,
    /// which is less than half a tick as long as the span is at most 2^28.
    #[must_use]
    pub const fn to_ticks(&self, command: Command) -> u32 {
        // A command has at most 30 bits and the span 29, 32 with the shift.
        let product = unsigned(command.0.cast_unsigned(), self.span_ticks << (32 - FRACTION_BITS));
        self.low_ticks + ((product + HALF) >> 32) as u32
    }

    /// Width of the pulse that an ESC gets, to the nearest tick; 0 where it gets none.
    #[must_use]
    #[inline]
    pub const fn to_width_ticks(&self, output: EscCommand) -> u32 {
        if output.0 < 0 { 0 } else { self.to_ticks(Command(output.0)) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commands_saturate_and_a_nan_stops_the_motor() {
        assert_eq!(Command::saturating_from_f64(f64::NAN), Command::ZERO);
        assert_eq!(Command::saturating_from_f64(f64::INFINITY), Command::ONE);
        assert_eq!(Command::saturating_from_f64(-0.1), Command::ZERO);
        assert_eq!(Command::saturating_from_bits(i32::MIN), Command::ZERO);
        assert_eq!(Command::saturating_from_bits(i32::MAX), Command::ONE);
        assert_eq!(Command::saturating_from_f64(0.65).to_f64(), libm::rint(0.65 * 536_870_912.0) / 536_870_912.0);
    }

    #[test]
    fn single_precision_gives_the_commands_of_double() {
        let ends = [f32::NAN, -f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MIN, f32::MAX, -0.0, f32::MIN_POSITIVE];
        let steps = (0..=1_u32 << 12).map(|step| step as f32 / 4096.0);
        // Where single precision is finer than a command: around its halves, which are rounded to even.
        let fine = (0..1_u32 << 14).map(|step| step as f32 / 8192.0 / ONE_BITS as f32);
        let patterns = (0..f32::INFINITY.to_bits()).step_by(9973).map(f32::from_bits);
        for value in ends.into_iter().chain(steps).chain(fine).chain(patterns) {
            let command = Command::saturating_from_f32(value);
            assert_eq!(command, Command::saturating_from_f64(f64::from(value)), "{value:e}");
            assert_eq!(command.to_f32(), command.to_f64() as f32, "{value:e}");
        }
    }

    #[test]
    fn a_clamp_with_its_ends_exchanged_gives_the_lower_end_given() {
        let (low, high) = (Command::saturating_from_f64(0.2), Command::saturating_from_f64(0.8));
        for value in [Throttle::MIN, Throttle::default(), Throttle::MAX] {
            assert_eq!(value.clamp_to(high, low), high);
        }
    }
}
