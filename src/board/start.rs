//! From reset to a running board.

use heapless::spsc::{Consumer, Producer};
use stm32f4xx_hal::pac::{GPIOA, GPIOC, Peripherals};
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::watchdog::IndependentWatchdog;

use super::capture::{self, Capture};
use super::clocks::{self, ClockReport};
use super::control_timer::ControlTimer;
use super::outputs::{self, Outputs};
use super::postmortem::{self, StartReason};
use super::serial::{RECEIVE_QUEUE, SEND_QUEUE, Serial};
use super::settings_flash::SettingsFlash;
use super::thrust_adc::ThrustAdc;

/// Longest time without a feed while starting or while the flash stalls: the design of the filter is some 100 ms of
/// double precision in software, and two sectors are erased in 4 s at most.
const WATCHDOG_PATIENT_MS: u32 = 16_000;
/// Longest time without a feed from the control task, 100 of its ticks. The watchdog's own oscillator is good for
/// -47 % to +47 %.
const WATCHDOG_RUN_MS: u32 = 20;

/// Frame rate of the outputs, which are low, until the settings are loaded.
const FIRST_FRAME_HZ: u32 = 400;

/// The interrupts' ends of the link's queues.
pub struct Queues {
    /// Bytes from the host.
    pub received: Producer<'static, u8, RECEIVE_QUEUE>,
    /// Bytes to the host.
    pub to_send: Consumer<'static, u8, SEND_QUEUE>,
}

/// Everything that was set up.
pub struct Board {
    /// Why it was started.
    pub start_reason: StartReason,
    /// What it runs on.
    pub clocks: ClockReport,
    /// Inputs.
    pub capture: Capture,
    /// Outputs.
    pub outputs: Outputs,
    /// The control task's timer, not started.
    pub control_timer: ControlTimer,
    /// The link, `None` where its clock is too slow.
    pub serial: Option<Serial>,
    /// The thrust sensor's converter.
    pub thrust_adc: ThrustAdc,
    /// Where the settings are.
    pub flash: SettingsFlash,
    /// Already runs; to be fed.
    pub watchdog: Watchdog,
}

/// The independent watchdog: its oscillator is its own, and nothing but a reset stops it.
pub struct Watchdog(IndependentWatchdog);

impl Watchdog {
    /// From here on it must be fed by every few control ticks.
    pub fn tighten(&mut self) {
        self.0.start(WATCHDOG_RUN_MS.millis());
    }

    /// The core is about to stand still for a while.
    pub fn relax(&mut self) {
        self.0.start(WATCHDOG_PATIENT_MS.millis());
    }

    /// All is well.
    #[inline]
    pub fn feed(&mut self) {
        self.0.feed();
    }
}

impl Board {
    /// Sets everything up. Interrupts are off meanwhile.
    pub fn new(device: Peripherals, mut core: cortex_m::Peripherals, queues: Queues) -> Self {
        let start_reason = postmortem::take(&device.RCC);
        let mut watchdog = IndependentWatchdog::new(device.IWDG);
        // A core that a debug probe halts must not leave the last pulses running: the reset comes all the same.
        watchdog.stop_on_debug(&device.DBGMCU, false);
        watchdog.start(WATCHDOG_PATIENT_MS.millis());

        let (mut rcc, source) = clocks::start(device.RCC);
        let clocks = clocks::measure(source, &device.TIM2, &mut core.SYST, &mut rcc);

        let gpioc = device.GPIOC.split(&mut rcc);
        outputs_low();
        let pins = outputs::Pins(
            gpioc.pc6.into_input(),
            gpioc.pc7.into_input(),
            gpioc.pc8.into_input(),
            gpioc.pc9.into_input(),
        );
        let outputs = Outputs::new(device.TIM3, pins, FIRST_FRAME_HZ, clocks.timer_hz, &mut rcc);

        let gpioa = device.GPIOA.split(&mut rcc);
        let pins = capture::Pins(
            gpioa.pa0.into_alternate().internal_pull_down(true),
            gpioa.pa1.into_alternate().internal_pull_down(true),
            gpioa.pa2.into_alternate().internal_pull_down(true),
            gpioa.pa3.into_alternate().internal_pull_down(true),
        );
        let capture = Capture::new(device.TIM2, input_port(), pins, &mut rcc);

        let serial = Serial::new(device.USART3, (gpioc.pc10, gpioc.pc11), queues.received, queues.to_send, &mut rcc);
        Self {
            start_reason,
            clocks,
            capture,
            outputs,
            control_timer: ControlTimer::new(core.SYST, clocks.core_hz),
            serial: serial.ok(),
            thrust_adc: ThrustAdc::new(device.ADC1, &device.ADC_COMMON, gpioc.pc0.into_analog(), &mut rcc),
            flash: SettingsFlash::new(device.FLASH),
            watchdog: Watchdog(watchdog),
        }
    }
}

/// Port A, to read the levels of the inputs.
#[allow(unsafe_code)]
fn input_port() -> GPIOA {
    // SAFETY: only its input register is read, which has no side effects.
    unsafe { GPIOA::steal() }
}

/// Takes the outputs from their timer and holds them low.
#[allow(unsafe_code)]
pub fn outputs_low() {
    // SAFETY: called with interrupts off, at start-up or from a handler that does not return.
    outputs::force_low(&unsafe { GPIOC::steal() });
}
