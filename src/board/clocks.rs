//! Clocks: crystal and PLL where they come up, less where they do not.
//!
//! | source | core | timers on APB1 | accuracy of pulse widths |
//! |---|---|---|---|
//! | crystal (8 MHz) and PLL | 168 MHz | 84 MHz | crystal, 50 ppm |
//! | internal oscillator (16 MHz) and PLL | 168 MHz | 84 MHz | 1 % at 25 °C, -8 to +4.5 % over temperature |
//! | internal oscillator | 16 MHz | 16 MHz | the same |
//!
//! On the internal oscillator the link, excitation and injection work, and pulses unlock no motor: those that arm could not
//! be distinguished from others. A crystal that runs is counted against the internal oscillator first; one of another
//! frequency than the board's is not used.
//!
//! The HAL waits for oscillators without limit. So each is first tried here with a bounded wait, and the HAL is asked
//! only for what has just been seen to run.

use cortex_m::peripheral::SYST;
use cortex_m::peripheral::syst::SystClkSource;
use rotorlead::controller::{ClockReport, check_crystal, check_timer};
use rotorlead::link::{Clock, CrystalCheck};
use stm32f4xx_hal::pac::{RCC, TIM2, TIM11};
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::rcc::{Config, Enable, HSI, Rcc, Reset};

/// The crystal of the supported boards.
const CRYSTAL_HZ: u32 = 8_000_000;
/// Core clock on the PLL, the fastest that the STM32F405 allows.
const CORE_HZ: u32 = 168_000_000;
/// Reads of a status register before an oscillator counts as dead. A read takes at least 6 cycles of 16 MHz: 37 ms,
/// 18 times the 2 ms that a crystal typically takes to start.
const PATIENCE: u32 = 100_000;
/// Input of the PLL that both sources are divided down to, 1 MHz, and its multiplier and divider for 168 MHz.
const PLL_INPUT_HZ: u32 = 1_000_000;
const PLL_MULTIPLIER: u16 = 336;

/// What runs, before the timers' clock is looked at.
pub struct Oscillator {
    source: Clock,
    crystal: CrystalCheck,
}

/// Brings up the fastest clock that runs and may be believed.
pub fn start(rcc: RCC, counter: &TIM11) -> (Rcc, Oscillator) {
    let starts = crystal_starts(&rcc);
    let crystal = if starts { measure_crystal(&rcc, counter) } else { CrystalCheck::NotChecked };
    let is_usable = starts && !matches!(crystal, CrystalCheck::Wrong { .. });
    let pll = pll_starts(&rcc, is_usable);
    let (config, source) = match (is_usable, pll) {
        (true, true) => (Config::hse(CRYSTAL_HZ.Hz()).sysclk(CORE_HZ.Hz()), Clock::Crystal),
        (false, true) => (Config::hsi().sysclk(CORE_HZ.Hz()), Clock::InternalPll),
        // A crystal without a PLL would give 8 MHz, which is less than the internal oscillator.
        (_, false) => (Config::hsi(), Clock::Internal),
    };
    if source != Clock::Crystal {
        rcc.cr().modify(|_, w| w.hseon().clear_bit());
    }
    let rcc = rcc.freeze(config);
    if source == Clock::Crystal {
        // A crystal that dies from now on raises the non-maskable interrupt, which stops the outputs: the core would go
        // on with 16 MHz and pulses ten times too long.
        rcc.cr().modify(|_, w| w.csson().set_bit());
    }
    (rcc, Oscillator { source, crystal })
}

/// Divider of the crystal on its way to TIM11, the largest: the core must see every capture.
const CRYSTAL_DIVIDER: u8 = 31;
/// The timer captures one edge in so many.
const CAPTURE_DIVIDER: u32 = 8;
/// Captures that are counted. At 8 MHz they take 15 872 counts of the 16-bit timer, and at 2 MHz 63 488.
const CAPTURES: u32 = 32;

