//! Fixed-point lead compensation between a flight controller and its ESCs.
#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate std;

pub mod excitation;
pub mod throttle;
