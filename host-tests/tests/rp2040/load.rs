//! What an excitation takes of the core, beside what the controller says of it.

use emulator::rp2040::{Bytes, CYCLES_PER_S, Edge, Emulator, Run, Trace};
use host_tests::pins::{self, JUMPER, ms};
use rotorlead::link::{
    ExciteRequest, FRAME_BYTES, LineSet, MAX_LOAD_PERCENT, Message, Receiver, Refusal, Request, encode,
};
use rotorlead::settings::Settings;
use rotorlead::throttle::Command;

/// When the controller runs for sure.
const STARTED: u64 = 37_500_000;
/// The exception of the control task.
const SYSTICK: u32 = 15;

fn excite(lines: LineSet) -> Request {
    let bits = |command| Command::saturating_from_f64(command).to_bits();
    Request::Excite(ExciteRequest { motor: 0, lines, nominal: bits(0.5), amplitude: bits(0.05), periods: 1 })
}

/// A controller whose host asks this, so many milliseconds after the start.
fn run(loop_rate_hz: u32, asked: &[(f64, Request)], end_ms: f64) -> Run {
    let mut settings = Settings { loop_rate_hz, ..Settings::default() };
    settings.motors.iter_mut().for_each(|motor| motor.compensate = true);
    (settings.excitation.arm_ms, settings.excitation.ramp_ms) = (10, 100);
    let mut run = pins::run(&settings, STARTED + ms(end_ms));
    run.inputs.push(Edge { cycle: 0, pin: JUMPER, is_high: false });
    for (tag, (at_ms, request)) in (1..).zip(asked) {
        let mut frame = [0; FRAME_BYTES];
        let length = encode(tag, request, &mut frame).unwrap();
        run.uart_in.push(Bytes { cycle: STARTED + ms(*at_ms), bytes: frame[..length].to_vec() });
    }
    run
}

fn answers(trace: &Trace) -> Vec<Message> {
    let mut receiver = Receiver::<Message>::new();
    trace.uart.iter().filter_map(|byte| receiver.push(*byte)).map(|tagged| tagged.message).collect()
}

/// Cycles of the longest control tick from 90 ms on, while lines are played.
fn longest_tick(loop_rate_hz: u32, lines: LineSet) -> u64 {
    let mut asked = vec![(0.0, excite(lines))];
    asked.extend([50.0, 80.0, 110.0].map(|at_ms| (at_ms, Request::KeepAlive)));
    let mut run = run(loop_rate_hz, &asked, 120.0);
    run.handlers_from = STARTED + ms(90.0);
    let trace = pins::trace(Emulator::Node, &run);
    assert_eq!(answers(&trace), [const { Message::Done }; 4]);
    trace.handler(SYSTICK).unwrap().most_cycles
}

#[test]
#[ignore = "needs the image and the emulators: cargo xtask test"]
fn an_excitation_leaves_a_third_of_the_tick() {
    for (loop_rate_hz, lines) in [(5000, LineSet::Odd30Hz), (5000, LineSet::Odd45Hz), (1000, LineSet::Odd45Hz)] {
        let longest = longest_tick(loop_rate_hz, lines);
        let found = longest as f64 * f64::from(loop_rate_hz) / CYCLES_PER_S as f64;
        let lines = lines.lines();
        println!(
            "{} lines at {loop_rate_hz} Hz take {longest} cycles in a tick, {:.1} % of it",
            lines.count(),
            100.0 * found
        );
        assert!(found < 2.0 / 3.0);
    }
}

/// A rate at which a period has no number of ticks that is a multiple of 4: each tick sums half of the lines.
const ODD_RATE_HZ: u32 = 4999;

#[test]
#[ignore = "needs the image and the emulators: cargo xtask test"]
fn the_controller_reckons_a_little_more_than_a_line_takes() {
    let sets = [LineSet::Odd30Hz, LineSet::Odd45Hz];
    let per_tick = |loop_rate_hz| {
        let [few, many] = sets.map(|set| set.lines().per_tick(loop_rate_hz * set.lines().period_s()) as f64);
        many - few
    };
    let [few, many] = sets.map(|set| longest_tick(1000, set) as f64);
    let line = (many - few) / per_tick(1000);
    let asked = [(0.0, excite(sets[0])), (10.0, excite(sets[1]))];
    let answers = answers(&pins::trace(Emulator::Node, &run(ODD_RATE_HZ, &asked, 30.0)));
    let percent = |message: &Message| match message {
        Message::Refused(Refusal::TooSlow { percent, .. }) if *percent > MAX_LOAD_PERCENT => f64::from(*percent),
        other => panic!("{other:?}"),
    };
    let [few, many] = &answers[..] else { panic!("{answers:?}") };
    let cycles_per_percent = CYCLES_PER_S as f64 / f64::from(ODD_RATE_HZ) / 100.0 / per_tick(ODD_RATE_HZ);
    let reckoned = (percent(many) - percent(few)) * cycles_per_percent;
    println!("a line takes {line:.1} cycles, and {reckoned:.0} are reckoned, to {cycles_per_percent:.0}");
    assert!((line - cycles_per_percent..1.1 * line + cycles_per_percent).contains(&reckoned));
}
