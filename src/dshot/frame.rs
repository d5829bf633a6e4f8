//! A frame's 16 bits.

use core::fmt;

use crate::throttle::{Command, FRACTION_BITS};

/// Where throttle begins, and its steps above that.
const FIRST_THROTTLE: u16 = 48;
const STEPS: u32 = 1999;
/// `2^29 / 1999`, and 2^16 times what is left over: a step as a command.
const STEP_BITS: u32 = (1 << FRACTION_BITS) / STEPS;
const STEP_REST: u32 = ((((1 << FRACTION_BITS) % STEPS) << 16) + STEPS / 2) / STEPS;
/// Bits of a command that are below what a step can tell.
const FINER_BITS: u32 = FRACTION_BITS - 16;

/// How the four last bits follow from the twelve before.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Checksum {
    /// Their exclusive or, in fours.
    Normal,
    /// The inverse of that: bidirectional DShot.
    Inverted,
}

impl Checksum {
    /// Of twelve bits.
    pub(super) const fn of(self, payload: u16) -> u16 {
        let sum = payload ^ (payload >> 4) ^ (payload >> 8);
        match self {
            Self::Normal => sum & 0xf,
            Self::Inverted => !sum & 0xf,
        }
    }
}

/// What a frame says, 0..=2047.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Value(u16);

/// The same, by what it means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Content {
    /// An instruction to the ESC, 0..=47; 0 stops the motor.
    Instruction(u8),
    /// How fast the motor is to turn: [`Command::ZERO`] is the slowest, and no stop.
    Throttle(Command),
}

impl Value {
    /// Stops the motor, and disarms it.
    pub const STOP: Self = Self(0);
    /// The highest value.
    pub const MAX: Self = Self(FIRST_THROTTLE + STEPS as u16);

    /// The throttle nearest to a command, 48..=2047, to 2 % of a step.
    #[must_use]
    pub const fn from_command(command: Command) -> Self {
        // At most 2^16 times 1999, and half.
        let sixteenth = (command.to_bits().cast_unsigned() + (1 << (FINER_BITS - 1))) >> FINER_BITS;
        Self(FIRST_THROTTLE + ((sixteenth * STEPS + (1 << 15)) >> 16) as u16)
    }

    /// From a number; `None` above 2047.
    #[must_use]
    pub const fn new(value: u16) -> Option<Self> {
        if value <= Self::MAX.0 { Some(Self(value)) } else { None }
    }

    /// The number.
    #[must_use]
    pub const fn get(self) -> u16 {
        self.0
    }

    /// What it means. [`Value::from_command`] gives every throttle back exactly.
    #[must_use]
    pub const fn content(self) -> Content {
        if self.0 < FIRST_THROTTLE {
            return Content::Instruction(self.0 as u8);
        }
        // Up to 1999, so that the products stay below 2^29 and 2^27.
        let steps = (self.0 - FIRST_THROTTLE) as u32;
        let bits = steps * STEP_BITS + ((steps * STEP_REST + (1 << 15)) >> 16);
        Content::Throttle(Command::saturating_from_bits(bits.cast_signed()))
    }
}

/// What is on the line, the first bit the highest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame(u16);

/// The checksum of a frame is not that of its bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BadChecksum;

impl fmt::Display for BadChecksum {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the checksum of a DShot frame is wrong: the line is disturbed, or one end is bidirectional and the other is not")
    }
}

impl core::error::Error for BadChecksum {}

impl Frame {
    /// A frame that says `value`, and whether the ESC is to report.
    #[must_use]
    pub const fn new(value: Value, reports: bool, checksum: Checksum) -> Self {
        let payload = (value.0 << 1) | reports as u16;
        Self((payload << 4) | checksum.of(payload))
    }

    /// A frame that has come in.
    ///
    /// # Errors
    /// [`BadChecksum`].
    pub const fn from_bits(bits: u16, checksum: Checksum) -> Result<Self, BadChecksum> {
        if checksum.of(bits >> 4) == bits & 0xf { Ok(Self(bits)) } else { Err(BadChecksum) }
    }

    /// The bits, the first on the line the highest.
    #[must_use]
    pub const fn to_bits(self) -> u16 {
        self.0
    }

    /// What it says.
    #[must_use]
    pub const fn value(self) -> Value {
        Value(self.0 >> 5)
    }

    /// Whether the ESC is to report.
    #[must_use]
    pub const fn reports(self) -> bool {
        self.0 & 0x10 != 0
    }
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;

    #[test]
    fn every_throttle_comes_back_exactly_and_in_order() {
        let mut before = None;
        for number in FIRST_THROTTLE..=Value::MAX.get() {
            let value = Value::new(number).unwrap();
            let Content::Throttle(command) = value.content() else { panic!("{number}") };
            assert_eq!(Value::from_command(command), value);
            let exact = f64::from(number - FIRST_THROTTLE) / f64::from(STEPS);
            assert!((command.to_f64() - exact).abs() * f64::from(1_u32 << FRACTION_BITS) < 0.52, "{number}");
            assert!(before.replace(command) < Some(command));
        }
        assert_eq!(Value::from_command(Command::ONE), Value::MAX);
        assert_eq!(Value::from_command(Command::ZERO).get(), FIRST_THROTTLE);
        assert_eq!(Value::MAX.content(), Content::Throttle(Command::ONE));
        assert_eq!(Value::new(Value::MAX.get() + 1), None);
    }

    #[test]
    fn a_command_goes_to_the_nearest_throttle() {
        for step in 0..20_000_u32 {
            let place = f64::from(step) / 19_999.0;
            let value = Value::from_command(Command::saturating_from_f64(place));
            let off = f64::from(value.get() - FIRST_THROTTLE) - place * f64::from(STEPS);
            assert!(off.abs() <= 0.52, "{place}: {off}");
        }
    }

    #[test]
    fn of_all_words_one_in_sixteen_is_a_frame_and_no_single_bit_may_turn() {
        for checksum in [Checksum::Normal, Checksum::Inverted] {
            let frames: HashSet<u16> =
                (0..=u16::MAX).filter(|bits| Frame::from_bits(*bits, checksum).is_ok()).collect();
            assert_eq!(frames.len(), 1 << 12);
            assert!(frames.iter().all(|bits| (0..16).all(|bit| !frames.contains(&(bits ^ (1 << bit))))));
            for bits in frames {
                let frame = Frame::from_bits(bits, checksum).unwrap();
                assert_eq!(Frame::new(frame.value(), frame.reports(), checksum), frame);
            }
        }
    }
}
