//! DShot in, DShot out; and pulses on one side.

use emulator::rp2040::{Edge, Emulator, Run, Trace};
use host_tests::pins::{self, INPUT_1, OUTPUT_1, frames, ms, pulses, pulses_of, us};
use rotorlead::dshot::{Checksum, Frame, Speed, Value};
use rotorlead::settings::{Pulse, PulseProtocol, Settings};

/// When the controller runs for sure.
const STARTED: u64 = 37_500_000;
const SPEEDS: [(PulseProtocol, Speed); 3] = [
    (PulseProtocol::Dshot150, Speed::Dshot150),
    (PulseProtocol::Dshot300, Speed::Dshot300),
    (PulseProtocol::Dshot600, Speed::Dshot600),
];
const EMULATORS: [Emulator; 2] = [Emulator::Node, Emulator::Native];

/// What an output has sent. The second emulator looks at pins between instructions, and not while an exception is entered.
fn frames_of(emulator: Emulator, trace: &Trace, motor: u8, speed: Speed) -> Vec<(u64, u16)> {
    let cycles = match emulator {
        Emulator::Node => 1.0,
        Emulator::Native => 20.0,
    };
    pins::frames_of(trace, OUTPUT_1 + motor, speed, cycles)
}

fn settings(input: PulseProtocol, output: PulseProtocol) -> Settings {
    let pulse =
        |protocol: PulseProtocol| Pulse { protocol, frame_hz: if protocol.dshot().is_some() { 4000 } else { 400 } };
    Settings { input: pulse(input), output: pulse(output), ..Settings::default() }
}

fn frame(value: u16, reports: bool) -> u16 {
    Frame::new(Value::new(value).unwrap(), reports, Checksum::Normal).to_bits()
}

/// A flight controller's frames at an input, one in `period` cycles from the start on: `value` gives the bits by their number.
fn line(run: &mut Run, motor: u8, speed: Speed, period: u64, bits: impl Fn(u64) -> u16) {
    let starts = (us(700.0)..run.until_cycle - us(200.0)).step_by(period as usize);
    run.inputs.extend(frames(INPUT_1 + motor, speed, (0..).zip(starts).map(|(n, start)| (start, bits(n)))));
}

/// Number of the first frame that comes after the controller has started.
fn first_after_start(period: u64) -> u64 {
    STARTED / period
}

#[test]
#[ignore = "needs the image and the emulators: cargo xtask test"]
fn each_frame_makes_one_go_out_with_its_value_at_every_speed_and_output() {
    for emulator in EMULATORS {
        for (protocol, speed) in SPEEDS {
            // A rate that drifts through the ticks.
            let period = us(253.0);
            let mut run = pins::run(&settings(protocol, protocol), STARTED + ms(12.0));
            let armed = first_after_start(period);
            // Stops, then all values that are not too low for a motor that is armed, some with the wish for a report.
            let value = move |n: u64| if n < armed { 0 } else { 148 + (n % 1900) as u16 };
            for motor in 0..4 {
                line(&mut run, motor, speed, period, |n| frame(value(n), n % 3 == 0));
            }
            let trace = pins::trace(emulator, &run);
            for motor in 0..4 {
                let sent = frames_of(emulator, &trace, motor, speed);
                let first =
                    sent.iter().position(|(_, bits)| *bits != frame(0, false) && *bits != frame(0, true)).unwrap();
                let passed: Vec<u16> = sent[first..].iter().map(|(_, bits)| *bits).collect();
                let expected: Vec<u16> = (armed..).map(|n| frame(value(n), n % 3 == 0)).take(passed.len()).collect();
                assert_eq!(passed, expected, "{emulator:?}, {protocol:?}, output {motor}");
                assert!(passed.len() >= 40, "{emulator:?}, {protocol:?}: {}", passed.len());
                // From the beginning of a frame to that of its answer: its length, a gap of about a bit, a tick, and the work in it.
                let late = sent[first..].iter().zip(armed..).map(|((start, _), n)| start - (us(700.0) + n * period));
                let most_us = late.clone().max().unwrap() as f64 / 125.0;
                let limit_us = 17.3e6 / f64::from(speed.bits_per_s()) + 200.0 + 60.0;
                assert!(most_us <= limit_us, "{emulator:?}, {protocol:?}: {most_us} us");
                if motor == 0 {
                    let least_us = late.min().unwrap() as f64 / 125.0;
                    println!(
                        "{protocol:?}, {emulator:?}: {} frames, {least_us:.0} to {most_us:.0} us late",
                        passed.len()
                    );
                }
            }
        }
    }
}

