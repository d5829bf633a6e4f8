//! DShot: frames beside those of an independent encoder, and a whole controller that has them at its inputs and outputs.

use dshot_frame::{BidirectionalFrame, NormalFrame};
use host_tests::board::{CRYSTAL, TestBoard, facts};
use host_tests::flash::Flash;
use rotorlead::channel::{Input, State};
use rotorlead::controller::{BoardFacts, ControlAccess as _, channels, filters};
use rotorlead::dshot::{
    Checksum, Content, FRESH_MS, Frame, LONGEST_TURN_US, Line, Offer, REPLY_BITS, Reply, ReplyWindow, Speed, Value,
    WINDOW_LEVELS, WORD_LEVELS, Word,
};
use rotorlead::link::{
    ExciteRequest, FrameFaults, LineSet, Message, NO_TURN, Path, RecordRequest, Refusal, Request, Tagged,
};
use rotorlead::settings::{Key, Origin, Problem, Pulse, PulseProtocol, Settings, Store, Validated};
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
    board.control.parts_mut().input_frames.words.iter_mut().for_each(|words| words.push_back(Word::from(frame)));
    run(board);
}

fn run(board: &mut TestBoard) {
    let readings = board.inputs.poll();
    board.control.run(readings, IDLE);
}

fn sent(board: &mut TestBoard, motor: usize) -> Vec<u16> {
    std::mem::take(&mut board.control.parts_mut().outputs.sent[motor]).iter().map(|frame| frame.value().get()).collect()
}

#[test]
fn a_frame_that_goes_out_has_what_the_channel_gives_and_the_compensators_answer() {
    let settings = settings(PulseProtocol::Dshot600, PulseProtocol::Dshot300);
    let (mut board, _) = start(&settings, facts(CRYSTAL));
    assert_eq!(board.control.parts_mut().input_frames.line, Some(Line::one_way(Speed::Dshot600)));
    assert_eq!(board.control.parts_mut().outputs.line, Some(Line::one_way(Speed::Dshot300)));
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
    // Two that do not arm yet are stops.
    let armed: Vec<u16> = (0..300).map(|n| if n < 2 { 0 } else { values[n] }).collect();
    let expected: Vec<u16> = values
        .iter()
        .map(|value| reference.tick(Input::Command(command(*value))))
        .map(|output| Value::from_command(output.command().unwrap()).get())
        .collect();
    values.iter().for_each(|value| tick(&mut board, *value));
    assert_eq!(sent(&mut board, 0), expected);
    assert!(expected.iter().any(|value| *value > 1000), "the lead");
    // Without the compensator a value passes as it is.
    assert_eq!(sent(&mut board, 1), armed);
}

/// 108 is Betaflight's idle of 3 %, and 48 where its dynamic idle goes.
#[test]
fn every_throttle_passes_between_two_stops_whatever_its_value() {
    let settings = settings(PulseProtocol::Dshot600, PulseProtocol::Dshot600);
    let (mut board, _) = start(&settings, facts(CRYSTAL));
    (0..10).for_each(|_| tick(&mut board, 0));
    (0..3).for_each(|_| tick(&mut board, 200));
    let _ = sent(&mut board, 1);
    let throttles = [200, 127, 126, 100, 70, 48, 128, 140, 146, 147, 48, 2047, 49];
    throttles.iter().for_each(|value| tick(&mut board, *value));
    assert_eq!(sent(&mut board, 1), throttles);
    tick(&mut board, 0);
    assert_eq!(sent(&mut board, 1), [0]);
}

