//! From reset to a running board.

use heapless::spsc::{Consumer, Producer};
use rotorlead::controller::hardware::{BoardFacts, ControlParts};
use rotorlead::link::BrownOut;
use rotorlead::systick::ControlTimer;
use rotorlead_rp2040::generated::{JUMPER, LED};
use rp2040_hal::pac::io_bank0::gpio::gpio_ctrl::FUNCSEL_A;
use rp2040_hal::pac::{Peripherals, RESETS, TIMER};

use crate::boot;
use crate::clocks::{self, Parts};
use crate::inputs::{self, Capture, InputFrames};
use crate::outputs::Outputs;
use crate::parts::{BoardStatus, Rp2040};
use crate::pins::{Pins, Pull};
use crate::postmortem;
use crate::serial::Serial;
use crate::settings_flash::SettingsFlash;
use crate::thrust_adc::ThrustAdc;
use crate::usb::Usb;
use crate::watchdog::Watchdog;
use crate::wire::{RECEIVE_QUEUE, SEND_QUEUE, WIRES};

/// Reads of the reset controller before a part counts as dead. It takes some cycles.
const PATIENCE: u32 = 10_000;
/// Flashes of the lamp that say that a clock did not start, before the next try.
const FLASHES: u32 = 20;
/// Half of such a flash in turns of the loop, of 3 cycles at 4 to 12 MHz: 30 to 100 ms.
const FLASH_CYCLES: u32 = 400_000;

/// An interrupt's ends of the queues of a wire.
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
    pub control: ControlParts<Rp2040>,
    /// The link by the UART.
    pub serial: Serial,
    /// The link by USB.
    pub usb: Usb,
    /// Where the settings are.
    pub flash: SettingsFlash,
    /// What the lowest priority asks.
    pub status: BoardStatus,
    /// Microseconds.
    pub timer: TIMER,
}

impl Board {
    /// Sets everything up. Interrupts are off meanwhile. The pins are inputs with a pull-down from a reset on.
    pub fn new(device: Peripherals, mut core: cortex_m::Peripherals, [uart, usb]: [Queues; WIRES]) -> Self {
        boot::move_vectors(&mut core.SCB);
        boot::guard_stack(&mut core.MPU);
        boot::slow_ring_oscillator(&device.ROSC);
        clocks::raise_brown_out(&device.VREG_AND_CHIP_RESET);
        let reset = postmortem::take(&device.WATCHDOG, &device.VREG_AND_CHIP_RESET, &device.RESETS);
        postmortem::resume_source().memory.begin_start();
        leave_reset(&device.RESETS);
        let pins = Pins::new(device.IO_BANK0, device.PADS_BANK0, device.SIO);
        let outputs = Outputs::new(device.PWM, Pins::steal());
        pins.set_low_output(LED);
        pins.set(JUMPER, FUNCSEL_A::SIO, Pull::Up);
        inputs::connect(&pins);

        let parts =
            Parts { crystal: device.XOSC, system_pll: device.PLL_SYS, usb_pll: device.PLL_USB, clocks: device.CLOCKS };
        if clocks::start(&parts, &device.RESETS, &device.WATCHDOG).is_none() {
            try_again(&pins);
        }
        leave_reset_of_clocked(&device.RESETS);
        // Its microseconds come from the crystal.
        let watchdog = Watchdog::start(device.WATCHDOG, &device.PSM);
        let clocks = clocks::measure(&device.TIMER, &mut core.SYST);
        let brown_out = BrownOut::Unknown;
        let facts = BoardFacts { clocks, reset, brown_out, speaks_dshot: true, has_boot_loader: true };
        Self {
            capture: Capture::new(timer()),
            control: ControlParts {
                input_frames: InputFrames::new(timer()),
                outputs,
                timer: ControlTimer::new(core.SYST, clocks.core_hz),
                thrust: ThrustAdc::new(device.ADC, &pins),
                watchdog,
            },
            serial: Serial::new(device.UART0, &pins, uart.received, uart.to_send),
            usb: Usb::new(device.USBCTRL_REGS, device.USBCTRL_DPRAM, usb.received, usb.to_send),
            flash: SettingsFlash::new(),
            status: BoardStatus { facts, pins },
            timer: device.TIMER,
        }
    }
}

/// What needs no clock but the core's.
fn leave_reset(resets: &RESETS) {
    resets.reset().modify(|_, w| {
        w.io_bank0().clear_bit();
        w.pads_bank0().clear_bit();
        w.pio0().clear_bit();
        w.pio1().clear_bit();
        w.pwm().clear_bit();
        w.timer().clear_bit()
    });
    for _ in 0..PATIENCE {
        let done = resets.reset_done().read();
        let pins = done.io_bank0().bit() && done.pads_bank0().bit();
        if pins && done.pio0().bit() && done.pio1().bit() && done.pwm().bit() && done.timer().bit() {
            break;
        }
    }
}

/// What needs a clock of its own, which runs now.
fn leave_reset_of_clocked(resets: &RESETS) {
    resets.reset().modify(|_, w| {
        w.adc().clear_bit();
        w.uart0().clear_bit();
        w.usbctrl().clear_bit()
    });
    for _ in 0..PATIENCE {
        let done = resets.reset_done().read();
        if done.adc().bit() && done.uart0().bit() && done.usbctrl().bit() {
            break;
        }
    }
}

/// A clock does not start: the lamp flickers for a while, with all outputs low, and all begins anew.
fn try_again(pins: &Pins) -> ! {
    for _ in 0..FLASHES {
        pins.put(LED, true);
        cortex_m::asm::delay(FLASH_CYCLES);
        pins.put(LED, false);
        cortex_m::asm::delay(FLASH_CYCLES);
    }
    crate::watchdog::reset()
}

/// The timer, to read its microseconds.
#[allow(unsafe_code)]
fn timer() -> TIMER {
    // SAFETY: only the register of its lower half is read, which has no side effects.
    unsafe { TIMER::steal() }
}
