//! Client of QEMU's debugging port.
//!
//! The protocol is GDB's remote serial protocol (the GDB manual, appendix E), of which a dozen packets are needed.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::time::Duration;

use crate::{ANSWER_LIMIT, Result};

/// Number of the program counter among the core's registers.
const PROGRAM_COUNTER: usize = 15;
/// The flags and the state of IT blocks, as the protocol numbers it, and the latter's bits.
const XPSR: usize = 25;
const IT_BLOCK: u32 = 0x0600_FC00;
/// Number of the first register of the FPU.
const FLOAT_REGISTERS: usize = 26;
/// Start of 8 bytes of RAM that no image uses: the end of the 128 KiB.
const SCRATCH: u32 = 0x2001_FFF0;

/// Registers of the core.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Registers {
    /// R0 to R15.
    pub r: [u32; 16],
    /// Flags, exception number, and how far an IT block is.
    pub xpsr: u32,
}

impl Registers {
    /// Address of the instruction that comes next.
    #[must_use]
    pub const fn pc(&self) -> u32 {
        self.r[PROGRAM_COUNTER]
    }

    /// Whether the condition of the IT block that the next instruction is in, if any, holds.
    #[must_use]
    pub fn executes(&self) -> bool {
        // Bits 7 to 2 of the block's state are bits 15 to 10 here, bits 1 and 0 are bits 26 and 25.
        let state = (self.xpsr >> 8 & 0xFC) | (self.xpsr >> 25 & 3);
        let flag = |bit: u32| self.xpsr >> bit & 1 != 0;
        let (n, z, c, v) = (flag(31), flag(30), flag(29), flag(28));
        if state & 0xF == 0 {
            return true;
        }
        let holds = match state >> 5 {
            0 => z,
            1 => c,
            2 => n,
            3 => v,
            4 => c && !z,
            5 => n == v,
            6 => n == v && !z,
            _ => return true,
        };
        holds != (state >> 4 & 1 != 0)
    }
}

/// A connection to the debugging port. Every method fails when QEMU ends, refuses, or does not answer within
/// [`ANSWER_LIMIT`].
#[derive(Debug)]
pub struct Debugger(BufReader<TcpStream>);

#[allow(clippy::missing_errors_doc, reason = "said once, of the type")]
impl Debugger {
    /// A client of this connection.
    #[must_use]
    pub fn new(port: TcpStream) -> Self {
        Self(BufReader::new(port))
    }

    /// Stops the core before it executes the instruction at `address`, from now on.
    pub fn add_breakpoint(&mut self, address: u32) -> Result {
        self.command(&format!("Z0,{address:x},2"))
    }

    /// Takes back [`Self::add_breakpoint`].
    pub fn remove_breakpoint(&mut self, address: u32) -> Result {
        self.command(&format!("z0,{address:x},2"))
    }

    /// Lets the core run, and does not wait for it.
    pub fn resume(&mut self) -> Result {
        // Answered only when the core stops.
        self.send("c")
    }

    /// Stops a running core wherever it is.
    pub fn halt(&mut self) -> Result {
        self.0.get_mut().write_all(&[3]).map_err(broken)?;
        self.stopped()
    }

    /// Runs to the next breakpoint.
    pub fn run(&mut self) -> Result<Registers> {
        self.resume()?;
        self.stopped()?;
        self.registers()
    }

    /// Runs to the next breakpoint; `None` where it has not come to one within `limit`, and stands somewhere then.
    pub fn run_within(&mut self, limit: Duration) -> Result<Option<Registers>> {
        self.resume()?;
        self.0.get_ref().set_read_timeout(Some(limit)).map_err(broken)?;
        // Nothing but the begin of the answer is looked at, behind the acknowledgment, so that none is torn.
        let came = loop {
            match self.0.fill_buf() {
                Ok([b'+', ..]) => self.0.consume(1),
                begin => break begin.is_ok(),
            }
        };
        self.0.get_ref().set_read_timeout(Some(ANSWER_LIMIT)).map_err(broken)?;
        if came {
            self.stopped()?;
            self.registers().map(Some)
        } else {
            self.halt().map(|()| None)
        }
    }

    /// Runs while `meanwhile` works, and then stops wherever it is.
    pub fn run_during<T>(&mut self, meanwhile: impl FnOnce() -> Result<T>) -> Result<T> {
        self.resume()?;
        let result = meanwhile();
        self.halt()?;
        result
    }

    /// Runs to `address`, where there need be no breakpoint.
    pub fn run_to(&mut self, address: u32) -> Result<Registers> {
        self.add_breakpoint(address)?;
        let registers = self.run();
        self.remove_breakpoint(address)?;
        registers.and_then(|registers| {
            if registers.pc() == address {
                Ok(registers)
            } else {
                Err(format!("the core stopped at {:#x}, not at {address:#x}", registers.pc()))
            }
        })
    }

    /// Executes one instruction. Interrupts wait.
    pub fn step(&mut self) -> Result<Registers> {
        self.send("s")?;
        self.stopped()?;
        self.registers()
    }

    /// All registers.
    pub fn registers(&mut self) -> Result<Registers> {
        let text = self.exchange("g")?;
        let mut words = hex_words(&text);
        let mut registers = Registers::default();
        for register in registers.r.iter_mut().chain([&mut registers.xpsr]) {
            *register = words.next().ok_or_else(|| format!("QEMU's registers are too few: {text}"))?;
        }
        Ok(registers)
    }

