//! DShot in, DShot out; and pulses on one side.

use host_tests::pins::{ms, us};
use host_tests::scenario::{
    LINES_BEGIN, Miss, Outcome, Play, Proof, STARTED, Scenario, Target, first_after_start, hold, yes,
};
use rotorlead::dshot::{Checksum, Frame, Speed, Value};
use rotorlead::settings::{Pulse, PulseProtocol, Settings};

use super::pulses::{lose_bit, swap_inputs};

const SPEEDS: [(PulseProtocol, Speed); 3] = [
    (PulseProtocol::Dshot150, Speed::Dshot150),
    (PulseProtocol::Dshot300, Speed::Dshot300),
    (PulseProtocol::Dshot600, Speed::Dshot600),
];

pub const FRAMES: Scenario = Scenario {
    name: "each frame of DShot makes one go out with its value, at every speed and output; DShot600: how late",
    prove: each_frame,
    controls: &[("two inputs are swapped", swap_inputs), ("an edge is lost", lose_bit)],
};

pub const INSTRUCTIONS: Scenario = Scenario {
    name: "DShot's instructions pass with all their repeats",
    prove: instructions,
    controls: &[("an edge is lost", lose_bit)],
};

pub const DAMAGED_FRAMES: Scenario = Scenario {
    name: "frames with wrong bits, of another speed, and pulses instead: nothing goes out",
    prove: damaged_frames,
    controls: &[("the input has the other speed", |play| {
        if let Some(settings) = &mut play.settings {
            settings.input.protocol = PulseProtocol::Dshot300;
        }
    })],
};

pub const PULSES_TO_FRAMES: Scenario = Scenario {
    name: "pulses in, DShot out, to the value",
    prove: pulses_to_frames,
    controls: &[
        ("two inputs are swapped", swap_inputs),
        ("frames are half as many", |play| {
            if let Some(settings) = &mut play.settings {
                settings.output.frame_hz = 1250;
            }
        }),
    ],
};

pub const FRAMES_TO_PULSES: Scenario = Scenario {
    name: "DShot in, pulses out, to a count",
    prove: frames_to_pulses,
    controls: &[("two inputs are swapped", swap_inputs)],
};

pub const LOST_FRAMES: Scenario = Scenario {
    name: "DShot is lost, and returns: it must show a stop first",
    prove: lost_frames,
    controls: &[("it returns within the hold time", |play| {
        if let Some(settings) = &mut play.settings {
            settings.motors[0].hold_ms = 120;
        }
    })],
};

pub fn settings(input: PulseProtocol, output: PulseProtocol) -> Settings {
    let pulse =
        |protocol: PulseProtocol| Pulse { protocol, frame_hz: if protocol.dshot().is_some() { 4000 } else { 400 } };
    Settings { input: pulse(input), output: pulse(output), ..Settings::default() }
}

/// The bits of a frame.
pub fn frame(value: u16, reports: bool) -> u16 {
    Frame::new(Value::new(value).expect("a value"), reports, Checksum::Normal).to_bits()
}

fn to_bits(sent: &[(u64, u16)]) -> Vec<u16> {
    sent.iter().map(|(_, bits)| *bits).collect()
}

fn each_frame(target: &dyn Target) -> Proof {
    let mut cell = String::new();
    for (protocol, speed) in SPEEDS {
        // A rate that drifts through the ticks.
        let period = us(253.0);
        let mut play = Play::new(&settings(protocol, protocol), STARTED + ms(12.0));
        let armed = first_after_start(period);
        // The third of them arms.
        let turns = armed + 2;
        // Stops, then all values that are not too low for a motor that is armed, some with the wish for a report. Each input
        // has its own.
        let value = move |motor: u8, n: u64| if n < armed { 0 } else { 148 + ((n + u64::from(motor)) % 1900) as u16 };
        for motor in 0..4 {
            play.frames(motor, speed, period, |n| Some(frame(value(motor, n), n % 3 == 0)));
        }
        let outcome = target.play(&play)?;
        let mut most_us = 0.0_f64;
        for motor in 0..4 {
            let sent = outcome.frames(motor, speed)?;
            let is_stop = |bits: u16| bits == frame(0, false) || bits == frame(0, true);
            let first = sent.iter().position(|(_, bits)| !is_stop(*bits));
            let Some(first) = first else {
                return Err(Miss::Wrong(format!("{protocol:?}, output {motor}: stops only")));
            };
            let passed = to_bits(&sent[first..]);
            let expected: Vec<u16> = (turns..).map(|n| frame(value(motor, n), n % 3 == 0)).take(passed.len()).collect();
            hold(passed == expected, || format!("{protocol:?}, output {motor}: {passed:x?}, and not {expected:x?}"))?;
            hold(passed.len() >= 40, || format!("{protocol:?}: {} frames", passed.len()))?;
            // From the beginning of a frame to that of its answer: its length, a gap of about a bit, a tick, and the work in it.
            for ((start, _), n) in sent[first..].iter().zip(turns..) {
                let late_us = (start - (LINES_BEGIN + n * period)) as f64 / 125.0;
                most_us = most_us.max(late_us);
            }
        }
        let limit_us = 17.3e6 / f64::from(speed.bits_per_s()) + 200.0 + 60.0;
        hold(most_us <= limit_us, || format!("{protocol:?}: {most_us} us late"))?;
        cell = format!("{most_us:.0} µs at most");
    }
    Ok(cell)
}

