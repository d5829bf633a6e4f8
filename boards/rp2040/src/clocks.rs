//! Clocks: the crystal of 12 MHz, and both PLLs.
//!
//! | clock | from | rate |
//! |---|---|---|
//! | core, PIO, PWM, UART | system PLL | 125 MHz |
//! | microseconds of timer and watchdog | crystal | 1 MHz |
//! | converter, USB | USB PLL | 48 MHz |
//!
//! A crystal that does not start leaves the ring oscillator, at 4 to 8 MHz: too slow and too inexact for pulses and link. Then there
//! is nothing to run.

use cortex_m::peripheral::SYST;
use cortex_m::peripheral::syst::SystClkSource;
use rotorlead::controller::{ClockReport, check_timer};
use rotorlead::link::{Clock, CrystalCheck};
use rp2040_hal::pac::{CLOCKS, PLL_SYS, PLL_USB, RESETS, TIMER, VREG_AND_CHIP_RESET, WATCHDOG, XOSC, pll_sys};

/// The crystal.
const CRYSTAL_HZ: u32 = 12_000_000;
/// Core clock: the crystal times 125, over 6 and 2.
pub const CORE_HZ: u32 = 125_000_000;
/// Cycles of the core between two counts: those of the stamping loop.
pub const COUNT_CYCLES: u32 = 5;
/// Multiplier and dividers of the system PLL, whose oscillator runs at 1500 MHz (RP2040 datasheet, 2.18.2).
pub const SYSTEM_PLL: (u16, u8, u8) = (125, 6, 2);
/// Of the USB PLL: 1200 MHz, and 48 MHz.
const USB_PLL: (u16, u8, u8) = (100, 5, 5);
/// Start-up of the crystal in 256 of its periods: 63 ms. One is enough on a Pico, and not for every crystal of other boards.
const CRYSTAL_DELAY: u16 = 63 * (CRYSTAL_HZ / 1000 / 256) as u16;
/// Reads of a status register before an oscillator counts as dead. A read takes at least 5 cycles of 12 MHz: 0.4 s.
const PATIENCE: u32 = 1_000_000;
/// Microseconds for which the core's counter is compared with the timer: a hundred times what the reads at either end take.
const COMPARISON_US: u32 = 1000;

/// Threshold of the brown-out detector: 0.946 V, where it is 0.860 V after a reset (RP2040 datasheet, 2.12.9). The core has 1.1 V and is
/// specified from 0.99 V on, for 133 MHz. The next step, 0.989 V, would be 10 % below the supply, of which the regulator's tolerance, its
/// ripple and the detector's own tolerance take their parts; and a reset for nothing ends a flight.
const BROWN_OUT: u8 = 0b1011;

/// Lets a fall of the core's supply reset the chip before the clock is too fast for it.
pub fn raise_brown_out(chip: &VREG_AND_CHIP_RESET) {
    chip.bod().write(|w| {
        w.vsel().variant(BROWN_OUT);
        w.en().set_bit()
    });
}

/// What the clocks are made of.
pub struct Parts {
    pub crystal: XOSC,
    pub system_pll: PLL_SYS,
    pub usb_pll: PLL_USB,
    pub clocks: CLOCKS,
}

