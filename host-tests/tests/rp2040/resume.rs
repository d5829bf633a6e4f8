//! A reset in flight, at the pins: how long the outputs are away, what they have then, and where they stay low.

use emulator::rp2040::{Bytes, Emulator, Reset, Run, Trace, Write};
use host_tests::pins::{self, INPUT_1, OUTPUT_1, Pulse, ms, pulses, us};
use rotorlead::link::{FRAME_BYTES, Info, Message, Receiver, Request, ResetReason, encode};
use rotorlead::settings::{MOTORS, Settings};

/// When the controller runs for sure, and the flight controller arms.
const ARMED: u64 = 37_500_000;
/// Of a flight controller at 400 Hz.
const PERIOD: u64 = 312_500;
/// The register that lets the ticks run: without them the watchdog bites.
const SYSTICK_CTRL: u32 = 0xE000_E010;
/// The watchdog's control register with its bit that resets at once: what any software may do, with no reason in memory.
const WATCHDOG_TRIGGER: (u32, u32) = (0x4005_8000, 0xC000_0000);
/// The scratch register that says whose watchdog runs: cleared by power and by RUN, so before the boot ROM takes a file and restarts
/// by a watchdog of its own.
const SCRATCH_0: u32 = 0x4005_800C;
/// The core's request for a reset, of itself alone: what a debugger does.
const CORE_RESET: (u32, u32) = (0xE000_ED0C, 0x05FA_0004);
/// The command of the flight, microseconds.
const FLOWN_US: f64 = 1400.0;

/// A flight from [`ARMED`] on, with the pulses of every motor `width_us` after these milliseconds; `None` for none.
fn flight(image: Run, width_us: impl Fn(f64) -> Option<f64>) -> Run {
    let mut run = image;
    let end = run.until_cycle;
    for motor in 0..MOTORS as u8 {
        let since_ms = |n: u64| (n * PERIOD) as f64 / ms(1.0) as f64 - ARMED as f64 / ms(1.0) as f64;
        let width = |n: u64| if since_ms(n) < 0.0 { Some(1000.0) } else { width_us(since_ms(n)) };
        let count = (0..end / PERIOD).take_while(|&n| width(n).is_some()).count() as u64;
        run.inputs
            .extend(pulses(INPUT_1 + motor, us(500.0), PERIOD, count * PERIOD, |n| us(width(n).unwrap_or(1000.0))));
    }
    run
}

fn run(settings: &Settings, after_ms: f64) -> Run {
    pins::run(settings, ARMED + ms(after_ms))
}

/// Asks what happened, so many milliseconds after the arming.
fn ask(run: &mut Run, after_ms: f64) {
    let mut frame = [0; FRAME_BYTES];
    let length = encode(1, &Request::Info, &mut frame).unwrap();
    run.uart_in.push(Bytes { cycle: ARMED + ms(after_ms), bytes: frame[..length].to_vec() });
}

fn info(trace: &Trace) -> Info {
    let mut receiver = Receiver::<Message>::new();
    let answers: Vec<_> =
        trace.uart.iter().filter_map(|byte| receiver.push(*byte)).map(|tagged| tagged.message).collect();
    let [Message::Info(info)] = &answers[..] else { panic!("{answers:?}") };
    *info
}

/// The pulses of a motor that began after `cycle`.
fn pulses_after(trace: &Trace, motor: u8, cycle: u64) -> Vec<Pulse> {
    pins::read_pulses(trace, OUTPUT_1 + motor).into_iter().filter(|pulse| pulse.rise > cycle).collect()
}

fn is_near(pulse: &Pulse, width_us: f64) -> bool {
    pulse.width.abs_diff(us(width_us)) <= 10
}

/// From the reset to the first pulse of each motor, which must have the command of the flight.
fn first_pulses_ms(trace: &Trace, reset: &Reset) -> Vec<f64> {
    (0..MOTORS as u8)
        .map(|motor| {
            let first = pulses_after(trace, motor, reset.cycle)[0];
            assert!(is_near(&first, FLOWN_US), "motor {motor}: {first:?}");
            (first.rise - reset.cycle) as f64 / ms(1.0) as f64
        })
        .collect()
}

