//! A controller at the other end of a line: asks, sets, records, excites and injects.
//!
//! [`Session`] talks the protocol of [`rotorlead::link`] over anything that reads and writes with a time limit;
//! `open` makes that from a serial port or, for the emulator, a TCP address. Where there is neither, as in a browser, all but
//! `open` and `find` is the same.

mod apply;
mod change;
mod compensator;
mod error;
mod excite;
mod inject;
mod line;
#[cfg(not(target_family = "wasm"))]
mod port;
mod recording;
mod sensors;
mod series;
mod session;
mod speed_text;
mod text;
mod words;

pub use apply::{Applied, apply, save_chosen};
pub use change::change;
pub use compensator::{change_with_filters, compensator, compensator_settings, is_compensated};
pub use error::DeviceError;
pub use excite::{Excited, Played, play};
pub use inject::{Difference, Injection, inject, path};
pub use line::{DEFAULT_BAUD, Port, READ_LIMIT, WRITE_LIMIT};
#[cfg(not(target_family = "wasm"))]
pub use port::{find, open};
pub use recording::{Recorded, Recording, record, template};
pub use sensors::{Calibration, Sensors};
pub use series::{Header, Keeper, Kept, Series, Signal, bench_frame_hz, excite, free_name};
pub use session::{Session, stop_frame};
pub use speed_text::{speed_curve, speeds_text};
pub use text::{curve_text, entries, set, unknown};
pub use words::{Said, fault_lines, info_lines};