/// Starts the clocks; `None` where one does not start.
pub fn start(parts: &Parts, resets: &RESETS, watchdog: &WATCHDOG) -> Option<()> {
    start_crystal(&parts.crystal)?;
    let clocks = &parts.clocks;
    clocks.clk_ref_ctrl().modify(|_, w| w.src().xosc_clksrc());
    wait(|| clocks.clk_ref_selected().read().bits() == 1 << 2)?;
    // From the crystal while the PLLs are set up, and with its other inputs off.
    clocks.clk_sys_ctrl().modify(|_, w| w.src().clk_ref());
    wait(|| clocks.clk_sys_selected().read().bits() == 1)?;
    // Where the core was on the system PLL while the image was copied, all of it begins anew.
    resets.reset().modify(|_, w| {
        w.pll_sys().set_bit();
        w.pll_usb().set_bit()
    });
    resets.reset().modify(|_, w| {
        w.pll_sys().clear_bit();
        w.pll_usb().clear_bit()
    });
    wait(|| {
        let done = resets.reset_done().read();
        done.pll_sys().bit() && done.pll_usb().bit()
    })?;
    start_pll(&parts.system_pll, SYSTEM_PLL)?;
    start_pll(&parts.usb_pll, USB_PLL)?;
    clocks.clk_sys_ctrl().modify(|_, w| w.auxsrc().clksrc_pll_sys());
    clocks.clk_sys_ctrl().modify(|_, w| w.src().clksrc_clk_sys_aux());
    wait(|| clocks.clk_sys_selected().read().bits() == 1 << 1)?;
    clocks.clk_peri_ctrl().write(|w| {
        w.auxsrc().clk_sys();
        w.enable().set_bit()
    });
    clocks.clk_adc_ctrl().write(|w| {
        w.auxsrc().clksrc_pll_usb();
        w.enable().set_bit()
    });
    clocks.clk_usb_ctrl().write(|w| {
        w.auxsrc().clksrc_pll_usb();
        w.enable().set_bit()
    });
    start_microseconds(watchdog);
    Some(())
}

fn start_crystal(crystal: &XOSC) -> Option<()> {
    // A reset by the watchdog leaves it running.
    let status = crystal.status().read();
    if status.stable().bit() && status.enabled().bit() {
        return Some(());
    }
    crystal.ctrl().write(|w| w.freq_range()._1_15mhz());
    crystal.startup().write(|w| w.delay().variant(CRYSTAL_DELAY));
    crystal.ctrl().modify(|_, w| w.enable().enable());
    wait(|| crystal.status().read().stable().bit())
}

fn start_pll(pll: &pll_sys::RegisterBlock, (multiplier, first, second): (u16, u8, u8)) -> Option<()> {
    pll.cs().write(|w| w.refdiv().variant(1));
    pll.fbdiv_int().write(|w| w.fbdiv_int().variant(multiplier));
    pll.pwr().modify(|_, w| {
        w.pd().clear_bit();
        w.vcopd().clear_bit()
    });
    wait(|| pll.cs().read().lock().bit())?;
    pll.prim().write(|w| {
        w.postdiv1().variant(first);
        w.postdiv2().variant(second)
    });
    pll.pwr().modify(|_, w| w.postdivpd().clear_bit());
    Some(())
}

/// The watchdog divides the crystal down for itself and for the timer.
fn start_microseconds(watchdog: &WATCHDOG) {
    watchdog.tick().write(|w| {
        w.cycles().variant((CRYSTAL_HZ / 1_000_000) as u16);
        w.enable().set_bit()
    });
}

fn wait(ready: impl Fn() -> bool) -> Option<()> {
    (0..PATIENCE).any(|_| ready()).then_some(())
}

/// Compares the core's clock with the crystal's microseconds: both dividers of the PLL, and its multiplier, are believed when seen.
pub fn measure(timer: &TIMER, syst: &mut SYST) -> ClockReport {
    const SYSTICK_MASK: u32 = 0x00FF_FFFF;
    syst.set_clock_source(SystClkSource::Core);
    syst.set_reload(SYSTICK_MASK);
    syst.clear_current();
    syst.enable_counter();
    let microseconds = || timer.timerawl().read().bits();
    let first = microseconds();
    let next = |from: u32, count: u32| wait(|| microseconds().wrapping_sub(from) >= count);
    // From the beginning of a microsecond to that of another.
    let counted = next(first, 1).and_then(|()| {
        let (from_us, from) = (microseconds(), SYST::get_current());
        next(from_us, COMPARISON_US)?;
        let (to_us, to) = (microseconds(), SYST::get_current());
        Some((to_us.wrapping_sub(from_us), from.wrapping_sub(to) & SYSTICK_MASK))
    });
    syst.disable_counter();
    let (timer_us, cycles) = counted.unwrap_or_default();
    let (core_hz, as_promised) = check_timer(1_000_000, CORE_HZ, timer_us, cycles);
    ClockReport {
        source: Clock::Crystal,
        core_hz,
        timer_hz: core_hz / COUNT_CYCLES,
        timer_as_promised: as_promised,
        crystal: CrystalCheck::NotChecked,
    }
}
