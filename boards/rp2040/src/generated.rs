//! What `board.toml` says, as constants. `cargo xtask boards` writes this file.

/// Name of the board.
pub const TITLE: &str = "RP2040 of a Raspberry Pi Pico";

/// First address of the flash.
pub const FLASH_START: u32 = 0x10000000;

/// First address of the settings, behind the image.
pub const SETTINGS_START: u32 = 0x101fe000;

/// Bytes of the flash that belong to the settings.
pub const SETTINGS_BYTES: u32 = 0x2000;

/// Pins: name, pin of the Pico, what to connect, level.
pub const PINS: [[&str; 4]; 15] = [
    ["GP0", "1", "link, to the receive line of the host's adapter, 1 Mbaud", "3.3 V"],
    ["GP1", "2", "link, from the transmit line of the host's adapter", "3.3 V"],
    ["GP2", "4", "input 1: pulses or DShot from the flight controller", "3.3 V"],
    ["GP3", "5", "input 2", "3.3 V"],
    ["GP4", "6", "input 3", "3.3 V"],
    ["GP5", "7", "input 4", "3.3 V"],
    ["GP6", "9", "output 1: pulses or DShot to the ESC, and 10 kOhm to ground", "3.3 V"],
    ["GP7", "10", "output 2, and 10 kOhm to ground", "3.3 V"],
    ["GP8", "11", "output 3, and 10 kOhm to ground", "3.3 V"],
    ["GP9", "12", "output 4, and 10 kOhm to ground", "3.3 V"],
    ["GP10", "14", "jumper to ground (pin 13): allows excitation and injection; open for a flight", "3.3 V"],
    ["GP15", "20", "nothing: for a moment the firmware may need it while a host sets up USB", "3.3 V"],
    ["GP26", "31", "amplifier of the thrust sensor", "0 to 3.3 V"],
    ["GP23", "", "mode of the board's regulator: driven high, for a fixed frequency", "3.3 V"],
    ["GP25", "", "the lamp on the board", "3.3 V"],
];

/// Interrupts, highest priority first: priority, name, task, longest wait that is allowed.
pub const INTERRUPTS: [[&str; 4]; 4] = [
    ["4", "SysTick", "the control task", "the next tick, 200 µs at 5 kHz"],
    ["2", "UART0_IRQ", "bytes of the link by the UART", "32 bytes, which the UART holds: 320 µs at 1 Mbaud"],
    ["1", "USBCTRL_IRQ", "bytes of the link by USB", "none: the host waits; 50 ms for the end of a setup (USB 2.0, 9.2.6.4)"],
    ["none", "idle", "messages, settings, design of the filter", "20 s"],
];

/// GP0: link, to the receive line of the host's adapter, 1 Mbaud.
pub const LINK_TX: u8 = 0;

/// GP1: link, from the transmit line of the host's adapter.
pub const LINK_RX: u8 = 1;

/// GP2: input 1: pulses or DShot from the flight controller.
pub const INPUT_1: u8 = 2;

/// GP3: input 2.
pub const INPUT_2: u8 = 3;

/// GP4: input 3.
pub const INPUT_3: u8 = 4;

/// GP5: input 4.
pub const INPUT_4: u8 = 5;

/// GP6: output 1: pulses or DShot to the ESC, and 10 kOhm to ground.
pub const OUTPUT_1: u8 = 6;

/// GP7: output 2, and 10 kOhm to ground.
pub const OUTPUT_2: u8 = 7;

/// GP8: output 3, and 10 kOhm to ground.
pub const OUTPUT_3: u8 = 8;

/// GP9: output 4, and 10 kOhm to ground.
pub const OUTPUT_4: u8 = 9;

/// GP10: jumper to ground (pin 13): allows excitation and injection; open for a flight.
pub const JUMPER: u8 = 10;

/// GP15: nothing: for a moment the firmware may need it while a host sets up USB.
pub const USB_RESERVED: u8 = 15;

/// GP26: amplifier of the thrust sensor.
pub const THRUST: u8 = 26;

/// GP23: mode of the board's regulator: driven high, for a fixed frequency.
pub const REGULATOR_MODE: u8 = 23;

/// GP25: the lamp on the board.
pub const LED: u8 = 25;
