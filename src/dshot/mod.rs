//! DShot: commands as digital frames instead of pulses.
//!
//! A [`Frame`] has 16 bits: a [`Value`] of 11, whether the ESC is to report, and a checksum. Values from 48 on are throttle, those
//! below are instructions to the ESC: stop, beep, turn the other way, save. A [`Relay`] lets these pass by the filter untouched, and
//! puts the filter's newest output into every other frame; those that a filter must not have in its path are dropped
//! (`instructions.rs` has the table). In bidirectional DShot the line idles high, the checksum is inverted, and
//! the ESC answers each frame on the same line with a [`Reply`]: how long its motor takes for an electrical turn. A
//! [`ReplyRelay`] gives these to the flight controller.
//!
//! How bits are timed on the line is a matter of the board; [`Speed`] has their rate. Sources: the protocol as Betaflight and BLHeli_32 have it
//! (`src/main/drivers/dshot.c` and `dshot_command.h`; "Dshotprog spec").

mod frame;
mod instructions;
mod receiver;
mod relay;
mod reply;
mod reply_relay;
mod reply_window;

pub use frame::{BELOW_THROTTLE, BadChecksum, Checksum, Content, Frame, HIGHEST, Value};
pub use instructions::Directions;
pub use receiver::{Receiver, Word};
pub use relay::{Counts, QUEUED, Relay};
pub use reply::{BadReply, LONGEST_TURN_US, REPLY_BITS, Reply};
pub use reply_relay::{FRESH_MS, Offer, ReplyRelay};
pub use reply_window::{ReplyWindow, WINDOW_LEVELS, WORD_LEVELS};

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
