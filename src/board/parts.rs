//! The parts of the board as the library takes them: [`rotorlead::controller::hardware`].

use core::sync::atomic::{AtomicBool, Ordering};

use rotorlead::controller::BoardFacts;
use rotorlead::controller::hardware::{ControlHardware, RequestHardware};
use rotorlead::systick::ControlTimer;
use stm32f4xx_hal::gpio::{Input, PC12};
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::watchdog::IndependentWatchdog;

use super::MOTORS;
use super::outputs::Outputs;
use super::serial;
use super::thrust_adc::ThrustAdc;

/// Longest time without a feed while starting or while the flash stalls: the design of the filter is some 100 ms of
/// double precision in software, and two sectors are erased in 4 s at most.
const WATCHDOG_PATIENT_MS: u32 = 16_000;
/// Longest time without a feed from the control task, 100 of its ticks. The watchdog's own oscillator is good for
/// -47 % to +47 %.
const WATCHDOG_RUN_MS: u32 = 20;
/// One over the time in which the watchdog has settled on a new limit, and has been fed: it takes its new limit over within
/// 5 periods of its own clock (RM0090, 21.4.4), 0.3 ms; then the control task must feed it once by the new one, which it does
/// every 1 to 2 ms.
const WATCHDOG_SETTLES_HZ: u32 = 250;

/// Whether the clock tells a disarmed pulse from an armed one. In memory of its own, where `cargo xtask bench --firmware`
/// finds it: the emulator has no crystal, and without one no pulse arms.
pub static PULSES_ARE_EXACT: AtomicBool = AtomicBool::new(false);

/// The independent watchdog: its oscillator is its own, and nothing but a reset stops it.
pub struct Watchdog(IndependentWatchdog);

impl Watchdog {
    /// Runs, with the longer of its two times.
    pub fn new(mut watchdog: IndependentWatchdog) -> Self {
        watchdog.start(WATCHDOG_PATIENT_MS.millis());
        Self(watchdog)
    }
}

/// What the control task drives.
pub struct ControlParts {
    /// The pulses.
    pub outputs: Outputs,
    /// The ticks.
    pub timer: ControlTimer,
    /// The thrust sensor's converter.
    pub thrust_adc: ThrustAdc,
    /// The watchdog.
    pub watchdog: Watchdog,
}

impl ControlHardware for ControlParts {
    fn set_frames(&mut self, divider: u32, counts: u32) {
        self.outputs.set_frames(divider, counts);
    }

    #[inline]
    fn set_widths(&mut self, counts: [u32; MOTORS]) {
        self.outputs.set(counts);
    }

    #[inline]
    fn frame_count(&self) -> u32 {
        self.outputs.frame_count()
    }

    #[inline]
    fn restart_frame(&mut self) {
        self.outputs.restart_frame();
    }

    #[inline]
    fn end_frame_at(&mut self, counts: u32) {
        self.outputs.end_frame_at(counts);
    }

    fn set_tick_rate(&mut self, rate_hz: u32) {
        self.timer.set_rate(rate_hz);
    }

    fn start_ticks(&mut self) {
        self.timer.start();
    }

    #[inline]
    fn is_tick_due(&self) -> bool {
        self.timer.is_due()
    }

    #[inline]
    fn start_conversion(&mut self) {
        self.thrust_adc.start();
    }

    #[inline]
    fn conversion(&mut self) -> u16 {
        self.thrust_adc.read()
    }

    #[inline]
    fn feed_watchdog(&mut self) {
        self.watchdog.0.feed();
    }

    fn set_watchdog_patient(&mut self, patient: bool) {
        self.watchdog.0.start(if patient { WATCHDOG_PATIENT_MS } else { WATCHDOG_RUN_MS }.millis());
    }
}

/// What the lowest priority asks of the board.
pub struct BoardStatus {
    /// What does not change.
    pub facts: BoardFacts,
    /// The jumper to ground that allows excitation and injection, against the pin's pull-up.
    pub jumper: PC12<Input>,
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
        cortex_m::asm::delay(self.facts.clocks.core_hz / WATCHDOG_SETTLES_HZ);
    }

    fn tells_pulses_apart(&self) -> bool {
        PULSES_ARE_EXACT.load(Ordering::Relaxed)
    }
}
