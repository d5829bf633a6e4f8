//! TIM2: time stamps of both edges of the four inputs.

use rotorlead::capture::Listening;
use rotorlead::controller::hardware::{CaptureTimer, Edge};
use stm32f4xx_hal::gpio::Alternate;
use stm32f4xx_hal::pac::{GPIOA, TIM2, tim2};
use stm32f4xx_hal::rcc::{Enable, Rcc, Reset};

use super::MOTORS;
use super::generated::{Input1, Input2, Input3, Input4};

/// The usual filter of an input (RM0090, TIMx_CCMR1, ICxF), and the long one. Both take 8 samples: a level that is shorter than 7
/// of their periods is none, one of 8 always is, and both edges are late alike, to one period.
///
/// | | a sample every | at 84 MHz | shorter levels are none | longer ones are sure |
/// |---|---|---|---|---|
/// | usual | 2 counts | 24 ns | 0.17 µs | 0.19 µs |
/// | long | 32 counts | 381 ns | 2.67 µs | 3.05 µs |
///
/// The long one is the shortest of the timer's that takes away all levels under 2 µs: with a sample every 16 counts it is 1.33 µs. Its
/// price is the width, which is right to 0.38 µs, so that it serves only where spikes come. At 16 MHz its levels are 14 and 16 µs;
/// settings leave 20 µs at least.
const USUAL_FILTER: u32 = 0b0100;
const LONG_FILTER: u32 = 0b1111;
const _: () = assert!(7 * 32 * 1_000_000 / 84_000_000 >= 2 && 8 * 32 * 1_000_000 / 16_000_000 < 20);

/// The pins of the inputs, routed to the timer, with their pull-downs.
pub struct Pins(pub Input1<Alternate<1>>, pub Input2<Alternate<1>>, pub Input3<Alternate<1>>, pub Input4<Alternate<1>>);

/// The capturing timer and its pins.
pub struct Capture {
    timer: TIM2,
    port: GPIOA,
    filters: [u32; MOTORS],
    _pins: Pins,
}

impl Capture {
    /// Starts counting and capturing, with the usual filter.
    pub fn new(timer: TIM2, port: GPIOA, pins: Pins, rcc: &mut Rcc) -> Self {
        TIM2::enable(rcc);
        TIM2::reset(rcc);
        timer.psc().write(|w| w.psc().set(0));
        timer.arr().write(|w| w.arr().set(u32::MAX));
        timer.ccmr1_input().write(|w| w.cc1s().ti1().cc2s().ti2());
        timer.ccmr2_input().write(|w| w.cc3s().ti3().cc4s().ti4());
        let capture = Self { timer, port, filters: [USUAL_FILTER; MOTORS], _pins: pins };
        capture.write_filters();
        let timer = &capture.timer;
        // Both polarity bits set: both edges.
        timer.ccer().write(|w| {
            for n in 0..MOTORS as u8 {
                w.ccp(n).set_bit();
                w.ccnp(n).set_bit();
                w.cce(n).set_bit();
            }
            w
        });
        timer.egr().write(|w| w.ug().set_bit());
        timer.sr().reset();
        timer.dier().write(|w| {
            w.cc1ie().set_bit();
            w.cc2ie().set_bit();
            w.cc3ie().set_bit();
            w.cc4ie().set_bit()
        });
        timer.cr1().modify(|_, w| w.cen().set_bit());
        capture
    }

    /// The selections of the inputs, which may be written only while these are off, are written as they are.
    #[allow(unsafe_code)]
    fn write_filters(&self) {
        let [one, two, three, four] = self.filters;
        // SAFETY: four bits of a filter for each of two inputs, at 4 and 12.
        unsafe {
            self.timer.ccmr1_input().modify(|r, w| w.bits(r.bits() & !0xF0F0 | one << 4 | two << 12));
            self.timer.ccmr2_input().modify(|r, w| w.bits(r.bits() & !0xF0F0 | three << 4 | four << 12));
        }
    }
}

impl CaptureTimer for Capture {
    #[inline]
    fn now(&self) -> u32 {
        self.timer.cnt().read().bits()
    }

    #[inline]
    fn take(&mut self) -> [Option<Edge>; MOTORS] {
        let timer = &self.timer;
        let captured = timer.sr().read();
        // Reading a capture register clears its flag.
        let stamp = |captured: bool, register: &tim2::CCR| captured.then(|| register.read().bits());
        let stamps = [
            stamp(captured.cc1if().bit(), timer.ccr1()),
            stamp(captured.cc2if().bit(), timer.ccr2()),
            stamp(captured.cc3if().bit(), timer.ccr3()),
            stamp(captured.cc4if().bit(), timer.ccr4()),
        ];
        // Only now: an edge that came before its stamp was read has overwritten the one before. One that comes later has an interrupt of
        // its own, and a level that is read behind it does not go with the stamp, so that the decoder misses an edge.
        let status = timer.sr().read();
        let levels = self.port.idr().read();
        let edge = |timestamp: Option<u32>, overcapture: bool, is_high: bool| {
            timestamp.map(|timestamp| Edge { timestamp, is_high, overcapture })
        };
        let edges = [
            edge(stamps[0], status.cc1of().bit(), levels.idr0().bit()),
            edge(stamps[1], status.cc2of().bit(), levels.idr1().bit()),
            edge(stamps[2], status.cc3of().bit(), levels.idr2().bit()),
            edge(stamps[3], status.cc4of().bit(), levels.idr3().bit()),
        ];
        // An overcapture that was told is cleared by writing 0, and 1 leaves a flag alone.
        let told = edges.map(|edge| edge.is_some_and(|edge| edge.overcapture));
        timer.sr().write(|w| {
            w.cc1of().bit(!told[0]);
            w.cc2of().bit(!told[1]);
            w.cc3of().bit(!told[2]);
            w.cc4of().bit(!told[3])
        });
        edges
    }

    fn listen(&mut self, inputs: [Listening; MOTORS]) {
        // An input that is off keeps its filter.
        let filter = |listening: Listening, before: u32| match listening {
            Listening::All => USUAL_FILTER,
            Listening::LongLevels => LONG_FILTER,
            Listening::Off => before,
        };
        let before = self.filters;
        for (of, listening) in self.filters.iter_mut().zip(inputs) {
            *of = filter(listening, *of);
        }
        if self.filters != before {
            self.write_filters();
        }
        let [one, two, three, four] = inputs.map(|listening| listening != Listening::Off);
        let before = self.timer.dier().read();
        let returns = |now: bool, before: bool| now && !before;
        let clear = [
            returns(one, before.cc1ie().bit()),
            returns(two, before.cc2ie().bit()),
            returns(three, before.cc3ie().bit()),
            returns(four, before.cc4ie().bit()),
        ];
        if clear.contains(&true) {
            let [one, two, three, four] = clear;
            self.timer.sr().write(|w| {
                w.cc1if().bit(!one).cc1of().bit(!one);
                w.cc2if().bit(!two).cc2of().bit(!two);
                w.cc3if().bit(!three).cc3of().bit(!three);
                w.cc4if().bit(!four).cc4of().bit(!four)
            });
        }
        self.timer.dier().write(|w| {
            w.cc1ie().bit(one);
            w.cc2ie().bit(two);
            w.cc3ie().bit(three);
            w.cc4ie().bit(four)
        });
    }
}
