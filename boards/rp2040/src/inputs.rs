//! The inputs: a machine of PIO0 for each, which stamps edges or collects the bits of DShot.
//!
//! With pulses all four count together, at the core's clock over [`COUNT_CYCLES`], from the beginning of a microsecond of the timer
//! on, so that the timer says what their count is now. A stamp holds 31 bits of it and the level after the edge. A machine's queue
//! holds 8 stamps or words; one that finds it full is lost, and raises a flag.
//!
//! **Debounce.** An edge is stamped when the line has had its new level in [`SETTLED_SAMPLES`] samples behind the first one. They
//! come every 10 cycles, the first of them 13 cycles after that, so the shortest level with a stamp lasts 13 + 25 * 10 = 263 cycles,
//! 2.1 µs, and 5 + 1 cycles more always suffice: the 2 µs of a glitch, and what a slow edge may add to a level. 32 samples in a row (2.56 µs) with the old level end the attempt: a spike that comes
//! before or after an edge moves that edge by its own length at most, and the samples of short levels that follow one another more
//! closely add up, so that frames of DShot leave stamps and are not taken for an open line.
//! Rise and fall take the same number of cycles, so no width is changed by the delay; it is taken off the stamps.

use core::sync::atomic::{AtomicU32, Ordering};

use pio::{Program, pio_asm};
use rotorlead::capture::Listening;
use rotorlead::controller::hardware::{CaptureTimer, Edge, InputFrameHardware};
use rotorlead::dshot::{Line, Offer, REPLY_BITS, Word};
use rotorlead::settings::MOTORS;
use rotorlead_rp2040::generated::INPUT_1;
use rp2040_hal::pac::TIMER;
use rp2040_hal::pac::io_bank0::gpio::gpio_ctrl::FUNCSEL_A;

use crate::clocks::{CORE_HZ, COUNT_CYCLES};
use crate::pins::{Pins, Pull};
use crate::state_machines::{Block, Direction, Divider, StateMachines};

/// Samples with the new level that an edge needs behind the first one: one more than the program loads.
const SETTLED_SAMPLES: u32 = 26;
/// From an edge to its stamp: two counts for each of these samples.
const DEBOUNCE_COUNTS: u32 = 2 * SETTLED_SAMPLES;
/// Stamps that a queue holds.
pub const EDGE_FIFO_DEPTH: u8 = 8;
/// Counts in a microsecond.
const COUNTS_PER_US: u32 = CORE_HZ / COUNT_CYCLES / 1_000_000;
/// The machines start so many counts after a microsecond's beginning at most: the loop that waits for it takes 10 cycles, and the
/// start 20.
const START_COUNTS: u32 = 30 / COUNT_CYCLES;
/// Reads of the timer, of 5 cycles at least, within which a microsecond begins.
const READS_PER_US: u32 = CORE_HZ / 1_000_000 / 5 + 1;
/// Cycles of a machine in a bit of DShot, as the program has them.
const BIT_CYCLES: u32 = 32;
/// The same where frames are answered: 32 in a bit of the reply.
const ANSWERED_BIT_CYCLES: u32 = 40;
/// From the end of a frame to its reply, microseconds: what ESCs do.
const REPLY_DELAY_US: u32 = 30;
/// Cycles of that delay in which the program does not count, 30 to 37 of them: up to the gap's end, and from there to the reply.
const UNCOUNTED_CYCLES: u32 = 34;
/// Bits of a word that count the delay, in turns of 2 cycles.
const DELAY_BITS: u32 = 10;

/// The timer's microsecond from which the stamps count.
static STARTED_US: AtomicU32 = AtomicU32::new(0);

/// Counts down, one in 5 cycles on every path. At rest it takes a sample every 5 cycles, and after one with the other level every 10:
/// `y` counts those that are still needed, and `osr` how many with the old level came in a row. `osr` is all ones in an attempt to rise,
/// of which 31 shifts leave the lowest, and zero in one to fall: that is the level of the stamp, and says where to go on.
fn stamps() -> Program<32> {
    pio_asm!(
        "    mov x, !null",
        "rise:",
        "    set y, 25 [1]",
        "more_high:",
        "    mov osr, !null",
        "rising:",
        "    jmp x-- rising_half",
        "rising_half:",
        "    jmp x-- rising_pin [4]",
        "rising_pin:",
        "    jmp pin is_high",
        "    out null, 1",
        "    jmp !osre rising [1]",
        "    jmp x-- low [1]",
        ".wrap_target",
        "low:",
        "    jmp x-- low_pin",
        "low_pin:",
        "    jmp pin rise [3]",
        ".wrap",
        "is_high:",
        "    jmp y-- more_high [1]",
        "stamp:",
        "    in x, 31",
        "    in osr, 1",
        "    push noblock",
        "    jmp x-- stamped",
        "stamped:",
        "    jmp x-- turn",
        "turn:",
        "    mov y, osr",
        "    jmp !y low [1]",
        "high:",
        "    jmp x-- high_pin",
        "high_pin:",
        "    jmp pin high [3]",
        "    set y, 25",
        "more_low:",
        "    mov osr, null",
        "falling:",
        "    jmp x-- falling_half",
        "falling_half:",
        "    jmp x-- falling_pin [5]",
        "falling_pin:",
        "    jmp pin no_fall",
        "    jmp y-- more_low",
        "    jmp stamp",
        "no_fall:",
        "    out null, 1",
        "    jmp !osre falling",
        "    jmp x-- still_high",
        "still_high:",
        "    jmp high [1]",
    )
    .program
}