/// Counts the crystal's periods by the internal oscillator, on which the core still runs. RM0090, 18.4.11 ("TIM11 option
/// register") and 6.2.11 ("Internal/external clock measurement"): the divided crystal is connected to channel 1 of TIM11.
/// Its reset line is left alone: QEMU 10.0 ends on a pulse of any of its bus.
#[allow(unsafe_code)]
fn measure_crystal(rcc: &RCC, counter: &TIM11) -> CrystalCheck {
    rcc.cfgr().modify(|_, w| w.rtcpre().set(CRYSTAL_DIVIDER));
    rcc.apb2enr().modify(|_, w| w.tim11en().set_bit());
    // The bus takes two cycles to pass the clock on (RM0090, 6.2.15).
    let _ = rcc.apb2enr().read();
    // SAFETY: 0b10 is one of the three sources that there are.
    counter.or().write(|w| unsafe { w.rmp().bits(0b10) });
    counter.psc().write(|w| w.psc().set(0));
    counter.arr().write(|w| w.arr().set(u16::MAX));
    // Input 1, one edge in 8.
    counter.ccmr1_input().write(|w| {
        w.cc1s().ti1();
        w.ic1psc().set(0b11)
    });
    counter.ccer().write(|w| w.cc1e().set_bit());
    counter.cr1().write(|w| w.cen().set_bit());
    let capture = || wait(|| counter.sr().read().cc1if().bit_is_set()).then(|| counter.ccr1().read().ccr().bits());
    let first = capture();
    let last = (0..CAPTURES).try_fold(0, |_, _| capture());
    counter.cr1().write(|w| w.cen().clear_bit());
    rcc.cfgr().modify(|_, w| w.rtcpre().set(0));
    rcc.apb2enr().modify(|_, w| w.tim11en().clear_bit());
    let (Some(first), Some(last)) = (first, last) else { return CrystalCheck::NotChecked };
    let periods = u32::from(CRYSTAL_DIVIDER) * CAPTURE_DIVIDER * CAPTURES;
    check_crystal(CRYSTAL_HZ, HSI, periods, u32::from(last.wrapping_sub(first)))
}

fn crystal_starts(rcc: &RCC) -> bool {
    rcc.cr().modify(|_, w| w.hseon().set_bit());
    wait(|| rcc.cr().read().hserdy().bit_is_set())
}

/// Runs the PLL at the frequency that it is wanted for, and stops it again.
#[allow(unsafe_code)]
fn pll_starts(rcc: &RCC, crystal: bool) -> bool {
    let source_hz = if crystal { CRYSTAL_HZ } else { HSI };
    rcc.pllcfgr().modify(|_, w| {
        if crystal {
            w.pllsrc().hse();
        } else {
            w.pllsrc().hsi();
        }
        w.pllp().div2();
        // SAFETY: within the reference manual's limits: an input of 1 to 2 MHz, an oscillator of 100 to 432 MHz.
        unsafe {
            w.plln().bits(PLL_MULTIPLIER);
            w.pllm().bits((source_hz / PLL_INPUT_HZ) as u8)
        }
    });
    rcc.cr().modify(|_, w| w.pllon().set_bit());
    let starts = wait(|| rcc.cr().read().pllrdy().bit_is_set());
    rcc.cr().modify(|_, w| w.pllon().clear_bit());
    // Its registers may be written only when it stands still.
    starts && wait(|| rcc.cr().read().pllrdy().bit_is_clear())
}

fn wait(ready: impl Fn() -> bool) -> bool {
    (0..PATIENCE).any(|_| ready())
}

/// Iterations for which the two counters run side by side, some 10 000 core cycles.
const COMPARISON: u32 = 2000;
/// Range of the core's own counter.
const SYSTICK_MASK: u32 = 0x00FF_FFFF;

/// Compares the timer clock that the registers promise with the core clock, and believes what it sees.
pub fn measure(oscillator: Oscillator, tim2: &TIM2, syst: &mut SYST, rcc: &mut Rcc) -> ClockReport {
    let core_hz = rcc.clocks.hclk().raw();
    TIM2::enable(rcc);
    TIM2::reset(rcc);
    tim2.psc().write(|w| w.psc().set(0));
    tim2.arr().write(|w| w.arr().set(u32::MAX));
    tim2.egr().write(|w| w.ug().set_bit());
    tim2.cr1().modify(|_, w| w.cen().set_bit());
    syst.set_clock_source(SystClkSource::Core);
    syst.set_reload(SYSTICK_MASK);
    syst.clear_current();
    syst.enable_counter();
    let (core_start, timer_start) = (SYST::get_current(), tim2.cnt().read().bits());
    for _ in 0..COMPARISON {
        cortex_m::asm::nop();
    }
    let (core_end, timer_end) = (SYST::get_current(), tim2.cnt().read().bits());
    syst.disable_counter();
    tim2.cr1().modify(|_, w| w.cen().clear_bit());

    // SysTick counts down.
    let core_ticks = core_start.wrapping_sub(core_end) & SYSTICK_MASK;
    let timer_ticks = timer_end.wrapping_sub(timer_start);
    let (timer_hz, timer_as_promised) = check_timer(core_hz, rcc.clocks.timclk1().raw(), core_ticks, timer_ticks);
    let Oscillator { source, crystal } = oscillator;
    ClockReport { source, core_hz, timer_hz, timer_as_promised, crystal }
}
