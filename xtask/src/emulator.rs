//! QEMU, as the tasks use it.

use std::path::Path;

use emulator::{Pace, Qemu};

use crate::board::Board;
use crate::run::{Result, run};

/// The machine on which single functions are measured, and that the benchmarks of the application know.
pub const EMULATED: &emulator::Board = &emulator::STM32F405;
/// The program.
pub const PROGRAM: &str = EMULATED.program;
/// The package that has it.
pub const PACKAGE: &str = EMULATED.package;
/// First major version that has what the application needs of the board.
pub const OLDEST: u32 = EMULATED.oldest;
/// TCP port of the emulated link, unless the caller says otherwise.
pub const DEFAULT_PORT: &str = "5740";

/// Major version of the QEMU that is installed.
pub fn version() -> Option<u32> {
    EMULATED.version()
}

/// Runs the image of a board until it is interrupted, with its link on a TCP port of this machine: `tcp:127.0.0.1:PORT`.
pub fn run_image(board: &Board, image: &Path, port: u16) -> Result {
    let machine = emulator::Board::named(&board.name).ok_or_else(|| format!("QEMU has no {}", board.name))?;
    eprintln!("xtask: the link is at tcp:127.0.0.1:{port}; Ctrl-C ends the emulator");
    run(&mut Qemu::new(machine, image, Pace::RealTime).serve_link(port).into_command())
}
