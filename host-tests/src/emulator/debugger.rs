//! As much of GDB's remote protocol as it takes to lead the core astray.

use std::io::{Read, Write};
use std::net::TcpStream;

/// Number of the program counter among the core's registers.
const PROGRAM_COUNTER: u8 = 15;

/// The connection. The core stands still from its begin on, and after [`Debugger::halt`].
pub struct Debugger(TcpStream);

impl Debugger {
    pub(super) fn new(stream: TcpStream) -> Self {
        Self(stream)
    }

    /// Lets the core run.
    pub fn go_on(&mut self) {
        // Answered only when it halts.
        self.send("c");
    }

    /// Halts the core.
    ///
    /// # Panics
    /// When it does not halt.
    pub fn halt(&mut self) {
        self.0.write_all(&[3]).expect("the emulator runs");
        let reason = self.receive();
        assert!(reason.starts_with('T') || reason.starts_with('S'), "{reason}");
    }

    /// The next instruction is the one there.
    ///
    /// # Panics
    /// When the register cannot be written.
    pub fn jump(&mut self, address: u32) {
        self.send(&format!("P{PROGRAM_COUNTER:x}={:08x}", address.swap_bytes()));
        assert_eq!(self.receive(), "OK");
    }

    fn send(&mut self, packet: &str) {
        let sum = packet.bytes().fold(0_u8, u8::wrapping_add);
        write!(self.0, "${packet}#{sum:02x}").expect("the emulator runs");
        let mut acknowledged = [0];
        self.0.read_exact(&mut acknowledged).expect("the debugger answers");
        assert_eq!(acknowledged, *b"+");
    }

    fn receive(&mut self) -> String {
        let mut packet = Vec::new();
        let mut byte = [0];
        let mut read = |byte: &mut [u8; 1]| self.0.read_exact(byte).expect("the debugger answers");
        while byte != *b"$" {
            read(&mut byte);
        }
        loop {
            read(&mut byte);
            if byte == *b"#" {
                break;
            }
            packet.push(byte[0]);
        }
        // The checksum: the connection is one of this machine.
        read(&mut byte);
        read(&mut byte);
        self.0.write_all(b"+").expect("the emulator runs");
        String::from_utf8(packet).expect("text")
    }
}