/// Collects the bits of a frame: from each rise to the middle between the ends of a zero's pulse and a one's, 3/8 and 6/8 of a bit,
/// and takes the level. A line that stays low for about a bit ends a word: within a frame no low is as long, and within one of half
/// the speed that of every zero is longer. One that stays high for 2.5 bits ends it, too, so that a line that idles high says
/// something: within a frame of half the speed no high is as long. The word has a one before its bits.
fn words() -> Program<32> {
    pio_asm!(
        "    set y, 1",
        ".wrap_target",
        "begin:",
        "    mov isr, y",
        "    wait 1 pin 0",
        "bit:",
        "    nop [15]",
        "    in pins, 1",
        "    set x, 30",
        "high:",
        "    jmp pin no_fall",
        "    set x, 12",
        "low:",
        "    jmp pin bit",
        "    jmp x-- low",
        "    jmp ended",
        "no_fall:",
        "    jmp x-- high",
        "    push noblock",
        "    wait 0 pin 0",
        "    jmp begin",
        "ended:",
        "    push noblock",
        ".wrap",
    )
    .program
}

/// As [`words`], for a line that idles high: levels are inverted, and a frame ends when the line stays high for about 3/4 bit. After 16
/// bits it takes the newest word in the TX FIFO, or the last one again. If that is not 0, it counts the delay in the first 10 bits, drives
/// the rest as levels and releases the line high. A fall during the delay is the first bit of a new frame.
fn answered_words() -> Program<32> {
    pio_asm!(
        "collected:",
        "    set y, 1",
        "    mov isr, y",
        "    out y, 16",
        "    jmp y-- some",
        ".wrap_target",
        "begin:",
        "    wait 0 pin 0",
        "bit:",
        "    nop [18]",
        "    in pins, 1",
        "    wait 1 pin 0",
        "    set y, 14",
        "high:",
        "    jmp pin no_fall",
        "    jmp bit",
        "no_fall:",
        "    jmp y-- high",
        "    mov osr, isr",
        "    push noblock",
        "    jmp collected",
        "some:",
        "    jmp y-- begin",
        "newest:",
        "    pull noblock",
        "    mov x, osr",
        "    mov y, status",
        "    jmp !y newest",
        "    jmp !x begin",
        "    out y, 10",
        "delay:",
        "    jmp pin still_high",
        "    jmp bit",
        "still_high:",
        "    jmp y-- delay",
        "    set pindirs, 1",
        "level:",
        "    out pins, 1 [30]",
        "    jmp !osre level",
        "    set pins, 1 [7]",
        "    set pindirs, 0",
        ".wrap",
    )
    .program
}

fn machines() -> StateMachines {
    StateMachines::of(Block::Inputs)
}

/// Gives the inputs' pins to the machines, which do nothing yet.
pub fn connect(pins: &Pins) {
    for gpio in (INPUT_1..).take(MOTORS) {
        pins.set(gpio, FUNCSEL_A::PIO0, Pull::Down);
    }
}

/// The inputs while they have pulses.
pub struct Capture {
    machines: StateMachines,
    timer: TIMER,
    is_listening: bool,
    /// Stamps of each input still to read up to and including the first after the gap that a lost stamp left: 1 if the next stamp is
    /// that one, 0 if there is no gap.
    stamps_until_gap: [u8; MOTORS],
}

impl Capture {
    /// Of pins that are connected.
    pub fn new(timer: TIMER) -> Self {
        Self { machines: machines(), timer, is_listening: true, stamps_until_gap: [0; MOTORS] }
    }
}

/// An edge from its stamp, which came within 43 s of now.
#[inline]
const fn edge(now: u32, stamp: u32, overcapture: bool) -> Edge {
    let count = (!stamp >> 1).wrapping_sub(DEBOUNCE_COUNTS);
    // Of all counts with these 31 bits the nearest to now.
    let age = (now.wrapping_sub(count) << 1).cast_signed() >> 1;
    Edge { timestamp: now.wrapping_sub(age.cast_unsigned()), is_high: stamp & 1 != 0, overcapture }
}

