//! The compensators and their design for firmware in C and C++: the header is `include/rotorlead.h`, and
//! `docs/c-interface.md` says how it is used.
//!
//! Everything lies in the caller's memory: no heap, no global state. Every pointer is checked before it is used, and what is
//! refused leaves the caller's memory as it was, but for an output of a step, which becomes 0.
//!
//! The tests hold the header to these sources. With `ROTORLEAD_UPDATE_PAGES=1` they write it.

// What a firmware links has no `std`. On a host, where only simulators and tests link it, `std` brings the panic handler.
#![cfg_attr(target_os = "none", no_std)]
// Pointers come from C, and C's linker finds functions by their names.
#![allow(unsafe_code)]

mod command;
mod compensator;
mod design;
mod pointer;
mod status;

pub use command::*;
pub use compensator::*;
pub use design::*;
pub use status::*;

/// Never called: `cargo xtask build --c` fails where a panic can be reached from one of the functions.
#[cfg(target_os = "none")]
#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    loop {
        core::hint::spin_loop();
    }
}