fn instructions(target: &dyn Target) -> Proof {
    let period = us(253.0);
    let mut play = Play::new(&settings(PulseProtocol::Dshot600, PulseProtocol::Dshot600), STARTED + ms(18.0));
    let first = first_after_start(period);
    // Beep 1, direction and save with 10 and 6 repeats, with the wish for a report, among stops.
    let value = move |n: u64| match n.wrapping_sub(first) {
        0 => 1,
        5..15 => 21,
        20..26 => 12,
        _ => 0,
    };
    for motor in 0..4 {
        play.frames(motor, Speed::Dshot600, period, |n| Some(frame(value(n), value(n) != 0)));
    }
    let outcome = target.play(&play)?;
    for motor in 0..4 {
        let sent = to_bits(&outcome.frames(motor, Speed::Dshot600)?);
        let passed: Vec<u16> = sent.into_iter().skip_while(|bits| *bits != frame(1, true)).take(40).collect();
        let expected: Vec<u16> = (first..).map(|n| frame(value(n), value(n) != 0)).take(40).collect();
        hold(passed == expected, || format!("output {motor}: {passed:x?}, and not {expected:x?}"))?;
    }
    yes()
}

fn damaged_frames(target: &dyn Target) -> Proof {
    let period = us(253.0);
    let armed = first_after_start(period);
    let value = move |n: u64| if n < armed { 0 } else { 1000 };
    let mut play = Play::new(&settings(PulseProtocol::Dshot600, PulseProtocol::Dshot600), STARTED + ms(12.0));
    // One frame in three has a wrong bit.
    let damage = |n: u64| if n > armed && n.is_multiple_of(3) { 1 << (n % 16) } else { 0 };
    play.frames(0, Speed::Dshot600, period, |n| Some(frame(value(n), false) ^ damage(n)));
    // The flight controller speaks DShot300 and 150, from a stop to the full throttle, of which all bits are ones.
    play.frames(1, Speed::Dshot300, period, |n| Some(if n < armed { frame(0, false) } else { 0xffff }));
    play.frames(2, Speed::Dshot150, period, |n| Some(if n < armed { frame(0, false) } else { 0xffff }));
    play.pulses(3, us(2500.0), play.end, |_| 1000.0);
    let outcome = target.play(&play)?;
    let sent = to_bits(&outcome.frames(0, Speed::Dshot600)?);
    let good: Vec<u16> = sent.into_iter().skip_while(|bits| *bits != frame(1000, false)).collect();
    let came = (armed..).take_while(|n| LINES_BEGIN + n * period < play.end - us(500.0));
    // The first two do not arm yet.
    let expected = came.filter(|n| *n == armed || n % 3 != 0).count() - 2;
    hold(good.len().abs_diff(expected) <= 1, || format!("{} frames of {expected}", good.len()))?;
    hold(good.iter().all(|bits| *bits == frame(1000, false)), || format!("{good:x?}"))?;
    outcome.hold_low(1..4)?;
    yes()
}

