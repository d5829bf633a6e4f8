//! What an ESC answers in bidirectional DShot.
//!
//! Some 30 µs after a frame it drives the line itself: 21 bits at 5/4 of the rate. The first is low; each of the others differs from
//! the one before where a bit of the code is set. The 20 bits of that are four groups of five, each of which stands for four bits
//! (group code recording, so that the line changes often), and these are
//!
//! ```text
//! eeem mmmm mmmm cccc    an electrical turn takes m 2^e microseconds
//! ```
//!
//! with the inverted checksum of the first twelve. A motor that stands has the longest time that there is, m = 511 and e = 7. A time
//! has the smallest e that it can have: twelve bits with an e above 0 and an m below 256 are no time but extended telemetry, such as
//! a temperature. Source: Betaflight, `src/main/drivers/dshot.c`.

use core::fmt;

use super::Checksum;

/// Bits of an answer on the line.
pub const REPLY_BITS: u32 = 21;
/// The groups of five bits for 0 to 15.
const GROUPS: [u8; 16] =
    [0x19, 0x1b, 0x12, 0x13, 0x1d, 0x15, 0x16, 0x17, 0x1a, 0x09, 0x0a, 0x0b, 0x1e, 0x0d, 0x0e, 0x0f];
/// That of no four bits.
const NONE: u8 = 0xff;
/// The four bits of each group.
const NIBBLES: [u8; 32] = {
    let mut nibbles = [NONE; 32];
    let mut nibble = 0;
    while nibble < GROUPS.len() {
        nibbles[GROUPS[nibble] as usize] = nibble as u8;
        nibble += 1;
    }
    nibbles
};
/// The payload of a motor that stands.
const STANDS: u16 = 0xfff;
/// The longest electrical turn that an answer can say, which a motor that stands has.
pub const LONGEST_TURN_US: u16 = 511 << 7;

/// An answer: twelve bits with a right checksum.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reply {
    payload: u16,
}

/// Why bits are no answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BadReply {
    /// Five bits in a row that no four bits have.
    Group,
    /// The checksum is not that of the bits.
    Checksum,
    /// It came so late that its end was not waited for.
    Cut,
}

impl fmt::Display for BadReply {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Group => {
                "an ESC's answer has bits that the code does not: the line is disturbed, or was read at another rate"
            }
            Self::Checksum => "the checksum of an ESC's answer is wrong: the line is disturbed",
            Self::Cut => "an ESC's answer came too late: the ESC has another speed, or the line is disturbed",
        })
    }
}

impl core::error::Error for BadReply {}

impl Reply {
    /// From the levels of the line, the first of 21 the highest bit.
    ///
    /// # Errors
    /// [`BadReply`].
    pub fn from_levels(levels: u32) -> Result<Self, BadReply> {
        // A bit of the code is a change of the level.
        let code = levels ^ (levels >> 1);
        let mut bits = 0_u16;
        for group in (0..4_u32).rev() {
            let five = (code >> (5 * group)) & 0x1f;
            let nibble = NIBBLES.get(five as usize).copied().unwrap_or(NONE);
            if nibble == NONE {
                return Err(BadReply::Group);
            }
            bits = (bits << 4) | u16::from(nibble);
        }
        let payload = bits >> 4;
        if Checksum::Inverted.compute(payload) != bits & 0xf {
            return Err(BadReply::Checksum);
        }
        Ok(Self { payload })
    }

    /// The levels of the line that say it: [`REPLY_BITS`], the first the highest bit.
    #[must_use]
    pub fn to_levels(self) -> u32 {
        let bits = (self.payload << 4) | Checksum::Inverted.compute(self.payload);
        let mut code = 0_u32;
        for nibble in (0..4_u32).rev() {
            let group = GROUPS.get(usize::from((bits >> (4 * nibble)) & 0xf)).copied().unwrap_or(0);
            code = (code << 5) | u32::from(group);
        }
        // Each level is that before, turned where a bit of the code is set.
        let mut levels = code;
        for turn in [1, 2, 4, 8, 16] {
            levels ^= levels >> turn;
        }
        levels
    }

    /// One with these twelve bits.
    #[must_use]
    pub const fn from_payload(payload: u16) -> Self {
        Self { payload: payload & 0xfff }
    }

    /// Its twelve bits.
    #[must_use]
    pub const fn payload(self) -> u16 {
        self.payload
    }

    /// Of an electrical turn of so many microseconds, to the nearest that can be said, rounded down; `None` is a motor that stands.
    #[must_use]
    pub fn from_period_us(period_us: Option<u32>) -> Self {
        let Some(period_us) = period_us else { return Self { payload: STANDS } };
        let exponent = (u32::BITS - period_us.leading_zeros()).saturating_sub(9);
        if exponent > 7 {
            return Self { payload: STANDS };
        }
        Self { payload: ((exponent << 9) | (period_us >> exponent)) as u16 }
    }

    /// Whether it is extended telemetry, and says nothing of an electrical turn.
    #[must_use]
    pub const fn is_extended(self) -> bool {
        self.payload >> 9 != 0 && self.payload & 0x100 == 0
    }

    /// Microseconds of an electrical turn, [`LONGEST_TURN_US`] of a motor that stands; `None` of extended telemetry.
    #[must_use]
    pub const fn turn_us(self) -> Option<u16> {
        if self.is_extended() {
            return None;
        }
        let (exponent, mantissa) = (self.payload >> 9, self.payload & 0x1ff);
        Some(mantissa << exponent)
    }

    /// Microseconds of an electrical turn; `None` of a motor that stands, and of extended telemetry.
    #[must_use]
    pub const fn period_us(self) -> Option<u32> {
        match self.turn_us() {
            Some(turn_us) if turn_us < LONGEST_TURN_US => Some(turn_us as u32),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_answer_comes_back() {
        for payload in 0..1 << 12 {
            let reply = Reply { payload };
            let levels = reply.to_levels();
            assert!(levels < 1 << (REPLY_BITS - 1), "the first is low");
            assert_eq!(Reply::from_levels(levels), Ok(reply));
        }
    }

    #[test]
    fn the_line_keeps_no_level_for_more_than_three_bits() {
        for payload in 0..1 << 12 {
            let levels = Reply { payload }.to_levels();
            let code = levels ^ (levels >> 1);
            assert!((0..18).all(|place| (code >> place) & 0x7 != 0), "{levels:#b}");
        }
    }

    #[test]
    fn a_level_that_is_read_wrong_is_seen() {
        for payload in 0..1 << 12 {
            let levels = Reply { payload }.to_levels();
            for bit in 0..REPLY_BITS - 1 {
                assert!(Reply::from_levels(levels ^ (1 << bit)) != Ok(Reply { payload }));
            }
        }
    }

    #[test]
    fn periods_are_said_to_a_part_in_256() {
        for period_us in 1..65_408 {
            let said = Reply::from_period_us(Some(period_us)).period_us().unwrap();
            assert!(said <= period_us && period_us - said <= period_us / 256, "{period_us}: {said}");
            assert!(!Reply::from_period_us(Some(period_us)).is_extended());
        }
        assert_eq!(Reply::from_period_us(None).period_us(), None);
        assert_eq!(Reply::from_period_us(Some(65_536)).period_us(), None);
        assert_eq!(Reply::from_period_us(Some(0)).period_us(), Some(0));
    }

    #[test]
    fn a_period_is_a_mantissa_times_a_power_of_two() {
        assert_eq!(Reply { payload: (2 << 9) | 297 }.period_us(), Some(297 << 2));
        assert_eq!(Reply { payload: (7 << 9) | 510 }.period_us(), Some(510 << 7));
    }
}
