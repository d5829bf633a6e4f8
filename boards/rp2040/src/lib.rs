//! What tests and tools must know of the firmware for an RP2040: its pins and its flash.
#![no_std]

#[rustfmt::skip]
pub mod generated;
pub mod usb_control;

use generated::{INPUT_1, INPUT_2, INPUT_3, INPUT_4, OUTPUT_1, OUTPUT_2, OUTPUT_3, OUTPUT_4};

/// Whether pins follow each other, as those of the inputs and of the outputs must.
const fn is_row([first, second, third, fourth]: [u8; 4]) -> bool {
    second == first + 1 && third == first + 2 && fourth == first + 3
}

const _: () = assert!(is_row([INPUT_1, INPUT_2, INPUT_3, INPUT_4]));
const _: () = assert!(is_row([OUTPUT_1, OUTPUT_2, OUTPUT_3, OUTPUT_4]));
