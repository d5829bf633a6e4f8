//! DShot: commands as digital frames instead of pulses.
//!
//! A [`Frame`] has 16 bits: a [`Value`] of 11, whether the ESC is to report, and a checksum. Values from 48 on are throttle, those
//! below are instructions to the ESC: stop, beep, turn the other way, save. A [`Relay`] lets these pass by the filter untouched, and
//! puts the filter's newest output into every other frame. In bidirectional DShot the line idles high, the checksum is inverted, and
//! the ESC answers each frame with a [`Reply`]: how long its motor takes for an electrical turn.
//!
//! How bits are timed on the line is a matter of the board. Sources: the protocol as Betaflight and BLHeli_32 have it
//! (`src/main/drivers/dshot.c` and `dshot_command.h`; "Dshotprog spec").

mod frame;
mod relay;
mod reply;

pub use frame::{BadChecksum, Checksum, Content, Frame, Value};
pub use relay::{Counts, Newest, QUEUED, Relay};
pub use reply::{BadReply, REPLY_BITS, Reply};
