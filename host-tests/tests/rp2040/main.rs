//! What the image for the RP2040 does at its pins, in two emulators.

use emulator::rp2040::Emulator;
use host_tests::pins::{self, INPUT_1, OUTPUT_1, ms, pulses, pulses_of, us};
use rotorlead::settings::Settings;

#[test]
#[ignore = "needs the image and the emulators: cargo xtask test"]
fn constant_pulses_pass_to_the_count() {
    let settings = Settings::default();
    let end = ms(500.0);
    let mut run = pins::run(&settings, end);
    for input in 0..4 {
        run.inputs.extend(pulses(INPUT_1 + input, us(1000.0), us(2500.0), end, |n| us(if n < 120 { 1000.0 } else { 1500.0 })));
    }
    let start = std::time::Instant::now();
    let trace = pins::trace(Emulator::Node, &run);
    println!("{:?} unmodelled {:?} uart {} resets {:?}", start.elapsed(), trace.unmodelled, trace.uart.len(), trace.resets);
    for output in 0..4 {
        let pulses = pulses_of(&trace, OUTPUT_1 + output);
        println!("{output}: {} {:?} .. {:?}", pulses.len(), &pulses.first(), &pulses.last());
        for pair in pulses.windows(2) {
            print!("{}/{} ", pair[1].rise - pair[0].rise, pair[0].width);
        }
        println!();
    }
}
