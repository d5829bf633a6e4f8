//! Bidirectional DShot: simulated ESCs answer the frames at the outputs, and a flight controller lets go of its lines behind its frames.

use std::collections::HashSet;

use emulator::rp2040::{Conflict, Edge, Emulator, Responder, Run, Trace, frames, frames_of_idle_high, pulses, reply};
use host_tests::pins::{self, INPUT_1, OUTPUT_1, bit_cycles, ms, us};
use rotorlead::dshot::{Checksum, Frame, REPLY_BITS, Reply, Speed, Value};
use rotorlead::link::{Message, NO_TURN, RecordRequest, Request};
use rotorlead::settings::{MOTORS, Pulse, PulseProtocol, Settings};

use crate::link::{self, requests};

/// When the controller runs for sure.
pub const STARTED: u64 = 37_500_000;
const EMULATORS: [Emulator; 2] = [Emulator::Node, Emulator::Native];
const SPEEDS: [(PulseProtocol, Speed); 2] =
    [(PulseProtocol::Dshot300Bidirectional, Speed::Dshot300), (PulseProtocol::Dshot600Bidirectional, Speed::Dshot600)];
/// The first frame of a flight controller, and from one to the next, which drifts through the ticks.
const FIRST_US: f64 = 700.0;
const PERIOD_US: f64 = 353.0;
/// When replies pass for sure, behind [`STARTED`].
const SETTLED_MS: f64 = 3.0;
/// What ESCs take from the end of a frame to the reply.
const ESC_DELAY_US: f64 = 30.0;
/// Falls of a line in a frame.
const FRAME_BITS: u32 = 16;

/// Cycles that an edge may be off: the second emulator looks at pins between instructions, and not while an exception is entered.
fn slack(emulator: Emulator) -> f64 {
    match emulator {
        Emulator::Node => 2.0,
        Emulator::Native => 20.0,
    }
}

pub fn settings(input: PulseProtocol, output: PulseProtocol) -> Settings {
    let pulse =
        |protocol: PulseProtocol| Pulse { protocol, frame_hz: if protocol.dshot().is_some() { 2500 } else { 400 } };
    Settings { input: pulse(input), output: pulse(output), ..Settings::default() }
}

fn frame(value: u16) -> u16 {
    Frame::new(Value::new(value).unwrap(), false, Checksum::Inverted).to_bits()
}

/// When a flight controller's frames begin.
fn starts(run: &Run, period_us: f64) -> impl Iterator<Item = u64> + use<> {
    (us(FIRST_US)..run.until_cycle - us(300.0)).step_by(us(period_us) as usize)
}

/// A flight controller at every input: stops, and a throttle from the start on.
fn fly(run: &mut Run, speed: Speed, period_us: f64) {
    for motor in 0..MOTORS as u8 {
        let frames = starts(run, period_us).map(|start| (start, frame(if start < STARTED { 0 } else { 500 })));
        let (edges, releases) = frames_of_idle_high(INPUT_1 + motor, speed.bits_per_s(), frames);
        run.inputs.extend(edges);
        run.releases.extend(releases);
    }
}

/// An ESC at an output, with a clock that is so much too fast. `levels` gives what it answers to its frames, by their number.
pub fn esc(run: &mut Run, motor: u8, speed: Speed, clock: f64, levels: impl Fn(u16) -> Option<u32>) {
    let answer = |levels: Option<u32>| {
        levels.map_or_else(Vec::new, |levels| reply(speed.bits_per_s(), levels, REPLY_BITS, us(ESC_DELAY_US), clock))
    };
    run.responders.push(Responder {
        pin: OUTPUT_1 + motor,
        falls: FRAME_BITS,
        answers: Some((0..1000).map(|n| answer(levels(n))).collect()),
    });
}

/// What an ESC says after its n-th frame: all payloads in turn, of each motor others.
fn said(motor: u8, n: u16) -> Reply {
    Reply::from_payload((n * 5 + u16::from(motor) * 1031) & 0xfff)
}

fn run(settings: &Settings, end: u64) -> Run {
    let mut run = pins::run(settings, end);
    run.watch.extend((INPUT_1..).take(MOTORS));
    run
}