#[test]
#[ignore = "needs the image and the emulators: cargo xtask test"]
fn instructions_pass_as_they_came_and_with_all_their_repeats() {
    let period = us(253.0);
    let mut run = pins::run(&settings(PulseProtocol::Dshot600, PulseProtocol::Dshot600), STARTED + ms(18.0));
    let first = first_after_start(period);
    // Beep 1, direction and save with 10 and 6 repeats, with the wish for a report, among stops.
    let value = move |n: u64| match n.wrapping_sub(first) {
        0 => 1,
        5..15 => 21,
        20..26 => 12,
        _ => 0,
    };
    for motor in 0..4 {
        line(&mut run, motor, Speed::Dshot600, period, |n| frame(value(n), value(n) != 0));
    }
    for emulator in EMULATORS {
        let trace = pins::trace(emulator, &run);
        for motor in 0..4 {
            let sent = frames_of(emulator, &trace, motor, Speed::Dshot600);
            let start = sent.iter().position(|(_, bits)| *bits == frame(1, true)).expect("the first instruction");
            let passed: Vec<u16> = sent[start..].iter().take(40).map(|(_, bits)| *bits).collect();
            let expected: Vec<u16> = (first..).map(|n| frame(value(n), value(n) != 0)).take(40).collect();
            assert_eq!(passed, expected, "{emulator:?}, output {motor}");
        }
    }
}

#[test]
#[ignore = "needs the image and the emulators: cargo xtask test"]
fn damaged_frames_and_those_of_another_speed_make_nothing_go_out() {
    let period = us(253.0);
    let settings = settings(PulseProtocol::Dshot600, PulseProtocol::Dshot600);
    let armed = first_after_start(period);
    let value = move |n: u64| if n < armed { 0 } else { 1000 };
    for emulator in EMULATORS {
        let mut run = pins::run(&settings, STARTED + ms(12.0));
        // One frame in three has a wrong bit.
        let damage = |n: u64| if n > armed && n.is_multiple_of(3) { 1 << (n % 16) } else { 0 };
        line(&mut run, 0, Speed::Dshot600, period, |n| frame(value(n), false) ^ damage(n));
        // The flight controller speaks DShot300 and 150, from a stop to the full throttle, of which all bits are ones.
        line(&mut run, 1, Speed::Dshot300, period, |n| if n < armed { frame(0, false) } else { 0xffff });
        line(&mut run, 2, Speed::Dshot150, period, |n| if n < armed { frame(0, false) } else { 0xffff });
        run.inputs.extend(pulses(INPUT_1 + 3, us(700.0), us(2500.0), run.until_cycle, |_| us(1000.0)));
        let trace = pins::trace(emulator, &run);
        let sent = frames_of(emulator, &trace, 0, Speed::Dshot600);
        let first = sent.iter().position(|(_, bits)| *bits == frame(1000, false)).unwrap();
        let good = sent.len() - first;
        let came = (armed..).take_while(|n| us(700.0) + n * period < run.until_cycle - us(500.0));
        let expected = came.filter(|n| *n == armed || n % 3 != 0).count();
        assert!(good.abs_diff(expected) <= 1, "{emulator:?}: {good} of {expected}");
        assert!(sent[first..].iter().all(|(_, bits)| *bits == frame(1000, false)), "{emulator:?}");
        for motor in 1..4 {
            assert_eq!(
                trace.edges_of(OUTPUT_1 + motor).filter(|edge| edge.is_high).count(),
                0,
                "{emulator:?}, {motor}"
            );
        }
    }
}

