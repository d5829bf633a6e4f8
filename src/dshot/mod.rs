//! DShot: commands as digital frames instead of pulses.
//!
//! A [`Frame`] has 16 bits: a [`Value`] of 11, whether the ESC is to report, and a checksum. Values from 48 on are throttle, those
//! below are instructions to the ESC: stop, beep, turn the other way, save. A [`Relay`] lets these pass by the filter untouched, and
//! puts the filter's newest output into every other frame. In bidirectional DShot the line idles high, the checksum is inverted, and
//! the ESC answers each frame with a [`Reply`]: how long its motor takes for an electrical turn.
//!
//! How bits are timed on the line is a matter of the board; [`Speed`] has their rate. Sources: the protocol as Betaflight and BLHeli_32 have it
//! (`src/main/drivers/dshot.c` and `dshot_command.h`; "Dshotprog spec").

mod frame;
mod receiver;
mod relay;
mod reply;

pub use frame::{BELOW_THROTTLE, BadChecksum, Checksum, Content, Frame, HIGHEST, Value};
pub use receiver::{Receiver, Word};
pub use relay::{Counts, QUEUED, Relay};
pub use reply::{BadReply, REPLY_BITS, Reply};

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
}
