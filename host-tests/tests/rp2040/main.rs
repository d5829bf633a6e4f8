//! What belongs to the RP2040 alone, in its emulators: settings in its flash, its watchdog, its panic, and the cycles of its core.
//!
//! What must hold of every controller is in `tests/scenarios`. Each test needs the image and the emulators: `cargo xtask test`
//! gives both.

mod bidirectional;
mod link;
mod load;
mod resume;
mod safety;
mod speed_correction;
mod spikes;
mod stack;
mod supply;
mod tune;
mod usb;
