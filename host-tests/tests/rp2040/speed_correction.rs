//! The correction of an inverse by the speed, at the pins: an ESC that says that its rotor is too slow.

use emulator::rp2040::{Emulator, frames};
use host_tests::board::{CRYSTAL, TestBoard, facts};
use host_tests::flash::Flash;
use host_tests::pins::{self, INPUT_1, OUTPUT_1, ms, us};
use rotorlead::design::{RotorCurve, SpeedCurve};
use rotorlead::dshot::{
    Checksum, Frame, REPLY_BITS, Reply, ReplyWindow, Speed, Value, WINDOW_LEVELS, WORD_LEVELS, Word,
};
use rotorlead::settings::{CompensatorKind, MOTORS, PulseProtocol, Settings, Store};
use rotorlead::throttle::Command;

use crate::bidirectional::{STARTED, esc, sent, settings};

const LEVEL: f64 = 0.5;
/// Two ticks of 5 kHz.
const PERIOD_US: f64 = 400.0;
/// Frames of the output, from the first that turns the motor on, that are compared.
const COMPARED: usize = 480;
/// The last reply of the ESC is behind so many frames since the start of the controller.
const ANSWERED: u16 = 600;

fn with_correction() -> Settings {
    let mut settings = settings(PulseProtocol::Dshot600, PulseProtocol::Dshot300Bidirectional);
    settings.compensator = CompensatorKind::Rpm;
    let [from, to] = [0.3, 0.8].map(Command::saturating_from_f64);
    for motor in &mut settings.motors {
        motor.compensate = true;
        motor.curve = Some(RotorCurve::from_time_constants_s([0.04; 33]));
    }
    settings.speeds = [Some(SpeedCurve::new(from, to, [52_000, 77_000, 98_000])); MOTORS];
    settings
}

/// What the ESC says: 15 % slower than the 71 496 electrical revolutions per minute that are right at the level.
fn said() -> Reply {
    Reply::from_period_us(Some((1.15 * 60e6 / 71_496.0) as u32))
}

fn value() -> Value {
    Value::from_command(Command::saturating_from_f64(LEVEL))
}

/// The library's own run: what goes out in frames with throttle, where the ESC answers the first `answered` of them.
fn library(answered: usize) -> Vec<u16> {
    let mut store = Store::new(Flash::<4096>::blank(), Flash::<4096>::SECTORS);
    store.save(&with_correction().validate().unwrap()).unwrap();
    let (mut board, _, _) = TestBoard::start(store, facts(CRYSTAL));
    let behind = WINDOW_LEVELS - REPLY_BITS - 23;
    let levels = !(u64::from(!said().to_levels() & ((1 << REPLY_BITS) - 1)) << behind);
    let window = ReplyWindow::new((levels >> WORD_LEVELS) as u32, levels as u32);
    let mut values = Vec::new();
    for tick in 0..2 * (COMPARED + 40) {
        let parts = board.control.parts_mut();
        if tick % 2 == 0 {
            let frame = Frame::new(if tick < 40 { Value::new(0).unwrap() } else { value() }, false, Checksum::Normal);
            parts.input_frames.words[0].push_back(Word::from(frame));
        }
        let readings = board.inputs.poll();
        board.control.run(readings, true);
        let parts = board.control.parts_mut();
        for frame in std::mem::take(&mut parts.outputs.sent[0]) {
            let is_throttle = frame.value().get() >= Value::LOWEST_THROTTLE.get();
            if is_throttle {
                values.push(frame.value().get());
            }
            if !is_throttle || values.len() < answered {
                parts.outputs.windows[0].push_back(window);
            }
        }
    }
    values
}

/// Values in the order in which they came, each with the frame at which it came first.
fn changes(values: &[u16]) -> Vec<(u16, usize)> {
    let mut changes: Vec<(u16, usize)> = values.iter().copied().zip(0..).collect();
    changes.dedup_by_key(|(value, _)| *value);
    changes
}

#[test]
#[ignore = "needs the image and the emulators: cargo xtask test"]
fn an_esc_that_says_it_is_too_slow_gets_more_as_the_library_has_it_until_it_is_silent() {
    let frame = |value: Value| Frame::new(value, false, Checksum::Normal).to_bits();
    let mut run = pins::run(&with_correction(), STARTED + ms(PERIOD_US * 1e-3 * (COMPARED as f64 + 20.0)));
    let starts = (us(700.0)..run.until_cycle - us(300.0)).step_by(us(PERIOD_US) as usize);
    let values = starts.map(|start| (start, frame(if start < STARTED { Value::new(0).unwrap() } else { value() })));
    run.inputs.extend(frames(INPUT_1, Speed::Dshot600.bits_per_s(), values));
    esc(&mut run, 0, Speed::Dshot300, 1.0, |n| (n < ANSWERED).then(|| said().to_levels()));
    let trace = pins::trace(Emulator::Node, &run);
    assert_eq!(trace.conflicts, []);
    let bits = sent(Emulator::Node, &trace, OUTPUT_1, Speed::Dshot300);
    let sent: Vec<u16> = bits.iter().map(|bits| bits >> 5).filter(|value| *value >= 48).take(COMPARED).collect();
    assert_eq!(sent.len(), COMPARED);
    let found = changes(&sent);
    let last = found.last().unwrap();
    println!("{} values, from {:?} to {last:?} of {COMPARED} frames", found.len(), found[0]);
    // When the motor was turned on is not known to a frame, nor which of its updates came first: the library's run agrees to three frames, with
    // an ESC that falls silent where this one did.
    let is_alike = |expected: &[(u16, usize)]| {
        let are_near = |(found, expected): (&(u16, usize), &(u16, usize))| {
            found.0 == expected.0 && found.1.abs_diff(expected.1) <= 3
        };
        found.len() == expected.len() && found.iter().zip(expected).all(are_near)
    };
    let silent_from = (COMPARED / 2..COMPARED).find(|&answered| is_alike(&changes(&library(answered))));
    println!("as the library's run with an ESC that is silent from frame {silent_from:?} on");
    assert!(silent_from.is_some_and(|from| from + 60 < COMPARED), "{found:?} {:?}", changes(&library(last.1)));
    assert!(found.len() > 10 && last.1 + 60 < COMPARED, "held from then on: {found:?}");
}