/// Commands that change how an ESC turns, where a motor compensates, and where the outputs have no frames.
#[test]
fn mode_3d_is_kept_from_a_compensated_motor_and_turtle_mode_from_outputs_with_pulses() {
    let compensated = settings(PulseProtocol::Dshot600, PulseProtocol::Dshot600);
    let (mut board, _) = start(&compensated, facts(CRYSTAL));
    (0..10).for_each(|_| tick(&mut board, 0));
    let _ = sent(&mut board, 1);
    (0..6).for_each(|_| tick(&mut board, 10));
    // Not to any motor: a flight controller means all of them.
    assert_eq!(sent(&mut board, 1), [0; 6]);
    assert_eq!(board.counts().motors.map(|motor| motor.refused_frames), [6; 4]);
    (0..10).for_each(|_| tick(&mut board, 600));
    assert_eq!(sent(&mut board, 1), [0; 10], "600 may mean backwards");
    (0..6).for_each(|_| tick(&mut board, 9));
    assert_eq!(sent(&mut board, 1), [9; 6]);
    (0..5).for_each(|_| tick(&mut board, 600));
    assert_eq!(sent(&mut board, 1), [0, 0, 600, 600, 600]);

    let mut plain = compensated.into_settings();
    plain.motors[0].compensate = false;
    let (mut board, _) = start(&plain.validate().unwrap(), facts(CRYSTAL));
    (0..10).for_each(|_| tick(&mut board, 0));
    let _ = sent(&mut board, 1);
    (0..6).for_each(|_| tick(&mut board, 10));
    assert_eq!(sent(&mut board, 1), [10; 6]);

    let to_pulses = settings(PulseProtocol::Dshot600, PulseProtocol::StandardPwm);
    let (mut board, _) = start(&to_pulses, facts(CRYSTAL));
    (0..10).for_each(|_| tick(&mut board, 0));
    (0..6).for_each(|_| tick(&mut board, 21));
    (0..100).for_each(|_| tick(&mut board, 600));
    let states = board.tick(|tick| tick.motors().each_ref().map(|motor| motor.channel().state()));
    assert_eq!(states, [State::Disarmed; 4]);
    (0..6).for_each(|_| tick(&mut board, 20));
    (0..3).for_each(|_| tick(&mut board, 600));
    let states = board.tick(|tick| tick.motors().each_ref().map(|motor| motor.channel().state()));
    assert_eq!(states, [State::Armed; 4]);
}

#[test]
fn info_has_the_rate_of_frames_and_says_where_pulses_are_left_over() {
    let rates = |settings: &Validated| {
        let (mut board, _) = start(settings, facts(CRYSTAL));
        (0..3000).for_each(|n| if n % 2 == 0 { tick(&mut board, 0) } else { run(&mut board) });
        board.frame_rates(settings.loop_rate_hz)[0]
    };
    // A frame in every other tick of 5 kHz.
    let relayed = rates(&settings(PulseProtocol::Dshot600, PulseProtocol::Dshot600));
    assert_eq!((relayed.input_hz, relayed.output_hz), (2500, 2500));
    let slow = rates(&settings(PulseProtocol::Dshot600, PulseProtocol::StandardPwm));
    assert_eq!((slow.input_hz, slow.output_hz), (2500, 400));
    let path = Path { input_hz: slow.input_hz, output_hz: slow.output_hz, ..Path::SILENT };
    assert!(path.leaves_pulses_over() && !Path { input_hz: 400, ..path }.leaves_pulses_over());
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
        assert_eq!(board.control.parts_mut().outputs.line, None);
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
        board.control.parts_mut().input_frames.words[2].push_back(Word::new(bad));
    }
    run(&mut board);
    let faults = board.counts().motors;
    assert_eq!(faults.map(|motor| motor.bad_frames), [0, 0, 4, 0]);
    // Words that the board has lost.
    board.control.parts_mut().input_frames.take_words_lost[1] = true;
    run(&mut board);
    assert_eq!(board.counts().motors.map(|motor| motor.dropped_frames), [0, 1, 0, 0]);
    // 100 ms without a frame.
    (0..510).for_each(|_| run(&mut board));
    assert_eq!(board.counts().motors.map(|motor| motor.lost), [1; 4]);
}

