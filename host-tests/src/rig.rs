//! A whole controller without its hardware: `Server`, `Desk` and `Tick` of the library, with a flash in memory and a
//! line that the test holds both ends of. Time is what the test says: one call of [`Rig::tick`] is one control tick.

use std::cell::RefCell;
use std::rc::Rc;

use embedded_storage::nor_flash::{ErrorType, NorFlash, ReadNorFlash};
use rotorlead::capture::Signal;
use rotorlead::channel::Channel;
use rotorlead::controller::{
    Board, Counts, Desk, DeskQueues, Facts, Motor, MotorQueues, Server, Tick, channels, coefficients,
};
use rotorlead::link::{Clock, FRAME_BYTES, Message, Receiver, Refusal, Request, ResetReason, Tagged, encode};
use rotorlead::settings::{Loaded, MOTORS, Store, Validated};
use rotorlead::throttle::{Command, PulseScale};

use crate::flash::{Flash, FlashError};
use crate::line::TIMER_HZ;

/// Bytes of a sector: four saves to an erase.
pub const SECTOR: usize = 2048;

/// A flash that the test keeps a handle on.
#[derive(Clone)]
pub struct SharedFlash(Rc<RefCell<Flash<SECTOR>>>);

impl SharedFlash {
    /// Shares `flash`.
    #[must_use]
    pub fn new(flash: Flash<SECTOR>) -> Self {
        Self(Rc::new(RefCell::new(flash)))
    }

    /// A copy of it as it is now.
    #[must_use]
    pub fn copy(&self) -> Flash<SECTOR> {
        self.0.borrow().clone()
    }
}

impl ErrorType for SharedFlash {
    type Error = FlashError;
}

impl ReadNorFlash for SharedFlash {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FlashError> {
        self.0.borrow_mut().read(offset, bytes)
    }

    fn capacity(&self) -> usize {
        self.0.borrow().capacity()
    }
}

impl NorFlash for SharedFlash {
    const WRITE_SIZE: usize = Flash::<SECTOR>::WRITE_SIZE;
    const ERASE_SIZE: usize = SECTOR;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashError> {
        self.0.borrow_mut().erase(from, to)
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashError> {
        self.0.borrow_mut().write(offset, bytes)
    }
}

/// What stands in for the board.
pub struct Hardware {
    /// The control task's state.
    pub tick: Tick,
    /// What the board has counted.
    pub counts: Counts,
    /// Why it started.
    pub reset: ResetReason,
    /// What the inputs have in the ticks that fall between the question whether a save may be and its end.
    pub during_save: Vec<[Signal; MOTORS]>,
    /// What the outputs had in these ticks.
    pub outputs_during_save: Vec<[Command; MOTORS]>,
    /// Whether the timers refuse new settings.
    pub refuses: bool,
    /// `flash_stalls`, call by call.
    pub stalls: Vec<bool>,
}

impl Board for Hardware {
    fn tick<R>(&mut self, f: impl FnOnce(&mut Tick) -> R) -> R {
        f(&mut self.tick)
    }

    fn reconfigure(&mut self, settings: &Validated, channels: [Channel; MOTORS]) -> Result<(), Refusal> {
        if self.refuses {
            return Err(Refusal::Design);
        }
        self.tick.reconfigure(channels, scale(settings), settings.loop_rate_hz);
        Ok(())
    }

    fn flash_stalls(&mut self, stalls: bool) {
        self.stalls.push(stalls);
        if stalls {
            for signals in &self.during_save {
                self.outputs_during_save.push(self.tick.run(*signals, || 0));
            }
        }
    }

    fn facts(&mut self) -> Facts {
        Facts { clock: Clock::Crystal, core_hz: 168_000_000, timer_hz: TIMER_HZ, reset: self.reset }
    }

    fn counts(&mut self) -> Counts {
        self.counts
    }
}

fn scale(settings: &Validated) -> PulseScale {
    PulseScale::new(settings.input.protocol(), TIMER_HZ).expect("every protocol suits this timer")
}

/// See the [module](self).
pub struct Rig {
    /// The board.
    pub hardware: Hardware,
    server: Server<SharedFlash>,
    receiver: Receiver<Message>,
    scale: PulseScale,
    tag: u8,
    /// Bytes on their way to the controller.
    to_controller: std::collections::VecDeque<u8>,
    /// What was heard and not taken yet.
    pub inbox: Vec<Tagged<Message>>,
}

impl Rig {
    /// A controller with a blank flash, right after its start.
    #[must_use]
    pub fn new() -> Self {
        Self::starting_from(&SharedFlash::new(Flash::blank())).0
    }

