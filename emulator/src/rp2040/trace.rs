//! What came of a run.

use serde::Deserialize;

use super::{Conflict, Edge};

/// A reset by the watchdog or of the core alone, after which the image has started again. RAM, and the watchdog's scratch
/// registers and reason, outlive it; one of the core alone leaves all else as it was.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
pub struct Reset {
    /// When.
    pub cycle: u64,
    /// Whether the firmware asked for it, and not the time ran out.
    pub is_forced: bool,
}

/// What a core must not do: a breakpoint or an undefined instruction, an access to where nothing is, a call of the boot
/// ROM that cannot be served, an instruction fetched from a flash that is being written.
///
/// The core enters its handler of hard faults, as on the chip; where it was in it already, it locks up and says so.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
pub struct Fault {
    /// When.
    pub cycle: u64,
    /// Address of the instruction.
    pub pc: u32,
    /// What, in words for a person.
    pub what: String,
}

/// The handler of an exception.
///
/// A call lasts from the first of the 15 cycles of the exception's entry to the end of the instruction that returns; the
/// unstacking behind it is not modelled. The calls that interrupt it are subtracted: the sum over all handlers is the time that
/// the core spends in them. A call that has not returned at the end of the run is not counted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
pub struct Handler {
    /// Number of the exception: 15 is SysTick, 16 and up are the interrupts.
    pub exception: u32,
    /// When its first call began, counted or not.
    pub first_cycle: u64,
    /// Calls that began at [`super::Run::handlers_from`] or later.
    pub calls: u64,
    /// Cycles of these calls together.
    pub total_cycles: u64,
    /// Cycles of the longest of them.
    pub most_cycles: u64,
}

/// What came of a run.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
pub struct Trace {
    /// When the run ended.
    pub cycles: u64,
    /// Edges at the watched pins, in order: of what the chip drives, and of what the test and the pulls do while it does
    /// not. Every pin is low before its first.
    pub edges: Vec<Edge>,
    /// Where chip and world drove a pin at once, each time that it began.
    pub conflicts: Vec<Conflict>,
    /// Bytes that UART0 has sent.
    pub uart: Vec<u8>,
    /// Bytes that a host has read by USB.
    pub usb: Vec<u8>,
    /// When a host had set the device up.
    pub usb_set_ups: Vec<u64>,
    /// When the firmware left for the boot ROM's loader: no instruction of it comes behind.
    pub boot_loader: Option<u64>,
    /// Resets by the watchdog.
    pub resets: Vec<Reset>,
    /// What went wrong in the core.
    pub faults: Vec<Fault>,
    /// The handlers that were called, by their exceptions' numbers. Empty in [`super::Emulator::Native`].
    pub handlers: Vec<Handler>,
    /// The bytes of [`super::Run::memory`], one element for each of its regions.
    pub memory: Vec<Vec<u8>>,
    /// Calls of `flash_range_erase` and `flash_range_program`.
    pub flash_operations: u32,
    /// Whether power was lost.
    pub power_is_cut: bool,
    /// What the firmware used that the emulator does not have, and what a USB host complains of, each once.
    pub unmodelled: Vec<String>,
}

impl Trace {
    /// Edges of one pin.
    pub fn edges_on(&self, pin: u8) -> impl Iterator<Item = Edge> {
        self.edges.iter().copied().filter(move |edge| edge.pin == pin)
    }

    /// The handler of an exception; `None` where it was never called.
    #[must_use]
    pub fn handler(&self, exception: u32) -> Option<&Handler> {
        self.handlers.iter().find(|handler| handler.exception == exception)
    }
}
