//! Which pin does what: GPIO numbers, and for a host the table that the binary prints.

/// The first of four pulse inputs in a row.
pub const INPUT_1: u8 = 2;
/// The first of four outputs in a row: both channels of PWM slices 3 and 4.
pub const OUTPUT_1: u8 = 6;
/// The jumper that allows excitation and injection.
pub const JUMPER: u8 = 10;
/// The lamp on the board.
pub const LED: u8 = 25;
/// The link.
pub const LINK_TX: u8 = 0;
pub const LINK_RX: u8 = 1;
/// The mode of the Pico's regulator: high for a fixed frequency.
pub const REGULATOR_MODE: u8 = 23;
/// The amplifier of the thrust sensor, input 0 of the converter.
pub const THRUST: u8 = 26;

/// One pin, for the table.
#[cfg(not(target_os = "none"))]
pub struct Pin {
    /// GPIO number.
    pub gpio: u8,
    /// Number on a Raspberry Pi Pico, where it has one.
    pub pico: Option<u8>,
    /// What to connect there.
    pub use_: &'static str,
}

#[cfg(not(target_os = "none"))]
const fn pin(gpio: u8, pico: u8, use_: &'static str) -> Pin {
    Pin { gpio, pico: Some(pico), use_ }
}

/// Every pin that the firmware uses.
#[cfg(not(target_os = "none"))]
pub const PINS: [Pin; 14] = [
    pin(LINK_TX, 1, "link, controller to host, 1 Mbaud 8N1"),
    pin(LINK_RX, 2, "link, host to controller"),
    pin(INPUT_1, 4, "input 1, from the flight controller (3.3 V, pulled down)"),
    pin(INPUT_1 + 1, 5, "input 2"),
    pin(INPUT_1 + 2, 6, "input 3"),
    pin(INPUT_1 + 3, 7, "input 4"),
    pin(OUTPUT_1, 9, "output 1, to the ESC (3.3 V; needs an external 10 kOhm pull-down)"),
    pin(OUTPUT_1 + 1, 10, "output 2"),
    pin(OUTPUT_1 + 2, 11, "output 3"),
    pin(OUTPUT_1 + 3, 12, "output 4"),
    pin(JUMPER, 14, "jumper to ground (pin 13): allows excitation and injection (pulled up inside)"),
    pin(THRUST, 31, "amplifier of the thrust sensor, 0 to 3.3 V"),
    Pin { gpio: REGULATOR_MODE, pico: None, use_: "mode of the board's regulator (high: fixed frequency)" },
    Pin { gpio: LED, pico: None, use_: "lamp on the board" },
];
