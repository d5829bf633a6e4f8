//! The parts of the board as the library takes them: [`rotorlead::controller::hardware`].

use core::sync::atomic::Ordering;

use rotorlead::controller::hardware::{BoardFacts, ControlHardware, NoInputFrames, RequestHardware};
use rotorlead::systick::ControlTimer;
use stm32f4xx_hal::gpio::Input;

use super::generated::Jumper;
use super::outputs::Outputs;
use super::serial;
use super::thrust_adc::ThrustAdc;
use super::watchdog::{SETTLES_HZ, Watchdog};

/// This board, to the control task.
pub enum Stm32f405 {}

impl ControlHardware for Stm32f405 {
    type Outputs = Outputs;
    type InputFrames = NoInputFrames;
    type Timer = ControlTimer;
    type Thrust = ThrustAdc;
    type Watchdog = Watchdog;
}

/// What the lowest priority asks of the board.
pub struct BoardStatus {
    /// What does not change.
    pub facts: BoardFacts,
    /// The jumper to ground that allows excitation and injection, against the pin's pull-up.
    pub jumper: Jumper<Input>,
}

impl RequestHardware for BoardStatus {
    fn facts(&self) -> BoardFacts {
        self.facts
    }

    fn is_bench_enabled(&mut self) -> bool {
        self.jumper.is_low()
    }

    fn link_overruns(&self) -> u32 {
        serial::LOST.load(Ordering::Relaxed)
    }

    fn wait_for_watchdog(&mut self) {
        cortex_m::asm::delay(self.facts.clocks.core_hz / SETTLES_HZ);
    }
}
