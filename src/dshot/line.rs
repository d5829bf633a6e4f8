//! What a line of DShot has: the rate of its bits, and whether its frames are answered.

use super::frame::Checksum;

/// Bits of a frame.
const FRAME_BITS: u32 = 16;

/// How fast the bits of a frame come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Speed {
    /// 150 kbit/s: a frame lasts for 107 µs.
    Dshot150,
    /// 300 kbit/s: 53 µs.
    Dshot300,
    /// 600 kbit/s: 27 µs.
    Dshot600,
}

impl Speed {
    /// Bits per second.
    #[must_use]
    pub const fn bits_per_s(self) -> u32 {
        match self {
            Self::Dshot150 => 150_000,
            Self::Dshot300 => 300_000,
            Self::Dshot600 => 600_000,
        }
    }

    /// How long a frame lasts, microseconds, rounded up.
    #[must_use]
    pub const fn frame_us(self) -> u32 {
        (FRAME_BITS * 1_000_000).div_ceil(self.bits_per_s())
    }

    /// Bits of a reply per second, 5/4 of those of a frame.
    #[must_use]
    pub const fn reply_levels_per_s(self) -> u32 {
        self.bits_per_s() / 4 * 5
    }
}

/// What a line has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Line {
    /// How fast the bits of a frame come.
    pub speed: Speed,
    /// Whether it idles high and its frames are answered: bidirectional DShot.
    pub is_bidirectional: bool,
}

impl Line {
    /// One way: low at rest, and no frame is answered.
    #[must_use]
    pub const fn one_way(speed: Speed) -> Self {
        Self { speed, is_bidirectional: false }
    }

    /// Both ways.
    #[must_use]
    pub const fn bidirectional(speed: Speed) -> Self {
        Self { speed, is_bidirectional: true }
    }

    /// That of its frames.
    #[must_use]
    pub const fn checksum(self) -> Checksum {
        if self.is_bidirectional { Checksum::Inverted } else { Checksum::Normal }
    }
}
