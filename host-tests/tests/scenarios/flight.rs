//! Flights as a pilot and a flight controller make them, with the default settings of the lines that they have.

use std::ops::Range;

use host_tests::pins::{INPUT_1, ms, us};
use host_tests::scenario::{LINES_BEGIN, Play, Proof, STARTED, Scenario, Target, hold, yes};
use rotorlead::dshot::Speed;
use rotorlead::settings::{Levels, Pulse, PulseProtocol, Settings};

use super::frames::frame;
use super::pulses::swap_inputs;

pub const BETAFLIGHT: Scenario = Scenario {
    name: "a flight with Betaflight, DShot600 at 8 kHz: no motor stops between arming and disarming, whatever its throttle",
    prove: betaflight,
    controls: &[
        ("the levels of pulses are set", |play| {
            if let Some(settings) = &mut play.settings {
                for motor in &mut settings.motors {
                    (motor.disarming, motor.arming) = (Some(Levels::PULSES.disarming), Some(Levels::PULSES.arming));
                }
            }
        }),
        ("two inputs are swapped", swap_inputs),
    ],
};

pub const ARDUPILOT: Scenario = Scenario {
    name: "a flight with ArduPilot, pulses at 490 Hz: each goes out, and no motor stops between arming and disarming",
    prove: ardupilot,
    controls: &[
        ("output frames are those of 450 Hz", |play| {
            if let Some(settings) = &mut play.settings {
                settings.output.frame_hz = 450;
            }
        }),
        ("two inputs are swapped", swap_inputs),
    ],
};

pub const TURTLE: Scenario = Scenario {
    name: "turtle mode, DShot in and pulses out: no motor turns until it is over",
    prove: turtle,
    controls: &[("the direction is told five times", |play| {
        let last = LINES_BEGIN + (TURN_BEGINS + 5) * FRAME;
        play.edges.retain(|edge| !(last..last + us(100.0)).contains(&edge.cycle));
    })],
};

/// 8 kHz.
const FRAME: u64 = 15_625;
/// 490 Hz.
const PULSE: u64 = 255_102;
/// Number of the frame with which turtle mode begins.
const TURN_BEGINS: u64 = (STARTED + 1_250_000) / FRAME;

/// A part of a flight: so many frames, at the end of which the throttle is this.
struct Leg {
    frames: u64,
    throttle: f64,
}

/// The throttle of the frame of this number, `None` before the first leg and after the last.
fn throttle(legs: &[Leg], number: u64) -> Option<f64> {
    let (mut begin, mut before) = (0, legs.first()?.throttle);
    for leg in legs {
        let since = number.checked_sub(begin)?;
        if since < leg.frames {
            // Half of it on the way, half there.
            let way = (2.0 * since as f64 / leg.frames as f64).min(1.0);
            return Some(before + (leg.throttle - before) * way);
        }
        (begin, before) = (begin + leg.frames, leg.throttle);
    }
    None
}

/// The frames of a leg in which the throttle stays, but for the first of them.
fn steady(legs: &[Leg], index: usize) -> Range<u64> {
    let begin: u64 = legs[..index].iter().map(|leg| leg.frames).sum();
    begin + legs[index].frames / 2 + 8..begin + legs[index].frames
}

/// Arming and idle at 3 %, take-off, hover, full stick, dynamic idle in the air (the lowest throttle there is), descent, failsafe
/// at a low throttle, landing at idle: DShot's values.
const BETAFLIGHT_LEGS: [Leg; 8] = [
    Leg { frames: 80, throttle: 108.0 },
    Leg { frames: 80, throttle: 500.0 },
    Leg { frames: 80, throttle: 900.0 },
    Leg { frames: 80, throttle: 2047.0 },
    Leg { frames: 80, throttle: 48.0 },
    Leg { frames: 80, throttle: 700.0 },
    Leg { frames: 80, throttle: 250.0 },
    Leg { frames: 80, throttle: 120.0 },
];

