//! A stopped emulator, whose core is measured one instruction at a time.

use std::net::TcpStream;
use std::path::Path;

use emulator::{Debugger, Listener, Pace, Process, Qemu};

use crate::emulator::EMULATED;
use crate::run::Result;
use crate::setup;

/// The emulator's parts.
pub struct Machine {
    /// The client of its debugging port.
    pub debugger: Debugger,
    /// The host's end of the link.
    pub link: TcpStream,
    /// Its process, which ends when this is dropped.
    pub qemu: Process,
}

impl Machine {
    /// Loads an image; the core stands at its first instruction.
    pub fn start(image: &Path) -> Result<Self> {
        setup::emulator()?;
        let (link, debugger) = (Listener::new()?, Listener::new()?);
        let qemu = Qemu::new(EMULATED, image, Pace::RealTime);
        let mut qemu = qemu.connect_link(&link).connect_debugger(&debugger).halted().start()?;
        let (link, debugger) = (link.accept(&mut qemu)?, debugger.accept(&mut qemu)?);
        Ok(Self { debugger: Debugger::new(debugger), link, qemu })
    }
}
