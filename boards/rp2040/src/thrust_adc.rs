//! The converter, input 0: the amplifier of the thrust sensor, one conversion per control tick.

use rotorlead::controller::hardware::ThrustConverter;
use rotorlead_rp2040::generated::{REGULATOR_MODE, THRUST};
use rp2040_hal::pac::ADC;

use crate::pins::Pins;

/// The converter: 12 bits in 96 cycles of 48 MHz, 2 µs.
pub struct ThrustAdc {
    converter: ADC,
    last: u16,
}

impl ThrustAdc {
    /// Switches it on, out of reset. The Pico's regulator, whose output is the converter's reference, leaves its power-save mode: there
    /// its bursts follow the load, and so the ticks, and would come at the same time of each conversion.
    pub fn new(converter: ADC, pins: &Pins) -> Self {
        pins.set_low_output(REGULATOR_MODE);
        pins.put(REGULATOR_MODE, true);
        pins.set_analog(THRUST);
        converter.cs().write(|w| {
            w.en().set_bit();
            w.ainsel().variant(0)
        });
        Self { converter, last: 0 }
    }
}

impl ThrustConverter for ThrustAdc {
    #[inline]
    fn start(&mut self) {
        self.converter.cs().modify(|_, w| w.start_once().set_bit());
    }

    #[inline]
    fn read(&mut self) -> u16 {
        if self.converter.cs().read().ready().bit() {
            self.last = self.converter.result().read().result().bits();
        }
        self.last
    }
}
