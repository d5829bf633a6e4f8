//! The four state machines of a PIO block, which run one program side by side.

use pio::Program;
use rotorlead::settings::MOTORS;
use rp2040_hal::pac::pio0::RegisterBlock;
use rp2040_hal::pac::{PIO0, PIO1};

/// The clock of a machine: the core's over this, in 1/256.
#[derive(Clone, Copy)]
pub struct Divider(u32);

impl Divider {
    /// The core's clock.
    pub const ONE: Self = Self(256);

    /// The nearest to `core_hz` over `rate_hz`, from 1 to 2^16.
    pub const fn of(core_hz: u32, rate_hz: u32) -> Self {
        let parts = (core_hz as u64 * 256 + rate_hz as u64 / 2) / rate_hz as u64;
        Self(if parts < 256 { 256 } else { parts as u32 })
    }

    /// The highest whole one that is not slower than `rate_hz`: every cycle has the same length.
    pub const fn whole(core_hz: u32, rate_hz: u32) -> Self {
        let whole = core_hz / rate_hz;
        Self(if whole == 0 { 256 } else { whole * 256 })
    }
}

/// What a machine does with its pin, and what its queues hold.
#[derive(Clone, Copy)]
pub enum Direction {
    /// Bits come in, and words go out to a queue of 8.
    In,
    /// Words come from a queue of 8, and bits go out, 16 of a word, the highest first. The pin is an output, and side-set.
    Out,
    /// Both ways, with two queues of 4. The program turns the pin round, which is an input at first, and would be high. A word
    /// that comes from the queue is used up when so many of its bits have gone out, and one that is collected goes to the queue
    /// by itself with so many bits, if it does at all.
    Both {
        /// Bits of a word that go out.
        out: u32,
        /// Bits of a word that has come in.
        collected: Option<u32>,
    },
}

/// Which of the two blocks.
#[derive(Clone, Copy)]
pub enum Block {
    /// PIO0.
    Inputs,
    /// PIO1.
    Outputs,
}

/// The four machines of a block. Every motor has the machine of its number.
pub struct StateMachines(Block);

/// Bits of all machines in the control register: run, restart, restart the divider.
const ALL: u32 = (1 << MOTORS) - 1;
const RESTART: u32 = ALL << 4;
const RESTART_DIVIDERS: u32 = ALL << 8;
/// In the registers of the queues: one bit of each machine.
const RECEIVE_EMPTY: u32 = ALL << 8;

/// Instructions for a machine that stands (RP2040 datasheet, 3.4): `set pins, 1`, `set pindirs`, `mov x, null` and `mov osr, null`.
const SET_PIN_HIGH: u32 = 0xE001;
const SET_INPUT: u32 = 0xE080;
const SET_OUTPUT: u32 = 0xE081;
const CLEAR_X: u32 = 0xA023;
const CLEAR_OSR: u32 = 0xA0E3;

impl StateMachines {
    /// Of a block that is out of reset.
    pub const fn of(block: Block) -> Self {
        Self(block)
    }

    #[allow(unsafe_code)]
    #[inline]
    fn registers(&self) -> &RegisterBlock {
        let block = match self.0 {
            Block::Inputs => PIO0::ptr(),
            Block::Outputs => PIO1::ptr(),
        };
        // SAFETY: the addresses are those of the two blocks, whose registers are alike.
        unsafe { &*block }
    }

