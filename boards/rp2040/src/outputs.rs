//! The outputs: channels of two PWM slices for pulses, and machines of PIO1 for frames of DShot.
//!
//! Both slices start together, and count alike. Their compare registers are taken over when a slice wraps: a new width takes effect
//! with the next frame, so a pulse is never cut or doubled. The pulse begins with the frame.
//!
//! The length of a frame is taken over when it wraps, too, so the frame that runs cannot be made shorter by its register. Its counter
//! is set forward instead, as soon as the pulse is over: it then wraps when the frame has its new length, to a count or two.

use pio::{Program, pio_asm};
use rotorlead::controller::hardware::OutputHardware;
use rotorlead::dshot::{Frame, Line, ReplyWindow, WINDOW_LEVELS, WORD_LEVELS};
use rotorlead::settings::MOTORS;
use rotorlead_rp2040::generated::OUTPUT_1;
use rp2040_hal::pac::PWM;
use rp2040_hal::pac::io_bank0::gpio::gpio_ctrl::FUNCSEL_A;
use rp2040_hal::pac::pwm::CH;

use crate::clocks::{CORE_HZ, COUNT_CYCLES};
use crate::pins::{Pins, Pull};
use crate::state_machines::{Block, Direction, Divider, StateMachines};

/// The slices of the outputs.
const SLICES: [usize; 2] = [3, 4];
/// Cycles of a machine in a bit of DShot, and in one that is answered: 32 in a bit of the reply.
const BIT_CYCLES: u32 = 8;
const ANSWERED_BIT_CYCLES: u32 = 40;
/// What may pass between reading a counter and setting it, in counts: 10 µs, which interrupts may take. A frame that ends by itself
/// within that is left to, and pulses are over only when that has passed since.
const MARGIN: u32 = 250;
/// Frames that may wait in a machine's queue beside the one that goes out. With those that are answered it is one: the levels behind two
/// are as many as the other queue holds, and a machine that finds that full stands.
const MOST_WAITING: u32 = 2;
const MOST_WAITING_ANSWERED: u32 = 1;

/// Sends the 16 bits of a word: high for 3 of 8 cycles for a zero and 6 for a one; then the line stays low for 12 bits at least.
fn frames() -> Program<32> {
    pio_asm!(
        ".side_set 1",
        ".wrap_target",
        "    pull block side 0",
        "bit:",
        "    out x, 1 side 1 [1]",
        "    jmp !x zero side 1",
        "    jmp tail side 1 [2]",
        "zero:",
        "    nop side 0 [2]",
        "tail:",
        "    jmp !osre bit side 0 [1]",
        "    set y, 5 side 0",
        "gap:",
        "    jmp y-- gap side 0 [15]",
        ".wrap",
    )
    .program
}

/// Sends the 16 upper bits of a word, inverted, on a line that idles high: low for 15 of 40 cycles for a zero and 30 for a one. Then
/// lets go of the line, and takes as many of its levels as the lower bits say, and one more: half a bit of a reply, 16 cycles, after
/// each edge, and a whole one later as long as there is no other. A level is that after the last edge, and not the pin's, which may
/// just have changed: then it would count twice.
fn answered_frames() -> Program<32> {
    pio_asm!(
        ".wrap_target",
        "frame:",
        "    pull block",
        "    set pindirs, 1 [7]",
        "bit:",
        "    set pins, 0 [14]",
        "    out pins, 1 [14]",
        "    set pins, 1 [8]",
        "    jmp !osre bit",
        "    set pindirs, 0",
        "    out x, 16",
        "high:",
        "    set y, 6",
        "still_high:",
        "    jmp pin no_fall",
        "    jmp low",
        "no_fall:",
        "    jmp y-- still_high",
        "    set y, 1",
        "    in y, 1",
        "    set y, 13",
        "    jmp x-- still_high",
        "    jmp frame",
        "low:",
        "    set y, 6",
        "still_low:",
        "    jmp pin high",
        "    jmp y-- still_low",
        "    in null, 1",
        "    set y, 13 [1]",
        "    jmp x-- still_low",
        ".wrap",
    )
    .program
}

/// The outputs.
pub struct Outputs {
    slices: PWM,
    machines: StateMachines,
    /// What makes the word of a frame: with those that are answered it turns the bits, and says below them how many levels are taken.
    mask: u32,
    most_waiting: u32,
    pins: Pins,
    /// Counts of a frame that ends by itself, and after how many it is to end.
    counts: u32,
    end: u32,
    /// Counts that were left out of the frame that runs.
    skipped: u32,
    /// The counter at the last tick: it has wrapped since where it is lower.
    last: u32,
    /// The longest of the widths that were written last, and of those of the frame that runs.
    written: u32,
    running: u32,
}

impl Outputs {
    /// Low.
    pub fn new(slices: PWM, pins: Pins) -> Self {
        let outputs = Self {
            slices,
            machines: StateMachines::of(Block::Outputs),
            mask: 0,
            most_waiting: MOST_WAITING,
            pins,
            counts: 1,
            end: 1,
            skipped: 0,
            last: 0,
            written: 0,
            running: 0,
        };
        outputs.force_low();
        outputs
    }

