//! What a run is: the image, and what the world outside does to the chip.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use super::{Error, PINS, Release, Responder};

/// A change of the level at a pin.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Edge {
    /// When, in cycles of 125 MHz since the core was started.
    pub cycle: u64,
    /// Number of the GPIO.
    pub pin: u8,
    /// The level from then on.
    pub is_high: bool,
}

/// Bytes in flash.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Flash {
    /// Where the first is, from the start of the flash.
    pub offset: u32,
    /// The bytes.
    pub bytes: Vec<u8>,
}

/// Bytes that are sent to UART0, one after the other at the speed that the firmware has set, or by USB.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Bytes {
    /// When the first start bit or packet comes; behind bytes that are still on the line if need be.
    pub cycle: u64,
    /// The bytes.
    pub bytes: Vec<u8>,
}

/// What becomes of the USB plug.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Plug {
    /// When.
    pub cycle: u64,
    /// What.
    pub what: PlugEvent,
}

/// What may become of the USB plug. A host sets the device up when it is plugged in, and reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum PlugEvent {
    /// Plugged into a host.
    Plugged,
    /// The same, on a bus that is never quiet, so that erratum E5 of the chip shows.
    PluggedIntoNoisyHub,
    /// Unplugged.
    Unplugged,
    /// The host sleeps: no packet goes either way.
    Suspended,
    /// It wakes up.
    Resumed,
    /// The host goes on sending, and reads nothing.
    Deaf,
    /// It reads again.
    Reading,
}

/// A voltage at an input of the converter, as the count that a conversion gives.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Analog {
    /// From when on.
    pub cycle: u64,
    /// Number of the input: 0 is GPIO 26.
    pub input: u8,
    /// The count, 12 bits.
    pub count: u16,
}

/// A word that is put into memory, or a register of a peripheral.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Write {
    /// When.
    pub cycle: u64,
    /// Where: a multiple of 4.
    pub address: u32,
    /// The word.
    pub value: u32,
}

/// Bytes of RAM or flash.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Region {
    /// Where the first is. Flash starts at 0x1000_0000.
    pub address: u32,
    /// How many there are.
    pub length: u32,
}

/// A loss of power while the flash is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct PowerCut {
    /// In which call of `flash_range_erase` or `flash_range_program`, from 0.
    pub operation: u32,
    /// How many bytes of it are done by then.
    pub bytes: u32,
}

/// An image, and what happens to the chip that executes it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Run {
    /// The image, an ELF file.
    #[serde(skip)]
    pub image: PathBuf,
    /// What is in flash beside the image, or instead of parts of it. Everything else of the flash is erased.
    #[serde(skip)]
    pub flash: Vec<Flash>,
    /// Edges that are driven into pins, in any order. Edges at cycle 0 are levels at the start. A pin is driven from its
    /// first edge on, except while the chip drives it; before that its pull decides.
    pub inputs: Vec<Edge>,
    /// Voltages at the converter, which are 0 before.
    pub analog: Vec<Analog>,
    /// Ends of this, each up to the pin's next edge.
    pub releases: Vec<Release>,
    /// What answers on lines of the chip.
    pub responders: Vec<Responder>,
    /// Bytes that UART0 receives.
    pub uart_in: Vec<Bytes>,
    /// Bytes that a host sends by USB, once it has set the device up.
    pub usb_in: Vec<Bytes>,
    /// What becomes of the USB plug, which is open at first.
    pub plug: Vec<Plug>,
    /// Words that are put into memory.
    pub writes: Vec<Write>,
    /// The pins whose edges are traced.
    pub watch: Vec<u8>,
    /// The cycle from which on calls of exception handlers are counted: [`super::Trace::handlers`].
    pub handlers_from: u64,
    /// What is read when the run has ended.
    pub memory: Vec<Region>,
    /// Whether a debugger is attached that halts the core at the breakpoint by which the firmware finds out. Without one that is a
    /// fault which is none of [`super::Trace::faults`].
    pub is_debugged: bool,
    /// A loss of power, which ends the run.
    pub power_cut: Option<PowerCut>,
    /// When the run ends, give or take an instruction.
    pub until_cycle: u64,
}

impl Run {
    /// A run in which nothing happens from outside.
    #[must_use]
    pub fn new(image: impl Into<PathBuf>, until_cycle: u64) -> Self {
        Self {
            image: image.into(),
            flash: Vec::new(),
            inputs: Vec::new(),
            analog: Vec::new(),
            releases: Vec::new(),
            responders: Vec::new(),
            uart_in: Vec::new(),
            usb_in: Vec::new(),
            plug: Vec::new(),
            writes: Vec::new(),
            watch: Vec::new(),
            handlers_from: 0,
            memory: Vec::new(),
            is_debugged: false,
            power_cut: None,
            until_cycle,
        }
    }

    /// An error that names a pin that the chip does not have.
    pub(super) fn check(&self) -> Result<(), Error> {
        let pins = self.inputs.iter().map(|edge| edge.pin).chain(self.watch.iter().copied());
        let pins = pins.chain(self.releases.iter().map(|release| release.pin));
        let mut pins = pins.chain(self.responders.iter().map(|responder| responder.pin));
        pins.find(|pin| *pin >= PINS).map_or(Ok(()), |pin| Err(Error::Pin { pin }))
    }
}
