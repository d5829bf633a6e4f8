//! What the outputs do when something is wrong.

use emulator::rp2040::{Bytes, Edge, Emulator, Run, Trace, Write};
use host_tests::pins::{self, INPUT_1, LED, OUTPUT_1, ms, pulses, pulses_of, us};
use rotorlead::link::{FRAME_BYTES, Message, Receiver, Request, ResetReason, encode};
use rotorlead::settings::{NoSignal, Settings};

/// When the controller runs for sure.
const STARTED: u64 = 37_500_000;
const PERIOD: u64 = 312_500;

/// A flight controller that sends a stop up to the start and then so many microseconds, until `end`.
fn flight_controller(run: &mut Run, motor: u8, armed_us: f64, end: u64) {
    let width = |n: u64| us(if n * PERIOD < STARTED { 1000.0 } else { armed_us });
    run.inputs.extend(pulses(INPUT_1 + motor, us(500.0), PERIOD, end, width));
}

fn rises(trace: &Trace, motor: u8) -> usize {
    trace.edges_of(OUTPUT_1 + motor).filter(|edge| edge.is_high).count()
}

#[test]
#[ignore = "needs the image and the emulators: cargo xtask test"]
fn without_a_signal_or_with_a_stuck_line_no_output_ever_rises() {
    for emulator in [Emulator::Node, Emulator::Native] {
        let mut run = pins::run(&Settings::default(), STARTED + ms(60.0));
        // Open, low, high, and high from the start of the controller on.
        run.inputs.push(Edge { cycle: 0, pin: INPUT_1 + 1, is_high: false });
        run.inputs.push(Edge { cycle: 0, pin: INPUT_1 + 2, is_high: true });
        run.inputs.push(Edge { cycle: STARTED, pin: INPUT_1 + 3, is_high: true });
        let trace = pins::trace(emulator, &run);
        assert_eq!([0, 1, 2, 3].map(|motor| rises(&trace, motor)), [0; 4], "{emulator:?}");
    }
}

#[test]
#[ignore = "needs the image and the emulators: cargo xtask test"]
fn a_full_throttle_that_was_never_disarmed_turns_nothing() {
    let mut run = pins::run(&Settings::default(), STARTED + ms(60.0));
    for motor in 0..4 {
        let width = |_| us(1200.0 + 200.0 * f64::from(motor));
        run.inputs.extend(pulses(INPUT_1 + motor, us(500.0), PERIOD, run.until_cycle, width));
    }
    let trace = pins::trace(Emulator::Node, &run);
    assert_eq!([0, 1, 2, 3].map(|motor| rises(&trace, motor)), [0; 4]);
}

#[test]
#[ignore = "needs the image and the emulators: cargo xtask test"]
fn without_settings_that_somebody_chose_no_output_ever_rises_and_the_lamp_flickers() {
    let mut run = Run::new(pins::image(), STARTED + ms(1000.0));
    run.watch = vec![OUTPUT_1, OUTPUT_1 + 1, OUTPUT_1 + 2, OUTPUT_1 + 3, LED];
    for motor in 0..4 {
        flight_controller(&mut run, motor, 1500.0, STARTED + ms(1000.0));
    }
    let trace = pins::trace(Emulator::Node, &run);
    assert_eq!([0, 1, 2, 3].map(|motor| rises(&trace, motor)), [0; 4]);
    let flashes = trace.edges_of(LED).filter(|edge| edge.is_high && edge.cycle > STARTED).count();
    assert!((4..=6).contains(&flashes), "{flashes} flashes in a second");
}

#[test]
#[ignore = "needs the image and the emulators: cargo xtask test"]
fn a_line_that_is_lost_is_held_then_stopped_and_then_silent() {
    let mut settings = Settings { stop_pulses_ms: 100, no_signal: NoSignal::NoPulses, ..Settings::default() };
    settings.motors.iter_mut().for_each(|motor| motor.hold_ms = 50);
    let lost = STARTED + ms(50.0);
    let mut run = pins::run(&settings, lost + ms(350.0));
    flight_controller(&mut run, 0, 1500.0, lost);
    let trace = pins::trace(Emulator::Node, &run);
    let found = pulses_of(&trace, OUTPUT_1);
    // The last pulse is good for 100 ms, its command for 50 more; then stops for 100.
    let [held, stopped] = [lost + ms(150.0), lost + ms(250.0)];
    for pulse in &found {
        let expected = match pulse.rise {
            rise if rise < STARTED + ms(6.0) => continue,
            rise if rise < held - ms(5.0) => us(1500.0),
            rise if rise < held + ms(3.0) => continue,
            _ => us(1000.0),
        };
        assert_eq!(pulse.width, expected, "at {} ms after the loss", (pulse.rise as f64 - lost as f64) / 125e3);
    }
    let last = found.last().unwrap().rise;
    assert!(last.abs_diff(stopped) < ms(6.0), "{} ms after the loss", (last as f64 - lost as f64) / 125e3);
}

#[test]
#[ignore = "needs the image and the emulators: cargo xtask test"]
fn glitches_do_not_reach_the_output() {
    let mut run = pins::run(&Settings::default(), STARTED + ms(60.0));
    let end = run.until_cycle;
    flight_controller(&mut run, 0, 1500.0, end);
    // A spike of 0.2 to 1.8 µs in each gap, and as long a gap in each pulse.
    let rises: Vec<u64> = (us(500.0)..run.until_cycle).step_by(PERIOD as usize).collect();
    for (n, rise) in rises.into_iter().enumerate() {
        let long = us(0.2 + 0.2 * (n % 9) as f64);
        for (from, is_high) in [(rise + us(400.0), false), (rise + us(2100.0), true)] {
            run.inputs.push(Edge { cycle: from, pin: INPUT_1, is_high });
            run.inputs.push(Edge { cycle: from + long, pin: INPUT_1, is_high: !is_high });
        }
    }
    let trace = pins::trace(Emulator::Node, &run);
    let found = pulses_of(&trace, OUTPUT_1);
    let late: Vec<_> = found.iter().filter(|pulse| pulse.rise > STARTED + ms(6.0)).collect();
    assert!(late.len() >= 20, "{}", late.len());
    assert!(late.iter().all(|pulse| pulse.width == us(1500.0)), "{late:?}");
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
    let is_high = trace.edges_of(OUTPUT_1).take_while(|edge| edge.cycle <= reset.cycle).last().unwrap().is_high;
    assert!(!is_high, "high at the reset");
    assert_eq!(trace.edges_of(OUTPUT_1).filter(|edge| edge.cycle > reset.cycle).count(), 0);
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
        let levels: Vec<Edge> = trace.edges_of(OUTPUT_1 + motor).collect();
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
}
