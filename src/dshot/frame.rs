//! A frame's 16 bits.

use core::fmt;

use crate::throttle::{Command, PulseScale};

/// The value below the lowest throttle. On the line it is an instruction; here it is where a command begins, and means a stop.
pub const BELOW_THROTTLE: u16 = 47;
/// The highest throttle, and the highest value.
pub const HIGHEST: u16 = 2047;
const SCALE: PulseScale = PulseScale::from_span(BELOW_THROTTLE as u32, (HIGHEST - BELOW_THROTTLE) as u32);

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
    pub(super) const fn compute(self, payload: u16) -> u16 {
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
    /// How fast the motor is to turn, above [`Command::ZERO`].
    Throttle(Command),
}

impl Value {
    /// Stops the motor, and disarms it.
    pub const STOP: Self = Self(0);
    /// The lowest throttle.
    pub const LOWEST_THROTTLE: Self = Self(BELOW_THROTTLE + 1);
    /// The highest value.
    pub const MAX: Self = Self(HIGHEST);

    /// The value nearest to a command: `47 + 2000 command`, where 47 is a stop.
    #[must_use]
    pub const fn from_command(command: Command) -> Self {
        // At most 2047.
        let value = SCALE.to_ticks(command) as u16;
        if value > BELOW_THROTTLE { Self(value) } else { Self::STOP }
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
        if self.0 <= BELOW_THROTTLE {
            return Content::Instruction(self.0 as u8);
        }
        Content::Throttle(self.command())
    }

    /// The command of a throttle; zero for everything below.
    #[must_use]
    pub const fn command(self) -> Command {
        SCALE.to_command(self.0 as u32)
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
        Self((payload << 4) | checksum.compute(payload))
    }

    /// A frame that has come in.
    ///
    /// # Errors
    /// [`BadChecksum`].
    pub const fn from_bits(bits: u16, checksum: Checksum) -> Result<Self, BadChecksum> {
        if checksum.compute(bits >> 4) == bits & 0xf { Ok(Self(bits)) } else { Err(BadChecksum) }
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
    use crate::throttle::FRACTION_BITS;

    #[test]
    fn every_throttle_comes_back_exactly_and_in_order() {
        let mut before = None;
        for number in BELOW_THROTTLE + 1..=HIGHEST {
            let value = Value::new(number).unwrap();
            let Content::Throttle(command) = value.content() else { panic!("{number}") };
            assert_eq!(Value::from_command(command), value);
            let exact = (f64::from(number) - 47.0) / 2000.0;
            assert!((command.to_f64() - exact).abs() * f64::from(1_u32 << FRACTION_BITS) <= 0.75, "{number}");
            assert!(before.replace(command) < Some(command));
        }
        assert_eq!(Value::from_command(Command::ONE), Value::MAX);
        assert_eq!(Value::from_command(Command::ZERO), Value::STOP);
        assert_eq!(Value::MAX.content(), Content::Throttle(Command::ONE));
        assert_eq!(Value::new(HIGHEST + 1), None);
    }

    #[test]
    fn a_command_goes_to_the_nearest_throttle_and_no_instruction_but_the_stop() {
        for step in 0..20_000_u32 {
            let place = f64::from(step) / 19_999.0;
            let value = Value::from_command(Command::saturating_from_f64(place));
            assert!(value == Value::STOP || value.get() > BELOW_THROTTLE);
            let off = f64::from(value.get().max(BELOW_THROTTLE)) - 47.0 - place * 2000.0;
            assert!(off.abs() <= 0.5 + 1e-5, "{place}: {off}");
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