/// The edges of a pin from a cycle on up to another: when, and the level from then on.
fn edges_between(trace: &Trace, pin: u8, from: u64, to: u64) -> Vec<(u64, bool)> {
    let edges = trace.edges_on(pin).filter(|edge| (from..to).contains(&edge.cycle));
    edges.map(|edge| (edge.cycle, edge.is_high)).collect()
}

/// What a flight controller gets behind a frame.
#[derive(Clone, Copy, Debug)]
struct Answer {
    /// The number of the frame.
    frame: usize,
    /// From the frame's end on, microseconds.
    delay_us: f64,
    levels: u32,
}

/// The answers to the frames that begin at `starts`, a period apart, once replies pass. Every level has the length of whole bits to a
/// third of one, as Betaflight's decoder takes it (`(samples + 1) / 3` of samples at three times the rate: `dshot_bitbang_decode.c`),
/// and here to the slack of the emulator.
fn answers(emulator: Emulator, trace: &Trace, pin: u8, speed: Speed, starts: &[u64]) -> Vec<Answer> {
    let reply_bit = 0.8 * 125e6 / f64::from(speed.bits_per_s());
    assert!(slack(emulator) < reply_bit / 3.0);
    let mut found = Vec::new();
    for (frame, pair) in starts.windows(2).enumerate().filter(|(_, pair)| pair[0] > STARTED + ms(SETTLED_MS)) {
        let end = pair[0] + (16.0 * 125e6 / f64::from(speed.bits_per_s())).round() as u64;
        let edges = edges_between(trace, pin, end, pair[1] - 3 * bit_cycles(speed));
        let Some(&(first, is_high)) = edges.first() else { continue };
        assert!(!is_high, "a reply begins with a fall");
        assert!(edges.last().unwrap().1, "the line is high again");
        let (mut levels, mut bits) = (0_u32, 0);
        for pair in edges.windows(2) {
            let length = (pair[1].0 - pair[0].0) as f64;
            let count = (length / reply_bit).round();
            assert!((length - count * reply_bit).abs() <= slack(emulator), "a level of {length} cycles");
            (0..count as u32).for_each(|_| levels = levels << 1 | u32::from(pair[0].1));
            bits += count as u32;
        }
        assert!(bits <= REPLY_BITS, "{bits} bits");
        // The last ones are as high as the idle line.
        (bits..REPLY_BITS).for_each(|_| levels = levels << 1 | 1);
        found.push(Answer { frame, delay_us: (first - end) as f64 / 125.0, levels });
    }
    found
}

/// The frames at an output: each 16 bits of which a zero is low for 3/8 and a one for 6/8, high at their end, and behind them the ESC's
/// reply.
pub fn sent(emulator: Emulator, trace: &Trace, pin: u8, speed: Speed) -> Vec<u16> {
    let bit = 125e6 / f64::from(speed.bits_per_s());
    // A reply of the slowest clock.
    let window = us(ESC_DELAY_US) + (0.8 * bit * f64::from(REPLY_BITS) / 0.94) as u64;
    let near = |cycles: u64, bits: f64| (cycles as f64 - bits * bit).abs() <= slack(emulator) + 2.0;
    let edges = edges_between(trace, pin, STARTED, trace.cycles - us(400.0));
    let mut frames = Vec::new();
    // The first may be cut: behind a reply the line is at rest.
    let first = edges.windows(2).position(|pair| !pair[1].1 && pair[1].0 - pair[0].0 > us(50.0)).unwrap() + 1;
    let mut rest = &edges[first..];
    // The last one may be cut, too.
    while let Some(&[(start, false), ..]) = rest.first_chunk::<{ 2 * FRAME_BITS as usize }>() {
        let (lows, _) = rest[..2 * FRAME_BITS as usize].as_chunks::<2>();
        let mut bits = 0;
        for (place, [fall, rise]) in lows.iter().enumerate() {
            assert!(near(fall.0 - start, place as f64), "bit {place} of the frame at {start}");
            let is_one = near(rise.0 - fall.0, 0.75);
            assert!(is_one || near(rise.0 - fall.0, 0.375), "low for {} cycles at {}", rise.0 - fall.0, fall.0);
            bits = bits << 1 | u16::from(is_one);
        }
        frames.push(bits);
        let over = start + (16.0 * bit) as u64 + window;
        rest = &rest[rest.iter().position(|edge| edge.0 > over).unwrap_or(rest.len())..];
    }
    frames
}

