//! The watchdog: counts the crystal's microseconds, and resets all but the oscillators when it is not fed.

use cortex_m::peripheral::SCB;
use rotorlead::controller::hardware::{self, Watchdog as _};
use rp2040_hal::pac::{PSM, WATCHDOG};

use crate::pins::Pins;

/// Longest time without a feed while starting or while the flash stalls, the longest that there is: the design of the filter is some
/// 200 ms of double precision in software, and two sectors are erased in 0.8 s at most.
const LONG_TIMEOUT_US: u32 = 8_000_000;
/// Longest time without a feed from the control task, 100 of its ticks.
const RUN_TIMEOUT_US: u32 = 20_000;
/// The counter goes down by two in a microsecond: RP2040-E1.
const COUNTS_PER_US: u32 = 2;

/// Stands in a scratch register from [`Watchdog::start`] to the next start. Power-on and the pin RUN clear it. The boot ROM, which
/// restarts by the watchdog after a file was copied, does not use this register.
const RUNNING_MARKER: u32 = 0x9E5E_7D06;

/// The watchdog, running.
pub struct Watchdog {
    registers: WATCHDOG,
    load: u32,
}

impl Watchdog {
    /// Runs, with the longer of its two times, and goes on while a debug probe halts the core: the last pulses must not go on.
    #[allow(unsafe_code)]
    pub fn start(registers: WATCHDOG, power: &PSM) -> Self {
        let mut watchdog = Self { registers, load: 0 };
        select(power);
        watchdog.set_long_timeout(true);
        // SAFETY: any bits are as good.
        watchdog.registers.scratch0().write(|w| unsafe { w.bits(RUNNING_MARKER) });
        watchdog.registers.ctrl().write(|w| {
            w.pause_dbg0().clear_bit();
            w.pause_dbg1().clear_bit();
            w.pause_jtag().clear_bit();
            w.enable().set_bit()
        });
        watchdog
    }
}

impl hardware::Watchdog for Watchdog {
    fn set_long_timeout(&mut self, patient: bool) {
        self.load = COUNTS_PER_US * if patient { LONG_TIMEOUT_US } else { RUN_TIMEOUT_US };
        self.feed();
    }

    #[inline]
    fn feed(&mut self) {
        self.registers.load().write(|w| w.load().variant(self.load));
    }
}

/// Whether [`Watchdog::start`] was the last to start the watchdog before this reset. Says so once.
pub fn take_was_running(registers: &WATCHDOG) -> bool {
    let was_running = registers.scratch0().read().bits() == RUNNING_MARKER;
    registers.scratch0().reset();
    was_running
}

/// Leaves the firmware for the boot ROM's loader, with every output low: no flight goes on behind it.
#[allow(unsafe_code)]
pub fn enter_boot_loader() -> ! {
    cortex_m::interrupt::disable();
    crate::outputs::connect_low(&Pins::steal());
    // SAFETY: interrupts are off and this does not return, so nobody else has it.
    let registers = unsafe { WATCHDOG::steal() };
    take_was_running(&registers);
    // It resets the chip by the watchdog; both its drive and its other interface are on, and no lamp flashes.
    rp2040_hal::rom_data::reset_to_usb_boot(0, 0)
}

/// Cycles after which a reset that was asked for should have come.
const RESET_CYCLES: u32 = 1000;

/// Triggers a watchdog reset, which also resets pins and timers; the core's own reset request would not. Call only from a handler that
/// does not return.
#[allow(unsafe_code)]
pub fn reset() -> ! {
    // SAFETY: interrupts are off and this does not return, so nobody else has them.
    let (registers, power) = unsafe { (WATCHDOG::steal(), PSM::steal()) };
    select(&power);
    registers.ctrl().modify(|_, w| w.trigger().set_bit());
    cortex_m::asm::delay(RESET_CYCLES);
    SCB::sys_reset()
}

/// What the watchdog resets: all but the two oscillators, on which its clock goes on.
fn select(power: &PSM) {
    power.wdsel().write(|w| {
        w.rosc().clear_bit();
        w.xosc().clear_bit();
        all_others(w)
    });
}

fn all_others(w: &mut rp2040_hal::pac::psm::wdsel::W) -> &mut rp2040_hal::pac::psm::wdsel::W {
    w.clocks().set_bit();
    w.resets().set_bit();
    w.busfabric().set_bit();
    w.rom().set_bit();
    w.sram0().set_bit();
    w.sram1().set_bit();
    w.sram2().set_bit();
    w.sram3().set_bit();
    w.sram4().set_bit();
    w.sram5().set_bit();
    w.xip().set_bit();
    w.vreg_and_chip_reset().set_bit();
    w.sio().set_bit();
    w.proc0().set_bit();
    w.proc1().set_bit()
}
