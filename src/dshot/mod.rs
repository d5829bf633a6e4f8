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
mod line;
mod receiver;
mod relay;
mod reply;
mod reply_relay;
mod reply_window;

pub use frame::{BELOW_THROTTLE, BadChecksum, Checksum, Content, Frame, HIGHEST, Value};
pub use instructions::Directions;
pub use line::{Line, Speed};
pub use receiver::{Receiver, Word};
pub use relay::{Counts, QUEUED, Relay};
pub use reply::{BadReply, LONGEST_TURN_US, REPLY_BITS, Reply};
pub use reply_relay::{FRESH_MS, Offer, ReplyRelay};
pub use reply_window::{ReplyWindow, WINDOW_LEVELS, WORD_LEVELS};
