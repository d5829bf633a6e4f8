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
//! at 5 kHz on a microcontroller, and bit for bit the same on a host.
//!
//! # Units and formats
//!
//! | quantity | type | format |
//! |---|---|---|
//! | command, 0..1 of the pulse range | [`throttle::Command`] | Q2.29 in an `i32`, confined to [0, 1] |
//! | filtered command, with headroom | [`throttle::Throttle`] | Q2.29 in an `i32`, [-4, 4) |
//! | filter coefficients | [`biquad::Coefficients`] | Q0.32 in an `i32`, [-0.5, 0.5) |
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
pub mod esc_output;
pub mod excitation;
#[cfg(feature = "link")]
pub mod link;
#[cfg(feature = "settings")]
pub mod settings;
pub mod throttle;