    /// Leaves out what the frame that runs is to be shorter, once its pulses are over.
    #[inline]
    fn hurry(&mut self) {
        let count = self.counter();
        let is_over = count > self.running + MARGIN && count + MARGIN < self.counts;
        if self.skipped == 0 && self.end < self.counts && is_over {
            self.skipped = self.counts - self.end;
            self.set_counter((count + self.skipped).min(self.counts - 1));
        }
    }

    #[inline]
    fn counter(&self) -> u32 {
        self.slices.ch(SLICES[0]).ctr().read().bits()
    }

    /// Both slices, one some cycles after the other.
    #[inline]
    fn set_counter(&mut self, count: u32) {
        self.last = count;
        for slice in self.slices() {
            slice.ctr().write(|w| w.ctr().variant(count as u16));
        }
    }

    fn force_low(&self) {
        connect_low(&self.pins);
        self.slices.en().reset();
        self.machines.stop();
    }

    fn connect(&self, function: FUNCSEL_A, pull: Pull) {
        for gpio in (OUTPUT_1..).take(MOTORS) {
            self.pins.set(gpio, function, pull);
        }
    }

    #[inline]
    fn slices(&self) -> [&CH; 2] {
        SLICES.map(|slice| self.slices.ch(slice))
    }
}

impl OutputHardware for Outputs {
    fn set_frames(&mut self, divider: u32, counts: u32) {
        self.force_low();
        let counts = counts.clamp(1, 1 << 16);
        // The slowest frames take a divider of 50.
        let divider = divider.saturating_mul(COUNT_CYCLES).clamp(1, u8::MAX.into()) as u8;
        for slice in self.slices() {
            slice.csr().reset();
            slice.div().write(|w| w.int().variant(divider));
            slice.ctr().reset();
            slice.cc().reset();
            slice.top().write(|w| w.top().variant((counts - 1) as u16));
        }
        (self.counts, self.end) = (counts, counts);
        (self.skipped, self.last, self.written, self.running) = (0, 0, 0, 0);
        // Both at once.
        self.slices.en().write(|w| {
            w.ch3().set_bit();
            w.ch4().set_bit()
        });
        self.connect(FUNCSEL_A::PWM, Pull::Down);
    }

    fn set_line(&mut self, line: Line) {
        self.force_low();
        let pull = if line.is_bidirectional {
            (self.mask, self.most_waiting) = (0xffff_0000 | (WINDOW_LEVELS - 1), MOST_WAITING_ANSWERED);
            let divider = Divider::of(CORE_HZ, line.speed.bits_per_s() * ANSWERED_BIT_CYCLES);
            let direction = Direction::Both { out: 16, collected: Some(WORD_LEVELS) };
            self.machines.load(&answered_frames(), divider, direction, OUTPUT_1);
            Pull::Up
        } else {
            (self.mask, self.most_waiting) = (0, MOST_WAITING);
            // Whole cycles, so that all bits have one length: 0.2 % short.
            let divider = Divider::whole(CORE_HZ, line.speed.bits_per_s() * BIT_CYCLES);
            self.machines.load(&frames(), divider, Direction::Out, OUTPUT_1);
            Pull::Down
        };
        self.machines.start();
        self.connect(FUNCSEL_A::PIO1, pull);
    }

    /// Once in each tick, of which every frame has more than one.
    #[inline]
    fn set_widths(&mut self, widths: [u32; MOTORS]) {
        let count = self.counter();
        if count < self.last {
            (self.running, self.skipped) = (self.written, 0);
        }
        self.last = count;
        let [first, second, third, fourth] = widths.map(|width| width.min(u16::MAX.into()) as u16);
        for (slice, (a, b)) in self.slices().into_iter().zip([(first, second), (third, fourth)]) {
            slice.cc().write(|w| {
                w.a().variant(a);
                w.b().variant(b)
            });
        }
        let written = first.max(second).max(third).max(fourth).into();
        if self.counter() < count {
            // It has wrapped meanwhile: which widths run is not known.
            (self.running, self.skipped, self.last) = (self.written.max(written), 0, 0);
            self.written = self.running;
            return;
        }
        self.written = written;
        self.hurry();
    }

    #[inline]
    fn frame_count(&self) -> u32 {
        self.counter().saturating_sub(self.skipped)
    }

    #[inline]
    fn restart_frame(&mut self) {
        self.set_counter(self.counts - 1);
    }

    #[inline]
    fn end_frame_at(&mut self, counts: u32) {
        self.end = counts;
        self.hurry();
    }

    #[inline]
    fn can_send(&self, motor: usize) -> bool {
        self.machines.waiting(motor) < self.most_waiting
    }

    #[inline]
    fn send(&mut self, motor: usize, frame: Frame) {
        self.machines.push(motor, u32::from(frame.to_bits()) << 16 ^ self.mask);
    }

    #[inline]
    fn take_reply(&mut self, motor: usize) -> Option<ReplyWindow> {
        self.machines.pop_two(motor).map(|(first, second)| ReplyWindow::new(first, second))
    }
}

/// Takes the outputs' pins from whatever drives them, and holds them low.
pub fn connect_low(pins: &Pins) {
    for gpio in (OUTPUT_1..).take(MOTORS) {
        pins.set_low_output(gpio);
    }
}