fn betaflight(target: &dyn Target) -> Proof {
    let line = Pulse { protocol: PulseProtocol::Dshot600, frame_hz: 8000 };
    let mut settings = Settings { input: line, output: line, ..Settings::default() };
    settings.motors[3].compensate = true;
    let armed = STARTED.div_ceil(FRAME);
    let frames: u64 = BETAFLIGHT_LEGS.iter().map(|leg| leg.frames).sum();
    let at = |number: u64| LINES_BEGIN + (armed + number) * FRAME;
    let mut play = Play::new(&settings, at(frames + 120));
    let value = |motor: u8, n: u64| {
        let flight = n.checked_sub(armed).and_then(|number| throttle(&BETAFLIGHT_LEGS, number));
        flight.map_or(0, |value| (value.round() as u16 + u16::from(motor) % 3).min(2047))
    };
    for motor in 0..4 {
        // One frame has a wrong bit, in the air.
        let wrong = |n: u64| if n == armed + 200 { 0x40 } else { 0 };
        play.frames(motor, Speed::Dshot600, FRAME, |n| Some(frame(value(motor, n), false) ^ wrong(n)));
    }
    let outcome = target.play(&play)?;
    for motor in 0..4 {
        let sent = outcome.frames(motor, Speed::Dshot600)?;
        let values: Vec<(u64, u16)> = sent.iter().map(|(start, bits)| (*start, bits >> 5)).collect();
        let (armed_at, disarmed_at) = (at(3) + us(600.0), at(frames));
        let flight: Vec<_> = values.iter().filter(|(start, _)| (armed_at..disarmed_at).contains(start)).collect();
        let stopped = flight.iter().find(|(_, value)| *value < 48);
        hold(stopped.is_none(), || format!("output {motor} stops in flight: {stopped:?}"))?;
        // At least one in each control tick.
        hold(flight.len() as u64 * us(200.0) > disarmed_at - armed_at - us(2000.0), || {
            format!("output {motor}: {} frames", flight.len())
        })?;
        let disarmed = values.iter().filter(|(start, _)| *start > disarmed_at + us(800.0));
        let turning: Vec<_> = disarmed.filter(|(_, value)| *value != 0).collect();
        hold(turning.is_empty(), || format!("output {motor} turns when it is disarmed: {turning:?}"))?;
        // What is not compensated comes out as it went in.
        for index in (0..BETAFLIGHT_LEGS.len()).filter(|_| motor < 3) {
            let steady = steady(&BETAFLIGHT_LEGS, index);
            let expected = value(motor, armed + steady.start);
            let during = at(steady.start)..at(steady.end);
            let wrong = values.iter().find(|(start, value)| during.contains(start) && *value != expected);
            hold(wrong.is_none(), || format!("output {motor}, leg {index}: {wrong:?}, and not {expected}"))?;
        }
    }
    yes()
}

/// `MOT_SPIN_ARM` 0.1, take-off, full stick, `MOT_SPIN_MIN` 0.15 in the air, a failsafe at a low throttle, landing: microseconds.
const ARDUPILOT_LEGS: [Leg; 7] = [
    Leg { frames: 24, throttle: 1100.0 },
    Leg { frames: 24, throttle: 1450.0 },
    Leg { frames: 24, throttle: 2000.0 },
    Leg { frames: 24, throttle: 1150.0 },
    Leg { frames: 24, throttle: 1500.0 },
    Leg { frames: 24, throttle: 1300.0 },
    Leg { frames: 24, throttle: 1100.0 },
];