/// A flight and its ESCs: `levels` says what an ESC answers to its n-th frame.
struct Flight {
    run: Run,
    starts: Vec<u64>,
    input: Speed,
}

impl Flight {
    fn new(
        input: (PulseProtocol, Speed),
        output: (PulseProtocol, Speed),
        period_us: f64,
        clock: f64,
        levels: impl Fn(u8, u16) -> Option<u32>,
    ) -> Self {
        Self::at_rate(Settings::default().loop_rate_hz, input, output, period_us, clock, levels)
    }

    fn at_rate(
        loop_rate_hz: u32,
        input: (PulseProtocol, Speed),
        output: (PulseProtocol, Speed),
        period_us: f64,
        clock: f64,
        levels: impl Fn(u8, u16) -> Option<u32>,
    ) -> Self {
        let settings = Settings { loop_rate_hz, ..settings(input.0, output.0) };
        let mut run = run(&settings, STARTED + ms(35.0));
        fly(&mut run, input.1, period_us);
        for motor in 0..MOTORS as u8 {
            esc(&mut run, motor, output.1, clock, |n| levels(motor, n));
        }
        let starts = starts(&run, period_us).collect();
        Self { run, starts, input: input.1 }
    }

    /// What comes of one in which nobody drives against another.
    fn trace(&self, emulator: Emulator) -> Trace {
        let trace = pins::trace(emulator, &self.run);
        assert_eq!(trace.conflicts, [], "{emulator:?}");
        trace
    }

    /// What the flight controller gets for each motor.
    fn answers_in(&self, emulator: Emulator, trace: &Trace) -> [Vec<Answer>; MOTORS] {
        let mut pins = INPUT_1..;
        [(); MOTORS].map(|()| answers(emulator, trace, pins.next().unwrap(), self.input, &self.starts))
    }

    fn answers(&self, emulator: Emulator) -> [Vec<Answer>; MOTORS] {
        self.answers_in(emulator, &self.trace(emulator))
    }

    /// Frames to which there can be an answer.
    fn frames(&self) -> usize {
        self.starts.iter().filter(|start| **start > STARTED + ms(SETTLED_MS)).count() - 1
    }
}

/// Which of its replies an ESC has given, of all that it says.
fn number(motor: u8, answer: &Answer) -> u16 {
    (0..4000).find(|n| said(motor, *n).to_levels() == answer.levels).expect("a reply of this ESC")
}

#[test]
#[ignore = "needs the image and the emulators: cargo xtask test"]
fn the_flight_controller_gets_what_each_esc_answers_bit_for_bit() {
    for emulator in EMULATORS {
        for input in SPEEDS {
            for (output, clock) in SPEEDS.into_iter().zip([0.95, 1.05]) {
                let flight = Flight::new(input, output, PERIOD_US, clock, |motor, n| Some(said(motor, n).to_levels()));
                let mut delays_us = Vec::new();
                let trace = flight.trace(emulator);
                for (motor, answers) in (0..).zip(flight.answers_in(emulator, &trace)) {
                    let sent = sent(emulator, &trace, OUTPUT_1 + motor, output.1);
                    let stops = sent.iter().take_while(|bits| **bits == frame(0)).count();
                    assert!(sent[stops..].iter().all(|bits| *bits == frame(500)), "{sent:x?}");
                    assert!(sent.len() - stops >= flight.frames(), "{} of {}", sent.len(), flight.frames());
                    let numbers: Vec<u16> = answers.iter().map(|answer| number(motor, answer)).collect();
                    assert!(numbers.is_sorted(), "{numbers:?}");
                    let different = numbers.iter().collect::<HashSet<_>>().len();
                    assert!(different + 1 >= answers.len(), "{numbers:?}");
                    assert_eq!(answers.len(), flight.frames());
                    delays_us.extend(answers.iter().map(|answer| answer.delay_us));
                }
                let least = delays_us.iter().copied().fold(f64::INFINITY, f64::min);
                let most = delays_us.iter().copied().fold(0.0, f64::max);
                let (input, output) = (input.1, output.1);
                println!("{emulator:?}, {input:?} in, {output:?} out: {least:.1} to {most:.1} us behind the frame");
                assert!(25.0 <= least && most <= 35.0);
            }
        }
    }
}