fn pulses_to_frames(target: &dyn Target) -> Proof {
    let mut play = Play::new(&settings(PulseProtocol::StandardPwm, PulseProtocol::Dshot600), STARTED + ms(25.0));
    let period = us(2500.0);
    for motor in 0..4 {
        // A throttle of 0.25 and a little more for each.
        let armed_us = 1250.0 + 50.0 * f64::from(motor);
        play.pulses(motor, period, play.end, |n| if n < first_after_start(period) { 1000.0 } else { armed_us });
    }
    let outcome = target.play(&play)?;
    for motor in 0..4 {
        let sent = outcome.frames(motor, Speed::Dshot600)?;
        let value = 47 + 500 + 100 * u16::from(motor);
        let armed = sent.iter().position(|(_, bits)| *bits != frame(0, false)).unwrap_or(sent.len());
        hold(armed >= 10, || format!("output {motor}: {armed} stops"))?;
        let armed = &sent[armed..];
        let is_value = armed.iter().all(|(_, bits)| *bits == frame(value, false));
        hold(is_value, || format!("output {motor}: {:x?}, and not {value}", to_bits(armed)))?;
        // One in two ticks of 200 µs, since 4000 a second are the most.
        hold(armed.len() > 40, || format!("output {motor}: {} frames", armed.len()))?;
        let wrong = armed.windows(2).find(|pair| (pair[1].0 - pair[0].0).abs_diff(us(400.0)) > us(25.0));
        hold(wrong.is_none(), || format!("output {motor}: {wrong:?}"))?;
    }
    yes()
}

fn frames_to_pulses(target: &dyn Target) -> Proof {
    let mut settings = settings(PulseProtocol::Dshot300, PulseProtocol::OneShot125);
    settings.output.frame_hz = 2000;
    let period = us(250.0);
    let armed = first_after_start(period);
    let mut play = Play::new(&settings, STARTED + ms(20.0));
    for motor in 0..4 {
        let value = 1047 + 100 * u16::from(motor);
        play.frames(motor, Speed::Dshot300, period, |n| Some(frame(if n < armed { 0 } else { value }, false)));
    }
    let outcome = target.play(&play)?;
    for motor in 0..4 {
        let found = outcome.pulses(motor)?;
        // 0.5 and 0.05 more for each, of 125 to 250 µs.
        let width = us(125.0 + 62.5 + 6.25 * f64::from(motor));
        let late: Vec<_> = found.iter().filter(|pulse| pulse.rise > STARTED + ms(3.0)).collect();
        hold(late.len() >= 30, || format!("output {motor}: {} pulses", late.len()))?;
        // To a count of 40 ns.
        let wrong = late.iter().find(|pulse| pulse.width.abs_diff(width) > 3);
        hold(wrong.is_none(), || format!("output {motor}: {wrong:?}, and not {width}"))?;
        let wrong = found.iter().take(5).find(|pulse| pulse.width != us(125.0));
        hold(wrong.is_none(), || format!("output {motor}: {wrong:?} is no stop"))?;
    }
    yes()
}

fn lost_frames(target: &dyn Target) -> Proof {
    let period = us(250.0);
    let mut settings = settings(PulseProtocol::Dshot600, PulseProtocol::Dshot600);
    settings.motors[0].hold_ms = 20;
    // Stops, half a throttle for 130 ms, nothing for 160 ms, half a throttle again, and then stops and half.
    let armed = first_after_start(period);
    let at = |n: u64| LINES_BEGIN + n * period;
    let [gone, back, stop, again] = [520, 1160, 1200, 1240].map(|n| armed + n);
    let mut play = Play::new(&settings, at(again + 60));
    let value = |n: u64| if (armed..stop).contains(&n) || n >= again { 1047 } else { 0 };
    let comes = |n: u64| n < again + 50 && !(gone..back).contains(&n);
    play.frames(0, Speed::Dshot600, period, |n| comes(n).then(|| frame(value(n), false)));
    play.stick(1, 0, true);
    let outcome: Outcome = target.play(&play)?;
    let out = outcome.frames(0, Speed::Dshot600)?;
    let between = |from: u64, to: u64| -> Vec<u16> {
        out.iter().filter(|(start, _)| (at(from)..at(to)).contains(start)).map(|(_, bits)| *bits).collect()
    };
    let all = |from: u64, to: u64, value: u16| {
        let bits = between(from, to);
        hold(bits.len() > 25 && bits.iter().all(|bits| *bits == frame(value, false)), || {
            format!("frames {from} to {to} are not {value}: {bits:x?}")
        })
    };
    let without = between(gone + 3, back);
    hold(without.is_empty(), || format!("frames without a frame: {without:x?}"))?;
    all(armed + 5, gone, 1047)?;
    // Back at half throttle: the ESC gets stops only, and after a stop the throttle again.
    let locked = between(back, stop);
    hold(locked.iter().all(|bits| *bits == frame(0, false)), || format!("{locked:x?} without a stop before"))?;
    all(again + 5, again + 50, 1047)?;
    outcome.hold_low([1])?;
    yes()
}
