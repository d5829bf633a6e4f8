//! The debugger, for tests: it leads the core astray, and panics where it cannot.

use std::net::TcpStream;

/// The connection. The core runs until [`Debugger::halt`].
pub struct Debugger(emulator::Debugger);

impl Debugger {
    pub(super) fn new(stream: TcpStream) -> Self {
        Self(emulator::Debugger::new(stream))
    }

    /// Lets the core run.
    ///
    /// # Panics
    /// When the emulator has ended.
    pub fn go_on(&mut self) {
        self.0.resume().unwrap_or_else(|error| panic!("{error}"));
    }

    /// Halts the core.
    ///
    /// # Panics
    /// When it does not halt.
    pub fn halt(&mut self) {
        self.0.halt().unwrap_or_else(|error| panic!("{error}"));
    }

    /// The next instruction is the one there.
    ///
    /// # Panics
    /// When the register cannot be written.
    pub fn jump(&mut self, address: u32) {
        self.0.jump(address).unwrap_or_else(|error| panic!("{error}"));
    }
}
