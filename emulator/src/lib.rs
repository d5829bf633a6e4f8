//! QEMU with the controller's image: its command line, its process, and the client of its debugging port.
//!
//! `xtask` and the host tests share it. It has no dependencies, so that `xtask` stays quick to compile.

mod debugger;
mod process;
mod qemu;
pub mod rp2040;

use std::process::{Command, Stdio};
use std::time::Duration;

pub use debugger::{Debugger, Registers};
pub use process::{Listener, Process};
pub use qemu::{Pace, Qemu};

/// What went wrong, in words for a person.
pub type Result<T = ()> = std::result::Result<T, String>;

/// Longest wait for QEMU to start, and for one answer of it. It may share the machine with other work.
pub const ANSWER_LIMIT: Duration = Duration::from_secs(60);

/// A board as QEMU has it.
#[derive(Debug)]
pub struct Board {
    /// The board's name in its `board.toml`.
    pub name: &'static str,
    /// The program.
    pub program: &'static str,
    /// Debian's package that has it.
    pub package: &'static str,
    /// First major version that has what the application needs of the board.
    pub oldest: u32,
    /// The machine.
    pub machine: &'static str,
    /// Which of its serial lines is the link, from 0.
    pub link_line: usize,
}

/// The emulated STM32F405. What it has of the chip and what not: QEMU's documentation, "STM32 boards".
pub const STM32F405: Board = Board {
    name: "stm32f405",
    program: "qemu-system-arm",
    package: "qemu-system-arm",
    // Models the clock registers.
    oldest: 10,
    machine: "olimex-stm32-h405",
    // USART3: its n-th serial line is USARTn.
    link_line: 2,
};

/// Every board that QEMU has.
const MACHINES: [&Board; 1] = [&STM32F405];

impl Board {
    /// The board of a name, where QEMU has it.
    #[must_use]
    pub fn named(name: &str) -> Option<&'static Self> {
        MACHINES.into_iter().find(|board| board.name == name)
    }

    /// Major version of the QEMU that is installed; `None` where none runs.
    #[must_use]
    pub fn version(&self) -> Option<u32> {
        let mut qemu = Command::new(self.program);
        let output = qemu.arg("--version").stdin(Stdio::null()).stderr(Stdio::null()).output().ok()?;
        if output.status.success() { major(&String::from_utf8_lossy(&output.stdout)) } else { None }
    }

    /// QEMU's name of the serial line that is the link.
    #[must_use]
    pub fn link_name(&self) -> String {
        format!("serial{}", self.link_line)
    }
}

fn major(text: &str) -> Option<u32> {
    text.split("version ").nth(1)?.split(|c: char| !c.is_ascii_digit()).next()?.parse().ok()
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
