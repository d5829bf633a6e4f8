//! TIM3: four pulses to the ESCs.
//!
//! Compare registers are preloaded: a new width takes effect with the next frame, so a pulse is never cut or doubled. The
//! pulse begins with the frame. All four share the timer and so the frame rate.
//!
//! # Why not TIM8
//!
//! The pins are channels of TIM8, too, whose outputs go off in hardware on a break: on this chip when the clock security system finds the
//! crystal dead, and for nothing else inside it. Here that takes the non-maskable interrupt and some thirty instructions on the
//! internal oscillator, to which the clock is switched by then: under 10 µs at 16 MHz, estimated, half of the shortest level
//! of a pulse.
//! TIM3 is what the emulator models: on TIM8 no test would see what stands in the compare registers, nor that this image
//! starts at all, since QEMU 10.0 ends when the HAL resets a timer of that bus.

use rotorlead::controller::hardware::OutputHardware;
use rotorlead::esc_output::put_out;
use stm32f4xx_hal::gpio::Input;
use stm32f4xx_hal::pac::{GPIOC, TIM3};
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::rcc::Rcc;
use stm32f4xx_hal::timer::PwmChannel;

use super::MOTORS;
use super::generated::{Output1, Output2, Output3, Output4};

/// Frame rate of the outputs, which are low, until the settings are loaded.
const FIRST_FRAME_HZ: u32 = 400;

/// The pins of the outputs.
pub struct Pins(pub Output1<Input>, pub Output2<Input>, pub Output3<Input>, pub Output4<Input>);

/// The timer with its four channels.
pub struct Outputs {
    channels: (PwmChannel<TIM3, 0>, PwmChannel<TIM3, 1>, PwmChannel<TIM3, 2>, PwmChannel<TIM3, 3>),
    timer: TIM3,
}

impl Outputs {
    /// Starts frames with every output low: a duty of 0 has no edges.
    pub fn new(timer: TIM3, pins: Pins, rcc: &mut Rcc) -> Self {
        let (_, (one, two, three, four)) = timer.pwm_hz(FIRST_FRAME_HZ.Hz(), rcc);
        let channels = (one.with(pins.0), two.with(pins.1), three.with(pins.2), four.with(pins.3));
        let mut outputs = Self { channels, timer: frame_registers() };
        outputs.set_widths([0; MOTORS]);
        let (one, two, three, four) = &mut outputs.channels;
        one.enable();
        two.enable();
        three.enable();
        four.enable();
        outputs
    }

    #[inline]
    fn set_length(&mut self, counts: u32) {
        self.timer.arr().write(|w| w.arr().set(counts.saturating_sub(1).min(u32::from(u16::MAX)) as u16));
    }
}

impl OutputHardware for Outputs {
    fn set_frames(&mut self, divider: u32, counts: u32) {
        self.set_widths([0; MOTORS]);
        // Divider and length count together, from the next frame on.
        self.timer.cr1().modify(|_, w| w.arpe().set_bit());
        self.timer.psc().write(|w| w.psc().set(divider.saturating_sub(1).min(u32::from(u16::MAX)) as u16));
        self.set_length(counts);
    }

    #[inline]
    fn set_widths(&mut self, counts: [u32; MOTORS]) {
        let (one, two, three, four) = &mut self.channels;
        let [first, second, third, fourth] = counts;
        put_out(one, first);
        put_out(two, second);
        put_out(three, third);
        put_out(four, fourth);
    }

    #[inline]
    fn frame_count(&self) -> u32 {
        self.timer.cnt().read().bits()
    }

    #[inline]
    fn restart_frame(&mut self) {
        self.timer.egr().write(|w| w.ug().set_bit());
    }

    #[inline]
    fn end_frame_at(&mut self, counts: u32) {
        self.timer.cr1().modify(|_, w| w.arpe().clear_bit());
        self.set_length(counts);
        // A counter that has passed its end would run on to the end of its range.
        if self.frame_count() >= counts {
            self.restart_frame();
        }
    }
}

/// The timer's registers, to set its frames. The HAL would take its clock for what the dividers promise, and not for what
/// was measured.
#[allow(unsafe_code)]
fn frame_registers() -> TIM3 {
    // SAFETY: of these, only those of the frames are written here, which the HAL's channels do not write.
    unsafe { TIM3::steal() }
}

/// Takes the pins away from the timer and holds them low. For the handlers of faults and panics: needs nothing but the
/// clock of port C, and takes three accesses to it.
pub fn force_low(gpioc: &GPIOC) {
    // First the level, then the direction: no glitch.
    gpioc.bsrr().write(|w| {
        w.br6().set_bit();
        w.br7().set_bit();
        w.br8().set_bit();
        w.br9().set_bit()
    });
    gpioc.moder().modify(|_, w| {
        w.moder6().output();
        w.moder7().output();
        w.moder8().output();
        w.moder9().output()
    });
}
