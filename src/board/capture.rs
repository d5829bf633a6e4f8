//! TIM2: time stamps of both edges of the four inputs.

use rotorlead::controller::hardware::{CaptureTimer, Edge};
use stm32f4xx_hal::gpio::{Alternate, PA0, PA1, PA2, PA3};
use stm32f4xx_hal::pac::{GPIOA, TIM2, tim2};
use stm32f4xx_hal::rcc::{Enable, Rcc, Reset};

use super::MOTORS;

/// The pins of the inputs, routed to the timer, with their pull-downs.
pub struct Pins(pub PA0<Alternate<1>>, pub PA1<Alternate<1>>, pub PA2<Alternate<1>>, pub PA3<Alternate<1>>);

/// The capturing timer and its pins.
pub struct Capture {
    timer: TIM2,
    port: GPIOA,
    _pins: Pins,
}

impl Capture {
    /// Starts counting and capturing.
    ///
    /// The input filter takes 8 samples at half the timer clock: spikes under 0.2 µs (at 84 MHz) are no edges, and all
    /// edges are late by that time.
    pub fn new(timer: TIM2, port: GPIOA, pins: Pins, rcc: &mut Rcc) -> Self {
        TIM2::enable(rcc);
        TIM2::reset(rcc);
        timer.psc().write(|w| w.psc().set(0));
        timer.arr().write(|w| w.arr().set(u32::MAX));
        timer.ccmr1_input().write(|w| {
            w.cc1s().ti1();
            w.cc2s().ti2();
            w.ic1f().fdts_div2_n8();
            w.ic2f().fdts_div2_n8()
        });
        timer.ccmr2_input().write(|w| {
            w.cc3s().ti3();
            w.cc4s().ti4();
            w.ic3f().fdts_div2_n8();
            w.ic4f().fdts_div2_n8()
        });
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
        Self { timer, port, _pins: pins }
    }
}

impl CaptureTimer for Capture {
    #[inline]
    fn now(&self) -> u32 {
        self.timer.cnt().read().bits()
    }

    #[inline]
    fn take(&mut self) -> [Option<Edge>; MOTORS] {
        let status = self.timer.sr().read();
        let levels = self.port.idr().read();
        // Reading a capture register clears its flag. An overcapture is cleared by writing 0, and 1 leaves a flag alone.
        let edge = |captured: bool, overcapture: bool, register: &tim2::CCR, high: bool| {
            captured.then(|| Edge { timestamp: register.read().bits(), is_high: high, overcapture })
        };
        let timer = &self.timer;
        let edges = [
            edge(status.cc1if().bit(), status.cc1of().bit(), timer.ccr1(), levels.idr0().bit()),
            edge(status.cc2if().bit(), status.cc2of().bit(), timer.ccr2(), levels.idr1().bit()),
            edge(status.cc3if().bit(), status.cc3of().bit(), timer.ccr3(), levels.idr2().bit()),
            edge(status.cc4if().bit(), status.cc4of().bit(), timer.ccr4(), levels.idr3().bit()),
        ];
        self.timer.sr().write(|w| {
            w.cc1of().bit(!status.cc1of().bit());
            w.cc2of().bit(!status.cc2of().bit());
            w.cc3of().bit(!status.cc3of().bit());
            w.cc4of().bit(!status.cc4of().bit())
        });
        edges
    }

    #[inline]
    fn listen(&mut self, inputs: [bool; MOTORS]) {
        let [one, two, three, four] = inputs;
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
