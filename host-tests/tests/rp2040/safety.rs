//! What the outputs do when the control task stops or panics.

use emulator::rp2040::{Bytes, Edge, Emulator, Run, Write};
use host_tests::pins::{self, INPUT_1, OUTPUT_1, ms, pulses, us};
use host_tests::scenario::table::{self, Column};
use host_tests::scenario::yes;
use rotorlead::link::{FRAME_BYTES, Message, Receiver, Request, ResetReason, encode};
use rotorlead::settings::Settings;

/// When the controller runs for sure.
const STARTED: u64 = 37_500_000;
const PERIOD: u64 = 312_500;

/// A flight controller that sends a stop up to the start and then so many microseconds, until `end`.
fn flight_controller(run: &mut Run, motor: u8, armed_us: f64, end: u64) {
    let width = |n: u64| us(if n * PERIOD < STARTED { 1000.0 } else { armed_us });
    run.inputs.extend(pulses(INPUT_1 + motor, us(500.0), PERIOD, end, width));
}

/// The register that lets the ticks run.
const SYSTICK_CTRL: u32 = 0xE000_E010;

#[test]
#[ignore = "needs the image and the emulators: cargo xtask test"]
fn a_control_task_that_stops_is_reset_with_the_outputs_low() {
    let mut run = pins::run(&Settings::default(), STARTED + ms(100.0));
    let end = run.until_cycle;
    flight_controller(&mut run, 0, 1500.0, end);
    let stopped = STARTED + ms(20.0);
    run.writes.push(Write { cycle: stopped, address: SYSTICK_CTRL, value: 0 });
    let trace = pins::trace(Emulator::Node, &run);
    let [reset] = trace.resets[..] else { panic!("{:?}", trace.resets) };
    assert!(!reset.is_forced);
    // Its time is 20 ms, from its last feed on.
    let after = reset.cycle - stopped;
    assert!((ms(19.0)..=ms(20.1)).contains(&after), "{} ms", after as f64 / 125e3);
    // Until then the last pulse is repeated; the pin is low from the reset on, and the start takes longer than the run.
    let is_high = trace.edges_on(OUTPUT_1).take_while(|edge| edge.cycle <= reset.cycle).last().unwrap().is_high;
    assert!(!is_high, "high at the reset");
    assert_eq!(trace.edges_on(OUTPUT_1).filter(|edge| edge.cycle > reset.cycle).count(), 0);
    table::hold_cannot(
        table::WATCHDOG,
        &[(Column::Mocks, "no reset"), (Column::Stm32, "no watchdog"), (Column::Rp2040Emu, "no watchdog")],
    );
    table::hold(table::WATCHDOG, Column::Rp2040js, &Ok(format!("after {:.1} ms", after as f64 / ms(1.0) as f64)));
}

#[test]
#[ignore = "needs the image and the emulators: cargo xtask test"]
fn a_panic_takes_the_outputs_low_and_info_names_it_after_the_restart() {
    let settings = Settings::default();
    let panics_at = STARTED + ms(20.0);
    let mut run = Run { image: pins::panicking_image(), ..pins::run(&settings, panics_at + ms(320.0)) };
    let width = |n: u64| match n * PERIOD {
        start if start < STARTED => us(1000.0),
        start if start < panics_at => us(1400.0),
        _ => us(1600.0),
    };
    for motor in 0..4 {
        run.inputs.extend(pulses(INPUT_1 + motor, us(500.0), PERIOD, run.until_cycle, width));
    }
    let mut frame = [0; FRAME_BYTES];
    let length = encode(1, &Request::Info, &mut frame).unwrap();
    run.uart_in.push(Bytes { cycle: panics_at + ms(300.0), bytes: frame[..length].to_vec() });
    let trace = pins::trace(Emulator::Node, &run);
    let [reset] = trace.resets[..] else { panic!("{:?}", trace.resets) };
    assert!(reset.is_forced);
    assert!((panics_at..panics_at + ms(6.0)).contains(&reset.cycle), "{} ms", reset.cycle as f64 / 125e3);
    for motor in 0..4 {
        let levels: Vec<Edge> = trace.edges_on(OUTPUT_1 + motor).collect();
        let is_high = levels.iter().take_while(|edge| edge.cycle < reset.cycle).last().unwrap().is_high;
        assert!(!is_high, "output {motor} at the reset");
        // The flight controller is armed: no pulse until it disarms.
        assert_eq!(levels.iter().filter(|edge| edge.cycle > reset.cycle && edge.is_high).count(), 0, "output {motor}");
    }
    let mut receiver = Receiver::<Message>::new();
    let answers: Vec<_> =
        trace.uart.iter().filter_map(|byte| receiver.push(*byte)).map(|tagged| tagged.message).collect();
    let [Message::Info(info)] = &answers[..] else { panic!("{answers:?}") };
    let ResetReason::Panic(place) = info.reset else { panic!("{:?}", info.reset) };
    assert!(place.file.ends_with(b"control.rs"), "{place:?}");
    table::hold_cannot(table::PANIC, &[(Column::Mocks, "no reset"), (Column::Rp2040Emu, "no watchdog")]);
    table::hold(table::PANIC, Column::Rp2040js, &yes());
}