    /// Gives a register of the core a value.
    pub fn set_register(&mut self, index: usize, value: u32) -> Result {
        self.command(&format!("P{index:x}={:08x}", value.swap_bytes()))
    }

    /// Makes the instruction at `address` the next one.
    pub fn jump(&mut self, address: u32) -> Result {
        self.set_register(PROGRAM_COUNTER, address)
    }

    /// The word at an address of memory or of a peripheral.
    pub fn read(&mut self, address: u32) -> Result<u32> {
        let text = self.exchange(&format!("m{address:x},4"))?;
        hex_words(&text).next().ok_or_else(|| format!("QEMU cannot read {address:#x}: {text}"))
    }

    /// Sets words of RAM.
    pub fn set_words(&mut self, address: u32, words: &[u32]) -> Result {
        let digits: String = words.iter().map(|word| format!("{:08x}", word.swap_bytes())).collect();
        self.command(&format!("M{address:x},{:x}:{digits}", 4 * words.len()))
    }

    /// Gives a register of the FPU a value, as two registers of single precision: the first two make register 0.
    pub fn set_float_register(&mut self, index: usize, words: [u32; 2]) -> Result {
        let [low, high] = words.map(u32::swap_bytes);
        self.command(&format!("P{:x}={low:08x}{high:08x}", FLOAT_REGISTERS + index))
    }

    /// Stores a word to a peripheral. QEMU's own writes do not reach them, so the core stores it: with an instruction in
    /// unused RAM, after which everything is as before.
    pub fn store(&mut self, address: u32, value: u32) -> Result {
        let before = self.registers()?;
        // STR R1, [R0] and a branch to itself, which is not reached.
        self.command(&format!("M{SCRATCH:x},4:0160fee7"))?;
        let changed = [(0, address), (1, value), (PROGRAM_COUNTER, SCRATCH), (XPSR, before.xpsr & !IT_BLOCK)];
        for (index, value) in changed {
            self.set_register(index, value)?;
        }
        let after = self.step()?;
        for index in [0, 1, PROGRAM_COUNTER] {
            self.set_register(index, before.r[index])?;
        }
        self.set_register(XPSR, before.xpsr)?;
        if self.registers()? != before {
            return Err("QEMU does not take back the registers".to_owned());
        }
        if after.pc() == SCRATCH + 2 { Ok(()) } else { Err(format!("the store to {address:#x} did not happen")) }
    }

    fn command(&mut self, packet: &str) -> Result {
        let answer = self.exchange(packet)?;
        if answer == "OK" { Ok(()) } else { Err(format!("QEMU answers {packet} with {answer:?}")) }
    }

    fn exchange(&mut self, packet: &str) -> Result<String> {
        self.send(packet)?;
        self.receive()
    }

    /// Waits until the core stops: at a breakpoint, behind an instruction, or halted.
    fn stopped(&mut self) -> Result {
        let reason = self.receive()?;
        if reason.starts_with(['S', 'T']) { Ok(()) } else { Err(format!("the core does not stop: {reason:?}")) }
    }

    fn send(&mut self, packet: &str) -> Result {
        let sum = packet.bytes().fold(0, u8::wrapping_add);
        // In one piece, with the acknowledgment of the packet before: each part would wake the emulator up.
        self.0.get_mut().write_all(format!("+${packet}#{sum:02x}").as_bytes()).map_err(broken)
    }

    fn receive(&mut self) -> Result<String> {
        let mut bytes = Vec::new();
        // Acknowledgments come before the packet.
        self.0.read_until(b'$', &mut bytes).map_err(broken)?;
        bytes.clear();
        self.0.read_until(b'#', &mut bytes).map_err(broken)?;
        if bytes.pop() != Some(b'#') {
            return Err("the emulator has ended".to_owned());
        }
        // The checksum: the connection is one of this machine.
        self.0.read_exact(&mut [0; 2]).map_err(broken)?;
        String::from_utf8(bytes).map_err(|error| error.to_string())
    }
}

fn broken(error: std::io::Error) -> String {
    format!("the emulator's debugging port: {error}")
}

/// Words as they lie in memory, lowest byte first.
fn hex_words(text: &str) -> impl Iterator<Item = u32> {
    text.as_bytes().chunks_exact(8).map_while(|digits| {
        let digits = std::str::from_utf8(digits).ok()?;
        Some(u32::from_str_radix(digits, 16).ok()?.swap_bytes())
    })
}

#[cfg(test)]
mod tests {
    use super::{Registers, hex_words};

    #[test]
    fn registers_are_read_lowest_byte_first() {
        assert_eq!(hex_words("78563412efbeadde").collect::<Vec<_>>(), [0x1234_5678, 0xdead_beef]);
    }

    #[test]
    fn a_block_of_conditions_skips_what_does_not_hold() {
        let in_block = |state: u32, flags: u32| {
            let xpsr = flags << 28 | (state & 0xFC) << 8 | (state & 3) << 25;
            Registers { xpsr, ..Registers::default() }.executes()
        };
        assert!(in_block(0, 0), "outside of a block");
        let (n, z, c) = (8, 4, 2);
        assert!(in_block(0x08, z) && !in_block(0x08, 0), "EQ");
        assert!(in_block(0x18, 0) && !in_block(0x18, z), "NE");
        assert!(in_block(0x88, c) && !in_block(0x88, c | z), "HI");
        assert!(in_block(0xB8, n) && !in_block(0xB8, 0), "LT");
        assert!(in_block(0xE8, 0) && in_block(0xE8, n), "AL");
    }
}