    /// A controller that starts with what is in `flash`, and what it found there.
    ///
    /// # Panics
    /// Where settings were loaded that make no controller, which is a claim of the settings.
    #[must_use]
    pub fn starting_from(flash: &SharedFlash) -> (Self, Loaded) {
        let mut store = Store::new(flash.clone(), Flash::<SECTOR>::SECTORS);
        let loaded = store.load();
        let coefficients = coefficients(&loaded.settings).expect("valid settings can be designed");
        let channels = channels(&loaded.settings, coefficients).expect("valid settings make channels");
        // Queues live for the rest of the process, as on the board.
        let (mut injects, mut results) = (Vec::new(), Vec::new());
        let motors = channels.map(|channel| {
            let (to_inject, inject) = Box::leak(Box::new(heapless::spsc::Queue::new())).split();
            let (outputs, from_motor) = Box::leak(Box::new(heapless::spsc::Queue::new())).split();
            injects.push(to_inject);
            results.push(from_motor);
            Motor::new(channel, MotorQueues { inject, outputs })
        });
        let (recorded, samples) = Box::leak(Box::new(heapless::spsc::Queue::new())).split();
        let scale = scale(&loaded.settings);
        let tick = Tick::new(motors, scale, loaded.settings.loop_rate_hz, recorded);
        let inject = injects.try_into().unwrap_or_else(|_| unreachable!("one for each motor"));
        let outputs = results.try_into().unwrap_or_else(|_| unreachable!("one for each motor"));
        let queues = DeskQueues { inject, outputs, samples };
        let desk = Desk::new(loaded.settings.clone(), loaded.origin, coefficients, store, queues);
        let hardware = Hardware {
            tick,
            counts: Counts::default(),
            reset: ResetReason::PowerOn,
            during_save: Vec::new(),
            outputs_during_save: Vec::new(),
            refuses: false,
            stalls: Vec::new(),
        };
        let rig = Self {
            hardware,
            server: Server::new(desk),
            receiver: Receiver::new(),
            scale,
            tag: 0,
            to_controller: std::collections::VecDeque::new(),
            inbox: Vec::new(),
        };
        (rig, loaded)
    }

    /// A pulse that means `command`.
    #[must_use]
    pub fn pulse(&self, command: f64) -> Signal {
        let width_ticks = self.scale.to_ticks(Command::saturating_from_f64(command));
        Signal::Pulse { width_ticks, period_ticks: TIMER_HZ / 400 }
    }

    /// What that pulse is taken for: a pulse has whole timer ticks.
    #[must_use]
    pub fn heard(&self, command: f64) -> Command {
        self.scale.to_command(self.scale.to_ticks(Command::saturating_from_f64(command)))
    }

    /// One control tick with the same at every input.
    pub fn tick(&mut self, signal: Signal) -> [Command; MOTORS] {
        self.hardware.tick.run([signal; MOTORS], || 0)
    }

    /// One control tick with `signal` at motor 0 and nothing at the others, whose output is this.
    pub fn tick_one(&mut self, signal: Signal) -> Command {
        let mut signals = [Signal::Nothing; MOTORS];
        signals[0] = signal;
        self.hardware.tick.run(signals, || 0)[0]
    }

    /// Puts bytes on the line to the controller.
    pub fn write(&mut self, bytes: &[u8]) {
        self.to_controller.extend(bytes);
    }

    /// Sends a request without waiting, and gives its tag.
    ///
    /// # Panics
    /// Never: requests fit.
    pub fn send(&mut self, request: &Request) -> u8 {
        self.tag = self.tag.wrapping_add(1);
        let mut frame = [0; FRAME_BYTES];
        let length = encode(self.tag, request, &mut frame).expect("every request fits a frame");
        self.write(&frame[..length]);
        self.tag
    }

    /// Lets the controller's lowest priority run, and at most so many bytes go each way.
    pub fn serve(&mut self, mut bytes: usize) {
        let mut bytes_in = bytes;
        loop {
            while bytes > 0
                && let Some(byte) = self.server.next_byte()
            {
                bytes -= 1;
                self.inbox.extend(self.receiver.push(byte));
            }
            if bytes == 0 {
                return;
            }
            let before = self.to_controller.len();
            let line = &mut self.to_controller;
            let received = || {
                let byte = if bytes_in > 0 { line.pop_front() } else { None };
                bytes_in -= usize::from(byte.is_some());
                byte
            };
            self.server.turn(received, &mut self.hardware);
            match self.server.next_byte() {
                Some(byte) => {
                    bytes -= 1;
                    self.inbox.extend(self.receiver.push(byte));
                }
                // Nothing to say, and nothing was taken from the line.
                None if self.to_controller.len() == before => return,
                None => {}
            }
        }
    }

    /// Sends a request and serves until there is an answer, which must come without a tick.
    ///
    /// # Panics
    /// When it does not.
    pub fn ask(&mut self, request: &Request) -> Message {
        let tag = self.send(request);
        self.serve(usize::MAX);
        self.take(tag).unwrap_or_else(|| panic!("{request:?} was not answered"))
    }

    /// The answer with that tag, when it was heard. Records stay.
    pub fn take(&mut self, tag: u8) -> Option<Message> {
        let is_answer = |tagged: &Tagged<Message>| tagged.tag == tag && !matches!(tagged.message, Message::Record(_));
        let index = self.inbox.iter().position(is_answer)?;
        Some(self.inbox.remove(index).message)
    }
}

impl Default for Rig {
    fn default() -> Self {
        Self::new()
    }
}