#[test]
#[ignore = "needs the image and the emulators: cargo xtask test"]
fn each_tick_sends_a_frame_of_throttle_on_where_the_flight_controller_is_faster() {
    let dshot600 = SPEEDS[1];
    for (emulator, loop_rate_hz) in [(Emulator::Node, 5_000), (Emulator::Node, 10_000), (Emulator::Native, 5_000)] {
        // At 8 kHz.
        let says = |motor, n| Some(said(motor, n).to_levels());
        let flight = Flight::at_rate(loop_rate_hz, dshot600, dshot600, 125.0, 1.0, says);
        let trace = flight.trace(emulator);
        for (motor, answers) in (0..).zip(flight.answers_in(emulator, &trace)) {
            assert_eq!(answers.len(), flight.frames(), "{emulator:?}, motor {motor}");
            assert!(answers.iter().map(|answer| number(motor, answer)).is_sorted());
            // The second emulator's edges are too late for back-to-back frames, where it enters exceptions.
            if emulator == Emulator::Node {
                let sent = sent(emulator, &trace, OUTPUT_1 + motor, dshot600.1).len();
                let seen = STARTED..trace.cycles - us(400.0);
                let received = flight.starts.iter().filter(|start| seen.contains(start)).count();
                println!("{loop_rate_hz} Hz, motor {motor}: {sent} frames out, {received} in");
                if loop_rate_hz > 8_000 {
                    // A line is free 101 us behind a frame, a little later than the next tick: then two go out as one. One may be cut at
                    // either end.
                    assert!(50 * sent >= 49 * received && sent <= received);
                } else {
                    // Those that come in one tick go out as one, and each tick has one: 5 of 8.
                    assert!(sent as f64 > 0.6 * received as f64 && sent < received);
                }
            }
        }
    }
}

#[test]
#[ignore = "needs the image and the emulators: cargo xtask test"]
fn replies_that_are_lost_or_damaged_are_bridged_for_a_while_and_no_further() {
    let dshot600 = SPEEDS[1];
    // A level of the checksum is wrong.
    let damaged = |motor, n| said(motor, n).to_levels() ^ 1;
    for emulator in EMULATORS {
        // Of three replies one does not come and one is damaged; the ESC of motor 1 is damaged alone, that of 2 is not there, and that of 3
        // falls silent.
        let silent_from = 300;
        let flight = Flight::new(dshot600, dshot600, PERIOD_US, 1.0, |motor, n| match motor {
            0 if n.is_multiple_of(3) => None,
            0 if n % 3 == 1 => Some(damaged(motor, n)),
            1 => Some(damaged(motor, n)),
            2 => None,
            3 if n >= silent_from => None,
            _ => Some(said(motor, n).to_levels()),
        });
        let [bridged, bad, none, fallen] = flight.answers(emulator);
        assert_eq!(bridged.len(), flight.frames(), "{emulator:?}");
        let numbers: Vec<u16> = bridged.iter().map(|answer| number(0, answer)).collect();
        assert!(numbers.iter().all(|n| n % 3 == 2) && numbers.is_sorted(), "{numbers:?}");
        assert_eq!((bad.len(), none.len()), (0, 0), "{emulator:?}");
        let last = fallen.last().expect("it answered at first");
        assert_eq!(number(3, last), silent_from - 1, "{emulator:?}");
        let first = fallen.iter().find(|answer| answer.levels == last.levels).unwrap();
        let repeated_us = (last.frame - first.frame) as f64 * PERIOD_US;
        assert!((2000.0..=3000.0).contains(&repeated_us), "{emulator:?}: repeated for {repeated_us} us");
    }
}

