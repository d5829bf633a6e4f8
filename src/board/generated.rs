//! What `board.toml` says, as constants. `cargo xtask boards` writes this file.

/// Name of the board.
pub const TITLE: &str = "STM32F405RG";

/// First address of the flash.
pub const FLASH_START: u32 = 0x08000000;

/// First address of the settings, behind the image.
pub const SETTINGS_START: u32 = 0x080c0000;

/// Bytes of the flash that belong to the settings.
pub const SETTINGS_BYTES: u32 = 0x40000;

/// Pins: name, function, what to connect, level.
pub const PINS: [[&str; 4]; 14] = [
    ["PA0", "TIM2_CH1", "input 1: pulses from the flight controller", "3.3 V"],
    ["PA1", "TIM2_CH2", "input 2", "3.3 V"],
    ["PA2", "TIM2_CH3", "input 3", "3.3 V"],
    ["PA3", "TIM2_CH4", "input 4", "3.3 V"],
    ["PC6", "TIM3_CH1", "output 1: pulses to the ESC, and 10 kOhm to ground", "3.3 V"],
    ["PC7", "TIM3_CH2", "output 2, and 10 kOhm to ground", "3.3 V"],
    ["PC8", "TIM3_CH3", "output 3, and 10 kOhm to ground", "3.3 V"],
    ["PC9", "TIM3_CH4", "output 4, and 10 kOhm to ground", "3.3 V"],
    ["PC10", "USART3_TX", "link, to the receive line of the host's adapter", "3.3 V"],
    ["PC11", "USART3_RX", "link, from the transmit line of the host's adapter", "3.3 V"],
    ["PC12", "GPIO", "jumper to ground: allows excitation and injection; open for a flight", "3.3 V"],
    ["PC0", "ADC1_IN10", "amplifier of the thrust sensor", "0 to 3.3 V, never 5 V"],
    ["PA13", "SWDIO", "debug probe", "3.3 V"],
    ["PA14", "SWCLK", "debug probe", "3.3 V"],
];

/// Interrupts, highest priority first: priority, name, task, longest wait that is allowed.
pub const INTERRUPTS: [[&str; 4]; 5] = [
    ["6", "PVD", "supply below 2.8 V: outputs low, and reset", "none"],
    ["5", "USART3", "one byte of the link each way", "the next byte, 10 µs at 1 Mbaud; the UART holds one more"],
    ["4", "TIM2", "takes the stamps of edges", "the next edge of the same input; settings leave 20 µs at least"],
    ["3", "SysTick", "the control task", "the next tick, 200 µs at 5 kHz"],
    ["none", "idle", "messages, settings, design of the filter", "20 s"],
];

/// PA0: input 1: pulses from the flight controller.
#[cfg(target_os = "none")]
pub use stm32f4xx_hal::gpio::PA0 as Input1;

/// PA1: input 2.
#[cfg(target_os = "none")]
pub use stm32f4xx_hal::gpio::PA1 as Input2;

/// PA2: input 3.
#[cfg(target_os = "none")]
pub use stm32f4xx_hal::gpio::PA2 as Input3;

/// PA3: input 4.
#[cfg(target_os = "none")]
pub use stm32f4xx_hal::gpio::PA3 as Input4;

/// PC6: output 1: pulses to the ESC, and 10 kOhm to ground.
#[cfg(target_os = "none")]
pub use stm32f4xx_hal::gpio::PC6 as Output1;

/// PC7: output 2, and 10 kOhm to ground.
#[cfg(target_os = "none")]
pub use stm32f4xx_hal::gpio::PC7 as Output2;

/// PC8: output 3, and 10 kOhm to ground.
#[cfg(target_os = "none")]
pub use stm32f4xx_hal::gpio::PC8 as Output3;

/// PC9: output 4, and 10 kOhm to ground.
#[cfg(target_os = "none")]
pub use stm32f4xx_hal::gpio::PC9 as Output4;

/// PC10: link, to the receive line of the host's adapter.
#[cfg(target_os = "none")]
pub use stm32f4xx_hal::gpio::PC10 as LinkTx;

/// PC11: link, from the transmit line of the host's adapter.
#[cfg(target_os = "none")]
pub use stm32f4xx_hal::gpio::PC11 as LinkRx;

/// PC12: jumper to ground: allows excitation and injection; open for a flight.
#[cfg(target_os = "none")]
pub use stm32f4xx_hal::gpio::PC12 as Jumper;

/// PC0: amplifier of the thrust sensor.
#[cfg(target_os = "none")]
pub use stm32f4xx_hal::gpio::PC0 as Thrust;