impl CaptureTimer for Capture {
    /// A tick takes the [`EDGE_FIFO_DEPTH`] of each queue at most, and a machine makes one in 2 µs at most.
    const IS_QUEUED: bool = true;

    /// At most 1.3 µs early: what was stamped since then is a little later than now.
    #[inline]
    fn now(&self) -> u32 {
        let microseconds = self.timer.timerawl().read().bits().wrapping_sub(STARTED_US.load(Ordering::Relaxed));
        microseconds.wrapping_mul(COUNTS_PER_US).wrapping_sub(START_COUNTS)
    }

    #[inline]
    fn take(&mut self) -> [Option<Edge>; MOTORS] {
        let mut edges = [None; MOTORS];
        if self.machines.are_empty() {
            return edges;
        }
        let now = self.now();
        for (input, (edge_of, stamps_until_gap)) in edges.iter_mut().zip(&mut self.stamps_until_gap).enumerate() {
            let Some(stamp) = self.machines.pop(input) else { continue };
            let is_behind_gap = *stamps_until_gap == 1;
            // The queue was full when a stamp was lost: this one and those behind it are older.
            *stamps_until_gap = if self.machines.take_overflow_flag(input) {
                EDGE_FIFO_DEPTH
            } else {
                stamps_until_gap.saturating_sub(1)
            };
            if self.is_listening {
                *edge_of = Some(edge(now, stamp, is_behind_gap));
            }
        }
        edges
    }

    /// All or none: no input is switched off by itself.
    fn listen(&mut self, inputs: [Listening; MOTORS]) {
        self.is_listening = inputs.iter().any(|input| *input != Listening::Off);
        self.stamps_until_gap = [0; MOTORS];
    }
}

/// What the control task has of the inputs: it changes what they have, and takes words.
pub struct InputFrames {
    machines: StateMachines,
    timer: TIMER,
    pins: Pins,
    /// Where frames are answered: what turns their bits, and turns of the delay.
    mask: u32,
    reply_delay: u32,
}

impl InputFrames {
    /// Of pins that are connected.
    pub fn new(timer: TIMER) -> Self {
        Self { machines: machines(), timer, pins: Pins::steal(), mask: 0, reply_delay: 0 }
    }

    fn stamp(&self) {
        self.machines.load(&stamps(), Divider::ONE, Direction::In, INPUT_1);
        let microsecond = || self.timer.timerawl().read().bits();
        let before = microsecond();
        // A timer that stands still is found out by its clock's check.
        let _ = (0..READS_PER_US).any(|_| microsecond() != before);
        self.machines.start();
        STARTED_US.store(before.wrapping_add(1), Ordering::Relaxed);
    }
}

impl InputFrameHardware for InputFrames {
    fn set_line(&mut self, line: Option<Line>) {
        self.mask = 0;
        let is_answered = line.is_some_and(|line| line.is_bidirectional);
        for gpio in (INPUT_1..).take(MOTORS) {
            self.pins.set(gpio, FUNCSEL_A::PIO0, if is_answered { Pull::Up } else { Pull::Down });
        }
        let Some(Line { speed, .. }) = line else { return self.stamp() };
        if is_answered {
            let rate_hz = speed.bits_per_s() * ANSWERED_BIT_CYCLES;
            // The one before the bits is the program's.
            self.mask = 0xffff;
            self.reply_delay = (rate_hz / 1_000_000 * REPLY_DELAY_US - UNCOUNTED_CYCLES) / 2 - 1;
            let direction = Direction::Both { out: DELAY_BITS + REPLY_BITS, collected: None };
            self.machines.load(&answered_words(), Divider::of(CORE_HZ, rate_hz), direction, INPUT_1);
        } else {
            let divider = Divider::of(CORE_HZ, speed.bits_per_s() * BIT_CYCLES);
            self.machines.load(&words(), divider, Direction::In, INPUT_1);
        }
        self.machines.start();
    }

    #[inline]
    fn take_word(&mut self, input: usize) -> Option<Word> {
        self.machines.pop(input).map(|bits| Word::new(bits ^ self.mask))
    }

    #[inline]
    fn take_words_lost(&mut self, input: usize) -> bool {
        self.machines.take_overflow_flag(input)
    }

    /// The word has the delay, and the levels behind it.
    #[inline]
    fn offer_reply(&mut self, input: usize, offer: Offer) {
        let word = match offer {
            Offer::Reply(reply) => {
                (self.reply_delay << REPLY_BITS | reply.to_levels()) << (u32::BITS - DELAY_BITS - REPLY_BITS)
            }
            Offer::None => 0,
        };
        self.machines.push(input, word);
    }

    #[inline]
    fn is_offer_taken(&self, input: usize) -> bool {
        self.machines.waiting(input) == 0
    }
}
