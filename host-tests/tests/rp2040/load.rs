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

/// Cycles of the longest control tick from 90 ms on, while 150 lines are played at 1 kHz.
fn longest_tick() -> u64 {
    let mut asked = vec![(0.0, excite(LineSet::Odd30Hz))];
    asked.extend([50.0, 80.0, 110.0].map(|at_ms| (at_ms, Request::KeepAlive)));
    let mut run = run(1000, &asked, 120.0);
    run.handlers_from = STARTED + ms(90.0);
    let trace = pins::trace(Emulator::Node, &run);
    assert_eq!(answers(&trace), [const { Message::Done }; 4]);
    trace.handler(SYSTICK).unwrap().most_cycles
}

#[test]
#[ignore = "needs the image and the emulators: cargo xtask test"]
fn an_excitation_takes_no_more_of_a_tick_than_the_controller_reckons_and_not_much_less() {
    let longest = longest_tick();
    let asked = [(0.0, excite(LineSet::Odd30Hz)), (10.0, excite(LineSet::Odd45Hz))];
    let answers = answers(&pins::trace(Emulator::Node, &run(5000, &asked, 30.0)));
    let [Message::Refused(refusal), Message::Refused(_)] = answers[..] else { panic!("{answers:?}") };
    let Refusal::TooSlow { lines: 150, loop_rate_hz: 5000, core_hz, percent } = refusal else { panic!("{refusal:?}") };
    assert_eq!(u64::from(core_hz), CYCLES_PER_S);
    let found = longest as f64 * 5000.0 / CYCLES_PER_S as f64 * 100.0;
    println!(
        "150 lines take {longest} cycles in a tick: {found:.0} % of one at 5 kHz, and {percent} % are reckoned with the link"
    );
    assert!(percent > MAX_LOAD_PERCENT);
    assert!(found < f64::from(percent) && f64::from(percent) < 1.25 * found, "{found} and {percent}");
}