/// Longest time without the boot ROM, of which the emulator has nothing: `docs/board-rp2040.md` says what that adds.
const MOST_MS: f64 = 15.0;

fn says(what: &str, first_ms: &[f64]) {
    println!("{what}: first pulses {first_ms:.2?} ms after the reset");
    assert!(first_ms.iter().all(|&after| after < MOST_MS), "{first_ms:?}");
}

#[test]
#[ignore = "needs the image and the emulators: cargo xtask test"]
fn after_a_bite_of_the_watchdog_the_motors_hold_their_commands_and_stop_when_the_hold_time_is_over() {
    let settings = Settings::default();
    let stopped = 150.0;
    // The flight controller is gone with the ticks.
    let mut run = flight(run(&settings, 350.0), |at| (at < stopped).then_some(FLOWN_US));
    run.writes.push(Write { cycle: ARMED + ms(stopped), address: SYSTICK_CTRL, value: 0 });
    ask(&mut run, 250.0);
    let trace = pins::trace(Emulator::Node, &run);
    let [reset] = &trace.resets[..] else { panic!("{:?}", trace.resets) };
    assert!(!reset.is_forced);
    says("watchdog", &first_pulses_ms(&trace, reset));
    let info = info(&trace);
    assert_eq!((info.reset, info.resumed), (ResetReason::Watchdog, [true; MOTORS]));
    for motor in 0..MOTORS as u8 {
        let after = pulses_after(&trace, motor, reset.cycle);
        let held: Vec<_> = after.iter().take_while(|pulse| is_near(pulse, FLOWN_US)).collect();
        let held_ms = (held.last().unwrap().rise - held[0].rise) as f64 / ms(1.0) as f64;
        // The default hold time, to a frame and the 2 ms of the record.
        assert!((94.0..=101.0).contains(&held_ms), "held for {held_ms} ms");
        // At most one pulse was on its way when the stop came.
        let rest = &after[held.len()..];
        assert!(rest.len() > 10 && rest.iter().all(|pulse| is_near(pulse, 1000.0)), "{rest:?}");
    }
}

#[test]
#[ignore = "needs the image and the emulators: cargo xtask test"]
fn with_good_input_the_flight_goes_on_after_a_bite_and_after_a_panic() {
    let settings = Settings::default();
    let struck = 150.0;
    let width = |at: f64| Some(if at < struck + 100.0 { FLOWN_US } else { 1300.0 });
    let mut bitten = flight(run(&settings, 400.0), width);
    bitten.writes.push(Write { cycle: ARMED + ms(struck), address: SYSTICK_CTRL, value: 0 });
    // One pulse that the planted panic strikes at.
    let panicking = Run { image: pins::panicking_image(), ..run(&settings, 400.0) };
    let is_struck = |at: f64| (struck..struck + 2.5).contains(&at);
    let panicking = flight(panicking, |at| if is_struck(at) { Some(1600.0) } else { width(at) });
    for (what, mut run) in [("watchdog", bitten), ("panic", panicking)] {
        ask(&mut run, 350.0);
        let trace = pins::trace(Emulator::Node, &run);
        let [reset] = &trace.resets[..] else { panic!("{what}: {:?}", trace.resets) };
        says(what, &first_pulses_ms(&trace, reset));
        assert_eq!(info(&trace).resumed, [true; MOTORS], "{what}");
        for motor in 0..MOTORS as u8 {
            let after = pulses_after(&trace, motor, reset.cycle);
            let flown = after.iter().take_while(|pulse| is_near(pulse, FLOWN_US)).count();
            let then = &after[flown..];
            assert!(flown > 20 && then.len() > 40, "{what}: {flown} and {} pulses", then.len());
            assert!(then.iter().all(|pulse| is_near(pulse, 1300.0)), "{what}: {then:?}");
        }
    }
}

