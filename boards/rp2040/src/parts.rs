//! The parts of the board as the library takes them: [`rotorlead::controller::hardware`].

use core::sync::atomic::Ordering;

use rotorlead::controller::hardware::{BoardFacts, ControlHardware, RequestHardware};
use rotorlead::systick::ControlTimer;
use rotorlead_rp2040::generated::JUMPER;

use crate::inputs::InputFrames;
use crate::outputs::Outputs;
use crate::pins::Pins;
use crate::serial;
use crate::thrust_adc::ThrustAdc;
use crate::watchdog::Watchdog;

/// This board, to the control task.
pub enum Rp2040 {}

impl ControlHardware for Rp2040 {
    type Outputs = Outputs;
    type InputFrames = InputFrames;
    type Timer = ControlTimer;
    type Thrust = ThrustAdc;
    type Watchdog = Watchdog;
}

/// What the lowest priority asks of the board.
pub struct BoardStatus {
    /// What does not change.
    pub facts: BoardFacts,
    /// The jumper to ground that allows excitation and injection, against the pin's pull-up; and the lamp.
    pub pins: Pins,
}

impl RequestHardware for BoardStatus {
    fn facts(&self) -> BoardFacts {
        self.facts
    }

    fn is_bench_enabled(&mut self) -> bool {
        !self.pins.is_high(JUMPER)
    }

    fn link_overruns(&self) -> u32 {
        serial::LOST.load(Ordering::Relaxed)
    }

    /// The watchdog takes a new time with the feed that sets it.
    fn wait_for_watchdog(&mut self) {}
}