    /// Stops the machines, and lets each begin the program anew with its pin, which for the first motor is `first_pin`. Queues are
    /// empty.
    #[allow(unsafe_code)]
    pub fn load(&self, program: &Program<32>, divider: Divider, direction: Direction, first_pin: u8) {
        self.stop();
        let block = self.registers();
        for (place, instruction) in block.instr_mem_iter().zip(&program.code) {
            // SAFETY: any instruction is one.
            place.write(|w| unsafe { w.bits(u32::from(*instruction)) });
        }
        for (machine, pin) in block.sm_iter().zip(u32::from(first_pin)..) {
            let wrap = u32::from(program.wrap.source) << 12 | u32::from(program.wrap.target) << 7;
            // Words are shifted to the left. Bits 31 and 30 join the queues, bit 16 lets collected words go by themselves. Bit 19 lets
            // what goes out go to the right: the program that stamps edges keeps its level in the lowest bit.
            let (shift, pins, turn): (u32, u32, &[u32]) = match direction {
                Direction::In => (1 << 31 | 1 << 19, pin << 15, &[SET_INPUT]),
                Direction::Out => (1 << 30 | 16 << 25, 1 << 29 | pin << 10, &[SET_OUTPUT]),
                Direction::Both { out, collected } => {
                    let collects = collected.map_or(0, |bits| bits << 20 | 1 << 16);
                    let turn = &[SET_PIN_HIGH, SET_INPUT, CLEAR_X, CLEAR_OSR];
                    (out << 25 | collects, 1 << 20 | pin << 15 | pin, turn)
                }
            };
            // SAFETY: fields as the datasheet has them (RP2040, 3.7).
            unsafe {
                machine.sm_clkdiv().write(|w| w.bits(divider.0 << 8));
                // `mov y, status` is all ones where no word waits to go out.
                machine.sm_execctrl().write(|w| w.bits(pin << 24 | wrap | 1));
                // Each change of the joining empties the queues.
                machine.sm_shiftctrl().write(|w| w.bits(1 << 31));
                machine.sm_shiftctrl().write(|w| w.bits(1 << 30));
                machine.sm_shiftctrl().write(|w| w.bits(shift));
                // One pin can be set.
                machine.sm_pinctrl().write(|w| w.bits(pins | 1 << 26 | pin << 5));
                for instruction in turn {
                    machine.sm_instr().write(|w| w.bits(*instruction));
                }
                // `jmp 0`.
                machine.sm_instr().write(|w| w.bits(0));
            }
        }
        self.forget_losses();
    }

    /// Lets all run, and with the same phase.
    #[allow(unsafe_code)]
    pub fn start(&self) {
        // SAFETY: as above.
        self.registers().ctrl().write(|w| unsafe { w.bits(ALL | RESTART_DIVIDERS) });
    }

    /// Halts all, and forgets what they waited for: an instruction that is given to them must not wait for a delay that is left.
    #[allow(unsafe_code)]
    pub fn stop(&self) {
        // SAFETY: as above.
        self.registers().ctrl().write(|w| unsafe { w.bits(RESTART) });
    }

    /// Whether no machine has a word.
    #[inline]
    pub fn are_empty(&self) -> bool {
        self.registers().fstat().read().bits() & RECEIVE_EMPTY == RECEIVE_EMPTY
    }

    /// The two oldest words of a machine.
    #[inline]
    pub fn pop_two(&self, motor: usize) -> Option<(u32, u32)> {
        let has_two = self.registers().flevel().read().bits() >> (8 * motor + 4) & 0xf >= 2;
        if motor >= MOTORS || !has_two {
            return None;
        }
        let queue = self.registers().rxf(motor);
        Some((queue.read().bits(), queue.read().bits()))
    }

    /// The oldest word of a machine.
    #[inline]
    pub fn pop(&self, motor: usize) -> Option<u32> {
        let is_empty = self.registers().fstat().read().bits() & 1 << (8 + motor) != 0;
        (motor < MOTORS && !is_empty).then(|| self.registers().rxf(motor).read().bits())
    }

    /// Words that wait to go out.
    #[inline]
    pub fn waiting(&self, motor: usize) -> u32 {
        self.registers().flevel().read().bits() >> (8 * motor) & 0xf
    }

    /// A word that is to go out. There is room.
    #[allow(unsafe_code)]
    #[inline]
    pub fn push(&self, motor: usize, word: u32) {
        if motor < MOTORS {
            // SAFETY: any bits are a word.
            self.registers().txf(motor).write(|w| unsafe { w.bits(word) });
        }
    }

    /// Whether a word found the queue full since the last time that this was asked.
    #[allow(unsafe_code)]
    #[inline]
    pub fn take_overflow_flag(&self, motor: usize) -> bool {
        let flag = 1 << motor;
        let take_overflow_flag = self.registers().fdebug().read().bits() & flag != 0;
        if take_overflow_flag {
            // SAFETY: a one clears its flag.
            self.registers().fdebug().write(|w| unsafe { w.bits(flag) });
        }
        take_overflow_flag
    }

    #[allow(unsafe_code)]
    fn forget_losses(&self) {
        // SAFETY: as above.
        self.registers().fdebug().write(|w| unsafe { w.bits(ALL) });
    }
}
