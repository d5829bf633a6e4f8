//! An RP2040 with its image, whose pins a test drives and reads with emulated time.
//!
//! Two emulators do the same run, so that an error of one shows: [`Emulator::Node`] is rp2040js, which has the PWM, the
//! watchdog, the UART, USB and the flash; [`Emulator::Native`] is the crate `rp2040-emu`, which has neither but was written by
//! others. What each lacks is said there.
//!
//! ```no_run
//! use emulator::rp2040::{Edge, Emulator, Run};
//!
//! let mut run = Run::new("firmware.elf", 125_000);
//! run.inputs = vec![Edge { cycle: 0, pin: 2, is_high: false }, Edge { cycle: 60_000, pin: 2, is_high: true }];
//! run.watch = vec![10];
//! let trace = Emulator::Node.run(&run)?;
//! assert!(trace.faults.is_empty());
//! # Ok::<(), emulator::rp2040::Error>(())
//! ```

mod error;
mod image;
mod live;
#[cfg(feature = "native")]
mod native;
mod node;
mod responder;
mod run;
mod signals;
mod trace;

pub use error::Error;
pub use live::Live;
pub use node::{NODE_PACKAGE, NPM_PACKAGE, OLDEST_NODE, VERSION, is_installed, node_version, package_folder};
pub use responder::{Conflict, Drive, Question, Release, Responder};
pub use run::{Analog, Bytes, Edge, Flash, Plug, PlugEvent, PowerCut, Region, Run, Write};
pub use signals::{frames, frames_of_idle_high, pulses, reply};
pub use trace::{Fault, Handler, Reset, Trace};

/// Cycles of the emulated clock in a second. Time runs at this rate from the first instruction on: the slower clocks of
/// the start are not modelled.
pub const CYCLES_PER_S: u64 = 125_000_000;

/// Pins of the chip.
pub const PINS: u8 = 30;

/// What executes the image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Emulator {
    /// npm's `rp2040js` in a process of node. PIO and PWM edges have the cycle that they have on the chip, but for what
    /// all share: inputs are seen without the two cycles of the synchronizer, and a pin that the core writes changes when
    /// the instruction starts. Peripherals do not stay in reset until the firmware ends it. The UART sends without delay. A host at the
    /// USB plug takes and sends a packet in 62.5 µs; it looks at their parity.
    Node,
    /// The crate `rp2040-emu` in this process. Pins change, and are seen, at the ends of instructions: up to 4 cycles
    /// late, 16 on entry to an exception. Has no PWM at the pins, no watchdog, no received bytes, no boot ROM, no
    /// interrupts from pins, and no nesting of interrupts. Ends at the first fault.
    #[cfg(feature = "native")]
    Native,
}

impl Emulator {
    /// Executes the image from its reset to the end of the run.
    ///
    /// # Errors
    /// When the image cannot be read, the emulator is not installed, or it does not have what the run needs. What the
    /// firmware does wrong is no error: see [`Trace::faults`].
    pub fn run(self, run: &Run) -> Result<Trace, Error> {
        run.check()?;
        if let Some(responder) = run.responders.iter().find(|responder| responder.answers.is_none()) {
            return Err(Error::Unanswered { pin: responder.pin });
        }
        let flash = image::flash(run)?;
        match self {
            Self::Node => node::run(run, &flash),
            #[cfg(feature = "native")]
            Self::Native => native::run(run, &flash),
        }
    }
}