/// What a line is behind a frame when the ESC says this some 30 µs later.
fn window(levels: u32) -> ReplyWindow {
    let behind = WINDOW_LEVELS - REPLY_BITS - 23;
    let levels = !(u64::from(!levels & ((1 << REPLY_BITS) - 1)) << behind);
    ReplyWindow::new((levels >> WORD_LEVELS) as u32, levels as u32)
}

/// A control tick with a frame of a bidirectional line at every input, and what the ESCs have answered.
fn answered_tick(board: &mut TestBoard, replies: [Option<u32>; 4]) {
    let frame = Frame::new(Value::new(0).unwrap(), false, Checksum::Inverted);
    let parts = board.control.parts_mut();
    for (motor, reply) in replies.into_iter().enumerate() {
        parts.input_frames.words[motor].push_back(Word::from(frame));
        parts.outputs.windows[motor].push_back(window(reply.unwrap_or(u32::MAX)));
    }
    run(board);
}

fn offers(board: &mut TestBoard) -> [Vec<Offer>; 4] {
    let inputs = &mut board.control.parts_mut().input_frames;
    inputs.are_taken = [true; 4];
    std::mem::take(&mut inputs.offers)
}

#[test]
fn replies_go_to_the_flight_controller_of_their_motor_and_are_counted() {
    let settings = settings(PulseProtocol::Dshot600Bidirectional, PulseProtocol::Dshot300Bidirectional);
    let (mut board, _) = start(&settings, facts(CRYSTAL));
    let parts = board.control.parts_mut();
    assert_eq!(parts.input_frames.line, Some(Line::bidirectional(Speed::Dshot600)));
    assert_eq!(parts.outputs.line, Some(Line::bidirectional(Speed::Dshot300)));
    parts.input_frames.are_taken = [true; 4];
    let reply = Reply::from_period_us(Some(700));
    let good = Some(reply.to_levels());
    // Before its input is live a motor's replies go nowhere.
    for _ in 0..2 {
        answered_tick(&mut board, [good; 4]);
        assert!(offers(&mut board).iter().all(Vec::is_empty));
    }
    answered_tick(&mut board, [good, Some(reply.to_levels() ^ 1), None, good]);
    let [first, bad, none, fourth] = offers(&mut board);
    assert_eq!((&first[..], &fourth[..]), (&[Offer::Reply(reply)][..], &[Offer::Reply(reply)][..]));
    assert!(bad.is_empty() && none.is_empty());
    let frame = board.control.parts_mut().outputs.sent[0].last().copied().unwrap();
    assert_eq!(Frame::from_bits(frame.to_bits(), Checksum::Inverted), Ok(frame));
    let counts = board.counts().motors.map(|motor| (motor.replies, motor.bad_replies));
    assert_eq!(counts, [(3, 0), (2, 1), (2, 0), (3, 0)]);
    // Then the ESCs are silent.
    let fresh_ticks = FRESH_MS * settings.loop_rate_hz / 1000;
    (1..fresh_ticks).for_each(|_| answered_tick(&mut board, [None; 4]));
    assert!(offers(&mut board).iter().all(Vec::is_empty));
    answered_tick(&mut board, [None; 4]);
    assert_eq!(offers(&mut board), [vec![Offer::None], vec![], vec![], vec![Offer::None]]);
}

