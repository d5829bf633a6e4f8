//! DShot: frames beside those of an independent encoder, and a whole controller that has them at its inputs and outputs.

use dshot_frame::{BidirectionalFrame, NormalFrame};
use host_tests::board::{CRYSTAL, TestBoard, facts};
use host_tests::flash::Flash;
use rotorlead::channel::Input;
use rotorlead::controller::{BoardFacts, ControlAccess as _, channels, filters};
use rotorlead::dshot::{Checksum, Content, Frame, Speed, Value, Word};
use rotorlead::link::{ExciteRequest, FrameFaults, LineSet, Message, Refusal, Request, Tagged};
use rotorlead::settings::{Origin, Pulse, PulseProtocol, Settings, Store, Validated};
use rotorlead::throttle::Command;

const SECTOR: usize = 4096;
const IDLE: bool = true;

#[test]
fn frames_are_those_of_an_independent_encoder() {
    for speed in 0..2000_u16 {
        for reports in [false, true] {
            let value = Value::new(speed + 48).unwrap();
            assert!(matches!(value.content(), Content::Throttle(_)));
            let normal = NormalFrame::new(speed, reports).unwrap();
            assert_eq!(Frame::new(value, reports, Checksum::Normal).to_bits(), normal.inner());
            let inverted = BidirectionalFrame::new(speed, reports).unwrap();
            let frame = Frame::new(value, reports, Checksum::Inverted);
            assert_eq!(frame.to_bits(), inverted.inner());
            assert_eq!((frame.value().get() - 48, frame.reports()), (inverted.speed(), inverted.telemetry_enabled()));
        }
    }
}

fn settings(input: PulseProtocol, output: PulseProtocol) -> Validated {
    let pulse =
        |protocol: PulseProtocol| Pulse { protocol, frame_hz: if protocol.dshot().is_some() { 2500 } else { 400 } };
    let mut settings = Settings { input: pulse(input), output: pulse(output), ..Settings::default() };
    settings.motors[0].compensate = true;
    settings.validate().unwrap()
}

fn start(settings: &Validated, facts: BoardFacts) -> (TestBoard, Origin) {
    let mut store = Store::new(Flash::<SECTOR>::blank(), Flash::<SECTOR>::SECTORS);
    store.save(settings).unwrap();
    let (board, _, origin) = TestBoard::start(store, facts);
    (board, origin)
}

/// A control tick with a frame at every input.
fn tick(board: &mut TestBoard, value: u16) {
    let frame = Frame::new(Value::new(value).unwrap(), false, Checksum::Normal);
    board.control.hardware_mut().words.iter_mut().for_each(|words| words.push_back(Word::from(frame)));
    run(board);
}

fn run(board: &mut TestBoard) {
    let readings = board.inputs.poll();
    board.control.run(readings, IDLE);
}

fn sent(board: &mut TestBoard, motor: usize) -> Vec<u16> {
    std::mem::take(&mut board.control.hardware_mut().sent[motor]).iter().map(|frame| frame.value().get()).collect()
}

#[test]
fn a_frame_that_goes_out_has_what_the_channel_gives_and_the_compensators_answer() {
    let settings = settings(PulseProtocol::Dshot600, PulseProtocol::Dshot300);
    let (mut board, _) = start(&settings, facts(CRYSTAL));
    assert_eq!(board.control.hardware_mut().input_speed, Some(Speed::Dshot600));
    assert_eq!(board.control.hardware_mut().output_speed, Some(Speed::Dshot300));
    (0..10).for_each(|_| tick(&mut board, 0));
    // Three frames make an input live: none goes out before.
    assert_eq!(sent(&mut board, 0), [0; 8]);
    let _ = sent(&mut board, 1);
    let [mut reference, ..] = channels(&settings, filters(&settings).unwrap()).unwrap();
    let command = |value| match Value::new(value).unwrap().content() {
        Content::Throttle(command) => command,
        Content::Instruction(_) => Command::ZERO,
    };
    for _ in 0..8 {
        let _ = reference.tick(Input::Command(Command::ZERO));
    }
    let values: Vec<u16> = (0..300).map(|n| if n < 100 { 800 } else { 900 }).collect();
    let expected: Vec<u16> = values
        .iter()
        .map(|value| reference.tick(Input::Command(command(*value))))
        .map(|output| Value::from_command(output.command().unwrap()).get())
        .collect();
    values.iter().for_each(|value| tick(&mut board, *value));
    assert_eq!(sent(&mut board, 0), expected);
    assert!(expected.iter().any(|value| *value > 1000), "the lead");
    // Without the compensator a value passes as it is.
    assert_eq!(sent(&mut board, 1), values);
}

