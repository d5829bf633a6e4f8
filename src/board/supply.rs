//! The supply: the voltage detector, and the brown-out level of the option bytes.
//!
//! With the flash's wait states as they are, 168 MHz needs 2.7 V (RM0090, 3.5.1). Below it the core may do anything, so the
//! detector, set above it, takes the outputs low while the core can still be trusted.

use rotorlead::link::BrownOut;
use stm32f4xx_hal::pac::{EXTI, FLASH, PWR};
use stm32f4xx_hal::rcc::{Enable, Rcc};

use super::postmortem;

/// Threshold of the detector, 2.8 V: RM0090, 5.4.1, PLS.
const THRESHOLD: u8 = 0b110;
/// Line of the detector at the interrupt controller: high where the supply is low (RM0090, 5.2.3).
const LINE: u8 = 16;
/// Reads of the detector before the supply counts as low at a start: at least 6 cycles of 168 MHz each, 3.5 ms.
const PATIENCE: u32 = 100_000;

/// Switches the voltage detector on; from here on a low supply raises its interrupt. A supply that is low already, and
/// stays so, restarts the controller: the outputs are low all the while.
pub fn watch(power: &PWR, lines: &EXTI, rcc: &mut Rcc) {
    PWR::enable(rcc);
    power.cr().modify(|_, w| {
        w.pls().set(THRESHOLD);
        w.pvde().set_bit()
    });
    if (0..PATIENCE).all(|_| power.csr().read().pvdo().bit_is_set()) {
        postmortem::supply_low();
    }
    lines.rtsr().modify(|_, w| w.tr(LINE).set_bit());
    // Whatever came while it was set up is over; what comes from here on is caught by the line, or seen below.
    lines.pr().write(|w| w.pr(LINE).clear_bit_by_one());
    lines.imr().modify(|_, w| w.mr(LINE).set_bit());
    if power.csr().read().pvdo().bit_is_set() {
        postmortem::supply_low();
    }
}

/// At which voltage the chip resets: RM0090, 3.9.10, BOR_LEV.
pub fn brown_out(flash: &FLASH) -> BrownOut {
    let options = flash.optcr().read();
    // Its protection bits are never all 0 on a chip that runs; an emulator's are.
    if options.bits() == 0 {
        return BrownOut::Unknown;
    }
    match options.bor_lev().bits() {
        0b00 => BrownOut::Level3,
        0b01 => BrownOut::Level2,
        0b10 => BrownOut::Level1,
        _ => BrownOut::Off,
    }
}
