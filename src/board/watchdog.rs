//! The independent watchdog: its oscillator is its own, and nothing but a reset stops it.

use rotorlead::controller::hardware;
use stm32f4xx_hal::pac::{DBGMCU, IWDG};
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::watchdog::IndependentWatchdog;

/// Longest time without a feed while starting or while the flash stalls: the design of the filter is some 100 ms of
/// double precision in software, and two sectors are erased in 4 s at most.
const PATIENT_MS: u32 = 16_000;
/// Longest time without a feed from the control task, 100 of its ticks. The watchdog's own oscillator is good for
/// -47 % to +47 %.
const RUN_MS: u32 = 20;
/// One over the time in which it has settled on a new limit, and has been fed: it takes its new limit over within 5 periods of its own
/// clock (RM0090, 21.4.4), 0.3 ms; then the control task must feed it once by the new one, which it does every 1 to 2 ms.
pub const SETTLES_HZ: u32 = 250;

/// The watchdog, running.
pub struct Watchdog(IndependentWatchdog);

impl Watchdog {
    /// Runs, with the longer of its two times, and goes on while a debug probe halts the core: the last pulses must not go on.
    pub fn start(registers: IWDG, debug: &DBGMCU) -> Self {
        let mut watchdog = IndependentWatchdog::new(registers);
        watchdog.stop_on_debug(debug, false);
        watchdog.start(PATIENT_MS.millis());
        Self(watchdog)
    }
}

impl hardware::Watchdog for Watchdog {
    #[inline]
    fn feed(&mut self) {
        self.0.feed();
    }

    fn set_long_timeout(&mut self, patient: bool) {
        self.0.start(if patient { PATIENT_MS } else { RUN_MS }.millis());
    }
}
