//! A whole controller on a board in memory: the library's own start, server, request handler and tick, with a line that the
//! test holds both ends of. Time is what the test says: one call of [`Rig::tick`] is one control tick.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;

use embedded_storage::nor_flash::{ErrorType, NorFlash, ReadNorFlash};
use rotorlead::capture::Signal;
use rotorlead::channel::{COMMANDS_TO_ARM, Channel};
use rotorlead::controller::{BoardFacts, ControlAccess, Counts, FrameRates, ResumeSource, Server, Tick};
use rotorlead::link::{FRAME_BYTES, Foreign, Message, Receiver, Refusal, Request, Sensed, Tagged, encode};
use rotorlead::settings::{MOTORS, Origin, Settings, Store, Validated};
use rotorlead::throttle::{Command, EscCommand, PulseScale};

use crate::board::{CRYSTAL, TestBoard, facts};
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

/// The board, and what a test wants to happen at it.
pub struct Hardware {
    /// The board.
    pub board: TestBoard,
    /// What the inputs have in the ticks that fall between the question whether a save may be and its end.
    pub during_save: Vec<[Signal; MOTORS]>,
    /// What the outputs had in these ticks.
    pub outputs_during_save: Vec<[EscCommand; MOTORS]>,
    /// Whether the watchdog was patient in these ticks.
    pub patient_during_save: Vec<bool>,
    /// What the inputs have in the ticks that come as soon as the lowest priority lets go of the control task's state: for
    /// the first time from now on, the second, and so on.
    pub after_locks: VecDeque<Vec<[Signal; MOTORS]>>,
    /// What the outputs had in these ticks.
    pub outputs_after_locks: Vec<[EscCommand; MOTORS]>,
    /// What the inputs have in the ticks that fall between the check of a request and what it starts.
    pub during_check: Vec<[Signal; MOTORS]>,
    /// Whether the timers refuse new settings.
    pub refuses: bool,
    /// `flash_stalls`, call by call.
    pub stalls: Vec<bool>,
}

impl Hardware {
    /// The control task's state.
    pub const fn tick_mut(&mut self) -> &mut Tick {
        self.board.tick_mut()
    }

    /// One control tick.
    pub fn run(&mut self, signals: [Signal; MOTORS]) -> [EscCommand; MOTORS] {
        self.tick_mut().run(signals.map(Into::into), |_| Sensed::adc(0))
    }
}

impl ControlAccess for Hardware {
    fn tick<R>(&mut self, f: impl FnOnce(&mut Tick) -> R) -> R {
        let result = self.board.tick(f);
        for signals in self.after_locks.pop_front().unwrap_or_default() {
            let outputs = self.run(signals);
            self.outputs_after_locks.push(outputs);
        }
        result
    }

    fn reconfigure(&mut self, settings: &Validated, channels: [Channel; MOTORS]) -> Result<(), Refusal> {
        if self.refuses {
            return Err(Refusal::Design);
        }
        self.board.reconfigure(settings, channels)
    }

    fn flash_stalls(&mut self, stalls: bool) {
        self.stalls.push(stalls);
        self.board.flash_stalls(stalls);
        if stalls {
            for signals in self.during_save.clone() {
                let outputs = self.run(signals);
                self.outputs_during_save.push(outputs);
                self.patient_during_save.push(self.board.control.parts_mut().watchdog.patient);
            }
        }
    }

    fn facts(&mut self) -> BoardFacts {
        for signals in std::mem::take(&mut self.during_check) {
            self.run(signals);
        }
        self.board.facts()
    }

    fn counts(&mut self) -> Counts {
        self.board.counts()
    }

    fn frame_rates(&mut self, loop_rate_hz: u32) -> [FrameRates; MOTORS] {
        self.board.frame_rates(loop_rate_hz)
    }

    fn is_bench_enabled(&mut self) -> bool {
        self.board.is_bench_enabled()
    }
}

fn scale(settings: &Settings) -> PulseScale {
    settings.input.scale(TIMER_HZ).expect("every protocol suits this timer")
}

/// A flash in which these settings were saved.
///
/// # Panics
/// When a flash without faults takes none.
#[must_use]
pub fn saved(settings: &Validated) -> SharedFlash {
    let flash = SharedFlash::new(Flash::blank());
    Store::new(flash.clone(), Flash::<SECTOR>::SECTORS).save(settings).expect("a flash without faults");
    flash
}

/// See the [module](self).
pub struct Rig {
    /// The board.
    pub hardware: Hardware,
    server: Server<SharedFlash, 2>,
    /// The wire that the host is at.
    pub wire: usize,
    /// Bytes that went to the other one.
    pub elsewhere: usize,
    receiver: Receiver<Message>,
    scale: PulseScale,
    tag: u8,
    /// Bytes on their way to the controller.
    to_controller: VecDeque<u8>,
    /// What was received and not taken yet.
    pub inbox: Vec<Tagged<Message>>,
}

