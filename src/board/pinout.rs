//! Which pin does what. For a host, where the firmware's binary prints it.

/// One pin of the STM32F405RG.
pub struct Pin {
    /// Port and number.
    pub name: &'static str,
    /// Timer channel, USART line or converter input that it is connected to.
    pub function: &'static str,
    /// What to connect there.
    pub use_: &'static str,
}

const fn pin(name: &'static str, function: &'static str, use_: &'static str) -> Pin {
    Pin { name, function, use_ }
}

/// Every pin the firmware uses, in the order in which a wiring table lists them.
pub const PINS: [Pin; 14] = [
    pin("PA0", "TIM2_CH1", "input 1, pulses from the flight controller (3.3 V, pulled down)"),
    pin("PA1", "TIM2_CH2", "input 2"),
    pin("PA2", "TIM2_CH3", "input 3"),
    pin("PA3", "TIM2_CH4", "input 4"),
    pin("PC6", "TIM3_CH1", "output 1, pulses to the ESC (3.3 V; needs an external 10 kOhm pull-down)"),
    pin("PC7", "TIM3_CH2", "output 2"),
    pin("PC8", "TIM3_CH3", "output 3"),
    pin("PC9", "TIM3_CH4", "output 4"),
    pin("PC10", "USART3_TX", "link, controller to host, 1 Mbaud 8N1"),
    pin("PC11", "USART3_RX", "link, host to controller (pulled up inside)"),
    pin("PC12", "GPIO", "jumper to ground: allows excitation and injection (pulled up inside)"),
    pin("PC0", "ADC1_IN10", "amplifier of the thrust sensor, 0 to 3.3 V"),
    pin("PA13", "SWDIO", "debug probe: flashing and the log"),
    pin("PA14", "SWCLK", "debug probe"),
];

/// What each timer and interrupt is for, highest priority first.
pub const INTERRUPTS: [(&str, &str); 5] = [
    ("PVD", "supply below 2.8 V: outputs low and reset, priority 6"),
    ("USART3", "one byte of the link each way, priority 5"),
    ("TIM2", "capture of both edges of the four inputs, priority 4"),
    ("SysTick", "control task at 5 kHz, priority 3"),
    ("none", "idle: messages, settings, design of the filter"),
];
