//! ADC1, channel 10 (PC0): the amplifier of the thrust sensor, one conversion per control tick.
//!
//! Set up by its registers: the HAL pulses the reset line of its bus, on which QEMU 10.0 ends.

use rotorlead::controller::hardware::ThrustConverter;
use stm32f4xx_hal::gpio::Analog;
use stm32f4xx_hal::pac::{ADC_COMMON, ADC1};
use stm32f4xx_hal::rcc::{Enable, Rcc};

use super::generated::Thrust;

const CHANNEL: u8 = 10;

/// The converter and its pin.
pub struct ThrustAdc {
    converter: ADC1,
    _pin: Thrust<Analog>,
    last: u16,
}

impl ThrustAdc {
    /// Switches it on: 12 bits, 28 + 12 cycles of a quarter of the bus clock per conversion (2 µs at 84 MHz).
    pub fn new(converter: ADC1, common: &ADC_COMMON, pin: Thrust<Analog>, rcc: &mut Rcc) -> Self {
        ADC1::enable(rcc);
        // At most 36 MHz.
        common.ccr().modify(|_, w| w.adcpre().div4());
        converter.smpr1().write(|w| w.smp10().cycles28());
        // SAFETY: channels are 0 to 18.
        converter.sqr3().write(|w| unsafe { w.sq1().bits(CHANNEL) });
        converter.cr2().write(|w| w.adon().set_bit());
        Self { converter, _pin: pin, last: 0 }
    }
}

impl ThrustConverter for ThrustAdc {
    #[inline]
    fn start(&mut self) {
        // Flags are cleared by writing 0, and all of this converter's are its own.
        self.converter.sr().reset();
        self.converter.cr2().modify(|_, w| w.swstart().set_bit());
    }

    #[inline]
    fn read(&mut self) -> u16 {
        if self.converter.sr().read().eoc().bit_is_set() {
            self.last = self.converter.dr().read().data().bits();
        }
        self.last
    }
}
