//! SysTick: the interrupt that runs the control task.
//!
//! It counts the core's clock, so that a tick is a whole number of instructions' time, and it leaves all timers with
//! pins to the pulses.

use cortex_m::peripheral::syst::SystClkSource;
use cortex_m::peripheral::{SCB, SYST};

use crate::controller::hardware::TickTimer;

/// Largest count of SysTick: 24 bits.
const LARGEST_RELOAD: u32 = 0x00FF_FFFF;

/// The timer of the control task.
pub struct ControlTimer {
    timer: SYST,
    core_hz: u32,
}

impl ControlTimer {
    /// Does not run yet.
    pub fn new(mut timer: SYST, core_hz: u32) -> Self {
        timer.disable_counter();
        timer.set_clock_source(SystClkSource::Core);
        Self { timer, core_hz }
    }
}

impl TickTimer for ControlTimer {
    /// The slowest is 10 Hz at 168 MHz.
    fn set_rate(&mut self, rate_hz: u32) {
        let rate_hz = rate_hz.max(1);
        let period = (self.core_hz + rate_hz / 2) / rate_hz;
        self.timer.set_reload(period.saturating_sub(1).clamp(1, LARGEST_RELOAD));
    }

    fn start(&mut self) {
        self.timer.clear_current();
        self.timer.enable_interrupt();
        self.timer.enable_counter();
    }

    /// The core itself takes the request back when a tick begins.
    #[inline]
    fn is_due(&self) -> bool {
        SCB::is_pendst_pending()
    }
}
