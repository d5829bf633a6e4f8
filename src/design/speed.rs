//! The rotor's electrical speed over the command.

use crate::throttle::Command;

/// Range of electrical speeds, revolutions per minute. Derived: the longest turn that a reply can say, 65 ms, is one of 917; a turn at the
/// highest takes 60 microseconds, of which a reply counts whole ones.
pub const ERPM_RANGE: (u32, u32) = (1000, 1_000_000);
/// The shortest range of commands. Chosen: a slope over less is mostly noise, and coefficients of a tick are bounded by it.
pub const SHORTEST_SPEED_RANGE: Command = Command::from_bits_in_range(Command::ONE.to_bits() / 20);

/// A rotor's electrical speed at rest, in revolutions per minute, as a quadratic of the command between two commands. It is that of the
/// three speeds at the lower one, in the middle, and at the higher one.
///
/// An electrical turn is a turn of the rotor over its pairs of poles: what an ESC measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "settings", derive(serde::Serialize, serde::Deserialize, postcard_schema::Schema))]
pub struct SpeedCurve(
    /// The two commands in Q2.29, and the three speeds.
    [u32; 5],
);

impl SpeedCurve {
    /// Between two commands, from the speeds at the first, in the middle, and at the second. [`Self::is_rising`] and the ranges are for a
    /// caller to ask.
    #[must_use]
    pub const fn new(from: Command, to: Command, [low, middle, high]: [u32; 3]) -> Self {
        Self([from.to_bits().cast_unsigned(), to.to_bits().cast_unsigned(), low, middle, high])
    }

    /// The commands between which it is known, in Q2.29.
    #[must_use]
    pub const fn range(&self) -> [i32; 2] {
        let [from, to, ..] = self.0;
        [from.cast_signed(), to.cast_signed()]
    }

    /// The speeds at the lower command, in the middle, and at the higher one.
    #[must_use]
    pub const fn erpm(&self) -> [u32; 3] {
        let [_, _, erpm @ ..] = self.0;
        erpm
    }

    /// Whether more command is nowhere less speed: the slopes at both ends are not negative, and between them lie all others.
    #[must_use]
    pub fn is_rising(&self) -> bool {
        let [low, middle, high] = self.erpm().map(i64::from);
        4 * middle >= 3 * low + high && 3 * high + low >= 4 * middle && high > low
    }
}
