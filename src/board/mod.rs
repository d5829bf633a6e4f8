//! The STM32F405 and what is connected to it: clocks, timers, pins, UART, watchdog, and what happens on a fault.
//!
//! Everything that knows a register is here. Where the compiler cannot see that an access is sound it is marked and
//! explained; the library holds no such code.

#[cfg(target_os = "none")]
use rotorlead::settings::MOTORS;

#[allow(dead_code, reason = "a host has no use for the addresses, and the board none for the tables")]
#[rustfmt::skip]
pub mod generated;

#[cfg(target_os = "none")]
pub mod capture;
#[cfg(target_os = "none")]
pub mod clocks;
#[cfg(target_os = "none")]
pub mod outputs;
#[cfg(target_os = "none")]
#[allow(unsafe_code, reason = "memory that survives a reset, and the handlers of faults")]
pub mod postmortem;
#[cfg(target_os = "none")]
pub mod serial;

#[cfg(target_os = "none")]
#[allow(unsafe_code, reason = "the flash is read and written at its addresses")]
pub mod settings_flash;
#[cfg(target_os = "none")]
#[allow(unsafe_code, reason = "a register that takes only some numbers")]
pub mod thrust_adc;

#[cfg(target_os = "none")]
mod parts;
#[cfg(target_os = "none")]
mod start;
#[cfg(target_os = "none")]
mod supply;
#[cfg(target_os = "none")]
mod watchdog;
#[cfg(target_os = "none")]
pub use parts::{BoardStatus, Stm32f405};
#[cfg(target_os = "none")]
pub use start::{Board, Queues, outputs_low};
