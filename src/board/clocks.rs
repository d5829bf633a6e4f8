//! Clocks: crystal and PLL where they come up, less where they do not.
//!
//! | source | core | timers on APB1 | accuracy of pulse widths |
//! |---|---|---|---|
//! | crystal (8 MHz) and PLL | 168 MHz | 84 MHz | crystal, 50 ppm |
//! | internal oscillator (16 MHz) and PLL | 168 MHz | 84 MHz | 1 % at 25 °C, -8 to +4.5 % over temperature |
//! | internal oscillator | 16 MHz | 16 MHz | the same |
//!
//! On the internal oscillator the link, excitation and injection work, and pulses unlock no motor: they could not be told
//! armed from disarmed.
//!
//! The HAL waits for oscillators without limit. So each is first tried here with a bounded wait, and the HAL is asked
//! only for what has just been seen to run.

use cortex_m::peripheral::SYST;
use cortex_m::peripheral::syst::SystClkSource;
use rotorlead::link::Clock;
use rotorlead::settings::SLOWEST_TIMER_HZ;
use stm32f4xx_hal::pac::{RCC, TIM2};
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::rcc::{Config, Enable, Rcc, Reset};

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

/// What the core runs on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, defmt::Format)]
pub enum Source {
    /// As intended: 168 MHz from the crystal.
    CrystalPll,
    /// The crystal did not start.
    InternalPll,
    /// Neither crystal nor PLL started.
    Internal,
}

impl From<Source> for Clock {
    fn from(source: Source) -> Self {
        match source {
            Source::CrystalPll => Self::Crystal,
            Source::InternalPll => Self::InternalPll,
            Source::Internal => Self::Internal,
        }
    }
}

/// The clocks as they run, for the host to see.
#[derive(Clone, Copy, Debug, defmt::Format)]
pub struct ClockReport {
    /// What the core runs on.
    pub source: Source,
    /// Core clock.
    pub core_hz: u32,
    /// Clock of the timers on APB1 (TIM2 to TIM5).
    pub timer_hz: u32,
    /// Whether `timer_hz` is what the registers promise. If not, it was measured against the core clock.
    pub timer_as_promised: bool,
}

/// Brings up the fastest clock that runs.
pub fn start(rcc: RCC) -> (Rcc, Source) {
    let crystal = crystal_starts(&rcc);
    let pll = pll_starts(&rcc, crystal);
    let (config, source) = match (crystal, pll) {
        (true, true) => (Config::hse(CRYSTAL_HZ.Hz()).sysclk(CORE_HZ.Hz()), Source::CrystalPll),
        (false, true) => (Config::hsi().sysclk(CORE_HZ.Hz()), Source::InternalPll),
        // A crystal without a PLL would give 8 MHz, which is less than the internal oscillator.
        (_, false) => (Config::hsi(), Source::Internal),
    };
    if source != Source::CrystalPll {
        rcc.cr().modify(|_, w| w.hseon().clear_bit());
    }
    let rcc = rcc.freeze(config);
    if source == Source::CrystalPll {
        // A crystal that dies from now on raises the non-maskable interrupt, which stops the outputs: the core would go
        // on with 16 MHz and pulses ten times too long.
        rcc.cr().modify(|_, w| w.csson().set_bit());
    }
    (rcc, source)
}

fn crystal_starts(rcc: &RCC) -> bool {
    rcc.cr().modify(|_, w| w.hseon().set_bit());
    wait(|| rcc.cr().read().hserdy().bit_is_set())
}

/// Runs the PLL at the frequency that it is wanted for, and stops it again.
#[allow(unsafe_code)]
fn pll_starts(rcc: &RCC, crystal: bool) -> bool {
    let source_hz = if crystal { CRYSTAL_HZ } else { stm32f4xx_hal::rcc::HSI };
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
/// A deviation below one part in this many is the comparison's own: at most 20 cycles of bus traffic in 10 000.
const TOLERANCE: u64 = 100;
/// Range of the core's own counter.
const SYSTICK_MASK: u32 = 0x00FF_FFFF;

/// Compares the timer clock that the registers promise with the core clock, and believes what it sees.
///
/// The factor between the two depends on three dividers and a rule about doubling. Everything that is a pulse or a
/// sampling rate rests on it, so it is worth a look at start-up; an emulator whose timers have a clock of their own is
/// found out, too.
pub fn measure(source: Source, tim2: &TIM2, syst: &mut SYST, rcc: &mut Rcc) -> ClockReport {
    let core_hz = rcc.clocks.hclk().raw();
    let promised_hz = rcc.clocks.timclk1().raw();
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
    let core_ticks = u64::from(core_start.wrapping_sub(core_end) & SYSTICK_MASK);
    let timer_ticks = u64::from(timer_end.wrapping_sub(timer_start));
    let measured_hz = (timer_ticks * u64::from(core_hz)).checked_div(core_ticks).unwrap_or(0);
    let promised = u64::from(promised_hz);
    let timer_as_promised = measured_hz.abs_diff(promised) <= promised / TOLERANCE;
    // A timer that stands still, or races beyond all measure, cannot be used whatever one believes. What is used suits
    // the default settings.
    let timer_hz = match u32::try_from(measured_hz) {
        Ok(hz) if !timer_as_promised && hz >= SLOWEST_TIMER_HZ => hz,
        _ => promised_hz,
    };
    ClockReport { source, core_hz, timer_hz, timer_as_promised }
}