fn ardupilot(target: &dyn Target) -> Proof {
    let settings = Settings::default();
    let armed = STARTED.div_ceil(PULSE);
    let frames: u64 = ARDUPILOT_LEGS.iter().map(|leg| leg.frames).sum();
    let at = |number: u64| LINES_BEGIN + (armed + number) * PULSE;
    let mut play = Play::new(&settings, at(frames + 14));
    let width_us = |motor: u8, n: u64| {
        let flight = n.checked_sub(armed).and_then(|number| throttle(&ARDUPILOT_LEGS, number));
        flight.map_or(1000.0, |width_us| (width_us + 4.0 * f64::from(motor)).min(2000.0))
    };
    for motor in 0..4 {
        play.pulses(motor, PULSE, at(frames + 12), |n| width_us(motor, n));
    }
    // The fall of one pulse is not seen, in the air.
    let lost = at(100);
    play.edges.retain(|edge| edge.pin != INPUT_1 || edge.is_high || !(lost..lost + us(2000.0)).contains(&edge.cycle));
    let outcome = target.play(&play)?;
    for motor in 0..4 {
        let out = outcome.pulses(motor)?;
        let (armed_at, disarmed_at) = (at(3) + ms(3.0), at(frames) + ms(1.0));
        let flight: Vec<_> = out.iter().filter(|pulse| (armed_at..disarmed_at).contains(&pulse.rise)).collect();
        let low = flight.iter().find(|pulse| pulse.width < us(1099.0));
        hold(low.is_none(), || format!("output {motor} stops in flight: {low:?}"))?;
        let disarmed = out.iter().filter(|pulse| pulse.rise > disarmed_at + ms(4.0));
        let turning: Vec<_> = disarmed.filter(|pulse| pulse.width != us(1000.0)).collect();
        hold(turning.is_empty(), || format!("output {motor} turns when it is disarmed: {turning:?}"))?;
        // As many pulses as come; one more or less at each end, and the one that was not seen.
        let (came, went) = ((disarmed_at - armed_at) / PULSE, flight.len() as u64);
        hold(came.abs_diff(went) <= 2, || format!("output {motor}: {went} pulses of {came}"))?;
        for index in 0..ARDUPILOT_LEGS.len() {
            let steady = steady(&ARDUPILOT_LEGS, index);
            let expected = us(width_us(motor, armed + steady.start));
            let during = at(steady.start)..at(steady.end);
            let wrong = out.iter().find(|pulse| during.contains(&pulse.rise) && pulse.width.abs_diff(expected) > 6);
            hold(wrong.is_none(), || format!("output {motor}, leg {index}: {wrong:?}, and not {expected}"))?;
        }
    }
    yes()
}

/// Stops; direction reversed, six times; throttle for 20 ms; direction normal; throttle again.
fn turtle(target: &dyn Target) -> Proof {
    let input = Pulse { protocol: PulseProtocol::Dshot600, frame_hz: 8000 };
    let output = Pulse { protocol: PulseProtocol::OneShot125, frame_hz: 2000 };
    let settings = Settings { input, output, ..Settings::default() };
    let value = |n: u64| match n.checked_sub(TURN_BEGINS) {
        None => 0,
        Some(0..6) => 21,
        Some(6..200) => 600,
        Some(200..210) => 0,
        Some(210..216) => 20,
        Some(216..226) => 0,
        Some(_) => 600,
    };
    let at = |number: u64| LINES_BEGIN + (TURN_BEGINS + number) * FRAME;
    let mut play = Play::new(&settings, at(400));
    for motor in 0..4 {
        play.frames(motor, Speed::Dshot600, FRAME, |n| Some(frame(value(n), false)));
    }
    let outcome = target.play(&play)?;
    for motor in 0..4 {
        let out = outcome.pulses(motor)?;
        let turned: Vec<_> = out.iter().filter(|pulse| pulse.rise < at(226) && pulse.width != us(125.0)).collect();
        hold(turned.is_empty(), || format!("output {motor} turns the usual way: {turned:?}"))?;
        let after: Vec<_> = out.iter().filter(|pulse| pulse.rise > at(240)).collect();
        let width = us(125.0 + 125.0 * (600.0 - 47.0) / 2000.0);
        let turns = after.len() > 20 && after.iter().all(|pulse| pulse.width.abs_diff(width) <= 3);
        hold(turns, || format!("output {motor} after turtle mode: {after:?}"))?;
    }
    yes()
}
