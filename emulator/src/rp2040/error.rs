//! What keeps a run from being done.

use std::path::PathBuf;

use super::{CYCLES_PER_S, PINS};

/// What keeps a run from being done.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The image cannot be read.
    #[error("{}: {problem}; `cargo xtask build` makes images", image.display())]
    Image {
        /// The file.
        image: PathBuf,
        /// What is wrong with it.
        problem: String,
    },
    /// A pin that the chip does not have.
    #[error("there is no GPIO {pin}: the last is {last}", last = PINS - 1)]
    Pin {
        /// Its number.
        pin: u8,
    },
    /// A responder without answers, and nobody who is asked for them.
    #[error("nothing answers at GPIO {pin}: run it in `Live`")]
    Unanswered {
        /// The pin.
        pin: u8,
    },
    /// Node or its package is not there.
    #[error("{0}; `cargo xtask setup` installs it")]
    NotInstalled(String),
    /// The emulator ended without a trace.
    #[error("rp2040js: {0}")]
    Node(String),
    /// The run needs what the emulator does not have.
    #[error("rp2040-emu has no {0}: run it in `Emulator::Node`")]
    Unsupported(&'static str),
    /// The emulated core waits for what never comes.
    #[error("rp2040-emu stands still {} ms after the start", cycle * 1000 / CYCLES_PER_S)]
    StandsStill {
        /// Since when.
        cycle: u64,
    },
}

impl From<Error> for String {
    fn from(error: Error) -> Self {
        error.to_string()
    }
}
