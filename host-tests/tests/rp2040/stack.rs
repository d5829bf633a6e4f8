//! What a stack does that grows out of its memory: the flashed image, with a control task that only pushes.

use emulator::rp2040::{Bytes, Emulator, Region, Run, Write};
use host_tests::pins::{self, INPUT_1, OUTPUT_1, ms, pulses, us};
use rotorlead::link::{FRAME_BYTES, Message, Receiver, Request, ResetReason, encode};
use rotorlead::settings::{MOTORS, Settings};

/// When the controller runs for sure, and the flight controller arms.
const ARMED: u64 = 37_500_000;
const PERIOD: u64 = 312_500;
/// Where the control task's vector is: the first of the data (`boards/rp2040/board.x`).
const TICK_VECTOR: u32 = 0x2000_DC00 + 4 * 15;
/// `push {r0-r7, lr}`, and back to it; behind all that the image has in RAM.
const PUSHES: Write = Write { cycle: 0, address: 0x2004_1F00, value: 0xE7FD_B5FF };
const THUMB: u32 = 1;

#[test]
#[ignore = "needs the image and the emulators: cargo xtask test"]
fn a_stack_that_leaves_its_memory_is_a_fault_with_the_outputs_low_and_harms_no_data() {
    let overflows = ARMED + ms(150.0);
    let mut run = pins::run(&Settings::default(), ARMED + ms(500.0));
    for motor in 0..MOTORS as u8 {
        let width = |n: u64| us(if n * PERIOD < ARMED { 1000.0 } else { 1400.0 });
        run.inputs.extend(pulses(INPUT_1 + motor, us(500.0), PERIOD, run.until_cycle, width));
    }
    run.writes.push(Write { cycle: overflows, ..PUSHES });
    run.writes.push(Write { cycle: overflows, address: TICK_VECTOR, value: PUSHES.address | THUMB });
    let mut frame = [0; FRAME_BYTES];
    let length = encode(1, &Request::Info, &mut frame).unwrap();
    run.uart_in.push(Bytes { cycle: ARMED + ms(450.0), bytes: frame[..length].to_vec() });
    let trace = Emulator::Node.run(&run).unwrap_or_else(|error| panic!("{error}"));
    let [fault] = &trace.faults[..] else { panic!("{:?}", trace.faults) };
    assert_eq!(fault.pc, PUSHES.address, "{fault:?}");
    let [reset] = trace.resets[..] else { panic!("{:?}", trace.resets) };
    assert!(reset.is_forced);
    // A tick at most, and 55 KiB of pushes of nine words in twelve cycles.
    assert!((overflows..overflows + ms(0.4)).contains(&reset.cycle), "{} ms", reset.cycle as f64 / 125e3);
    for motor in 0..MOTORS as u8 {
        let before = trace.edges_on(OUTPUT_1 + motor).take_while(|edge| edge.cycle < reset.cycle);
        assert!(!before.last().unwrap().is_high, "output {motor} at the reset");
    }
    let mut receiver = Receiver::<Message>::new();
    let answers: Vec<_> =
        trace.uart.iter().filter_map(|byte| receiver.push(*byte)).map(|tagged| tagged.message).collect();
    let [Message::Info(info)] = &answers[..] else { panic!("{answers:?}") };
    assert!(matches!(info.reset, ResetReason::Fault { .. }), "{:?}", info.reset);
    // The flight goes on, so the checksums of what is kept for it hold.
    assert_eq!(info.resumed, [true; MOTORS]);
}

/// What the memory protection forbids, and that it is on. No emulator has more of it than its registers.
#[test]
#[ignore = "needs the image and the emulators: cargo xtask test"]
fn nothing_below_the_stack_may_be_touched() {
    const CONTROL: u32 = 0xE000_ED94;
    let mut run = Run::new(pins::image(), ms(100.0));
    run.memory.push(Region { address: CONTROL, length: 16 });
    let trace = pins::trace(Emulator::Node, &run);
    let words: Vec<u32> = trace.memory[0].as_chunks().0.iter().map(|bytes| u32::from_le_bytes(*bytes)).collect();
    let [control, _, address, attributes] = words[..] else { panic!("{words:x?}") };
    assert_eq!(control & 0b111, 0b101, "on, but for the rest of memory and within the handler of faults");
    let size = 2_u32 << (attributes >> 1 & 31);
    assert_eq!((address & !0x1f, size), (0x1F00_0000, 0x0100_0000));
    let permissions = attributes >> 24 & 0b111;
    assert_eq!((attributes & 1, permissions), (1, 0), "{attributes:x}");
}
