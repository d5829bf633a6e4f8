//! TIM3: four pulses to the ESCs.
//!
//! Compare and reload registers are preloaded: a new width takes effect with the next frame, so a pulse is never cut
//! or doubled. The pulse begins with the frame. All four share the timer and so the frame rate.

use embedded_hal::pwm::SetDutyCycle;
use stm32f4xx_hal::gpio::{Input, PC6, PC7, PC8, PC9};
use stm32f4xx_hal::pac::{GPIOC, TIM3};
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::rcc::Rcc;
use stm32f4xx_hal::timer::pwm::{ErasedChannel, PwmHzManager};

use super::MOTORS;

/// One output, as embedded-hal sees it.
pub type Output = ErasedChannel<TIM3>;

/// The pins of the outputs.
pub struct Pins(pub PC6<Input>, pub PC7<Input>, pub PC8<Input>, pub PC9<Input>);

/// The timer with its four channels.
pub struct Outputs {
    /// One per motor.
    pub channels: [Output; MOTORS],
    /// Holds the timer.
    _frame: PwmHzManager<TIM3>,
    /// What the timer counts at: pulse widths are in these ticks.
    pub counter_hz: u32,
}

impl Outputs {
    /// Starts frames at `frame_hz` (at least 1) with every output low: a duty of 0 has no edges.
    pub fn new(timer: TIM3, pins: Pins, frame_hz: u32, timer_hz: u32, rcc: &mut Rcc) -> Self {
        let frame_hz = frame_hz.max(1);
        // The HAL's own rule: the smallest divider with which a frame fits the 16-bit counter.
        let ticks = rcc.clocks.timclk1().raw() / frame_hz;
        let divider = 1 + ticks.saturating_sub(1) / (1 << 16);
        let (frame, (one, two, three, four)) = timer.pwm_hz(frame_hz.Hz(), rcc);
        let mut channels =
            [one.with(pins.0).erase(), two.with(pins.1).erase(), three.with(pins.2).erase(), four.with(pins.3).erase()];
        for channel in &mut channels {
            let Ok(()) = channel.set_duty_cycle(0);
            channel.enable();
        }
        Self { channels, _frame: frame, counter_hz: timer_hz / divider }
    }
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