#[test]
fn an_excitation_and_an_injection_send_a_frame_in_each_tick_and_an_input_without_frames_none() {
    let mut settings = settings(PulseProtocol::Dshot600, PulseProtocol::Dshot600).into_settings();
    settings.excitation.arm_ms = 20;
    let mut store = Store::new(Flash::<SECTOR>::blank(), Flash::<SECTOR>::SECTORS);
    store.save(&settings.validate().unwrap()).unwrap();
    let (mut board, mut handler, _) = TestBoard::start(store, facts(CRYSTAL));
    let mut ask = |request, board: &mut TestBoard| {
        handler.answer(Tagged { tag: 1, message: request }, FrameFaults::default(), board).unwrap().message
    };
    (0..100).for_each(|_| run(&mut board));
    assert_eq!(sent(&mut board, 0), [0; 0]);
    let bits = |value: f64| Command::saturating_from_f64(value).to_bits();
    let excite =
        ExciteRequest { motor: 0, lines: LineSet::Odd30Hz, nominal: bits(0.5), amplitude: bits(0.05), periods: 1 };
    assert_eq!(ask(Request::Excite(excite), &mut board), Message::Done);
    (0..100).for_each(|_| run(&mut board));
    assert_eq!(sent(&mut board, 0), [0; 100], "stops for the ESC to arm");
    (0..400).for_each(|_| run(&mut board));
    let ramp = sent(&mut board, 0);
    assert_eq!(ramp.len(), 400);
    assert!(ramp.is_sorted() && ramp[399] > 48, "{ramp:?}");
    assert_eq!(sent(&mut board, 1), [0; 0], "of another motor");
    // The flight controller is back: a frame for each of its own, and none besides.
    (0..10).for_each(|_| tick(&mut board, 0));
    assert!(sent(&mut board, 1).len() <= 10);
}

#[test]
fn a_board_without_dshot_refuses_it_and_does_not_start_with_it() {
    let mute = BoardFacts { speaks_dshot: false, ..facts(CRYSTAL) };
    for (input, output) in
        [(PulseProtocol::Dshot600, PulseProtocol::StandardPwm), (PulseProtocol::StandardPwm, PulseProtocol::Dshot150)]
    {
        let settings = settings(input, output);
        let (mut board, origin) = start(&settings, mute);
        assert_eq!(origin, Origin::DefaultsBad);
        let channels = channels(&settings, filters(&settings).unwrap()).unwrap();
        assert_eq!(board.reconfigure(&settings, channels), Err(Refusal::NoDshot));
        assert_eq!(board.control.hardware_mut().output_speed, None);
    }
}

#[test]
fn frames_of_an_input_are_counted_and_its_pulses_are_left_alone() {
    let settings = settings(PulseProtocol::Dshot600, PulseProtocol::Dshot600);
    let (mut board, _) = start(&settings, facts(CRYSTAL));
    // The words wait for the control task: the capture must not take them for stamps.
    assert!(!board.inputs.capture());
    (0..10).for_each(|_| tick(&mut board, 0));
    for bad in [0, 1, 1 << 16 | 0x0124, 1 << 17] {
        board.control.hardware_mut().words[2].push_back(Word::new(bad));
    }
    run(&mut board);
    let faults = board.counts().motors;
    assert_eq!(faults.map(|motor| motor.bad_frames), [0, 0, 4, 0]);
    // 100 ms without a frame.
    (0..510).for_each(|_| run(&mut board));
    assert_eq!(board.counts().motors.map(|motor| motor.lost), [1; 4]);
}
