//! Pins: what drives them, and which way they are pulled.

use rp2040_hal::pac::io_bank0::gpio::gpio_ctrl::FUNCSEL_A;
use rp2040_hal::pac::{IO_BANK0, PADS_BANK0, SIO};

/// Which way a pin is pulled inside.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Pull {
    /// Nowhere.
    None,
    /// Down, some 60 kOhm.
    Down,
    /// Up.
    Up,
}

/// The registers of the pins. Each is written by one part of the board alone.
pub struct Pins {
    functions: IO_BANK0,
    pads: PADS_BANK0,
    levels: SIO,
}

impl Pins {
    /// Of pins that are out of reset.
    pub const fn new(functions: IO_BANK0, pads: PADS_BANK0, levels: SIO) -> Self {
        Self { functions, pads, levels }
    }

    /// Another one, for a part that has pins of its own.
    #[allow(unsafe_code)]
    pub fn steal() -> Self {
        // SAFETY: only registers of single pins, and those that set and clear single bits, are written.
        unsafe { Self { functions: IO_BANK0::steal(), pads: PADS_BANK0::steal(), levels: SIO::steal() } }
    }

    /// Gives a pin its function, pulled as said, with its input buffer on.
    pub fn set(&self, gpio: u8, function: FUNCSEL_A, pull: Pull) {
        self.pads.gpio(gpio.into()).write(|w| {
            w.ie().set_bit();
            w.schmitt().set_bit();
            w.pde().bit(pull == Pull::Down);
            w.pue().bit(pull == Pull::Up)
        });
        self.functions.gpio(gpio.into()).gpio_ctrl().write(|w| w.funcsel().variant(function));
    }

    /// Leaves a pin to the converter: no pull, no buffer.
    pub fn set_analog(&self, gpio: u8) {
        self.pads.gpio(gpio.into()).write(|w| {
            w.od().set_bit();
            w.ie().clear_bit();
            w.pde().clear_bit();
            w.pue().clear_bit()
        });
        self.functions.gpio(gpio.into()).gpio_ctrl().write(|w| w.funcsel().variant(FUNCSEL_A::NULL));
    }

    /// Makes a pin an output of the core, and low: first the level, then the direction, then the function.
    #[allow(unsafe_code)]
    pub fn set_low_output(&self, gpio: u8) {
        let bit = 1 << gpio;
        // SAFETY: of these registers a one sets or clears its pin, and a zero does nothing.
        unsafe {
            self.levels.gpio_out_clr().write(|w| w.bits(bit));
            self.levels.gpio_oe_set().write(|w| w.bits(bit));
        }
        self.set(gpio, FUNCSEL_A::SIO, Pull::Down);
    }

    /// The level of an input.
    pub fn is_high(&self, gpio: u8) -> bool {
        self.levels.gpio_in().read().bits() & 1 << gpio != 0
    }

    /// The level of an output of the core.
    #[allow(unsafe_code)]
    pub fn put(&self, gpio: u8, is_high: bool) {
        let bit = 1 << gpio;
        // SAFETY: as above.
        unsafe {
            if is_high {
                self.levels.gpio_out_set().write(|w| w.bits(bit));
            } else {
                self.levels.gpio_out_clr().write(|w| w.bits(bit));
            }
        }
    }
}
