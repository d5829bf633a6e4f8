//! Everything between the pulse that comes in from a flight controller and the pulse that goes out to an ESC.
//!
//! A motor with a propeller follows its command with a first-order lag `K / (tau s + 1)` whose time constant is 70 to
//! 160 ms. This crate holds the lead compensator
//!
//! ```text
//! C(s) = omega_f^2 (s / omega_z + 1) / (s^2 + 2 zeta omega_f s + omega_f^2)
//! ```
//!
//! that cancels the lag and puts a faster, well damped one in its place (Charla, Yao and Voyles, "On Enhancing the
//! Bandwidth of the Actuator Dynamics in a Multi-rotor Aerial Vehicle", eq. 3), as a fixed-point section that runs
//! at 5 kHz on a microcontroller, and bit for bit the same on a host. Where the time constant is known over the command,
//! [`inverse`] has what makes the motor equally fast at every operating point.
//!
//! # In a control loop of your own
//!
//! ```
//! use rotorlead::compensator::Compensator;
//! use rotorlead::design::{LeadDesign, LeadParameters};
//! use rotorlead::protocol::PulseProtocol;
//! use rotorlead::throttle::Command;
//!
//! // Once. The poles 1 / tau of the identified motors, and the highest frequency that is to be amplified, rad/s.
//! let lead = LeadParameters::from_poles(&[6.28, 9.29, 14.13], 628.0)?;
//! let design = LeadDesign::new(lead, 5000.0, None)?; // update runs at 5 kHz
//! let mut compensator = Compensator::new(*design.coefficients(), Command::ZERO, Command::ONE);
//! let pulses = PulseProtocol::StandardPwm.at(400).scale(84_000_000)?; // the timer counts at 84 MHz
//!
//! // In each tick, for each motor: the mixer's throttle, 0 to 1, to the width of the next pulse in counts of the timer.
//! let mut tick = |throttle| pulses.to_ticks(compensator.update(Command::saturating_from_f64(throttle)));
//! assert_eq!(tick(0.0), 84_000); // 1 ms
//! assert!(tick(0.1) > 84_000); // and the filter is on its way
//! # Ok::<(), Box<dyn core::error::Error>>(())
//! ```
//!
//! Each motor has a compensator of its own. [`compensator::Compensator::reset`] puts it at rest at the throttle with which the
//! loop starts. [`compensator::Compensator::set_enabled`] bypasses it without a jump.
//! [`throttle::Command::saturating_from_bits`] takes the throttle as an integer, which saves a conversion from `f64` in
//! software.
//!
//! # Features
//!
//! No feature is on by default. Each of `settings`, `link`, `controller` and `stm32f405` includes those before it, and `stm32f405` includes `systick`.
//!
//! | feature | what it brings | for |
//! |---|---|---|
//! | none | the filter, the inverse and their design, pulses in ([`capture`]) and out ([`esc_output`]), [`dshot`], the safety states of a [`channel`], [`excitation`] | a control loop of your own |
//! | `settings` | `settings`: what a controller stores, its ranges, and its form in flash | a firmware with two sectors of flash (`embedded-storage`) |
//! | `link` | `link`: framed messages between a controller and a host | a firmware with a serial line, and its host |
//! | `controller` | `controller`: the whole controller but for its hardware, as traits | a board of your own: see `docs/boards.md` |
//! | `systick` | `systick`: the timer of the control task, on any Cortex-M | a board of your own with such a core |
//! | `stm32f405` | the board and the binary `rotorlead-firmware`, its HAL, RTIC, defmt, memory map and linker arguments | the application on that board, and nothing else |
//! | `planted-panic` | a panic in the control task | the test of the check that finds panics |
//!
//! Without `stm32f405` the library depends on no chip, takes no critical section, and passes no argument to the linker; `systick`
//! brings the crate `cortex-m`. The
//! tests build it for a Cortex-M0 (`thumbv6m-none-eabi`), a Cortex-M4F (`thumbv7em-none-eabihf`) and a host. The queues of
//! `controller` are those of `heapless` 0.8. They load and store their indices and never exchange them, so a core without
//! compare-and-swap needs neither `portable-atomic` nor a critical section.
//!
//! # Units and formats
//!
//! | quantity | type | format |
//! |---|---|---|
//! | command, 0..1 of the pulse range | [`throttle::Command`] | Q2.29 in an `i32`, confined to [0, 1] |
//! | what an ESC gets: a command, or no pulse | [`throttle::EscCommand`] | Q2.29 in an `i32`, [0, 1], or -1 for no pulse |
//! | filtered command, with headroom | [`throttle::Throttle`] | Q2.29 in an `i32`, [-4, 4) |
//! | filter coefficients | [`biquad::Coefficients`] | Q0.32 in an `i32`, [-0.5, 0.5) |
//! | coefficients and gains of the inverse | [`inverse::Coefficients`] | Q1.30 and Q9.22 in an `i32` |
//! | phase of a sinusoid | `u32` | turns, 2^32 to the turn |
//! | frequencies of a design | `f64` | rad/s (`_rad_s`), rates in hertz (`_hz`) |
//!
//! Floating point appears only where a design is computed, at start-up; the code that runs once per tick is integer,
//! without division, without panic and without heap.

#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate std;

pub mod biquad;
pub mod capture;
pub mod channel;
#[cfg(feature = "settings")]
mod checksum;
pub mod compensator;
#[cfg(feature = "controller")]
pub mod controller;
pub mod design;
pub mod dshot;
pub mod esc_output;
pub mod excitation;
pub mod inverse;
#[cfg(feature = "link")]
pub mod link;
mod multiply;
pub mod protocol;
#[cfg(feature = "settings")]
pub mod settings;
#[cfg(all(feature = "systick", target_os = "none"))]
pub mod systick;
pub mod throttle;