#[test]
#[ignore = "needs the image and the emulators: cargo xtask test"]
fn the_third_panic_within_10_s_ends_off() {
    let strikes = [150.0, 300.0, 450.0];
    let run = Run { image: pins::panicking_image(), ..run(&Settings::default(), 800.0) };
    let is_struck = |at: f64| strikes.iter().any(|&strike| (strike..strike + 2.5).contains(&at));
    let mut run = flight(run, |at| Some(if is_struck(at) { 1600.0 } else { FLOWN_US }));
    ask(&mut run, 780.0);
    let trace = pins::trace(Emulator::Node, &run);
    let [first, second, third] = &trace.resets[..] else { panic!("{:?}", trace.resets) };
    says("first panic", &first_pulses_ms(&trace, first));
    says("second panic", &first_pulses_ms(&trace, second));
    for motor in 0..MOTORS as u8 {
        assert_eq!(pulses_after(&trace, motor, third.cycle), [], "motor {motor}");
    }
    let info = info(&trace);
    assert!(matches!(info.reset, ResetReason::Panic(_)), "{info:?}");
    assert_eq!(info.resumed, [false; MOTORS]);
}

#[test]
#[ignore = "needs the image and the emulators: cargo xtask test"]
fn nothing_goes_on_where_it_is_not_wanted() {
    let settings = Settings::default();
    let stopped = ARMED + ms(150.0);
    let bite = Write { cycle: stopped, address: SYSTICK_CTRL, value: 0 };
    let fly = |settings: &Settings, writes: &[Write]| {
        let mut run = flight(run(settings, 600.0), |_| Some(FLOWN_US));
        run.writes.extend(writes);
        run
    };
    let (address, value) = WATCHDOG_TRIGGER;
    let never = Settings { resume: false, ..settings.clone() };
    let runs = [
        ("a reset by software", fly(&settings, &[Write { cycle: stopped, address, value }])),
        ("the boot ROM's watchdog", fly(&settings, &[bite, Write { address: SCRATCH_0, ..bite }])),
        ("the setting is off", fly(&never, &[bite])),
        ("a debugger is attached", Run { is_debugged: true, ..fly(&settings, &[bite]) }),
    ];
    for (what, run) in runs {
        let trace = pins::trace(Emulator::Node, &run);
        let [reset] = &trace.resets[..] else { panic!("{what}: {:?}", trace.resets) };
        for motor in 0..MOTORS as u8 {
            assert_eq!(pulses_after(&trace, motor, reset.cycle), [], "{what}: motor {motor}");
        }
    }
}

/// The watchdog's register says its bite for as long as the chip has power.
#[test]
#[ignore = "needs the image and the emulators: cargo xtask test"]
fn a_reset_of_the_core_behind_a_bite_is_no_bite() {
    let (bitten, reset) = (ARMED + ms(150.0), ARMED + ms(300.0));
    let mut run = flight(run(&Settings::default(), 700.0), |_| Some(FLOWN_US));
    let (address, value) = CORE_RESET;
    run.writes.push(Write { cycle: bitten, address: SYSTICK_CTRL, value: 0 });
    run.writes.push(Write { cycle: reset, address, value });
    ask(&mut run, 650.0);
    let trace = pins::trace(Emulator::Node, &run);
    let [bite, of_core] = &trace.resets[..] else { panic!("{:?}", trace.resets) };
    says("watchdog", &first_pulses_ms(&trace, bite));
    // The PWM goes on with the last pulses until the start has taken its pins.
    let started = of_core.cycle + ms(10.0);
    for motor in 0..MOTORS as u8 {
        assert_eq!(pulses_after(&trace, motor, started), [], "motor {motor}");
    }
    let info = info(&trace);
    assert_eq!((info.reset, info.resumed), (ResetReason::Software, [false; MOTORS]));
}