#[test]
#[ignore = "needs the image and the emulators: cargo xtask test"]
fn a_line_on_which_nobody_awaits_an_answer_is_never_driven() {
    let dshot600 = SPEEDS[1];
    for emulator in EMULATORS {
        let mut flight = Flight::new(dshot600, dshot600, PERIOD_US, 1.0, |motor, n| Some(said(motor, n).to_levels()));
        // From some time on, while replies are fresh, the lines have pulses, DShot one way, and half the speed.
        let turn = STARTED + ms(12.0);
        let run = &mut flight.run;
        run.inputs.retain(|edge| edge.pin == INPUT_1 || edge.cycle < turn);
        run.releases.retain(|release| release.pin == INPUT_1 || release.cycle < turn);
        let later = |edges: Vec<Edge>| edges.into_iter().filter(move |edge| edge.cycle >= turn + us(100.0));
        run.inputs.extend(later(pulses(INPUT_1 + 1, us(700.0), us(2500.0), run.until_cycle, |_| us(1000.0))));
        let starts = flight.starts.iter().map(|start| (*start, frame(500)));
        run.inputs.extend(later(frames(INPUT_1 + 2, 600_000, starts.clone())));
        run.inputs.extend(later(frames_of_idle_high(INPUT_1 + 3, 300_000, starts).0));
        // They are driven throughout from then on: an answer would be a conflict.
        let before = flight.starts.iter().filter(|start| **start < turn).count();
        flight.starts.truncate(before);
        for answers in flight.answers(emulator) {
            assert_eq!(answers.len(), flight.frames(), "{emulator:?}");
        }
    }
}

#[test]
#[ignore = "needs the image and the emulators: cargo xtask test"]
fn a_flight_controller_with_replies_on_an_input_without_is_counted_and_nothing_goes_out() {
    for (_, speed) in SPEEDS {
        let one_way = if speed == Speed::Dshot300 { PulseProtocol::Dshot300 } else { PulseProtocol::Dshot600 };
        let mut run = run(&settings(one_way, one_way), STARTED + ms(30.0));
        fly(&mut run, speed, PERIOD_US);
        run.uart_in = requests(STARTED + ms(5.0), 10.0, &[Request::Faults, Request::Faults]);
        let trace = pins::trace(Emulator::Node, &run);
        let [Message::Faults(before), Message::Faults(after)] = &link::answers(&trace)[..] else {
            panic!("{:?}", link::answers(&trace))
        };
        let frames = ms(10.0) as f64 / us(PERIOD_US) as f64;
        for (before, after) in before.motors.iter().zip(&after.motors) {
            let bad = f64::from(after.bad_frames - before.bad_frames);
            println!("{speed:?}: {bad} bad frames of {frames:.1}");
            assert!((bad - frames).abs() <= 2.0 && after.dropped_frames == 0, "{after:?}");
        }
        for motor in 0..MOTORS as u8 {
            assert_eq!(edges_between(&trace, OUTPUT_1 + motor, STARTED, run.until_cycle), []);
        }
    }
}

#[test]
#[ignore = "needs the image and the emulators: cargo xtask test"]
fn pulses_go_on_as_frames_that_are_answered_and_faults_count_the_replies() {
    let dshot300 = SPEEDS[0];
    let mut run = run(&settings(PulseProtocol::StandardPwm, dshot300.0), STARTED + ms(40.0));
    for motor in 0..MOTORS as u8 {
        run.inputs.extend(pulses(INPUT_1 + motor, us(500.0), us(2500.0), run.until_cycle, |_| us(1000.0)));
    }
    esc(&mut run, 0, dshot300.1, 1.0, |n| Some(said(0, n).to_levels()));
    esc(&mut run, 1, dshot300.1, 1.0, |n| Some(said(1, n).to_levels() ^ u32::from(n % 2 == 0)));
    run.uart_in = requests(STARTED + ms(20.0), 10.0, &[Request::Faults]);
    let trace = pins::trace(Emulator::Node, &run);
    assert_eq!(trace.conflicts, []);
    let [Message::Faults(faults)] = &link::answers(&trace)[..] else { panic!("{:?}", link::answers(&trace)) };
    let counts = faults.motors.map(|motor| (motor.replies, motor.bad_replies));
    println!("good and bad replies: {counts:?}");
    let [(all, 0), (good, bad), (0, 0), (0, 0)] = counts else { panic!("{counts:?}") };
    assert!(all > 50 && good.abs_diff(bad) <= 1 && (good + bad).abs_diff(all) <= 1, "{counts:?}");
}