impl Rig {
    /// A controller in whose flash somebody has saved the defaults, with the jumper fitted, right after its start.
    #[must_use]
    pub fn new() -> Self {
        Self::with(Settings::default())
    }

    /// The same with these settings.
    ///
    /// # Panics
    /// When they are not valid.
    #[must_use]
    pub fn with(settings: Settings) -> Self {
        Self::starting_from(&saved(&settings.validate().expect("valid settings"))).0
    }

    /// A controller that starts with what is in `flash`, and what it found there.
    #[must_use]
    pub fn starting_from(flash: &SharedFlash) -> (Self, Origin) {
        Self::starting_on(flash, facts(CRYSTAL))
    }

    /// The same on another board.
    #[must_use]
    pub fn starting_on(flash: &SharedFlash, facts: BoardFacts) -> (Self, Origin) {
        Self::after_reset(flash, facts, None)
    }

    /// The same with memory that has survived a reset.
    #[must_use]
    pub fn after_reset(flash: &SharedFlash, facts: BoardFacts, resume_from: Option<ResumeSource>) -> (Self, Origin) {
        let store = Store::new(flash.clone(), Flash::<SECTOR>::SECTORS);
        let (board, handler, origin) = TestBoard::start_after_reset(store, facts, resume_from);
        let scale = scale(handler.settings());
        let hardware = Hardware {
            board,
            during_save: Vec::new(),
            outputs_during_save: Vec::new(),
            patient_during_save: Vec::new(),
            after_locks: VecDeque::new(),
            outputs_after_locks: Vec::new(),
            during_check: Vec::new(),
            refuses: false,
            stalls: Vec::new(),
        };
        let rig = Self {
            hardware,
            server: Server::new(handler),
            wire: 0,
            elsewhere: 0,
            receiver: Receiver::new(),
            scale,
            tag: 0,
            to_controller: VecDeque::new(),
            inbox: Vec::new(),
        };
        (rig, origin)
    }

    /// From now on pulses mean what they mean with these settings.
    pub fn set_pulses(&mut self, settings: &Settings) {
        self.scale = scale(settings);
    }

    /// A pulse that means `command`.
    #[must_use]
    pub fn pulse(&self, command: f64) -> Signal {
        let width_ticks = self.scale.to_ticks(Command::saturating_from_f64(command));
        Signal::Pulse { width_ticks, period_ticks: TIMER_HZ / 400 }
    }

    /// What that pulse is taken for: a pulse has whole timer ticks.
    #[must_use]
    pub fn as_measured(&self, command: f64) -> Command {
        self.scale.to_command(self.scale.to_ticks(Command::saturating_from_f64(command)))
    }

    /// One control tick with the same at every input.
    pub fn tick(&mut self, signal: Signal) -> [EscCommand; MOTORS] {
        self.hardware.run([signal; MOTORS])
    }

    /// One control tick with `signal` at motor 0 and nothing at the others, whose output is this.
    pub fn tick_one(&mut self, signal: Signal) -> EscCommand {
        let mut signals = [Signal::Nothing; MOTORS];
        signals[0] = signal;
        self.hardware.run(signals)[0]
    }

    /// The control ticks that arm motor 0 with `signal`, and nothing at the others: the last output.
    pub fn arm_one(&mut self, signal: Signal) -> EscCommand {
        let mut signals = [Signal::Nothing; MOTORS];
        signals[0] = signal;
        self.arm(signals)[0]
    }

    /// The control ticks that arm what is disarmed with these: the last outputs.
    pub fn arm(&mut self, signals: [Signal; MOTORS]) -> [EscCommand; MOTORS] {
        for _ in 1..COMMANDS_TO_ARM {
            self.hardware.run(signals);
        }
        self.hardware.run(signals)
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
                self.receive(byte);
            }
            if bytes == 0 {
                return;
            }
            let before = self.to_controller.len();
            let (line, wire) = (&mut self.to_controller, self.wire);
            let received = |at| {
                let byte = if bytes_in > 0 && at == wire { line.pop_front() } else { None };
                bytes_in -= usize::from(byte.is_some());
                byte
            };
            self.server.poll(received, &mut self.hardware);
            match self.server.next_byte() {
                Some(byte) => {
                    bytes -= 1;
                    self.receive(byte);
                }
                // Nothing to say, and nothing was taken from the line.
                None if self.to_controller.len() == before => return,
                None => {}
            }
        }
    }

    fn receive(&mut self, byte: u8) {
        if self.server.written_to() == self.wire {
            self.inbox.extend(self.receiver.push(byte));
        } else {
            self.elsewhere += 1;
        }
    }

    /// Whether the board is to call its boot loader.
    #[must_use]
    pub const fn is_leaving(&self) -> bool {
        self.server.is_leaving()
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

    /// What the controller said in another version than ours since the last call: a notice, if anything.
    pub const fn take_foreign(&mut self) -> Option<Foreign> {
        self.receiver.take_foreign()
    }

    /// The answer with that tag, when it was received. Records stay.
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
