//! QEMU with the board.

use std::path::Path;
use std::process::Command;

use crate::board::BOARD;
use crate::run::{Result, command, output, run};

/// The program.
pub const PROGRAM: &str = BOARD.emulator.program;
/// The package that has it.
pub const PACKAGE: &str = BOARD.emulator.package;
/// First major version that has what the application needs of the board.
pub const OLDEST: u32 = BOARD.emulator.oldest;
/// TCP port of the emulated link, unless the caller says otherwise.
pub const DEFAULT_PORT: u16 = 5740;

/// Major version of the QEMU that is installed.
pub fn version() -> Option<u32> {
    major(&output(&mut command(PROGRAM, &["--version"]))?)
}

fn major(text: &str) -> Option<u32> {
    text.split("version ").nth(1)?.split(|c: char| !c.is_ascii_digit()).next()?.parse().ok()
}

/// QEMU with this image and its link on a TCP port of this machine. The address says `on the fly` what to
/// connect to: `tcp:127.0.0.1:PORT`.
///
/// With `-icount shift=0` an instruction takes 1 ns of the emulated time, and a control tick has 19 000 of them. Without
/// it interrupts are lost.
pub fn emulator(image: &Path, port: u16) -> Command {
    let machine = &BOARD.emulator;
    let options = ["-M", machine.machine, "-nographic", "-monitor", "none", "-icount", "shift=0"];
    let mut qemu = command(PROGRAM, &options);
    for _ in 0..machine.link_line {
        qemu.args(["-serial", "null"]);
    }
    qemu.arg("-serial").arg(format!("tcp:127.0.0.1:{port},server=on,wait=off"));
    qemu.arg("-kernel").arg(image);
    qemu
}

/// Runs the image until it is interrupted.
pub fn run_image(image: &Path, port: u16) -> Result {
    eprintln!("xtask: the link is at tcp:127.0.0.1:{port}; Ctrl-C ends the emulator");
    run(&mut emulator(image, port))
}

#[cfg(test)]
mod tests {
    use super::major;

    #[test]
    fn the_version_is_read_from_what_qemu_says() {
        assert_eq!(major("QEMU emulator version 10.0.2 (Debian 1:10.0.2+ds-2)\nCopyright"), Some(10));
        assert_eq!(major("QEMU emulator version 7.2.22\n"), Some(7));
        assert_eq!(major("something else"), None);
    }
}
