//! The image that would be flashed, in an emulator. `cargo xtask test` builds the images and runs these.

mod image;
mod inverse_in_the_loop;
mod processor_in_the_loop;
