//! A controller at the other end of a line: asks, sets, records, excites and injects.
//!
//! [`Session`] talks the protocol of [`rotorlead::link`] over anything that reads and writes with a time limit;
//! `open` makes that from a serial port or, for the emulator, a TCP address. Where there is neither, as in a browser, all but
//! `open` and `find` is the same.

mod change;
mod error;
mod excite;
mod inject;
mod line;
#[cfg(not(target_family = "wasm"))]
mod port;
mod recording;
mod sensors;
mod session;
mod speed_text;
mod text;

pub use change::change;
pub use error::DeviceError;
pub use excite::{Excited, Played, play};
pub use inject::{Difference, Injection, inject, path};
pub use line::{DEFAULT_BAUD, Port, READ_LIMIT, WRITE_LIMIT};
#[cfg(not(target_family = "wasm"))]
pub use port::{find, open};
pub use recording::{Recorded, Recording, record, template};
pub use sensors::{Calibration, Sensors};
pub use session::Session;
pub use speed_text::{speed_curve, speeds_text};
pub use text::{curve_text, entries, set, unknown};