#[test]
fn the_speed_of_a_reply_is_recorded_until_three_frames_have_none() {
    let settings = settings(PulseProtocol::StandardPwm, PulseProtocol::Dshot600Bidirectional);
    let mut store = Store::new(Flash::<SECTOR>::blank(), Flash::<SECTOR>::SECTORS);
    store.save(&settings).unwrap();
    let (mut board, mut handler, _) = TestBoard::start(store, facts(CRYSTAL));
    let record = Request::Record(Some(RecordRequest { motor: 2, divisor: 1 }));
    handler.answer(Tagged { tag: 1, message: record }, FrameFaults::default(), &mut board);
    // Extended telemetry says nothing of the speed.
    let extended = Reply::from_payload(0x2aa);
    assert!(extended.is_extended());
    let said = |period_us| Some(Reply::from_period_us(period_us));
    let mut replies = vec![None, said(Some(700)), said(None), Some(extended), said(Some(1400))];
    replies.extend([None; 20]);
    for reply in &replies {
        let levels = reply.map_or(u32::MAX, Reply::to_levels);
        board.control.parts_mut().outputs.windows[2].push_back(window(levels));
        board.control.parts_mut().outputs.windows[1].push_back(window(Reply::from_payload(1).to_levels()));
        run(&mut board);
    }
    handler.answer(Tagged { tag: 2, message: Request::Record(None) }, FrameFaults::default(), &mut board);
    let mut recorded = Vec::new();
    while let Some(Tagged { message, .. }) = handler.poll() {
        if let Message::Record(record) = message {
            recorded.extend_from_slice(record.turn_us.as_slice());
        }
    }
    // 3 ms, which is longer than three frames at 2.5 kHz.
    let held = (FRESH_MS * settings.loop_rate_hz / 1000) as usize;
    let mut expected = vec![NO_TURN, 700, i32::from(LONGEST_TURN_US), i32::from(LONGEST_TURN_US)];
    expected.extend(vec![1400; held]);
    expected.resize(replies.len(), NO_TURN);
    assert_eq!(recorded, expected);
}

#[test]
fn no_reply_is_offered_while_the_flash_stalls_the_core() {
    let settings = settings(PulseProtocol::Dshot300Bidirectional, PulseProtocol::Dshot300Bidirectional);
    let (mut board, _) = start(&settings, facts(CRYSTAL));
    let _ = offers(&mut board);
    let good = Some(Reply::from_period_us(None).to_levels());
    (0..5).for_each(|_| answered_tick(&mut board, [good; 4]));
    assert_eq!(offers(&mut board).map(|offers| offers.len()), [1; 4], "and nothing more before it was taken");
    board.flash_stalls(true);
    assert_eq!(offers(&mut board), [const { [Offer::None] }; 4].map(Vec::from));
}

#[test]
fn outputs_alone_may_be_bidirectional_and_inputs_alone_are_refused() {
    let one_way = settings(PulseProtocol::StandardPwm, PulseProtocol::Dshot600Bidirectional);
    let (mut board, _) = start(&one_way, facts(CRYSTAL));
    board.control.parts_mut().outputs.windows[2].push_back(window(Reply::from_period_us(Some(99)).to_levels()));
    run(&mut board);
    assert_eq!(board.counts().motors.map(|motor| motor.replies), [0, 0, 1, 0]);
    for output in [PulseProtocol::StandardPwm, PulseProtocol::Dshot600] {
        let mut refused = one_way.clone().into_settings();
        refused.input = Pulse { protocol: PulseProtocol::Dshot300Bidirectional, frame_hz: 2500 };
        refused.output = Pulse { protocol: output, frame_hz: 400 };
        let error = refused.validate().unwrap_err();
        assert_eq!((error.place.key, error.problem), (Key::InputProtocol, Problem::NoReplies));
        assert!(error.to_string().contains("output.protocol must be bidirectional, too"), "{error}");
    }
}

#[test]
fn frames_come_no_faster_than_their_replies_let_them() {
    for (protocol, most_hz) in
        [(PulseProtocol::Dshot300Bidirectional, 4587), (PulseProtocol::Dshot600Bidirectional, 8403)]
    {
        let mut settings = settings(PulseProtocol::StandardPwm, protocol).into_settings();
        settings.output.frame_hz = most_hz;
        assert!(settings.clone().validate().is_ok(), "{protocol:?}");
        settings.output.frame_hz += 1;
        let problem = settings.validate().unwrap_err().problem;
        assert!(
            matches!(problem, Problem::PulseTooLong { max_frame_hz, .. } if max_frame_hz == most_hz),
            "{problem:?}"
        );
    }
}