#[test]
#[ignore = "needs the image and the emulators: cargo xtask test"]
fn pulses_become_frames() {
    let settings = settings(PulseProtocol::StandardPwm, PulseProtocol::Dshot600);
    for emulator in EMULATORS {
        let mut run = pins::run(&settings, STARTED + ms(25.0));
        for motor in 0..4 {
            // A throttle of 0.25 and a little more for each.
            let armed_us = 1250.0 + 50.0 * f64::from(motor);
            let width = |n: u64| us(if n * us(2500.0) < STARTED { 1000.0 } else { armed_us });
            run.inputs.extend(pulses(INPUT_1 + motor, us(500.0), us(2500.0), run.until_cycle, width));
        }
        let trace = pins::trace(emulator, &run);
        for motor in 0..4 {
            let sent = frames_of(emulator, &trace, motor, Speed::Dshot600);
            assert!(sent.iter().take(10).all(|(_, bits)| *bits == frame(0, false)), "{emulator:?}: stops at first");
            let value = 47 + 500 + 100 * u16::from(motor);
            let armed: Vec<_> = sent.iter().skip_while(|(_, bits)| *bits == frame(0, false)).collect();
            assert!(armed.iter().all(|(_, bits)| *bits == frame(value, false)), "{emulator:?}, output {motor}");
            // One in two ticks of 200 µs, since 4000 a second are the most.
            assert!(armed.len() > 40, "{}", armed.len());
            for pair in armed.windows(2) {
                let apart = pair[1].0 - pair[0].0;
                assert!(apart.abs_diff(us(400.0)) <= us(25.0), "{emulator:?}: {apart} cycles");
            }
        }
    }
}

#[test]
#[ignore = "needs the image and the emulators: cargo xtask test"]
fn frames_become_pulses() {
    let mut settings = settings(PulseProtocol::Dshot300, PulseProtocol::OneShot125);
    settings.output.frame_hz = 2000;
    let period = us(250.0);
    let armed = first_after_start(period);
    let mut run = pins::run(&settings, STARTED + ms(20.0));
    for motor in 0..4 {
        line(&mut run, motor, Speed::Dshot300, period, |n| {
            frame(if n < armed { 0 } else { 1047 + 100 * u16::from(motor) }, false)
        });
    }
    let trace = pins::trace(Emulator::Node, &run);
    for motor in 0..4_u8 {
        let found = pulses_of(&trace, OUTPUT_1 + motor);
        // 0.5 and 0.05 more for each, of 125 to 250 µs.
        let width = us(125.0 + 62.5 + 6.25 * f64::from(motor));
        let late: Vec<_> = found.iter().filter(|pulse| pulse.rise > STARTED + ms(3.0)).collect();
        assert!(late.len() >= 30, "{}", late.len());
        // To a count of 40 ns.
        assert!(late.iter().all(|pulse| pulse.width.abs_diff(width) <= 3), "output {motor}: {:?}", late[0]);
        assert!(found.iter().take(5).all(|pulse| pulse.width == us(125.0)), "output {motor}: {:?}", found[0]);
    }
}

#[test]
#[ignore = "needs the image and the emulators: cargo xtask test"]
fn without_frames_none_go_out_and_a_line_that_returns_must_show_a_stop() {
    let period = us(250.0);
    let settings = settings(PulseProtocol::Dshot600, PulseProtocol::Dshot600);
    // Stops, half a throttle for 10 ms, nothing for 350 ms, half a throttle again, and then stops and half.
    let armed = first_after_start(period);
    let at = |n: u64| us(700.0) + n * period;
    let [gone, back, stop, again] = [40, 1440, 1480, 1520].map(|n| armed + n);
    let end = at(again + 60);
    let mut run = pins::run(&settings, end);
    let value = |n: u64| if (armed..stop).contains(&n) || n >= again { 1047 } else { 0 };
    let sent: Vec<(u64, u16)> =
        (0..again + 50).filter(|n| !(gone..back).contains(n)).map(|n| (at(n), frame(value(n), false))).collect();
    run.inputs.extend(frames(INPUT_1, Speed::Dshot600, sent));
    run.inputs.push(Edge { cycle: 0, pin: INPUT_1 + 1, is_high: true });
    let trace = pins::trace(Emulator::Node, &run);
    let out = frames_of(Emulator::Node, &trace, 0, Speed::Dshot600);
    let between = |from: u64, to: u64| out.iter().filter(move |(start, _)| (at(from)..at(to)).contains(start));
    assert_eq!(between(gone + 3, back).count(), 0, "frames without a frame");
    assert!(between(armed + 5, gone).all(|(_, bits)| *bits == frame(1047, false)));
    // Back at half throttle: the ESC gets stops only, and after a stop the throttle again.
    assert!(between(back, stop).all(|(_, bits)| *bits == frame(0, false)));
    assert!(between(again + 5, again + 50).all(|(_, bits)| *bits == frame(1047, false)));
    assert!(between(again + 5, again + 50).count() > 40);
    assert_eq!(trace.edges_of(OUTPUT_1 + 1).count(), 0, "a line that is stuck high");
}
