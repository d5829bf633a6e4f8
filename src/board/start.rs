//! From reset to a running board.

use heapless::spsc::{Consumer, Producer};
use rotorlead::controller::hardware::{BoardFacts, ControlParts, NoInputFrames};
use rotorlead::systick::ControlTimer;
use stm32f4xx_hal::pac::{GPIOA, GPIOC, Peripherals};
use stm32f4xx_hal::prelude::*;

use super::capture::{self, Capture};
use super::clocks;
use super::outputs::{self, Outputs};
use super::serial::{RECEIVE_QUEUE, SEND_QUEUE, Serial};
use super::settings_flash::SettingsFlash;
use super::thrust_adc::ThrustAdc;
use super::watchdog::Watchdog;
use super::{BoardStatus, Stm32f405, postmortem, supply};

/// The interrupts' ends of the link's queues.
pub struct Queues {
    /// Bytes from the host.
    pub received: Producer<'static, u8, RECEIVE_QUEUE>,
    /// Bytes to the host.
    pub to_send: Consumer<'static, u8, SEND_QUEUE>,
}

/// Everything that was set up.
pub struct Board {
    /// Inputs.
    pub capture: Capture,
    /// What the control task drives; its ticks are not started.
    pub control: ControlParts<Stm32f405>,
    /// The link, `None` where its clock is too slow.
    pub serial: Option<Serial>,
    /// Where the settings are.
    pub flash: SettingsFlash,
    /// What the lowest priority asks.
    pub status: BoardStatus,
}

impl Board {
    /// Sets everything up. Interrupts are off meanwhile.
    pub fn new(device: Peripherals, mut core: cortex_m::Peripherals, queues: Queues) -> Self {
        let reset = postmortem::take(&device.RCC);
        postmortem::resume_source().memory.begin_start();
        let watchdog = Watchdog::start(device.IWDG, &device.DBGMCU);

        let (mut rcc, oscillator) = clocks::start(device.RCC, &device.TIM11);
        let clocks = clocks::measure(oscillator, &device.TIM2, &mut core.SYST, &mut rcc);

        let gpioc = device.GPIOC.split(&mut rcc);
        outputs_low();
        supply::watch(&device.PWR, &device.EXTI, &mut rcc);
        let pins = outputs::Pins(
            gpioc.pc6.into_input(),
            gpioc.pc7.into_input(),
            gpioc.pc8.into_input(),
            gpioc.pc9.into_input(),
        );
        let outputs = Outputs::new(device.TIM3, pins, &mut rcc);

        let gpioa = device.GPIOA.split(&mut rcc);
        let pins = capture::Pins(
            gpioa.pa0.into_alternate().internal_pull_down(true),
            gpioa.pa1.into_alternate().internal_pull_down(true),
            gpioa.pa2.into_alternate().internal_pull_down(true),
            gpioa.pa3.into_alternate().internal_pull_down(true),
        );
        let capture = Capture::new(device.TIM2, input_port(), pins, &mut rcc);

        // An open line reads as idle.
        let pins = (gpioc.pc10, gpioc.pc11.internal_pull_up(true));
        let serial = Serial::new(device.USART3, pins, queues.received, queues.to_send, &mut rcc);
        let brown_out = supply::brown_out(&device.FLASH);
        let facts = BoardFacts { clocks, reset, brown_out, speaks_dshot: false, has_boot_loader: false };
        Self {
            capture,
            control: ControlParts {
                outputs,
                input_frames: NoInputFrames,
                timer: ControlTimer::new(core.SYST, clocks.core_hz),
                thrust: ThrustAdc::new(device.ADC1, &device.ADC_COMMON, gpioc.pc0.into_analog(), &mut rcc),
                watchdog,
            },
            serial: serial.ok(),
            flash: SettingsFlash::new(device.FLASH),
            status: BoardStatus { facts, jumper: gpioc.pc12.into_pull_up_input() },
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
