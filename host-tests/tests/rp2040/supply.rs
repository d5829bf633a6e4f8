//! The supply: the core's brown-out detector, and the mode of the board's regulator.

use emulator::rp2040::{Edge, Emulator, Region, Run};
use host_tests::pins::{self, REGULATOR_MODE, ms};

/// The brown-out detector's register.
const BROWN_OUT: u32 = 0x4006_4004;

#[test]
#[ignore = "needs the image and the emulators: cargo xtask test"]
fn the_brown_out_detector_is_on_at_0_946_v() {
    let mut run = Run::new(pins::image(), ms(100.0));
    run.memory.push(Region { address: BROWN_OUT, length: 4 });
    let trace = pins::trace(Emulator::Node, &run);
    // The thresholds are 43 mV apart, from 0.473 V on (RP2040 datasheet, 2.12.9).
    let register = u32::from_le_bytes(*trace.memory[0].first_chunk().unwrap());
    assert_eq!((473 + 43 * (register >> 4 & 0xf), register & 1), (946, 1));
}

#[test]
#[ignore = "needs the image and the emulators: cargo xtask test"]
fn the_regulator_has_a_fixed_frequency() {
    let mut run = Run::new(pins::image(), ms(100.0));
    run.watch.push(REGULATOR_MODE);
    let modes: Vec<Edge> = pins::trace(Emulator::Node, &run).edges_on(REGULATOR_MODE).collect();
    assert!(matches!(modes[..], [Edge { is_high: true, .. }]), "{modes:?}");
}