#[test]
#[ignore = "needs the image and the emulators: cargo xtask test"]
fn the_recorder_has_the_speed_that_the_esc_says() {
    let dshot300 = SPEEDS[0];
    let motor = 2;
    let mut run = run(&settings(PulseProtocol::StandardPwm, dshot300.0), STARTED + ms(80.0));
    run.inputs.extend(pulses(INPUT_1 + motor, us(500.0), us(2500.0), run.until_cycle, |_| us(1000.0)));
    // Each eighth reply is extended telemetry. It is silent for 12 frames, of two ticks each: for longer than a speed is held.
    let silent = 290..302;
    let said = |n: u16| match n % 8 {
        0 => Reply::from_payload(0x2aa),
        _ => Reply::from_period_us(Some(500 + 2 * u32::from(n))),
    };
    esc(&mut run, motor, dshot300.1, 1.0, |n| (!silent.contains(&n)).then(|| said(n).to_levels()));
    let request = RecordRequest { motor, divisor: 1 };
    run.uart_in = requests(STARTED, 60.0, &[Request::Record(Some(request)), Request::Record(None)]);
    let trace = pins::trace(Emulator::Node, &run);
    assert_eq!(trace.conflicts, []);
    let recorded: Vec<i32> = link::answers(&trace)
        .into_iter()
        .filter_map(|answer| if let Message::Record(record) = answer { Some(record) } else { None })
        .flat_map(|record| record.turn_us.as_slice().to_vec())
        .collect();
    assert!(recorded.len() > 250, "{} samples", recorded.len());
    // Each speed is in some sample, in the order in which they were said.
    let mut seen = recorded.clone();
    seen.dedup();
    let turn_us = |n| said(n).turn_us().map(i32::from);
    let mut expected: Vec<i32> = (0..silent.start).filter_map(turn_us).collect();
    expected.push(NO_TURN);
    expected.extend((silent.end..1000).filter_map(turn_us));
    expected.dedup();
    let first = expected.windows(2).position(|pair| pair == &seen[..2]).expect("what was said");
    println!("{} samples, {} speeds", recorded.len(), seen.len());
    assert!(seen.len() > 60 && seen.contains(&NO_TURN), "{seen:?}");
    assert_eq!(seen, expected[first..first + seen.len()]);
    let gap = recorded.iter().filter(|turn_us| **turn_us == NO_TURN).count();
    assert!((5..=20).contains(&gap), "{gap} samples without a speed");
}

#[test]
#[ignore = "needs the image and the emulators: cargo xtask test"]
fn two_that_drive_a_line_at_once_are_seen() {
    let dshot600 = SPEEDS[1];
    for emulator in EMULATORS {
        // A flight controller that goes on driving its line high behind its frames, and an ESC that answers within a frame.
        let Flight { mut run, .. } =
            Flight::new(dshot600, dshot600, PERIOD_US, 1.0, |motor, n| Some(said(motor, n).to_levels()));
        run.releases.retain(|release| release.pin != INPUT_1 + 1);
        let drives = run.responders[2].answers.iter_mut().flatten().flatten();
        drives.for_each(|drive| drive.after -= us(ESC_DELAY_US) + bit_cycles(dshot600.1) / 2);
        let trace = pins::trace(emulator, &run);
        let pins: HashSet<u8> = trace.conflicts.iter().map(|Conflict { pin, .. }| *pin).collect();
        assert_eq!(pins, HashSet::from([INPUT_1 + 1, OUTPUT_1 + 2]), "{emulator:?}");
    }
}
