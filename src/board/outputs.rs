//! TIM3: four pulses to the ESCs.
//!
//! Compare and reload registers are preloaded: a new width takes effect with the next frame, so a pulse is never cut
//! or doubled. The pulse begins with the frame. All four share the timer and so the frame rate.

use embedded_hal::pwm::SetDutyCycle;
use rotorlead::esc_output::put_out;
use stm32f4xx_hal::gpio::{Input, PC6, PC7, PC8, PC9};
use stm32f4xx_hal::pac::{GPIOC, TIM3};
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::rcc::Rcc;
use stm32f4xx_hal::timer::pwm::ErasedChannel;

use super::MOTORS;

/// One output, as embedded-hal sees it.
pub type Output = ErasedChannel<TIM3>;

/// The pins of the outputs.
pub struct Pins(pub PC6<Input>, pub PC7<Input>, pub PC8<Input>, pub PC9<Input>);

/// The timer with its four channels.
pub struct Outputs {
    channels: [Output; MOTORS],
    timer: TIM3,
    timer_hz: u32,
}

impl Outputs {
    /// Starts frames with every output low: a duty of 0 has no edges. The timer's clock is `timer_hz`.
    pub fn new(timer: TIM3, pins: Pins, frame_hz: u32, timer_hz: u32, rcc: &mut Rcc) -> Self {
        let (_, (one, two, three, four)) = timer.pwm_hz(frame_hz.max(1).Hz(), rcc);
        let mut channels =
            [one.with(pins.0).erase(), two.with(pins.1).erase(), three.with(pins.2).erase(), four.with(pins.3).erase()];
        for channel in &mut channels {
            let Ok(()) = channel.set_duty_cycle(0);
            channel.enable();
        }
        let mut outputs = Self { channels, timer: frame_registers(), timer_hz };
        outputs.set_frame_rate(frame_hz);
        outputs
    }

    /// Frames at `frame_hz` (at least 1) from now on, low until the next widths.
    pub fn set_frame_rate(&mut self, frame_hz: u32) {
        put_out(&mut self.channels, [0; MOTORS]);
        let reload = self.counter_hz(frame_hz) / frame_hz.max(1);
        // Both are preloaded: they count from the next frame on.
        self.timer.psc().write(|w| w.psc().set(self.prescaler(frame_hz) as u16));
        self.timer.arr().write(|w| w.arr().set(reload.saturating_sub(1).min(u32::from(u16::MAX)) as u16));
    }

    /// What the timer counts at with frames at `frame_hz`: pulse widths are in these ticks.
    pub fn counter_hz(&self, frame_hz: u32) -> u32 {
        self.timer_hz / (1 + self.prescaler(frame_hz))
    }

    /// The smallest one with which a frame fits the 16-bit counter.
    fn prescaler(&self, frame_hz: u32) -> u32 {
        let ticks = self.timer_hz / frame_hz.max(1);
        (ticks.saturating_sub(1) / (1 << 16)).min(u32::from(u16::MAX))
    }

    /// Widths of the next pulses, in ticks.
    #[inline]
    pub fn set(&mut self, widths: [u32; MOTORS]) {
        put_out(&mut self.channels, widths);
    }
}

/// The timer's registers, to set its frames. The HAL would take its clock for what the dividers promise, and not for what
/// was measured.
#[allow(unsafe_code)]
fn frame_registers() -> TIM3 {
    // SAFETY: of these, only prescaler and reload are written here, which the HAL's channels do not write.
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
