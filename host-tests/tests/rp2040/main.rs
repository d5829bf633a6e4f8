//! What the image for the RP2040 does at its pins, in two emulators that others have written.
//!
//! Levels are driven into its inputs, and the edges at its outputs are compared with what the library or an `f64` model says. Each
//! test needs the image and the emulators: `cargo xtask test` gives both.

mod bidirectional;
mod frames;
mod link;
mod pulses;
mod safety;
