//! QEMU's command line.

use std::path::Path;
use std::process::{Command, Stdio};

use crate::{Board, Listener, Process, Result};

/// How the emulated time relates to the real one while the core sleeps. While it executes, an instruction takes 1 ns of
/// the emulated time either way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pace {
    /// A sleeping core waits in real time.
    RealTime,
    /// A sleeping core skips to its next event. In real time, the thread that brings the bytes of the link was seen to
    /// wait up to 300 ms for the one that executes.
    Fastest,
}

/// A QEMU that is to be started.
#[derive(Debug)]
pub struct Qemu {
    command: Command,
    link_line: usize,
}

impl Qemu {
    /// QEMU with a board and its image, and no line to either yet.
    ///
    /// Of QEMU's shifts, 0 is the one in which a control tick has most instructions, 19 000, nearly as many as on silicon.
    /// Without `-icount` interrupts are lost.
    #[must_use]
    pub fn new(board: &Board, image: &Path, pace: Pace) -> Self {
        let sleep = match pace {
            Pace::RealTime => "on",
            Pace::Fastest => "off",
        };
        let mut command = Command::new(board.program);
        command.args(["-M", board.machine, "-nographic", "-monitor", "none"]);
        command.args(["-icount", &format!("shift=0,sleep={sleep}")]).arg("-kernel").arg(image);
        Self { command, link_line: board.link_line }
    }

    /// Serves the link on a TCP port of this machine, to one client after the other. QEMU takes a free one for port 0.
    #[must_use]
    pub fn serve_link(self, port: u16) -> Self {
        self.link(&format!("tcp:127.0.0.1:{port},server=on,wait=off,nodelay=on"))
    }

    /// Connects the link to a listener: no port is guessed, which could be somebody else's by the time QEMU takes it.
    #[must_use]
    pub fn connect_link(self, listener: &Listener) -> Self {
        self.link(&format!("tcp:{},nodelay=on", listener.address()))
    }

    fn link(mut self, to: &str) -> Self {
        for _ in 0..self.link_line {
            self.command.args(["-serial", "null"]);
        }
        self.command.args(["-serial", to]);
        self
    }

    /// Connects QEMU's monitor (QMP) to a listener.
    #[must_use]
    pub fn connect_monitor(mut self, listener: &Listener) -> Self {
        self.command.args(["-qmp", &format!("tcp:{}", listener.address())]);
        self
    }

    /// Connects the debugging port to a listener. The core runs until [`crate::Debugger::halt`], unless
    /// [`Self::halted`] says otherwise.
    #[must_use]
    pub fn connect_debugger(mut self, listener: &Listener) -> Self {
        let (host, port) = (listener.address().ip(), listener.address().port());
        // A stepped instruction is several small packets each way, of which none may wait for another.
        let socket = format!("socket,id=debugger,host={host},port={port},nodelay=on");
        self.command.args(["-chardev", &socket, "-gdb", "chardev:debugger"]);
        self
    }

    /// Leaves the core at its first instruction.
    #[must_use]
    pub fn halted(mut self) -> Self {
        self.command.arg("-S");
        self
    }

    /// Writes every access to what QEMU does not model to a file. Some 300 kB a second.
    #[must_use]
    pub fn trace(mut self, file: &Path) -> Self {
        self.command.args(["-d", "unimp", "-D"]).arg(file);
        self
    }

    /// Loads an Intel HEX file beside the image.
    #[must_use]
    pub fn load(mut self, file: &Path) -> Self {
        self.command.arg("-device").arg(format!("loader,file={}", file.display()));
        self
    }

    /// The command line, for a caller that runs it in its own way.
    #[must_use]
    pub fn into_command(self) -> Command {
        self.command
    }

    /// Starts it. Nothing of it is printed but its errors.
    ///
    /// # Errors
    /// When QEMU does not run.
    pub fn start(mut self) -> Result<Process> {
        let name = self.command.get_program().to_string_lossy().into_owned();
        let child = self.command.stdin(Stdio::null()).stdout(Stdio::null()).spawn();
        let child = child.map_err(|error| format!("{name}: {error}; `cargo xtask setup` installs it"))?;
        Ok(Process::new(name, child))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::STM32F405;

    fn words(qemu: Qemu) -> String {
        let words: Vec<_> = qemu.into_command().get_args().map(|word| word.to_string_lossy().into_owned()).collect();
        words.join(" ")
    }

    #[test]
    fn the_link_is_the_boards_line() {
        let qemu = Qemu::new(&STM32F405, Path::new("image"), Pace::RealTime).serve_link(5740);
        assert!(
            words(qemu).ends_with("-serial null -serial null -serial tcp:127.0.0.1:5740,server=on,wait=off,nodelay=on")
        );
        assert_eq!(STM32F405.link_name(), "serial2");
    }

    #[test]
    fn the_pace_is_that_of_a_sleeping_core() {
        for (pace, expected) in [(Pace::RealTime, "shift=0,sleep=on"), (Pace::Fastest, "shift=0,sleep=off")] {
            assert!(words(Qemu::new(&STM32F405, Path::new("image"), pace)).contains(expected));
        }
    }
}
