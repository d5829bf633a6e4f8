//! The link: the bytes of every message, and what a bad line can do.

use host_tests::cases;
use host_tests::fuzz::{frame, fuzz_link};
use proptest::prelude::*;
use rotorlead::excitation::{Multisine, ODD_LINES_30_HZ};
use rotorlead::link::{
    BrownOut, ChannelState, Clock, CrystalCheck, ExciteRequest, FRAME_BYTES, Faults, FrameFaults, INJECT_SAMPLES,
    INJECT_WINDOW, Info, InjectRequest, Injected, Injector, LineSet, Message, MotorFaults, NO_INPUT, NO_TURN,
    PAYLOAD_BYTES, PanicPlace, Path, RECORD_SAMPLES, Receiver, Record, RecordClock, RecordRequest, Recorder, Refusal,
    Request, ResetReason, Sample, Sensed, Series, Source, Tagged, VERSION, Writer, encode,
};
use rotorlead::settings::{Key, Origin, Problem, SettingId, Settings, SettingsError, Warnings};
use rotorlead::throttle::Command;
use serde::Serialize;
use serde::de::DeserializeOwned;

fn series<const N: usize>(samples: &[i32]) -> Series<N> {
    Series::try_from(samples).unwrap()
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

fn framed<T: Serialize>(tag: u8, message: &T) -> Vec<u8> {
    let mut frame = [0; FRAME_BYTES];
    let length = encode(tag, message, &mut frame).unwrap();
    frame[..length].to_vec()
}

fn receive<T: DeserializeOwned>(receiver: &mut Receiver<T>, bytes: &[u8]) -> Vec<Tagged<T>> {
    bytes.iter().filter_map(|&byte| receiver.push(byte)).collect()
}

/// The default settings: loop rate; lead or inverse; the lead's zero, poles and damping as `f64`; the inverse's natural
/// frequency, damping and slew as `f64`, and its range; input and output; stop, what there is without a signal, stop pulses;
/// four motors of compensate, disarming, arming, idle, max, hold, curve; the excitation's duration, command, amplitude, time
/// to arm and ramp; the divisor; the motors' speeds.
macro_rules! DEFAULTS {
    () => {
        "8827 00 e17a14ae47412c40 15144196cb8d5740 cd3b7f669ea0e63f \
         15144196cb8d5740 cd3b7f669ea0e63f 00 8080808004 01ea03 01ef03 0000000000003440 00 00 d00f 01 \
         00 000000 8080808004 64 00 00 000000 8080808004 64 00 00 000000 8080808004 64 00 00 000000 8080808004 64 00 \
         78 8080808003 e6cc9933 b817 d00f 01 00000000"
    };
}

/// Every request, with the bytes of its body.
fn requests() -> Vec<(Request, &'static str)> {
    let excite =
        ExciteRequest { motor: 2, lines: LineSet::Odd45Hz, nominal: 1 << 28, amplitude: 1 << 25, periods: 300 };
    let inject = InjectRequest { motor: 1, first: 300, samples: series(&[5, 5, 4, -1]) };
    vec![
        (Request::Info, "00"),
        (Request::GetSettings, "01"),
        (Request::SetSettings(Settings::default()), concat!("02", DEFAULTS!())),
        (Request::SaveSettings, "03"),
        (Request::SetMode { motor: 3, source: Source::Inject, compensate: true }, "04030101"),
        (Request::Excite(excite), "0502018080808002808080 20ac02"),
        (Request::KeepAlive, "06"),
        (Request::StopExcitation, "07"),
        (Request::Record(None), "0800"),
        (Request::Record(Some(RecordRequest { motor: 1, divisor: 500 })), "080101f403"),
        (Request::Inject(inject), "0901ac02040a090107"),
        (Request::Faults, "0a"),
        (Request::BootLoader, "0b"),
    ]
}

/// Every message, with the bytes of its body.
fn messages() -> Vec<(Message, &'static str)> {
    let info = Info {
        firmware: [1, 2, 3],
        clock: Clock::InternalPll,
        core_hz: 168_000_000,
        timer_hz: 84_000_000,
        crystal: CrystalCheck::Wrong { measured_hz: 300 },
        may_arm: false,
        ticks: 5,
        reset: ResetReason::Watchdog,
        brown_out: BrownOut::Level3,
        settings: Origin::StoredOnce,
        outputs_enabled: true,
        bench_enabled: false,
        motors: [ChannelState::NoSignal, ChannelState::Armed, ChannelState::Lost, ChannelState::Injected],
        paths: [
            Path::SILENT,
            Path { compensates: true, command: 1 << 28, output: 3, input_hz: 490, output_hz: 495 },
            Path::SILENT,
            Path::SILENT,
        ],
        resumed: [false, true, false, true],
    };
    let panicked = Info { reset: ResetReason::Panic(PanicPlace::new("a.rs", 97)), ..info };
    let link = FrameFaults { truncated: 1, corrupted: 2, oversized: 3, other_version: 4, unknown: 5 };
    let motor = MotorFaults {
        glitches: 10,
        missing_edges: 11,
        out_of_range: 12,
        too_soon: 13,
        masked: 14,
        lost: 15,
        bad_frames: 16,
        dropped_frames: 17,
        refused_frames: 20,
        replies: 18,
        bad_replies: 19,
    };
    let faults = Faults {
        link,
        link_overruns: 6,
        missed_deadlines: 7,
        idle_hangs: 20,
        record_dropped: 8,
        dead_man: 9,
        motors: [motor, MotorFaults::default(), MotorFaults::default(), motor],
    };
    let record = Record {
        motor: 1,
        divisor: 5,
        first_tick: 1000,
        input: series(&[NO_INPUT, NO_INPUT]),
        before: series(&[100, 101]),
        after: series(&[100, 110]),
        adc: series(&[2000, 2001]),
        turn_us: series(&[NO_TURN, 857]),
    };
    let place = SettingId { key: Key::Damping, motor: None };
    let out_of_range = Problem::OutOfRange { value: 3.0, min: 0.25, max: 2.0 };
    let refused = |refusal| Message::Refused(refusal);
    let error = |place, problem| refused(Refusal::Settings(SettingsError { place, problem }));
    let motor_max = SettingId { key: Key::Max, motor: Some(2) };
    vec![
        (Message::Done, "00"),
        (refused(Refusal::UnknownMotor), "0100"),
        (refused(Refusal::NotDisarmed { motor: 3 }), "010103"),
        (refused(Refusal::NoSettings), "0102"),
        (refused(Refusal::InputLive { motor: 3 }), "010303"),
        (error(place, out_of_range), "0104 0400 00 0000000000000840 000000000000d03f 0000000000000040"),
        (error(place, Problem::ZeroNotBelowPoles), "0104040001"),
        (error(SettingId { key: Key::TimeConstantS, motor: Some(3) }, Problem::NoCurve), "010418010302"),
        (error(SettingId { key: Key::Erpm, motor: Some(3) }, Problem::NoSpeed), "010419010308"),
        (error(SettingId { key: Key::Erpm, motor: Some(3) }, Problem::SpeedFalls), "010419010309"),
        (error(SettingId { key: Key::OutputProtocol, motor: None }, Problem::NeedsReplies), "01040b000a"),
        (error(SettingId { key: Key::Stop, motor: None }, Problem::StopWithoutRawDuty), "01040e0003"),
        (error(place, Problem::PulseTooLong { longest_us: 2000, max_frame_hz: 495 }), "0104040004d00fef03"),
        (error(SettingId { key: Key::InputProtocol, motor: None }, Problem::NoReplies), "0104090007"),
        (error(motor_max, Problem::NoEdges { min: 0.25, max: 2.0 }), "010416010205000000000000d03f0000000000000040"),
        (refused(Refusal::Design), "0105"),
        (refused(Refusal::SaveFailed), "0106"),
        (refused(Refusal::CommandOutsideLimits { min_command: 1, max_command: 2, max_amplitude: 3 }), "0107020406"),
        (refused(Refusal::TooLong { max_duration_s: 120 }), "010878"),
        (refused(Refusal::Exciting), "0109"),
        (refused(Refusal::NotInjecting), "010a"),
        (refused(Refusal::OutOfSequence { expected: 300 }), "010bac02"),
        (refused(Refusal::WindowFull), "010c"),
        (refused(Refusal::Divisor), "010d"),
        (refused(Refusal::BenchDisabled), "010e"),
        (
            refused(Refusal::TooSlow { lines: 150, loop_rate_hz: 5000, core_hz: 16_000_000, percent: 300 }),
            "010f 9601 8827 80c8d007 ac02",
        ),
        (refused(Refusal::Injecting { motor: 3 }), "011003"),
        (refused(Refusal::NoDshot), "0111"),
        (refused(Refusal::NotRested { motor: 2 }), "011202"),
        (refused(Refusal::NoBootLoader), "0113"),
        (
            error(
                SettingId { key: Key::InputFrameHz, motor: None },
                Problem::FramesOutrunTicks { min_loop_rate_hz: 4000 },
            ),
            "01040a0006a01f",
        ),
        (
            Message::Info(info),
            "02 010203 01 80f48d50 80fa8628 02ac02 00 05 04 04 01 01 00 00030507 0001010000 0180808080 0206ea03ef03 0001010000 0001010000 00010001",
        ),
        (
            Message::Info(panicked),
            "02 010203 01 80f48d50 80fa8628 02ac02 00 05 0561 0000000000000000000000000000000000000000 612e7273 04 01 01 00 \
             00030507 0001010000 0180808080 0206ea03ef03 0001010000 0001010000 00010001",
        ),
        (Message::Settings(Settings::default()), concat!("03", DEFAULTS!())),
        (
            Message::SettingsTaken(Warnings {
                slow_input: true,
                slow_output: false,
                cannot_follow: true,
                low_arming: false,
                high_idle: true,
                levels_above_frames: false,
                pulses_outrun_ticks: true,
            }),
            "0401000100010001",
        ),
        (
            Message::Faults(faults),
            "05 0102030405 06 07 14 08 09 0a0b0c0d0f0e1011141213 0000000000000000000000 0000000000000000000000 0a0b0c0d0f0e1011141213",
        ),
        (
            Message::Injected(Injected { first: 128, outputs: series(&[1 << 29, 1 << 29]) }),
            "06 8001 02 8080808004 ffffffff03",
        ),
        (Message::Record(record), "07 01 05 e807 020102 02c801c501 02c801b301 02a01f9d1f 0201b60d"),
    ]
}

fn check_golden<T: Serialize + DeserializeOwned + PartialEq + std::fmt::Debug>(messages: Vec<(T, &'static str)>) {
    let mut wrong = String::new();
    for (message, expected) in messages {
        let expected: String = expected.split_whitespace().collect();
        let body = postcard::to_stdvec(&message).unwrap();
        if hex(&body) != expected {
            wrong += &format!("{message:?}\n  is      {}\n  written {expected}\n", hex(&body));
        }
        // The frame around it is the documented one, and comes back as it was sent.
        let bytes = framed(9, &message);
        assert_eq!(bytes, frame(VERSION, 9, &body));
        assert_eq!(receive(&mut Receiver::new(), &bytes), [Tagged { tag: 9, message }]);
    }
    assert!(wrong.is_empty(), "the bytes of messages have changed, which takes a new VERSION:\n{wrong}");
}

#[test]
fn the_bytes_of_every_request_are_as_written() {
    check_golden(requests());
}

#[test]
fn the_bytes_of_every_message_are_as_written() {
    check_golden(messages());
}

#[test]
fn a_whole_frame_is_as_written() {
    assert_eq!(hex(&framed(9, &Request::Faults)), "000809090a367c201800");
}

/// One frame of each kind, and another good one after them.
fn line() -> (Vec<Vec<u8>>, Vec<u8>) {
    (requests().iter().map(|(request, _)| framed(1, request)).collect(), framed(2, &Request::KeepAlive))
}

/// Sends `bad` and then a good frame; `bad` must be dropped and the other one received.
fn dropped(bad: &[u8]) -> FrameFaults {
    let mut receiver = Receiver::<Request>::new();
    let received = receive(&mut receiver, &[bad, &line().1].concat());
    assert_eq!(received, [Tagged { tag: 2, message: Request::KeepAlive }], "after {}", hex(bad));
    *receiver.faults()
}

#[test]
fn a_frame_that_is_cut_anywhere_is_counted_and_dropped() {
    for frame in line().0 {
        for end in 2..frame.len() - 1 {
            let faults = dropped(&frame[..end]);
            assert_eq!((faults.truncated + faults.corrupted, faults.total()), (1, 1), "{end} bytes");
        }
    }
}

#[test]
fn a_frame_with_any_wrong_byte_is_counted_and_dropped() {
    for frame in line().0 {
        for place in 1..frame.len() - 1 {
            for wrong in (0..=255).filter(|&wrong| wrong != frame[place]) {
                let mut frame = frame.clone();
                frame[place] = wrong;
                let faults = dropped(&frame);
                // A zero makes two pieces of it, of which one may be empty.
                let pieces = 1 + u32::from(wrong == 0 && place != 1 && place != frame.len() - 2);
                assert_eq!((faults.truncated + faults.corrupted, faults.total()), (pieces, pieces));
            }
        }
    }
}

#[test]
fn a_frame_with_a_byte_too_many_or_one_too_few_is_dropped() {
    for frame in line().0 {
        for place in 1..frame.len() - 1 {
            let mut short = frame.clone();
            short.remove(place);
            // Where the neighbors are equal, removing either is the same.
            assert_eq!(dropped(&short).total(), u32::from(short.len() > 2));
            for extra in [1, 0x55, 0xff] {
                let mut long = frame.clone();
                long.insert(place, extra);
                assert_eq!(dropped(&long).total(), 1);
            }
        }
    }
}

#[test]
fn an_oversized_frame_is_counted_once_and_takes_no_more_than_its_buffer() {
    for length in [FRAME_BYTES + 1, FRAME_BYTES + 2, 10 * FRAME_BYTES, 1_000_000] {
        let faults = dropped(&vec![1; length]);
        assert_eq!(faults, FrameFaults { oversized: 1, ..FrameFaults::default() });
    }
    assert_eq!(dropped(&vec![1; FRAME_BYTES]).oversized, 0);
}

#[test]
fn a_frame_of_another_version_is_dropped_whatever_is_in_it() {
    for version in (0..=255).filter(|&version| version != VERSION) {
        let body = postcard::to_stdvec(&Request::SaveSettings).unwrap();
        let faults = dropped(&frame(version, 1, &body));
        assert_eq!(faults, FrameFaults { other_version: 1, ..FrameFaults::default() });
    }
}

#[test]
fn a_body_that_is_no_message_is_dropped_though_its_checksum_is_right() {
    let unknown = FrameFaults { unknown: 1, ..FrameFaults::default() };
    for (request, _) in requests() {
        let body = postcard::to_stdvec(&request).unwrap();
        for end in 0..body.len() {
            // A prefix of a message may be none.
            assert_eq!(dropped(&frame(VERSION, 1, &body[..end])), unknown, "{request:?} to {end}");
        }
        assert_eq!(dropped(&frame(VERSION, 1, &[&body[..], &[0]].concat())), unknown);
    }
    for variant in requests().len() as u8..=255 {
        // Two bytes: 128 and more announce another one.
        assert_eq!(dropped(&frame(VERSION, 1, &[variant, 1])), unknown);
    }
    // More samples than there may be, and more than there are.
    let many = [&[9, 0, 0, 129, 1][..], &[0; 129]].concat();
    assert_eq!(dropped(&frame(VERSION, 1, &many)), unknown);
    assert_eq!(dropped(&frame(VERSION, 1, &[9, 0, 0, 0xff, 0xff, 0xff, 0xff, 0x0f, 0])), unknown);
    assert_eq!(dropped(&frame(VERSION, 1, &[])), unknown);
}

#[test]
fn an_envelope_without_room_for_its_parts_is_truncated() {
    for length in 0..6 {
        let coded = cobs::encode_vec(&vec![1; length]);
        let faults = dropped(&[&[0], &coded[..], &[0]].concat());
        assert_eq!(faults, FrameFaults { truncated: 1, ..FrameFaults::default() });
    }
}

#[test]
fn garbage_between_frames_costs_no_frame() {
    let (frames, _) = line();
    let mut receiver = Receiver::<Request>::new();
    let mut received = 0;
    for (index, frame) in frames.iter().enumerate() {
        let garbage: Vec<u8> = (0..index * 37).map(|k| (k * k + 11 * index) as u8).collect();
        received += receive(&mut receiver, &[&garbage, &frame[..]].concat()).len();
    }
    assert_eq!(received, frames.len());
}

#[test]
fn a_flood_of_noise_is_never_acted_on_and_the_link_works_after_it() {
    let mut receiver = Receiver::<Request>::new();
    let mut state = 1_u64;
    for _ in 0..20_000_000 {
        // MMIX's generator (Knuth); its high bits are good.
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        assert_eq!(receiver.push((state >> 56) as u8), None);
    }
    println!("20 MB of noise: {:?}", receiver.faults());
    assert!(receiver.faults().total() > 70_000);
    assert_eq!(receive(&mut receiver, &line().1).len(), 1);
}

#[test]
fn the_longest_messages_fit_a_frame() {
    // Second differences of this take 5 bytes each.
    let wild = |count: usize| (0..count as i32).map(|k| (k % 2) << 30).collect::<Vec<_>>();
    let column = series(&wild(RECORD_SAMPLES));
    let record = Message::Record(Record {
        motor: u8::MAX,
        divisor: u16::MAX,
        first_tick: u32::MAX,
        input: column.clone(),
        before: column.clone(),
        after: column.clone(),
        adc: column.clone(),
        turn_us: column,
    });
    let samples = series(&wild(INJECT_SAMPLES));
    let outputs = samples.clone();
    let injected = Message::Injected(Injected { first: u32::MAX, outputs });
    let inject = Request::Inject(InjectRequest { motor: u8::MAX, first: u32::MAX, samples });
    let lengths = [framed(255, &record).len(), framed(255, &injected).len(), framed(255, &inject).len()];
    println!("record, injected, inject at worst: {lengths:?} of {FRAME_BYTES} bytes");
    assert!(lengths[0] > 5 * 5 * (RECORD_SAMPLES - 1) && lengths[1] > 5 * (INJECT_SAMPLES - 1), "not the worst");
    assert!(lengths.iter().all(|&length| length <= FRAME_BYTES));
    let settings = framed(0, &Request::SetSettings(Settings::default())).len();
    println!("settings: {settings} bytes");
    assert_eq!(PAYLOAD_BYTES + PAYLOAD_BYTES / 254 + 3, FRAME_BYTES);
}

#[test]
fn a_multisine_takes_little_room_on_the_line() {
    let mut multisine = Multisine::new(ODD_LINES_30_HZ, 0.5, 0.05, 5000.0).unwrap();
    multisine.start(None);
    let design = host_tests::paper_design();
    let start = multisine.nominal();
    let mut filter = rotorlead::compensator::Compensator::new(*design.coefficients(), Command::ZERO, Command::ONE);
    filter.reset(start);
    let (before, after): (Vec<i32>, Vec<i32>) = (0..50_000)
        .map(|_| {
            let command = multisine.update();
            (command.to_bits(), filter.update(command).to_bits())
        })
        .unzip();
    let inject = |(index, samples): (usize, &[i32])| {
        let first = (index * INJECT_SAMPLES) as u32;
        framed(index as u8, &Request::Inject(InjectRequest { motor: 0, first, samples: series(samples) })).len()
    };
    let injected = |(index, outputs): (usize, &[i32])| {
        let first = (index * INJECT_SAMPLES) as u32;
        framed(index as u8, &Message::Injected(Injected { first, outputs: series(outputs) })).len()
    };
    let per_sample = |total: usize| total as f64 / before.len() as f64;
    let down = per_sample(before.chunks(INJECT_SAMPLES).enumerate().map(inject).sum());
    let up = per_sample(after.chunks(INJECT_SAMPLES).enumerate().map(injected).sum());
    println!("bytes a sample: {down:.2} to the controller, {up:.2} back");
    assert!(down < 2.8 && up < 3.2);

    let mut recorder = Recorder::new(0, 1);
    let mut total = 0;
    for (tick, (&before, &after)) in before.iter().zip(&after).enumerate() {
        // A converter with 5 counts of noise or so.
        let adc = 2000 + (tick as u32).wrapping_mul(2_654_435_761).rotate_left(7) as u16 % 17;
        // An ESC whose rotor's speed follows the commands.
        let turn_us = 900 - (before >> 21);
        let sample = Sample { tick: tick as u32, input: before, before, after, sensed: Sensed { adc, turn_us } };
        total += recorder.push(sample).map_or(0, |record| framed(0, &Message::Record(record)).len());
    }
    println!("bytes a recorded sample: {:.2}", per_sample(total));
    assert!(per_sample(total) < 11.0);
}

#[test]
fn a_writer_gives_the_bytes_of_a_frame_and_then_none() {
    let mut writer = Writer::new();
    assert_eq!(writer.next_byte(), None);
    writer.load(3, &Message::Done).unwrap();
    let bytes: Vec<u8> = std::iter::from_fn(|| writer.next_byte()).collect();
    assert_eq!(bytes, framed(3, &Message::Done));
    assert!(writer.is_empty());
}

/// What a controller with this divisor records in `ticks` ticks, when the queue drops those in `lost`.
fn recorded(divisor: u16, ticks: u32, lost: std::ops::Range<u32>) -> (Vec<Record>, u32) {
    let mut clock = RecordClock::new(divisor);
    let mut recorder = Recorder::new(0, divisor);
    let mut records = Vec::new();
    for at in 0..ticks {
        if let Some(tick) = clock.tick() {
            assert_eq!(tick, at);
            if !lost.contains(&tick) {
                let value = tick as i32;
                let sample = Sample {
                    tick,
                    input: value,
                    before: value + 1,
                    after: value + 2,
                    sensed: Sensed { adc: value as u16, turn_us: value + 3 },
                };
                records.extend(recorder.push(sample));
            }
        }
    }
    records.extend(recorder.finish());
    assert_eq!(recorder.finish(), None);
    (records, recorder.missing())
}

#[test]
fn records_hold_every_sample_and_show_the_gaps() {
    for divisor in [1, 5, 7] {
        for lost in [0..0, 0..3, 100..101, 160..161, 31..33, 500..900, 990..1000] {
            let (records, missing) = recorded(divisor, 1000, lost.clone());
            let mut ticks = Vec::new();
            for record in &records {
                let columns = [&record.input, &record.before, &record.after, &record.adc, &record.turn_us];
                assert!(columns.iter().all(|column| column.len() == record.before.len()));
                for (index, &before) in record.before.as_slice().iter().enumerate() {
                    let tick = record.first_tick + index as u32 * u32::from(divisor);
                    assert_eq!(before, tick as i32 + 1);
                    assert_eq!(record.adc.as_slice()[index], tick as i32);
                    assert_eq!(record.turn_us.as_slice()[index], tick as i32 + 3);
                    ticks.push(tick);
                }
            }
            let kept = |tick: &u32| !lost.contains(tick);
            let expected: Vec<u32> = (0..1000).step_by(usize::from(divisor)).filter(kept).collect();
            assert_eq!(ticks, expected);
            // Those at the very end are not missed by anybody.
            let last = *expected.last().unwrap();
            let gone = (0..last).step_by(usize::from(divisor)).filter(|tick| !kept(tick)).count();
            assert_eq!(missing as usize, gone);
        }
    }
}

#[test]
fn injections_are_answered_in_order_and_only_in_sequence() {
    let block = |first, length| InjectRequest { motor: 0, first, samples: series(&vec![7; length]) };
    let mut injector = Injector::new();
    assert_eq!(injector.accept(1, &block(5, 3)), Err(Refusal::OutOfSequence { expected: 0 }));
    assert_eq!(injector.output(Command::ONE.into()), None);
    for (tag, first) in (0..INJECT_WINDOW as u8).zip((0..).step_by(3)) {
        assert_eq!(injector.accept(tag, &block(first, 3)), Ok(()));
    }
    let expected = 3 * INJECT_WINDOW as u32;
    assert_eq!(injector.accept(9, &block(expected, 3)), Err(Refusal::WindowFull));
    // The same frame once more: it was accepted, so it is not played again.
    assert_eq!(injector.accept(9, &block(0, 3)), Err(Refusal::OutOfSequence { expected }));
    let mut replies = Vec::new();
    for output in 0..expected as i32 + 2 {
        replies.extend(injector.output(Command::saturating_from_bits(output).into()));
    }
    let next = expected;
    let expected = |tag: u8, first: u32, outputs: &[i32]| {
        let message = Injected { first, outputs: series(outputs) };
        Tagged { tag, message }
    };
    assert_eq!(replies, [expected(0, 0, &[0, 1, 2]), expected(1, 3, &[3, 4, 5]), expected(2, 6, &[6, 7, 8])]);
    assert!(!injector.is_busy());
    assert_eq!(injector.accept(3, &block(next, 1)), Ok(()));
}

proptest! {
    #![proptest_config(cases(2000))]

    #[test]
    fn any_samples_survive(samples in proptest::collection::vec(any::<i32>(), 0..=INJECT_SAMPLES)) {
        let request = Request::Inject(InjectRequest { motor: 0, first: 0, samples: series(&samples) });
        let received = receive(&mut Receiver::new(), &framed(0, &request));
        prop_assert_eq!(received, [Tagged { tag: 0, message: request }]);
    }

    #[test]
    fn no_bytes_on_the_line_make_the_link_panic(bytes in proptest::collection::vec(any::<u8>(), 0..1500)) {
        fuzz_link(&bytes);
    }

    #[test]
    fn nor_do_good_frames_with_some_bytes_changed(
        which in 0..12_usize,
        changes in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..4)
    ) {
        // Both the frame and its body, whose checksum is then made right.
        for mut bytes in [framed(1, &requests()[which].0), postcard::to_stdvec(&requests()[which].0).unwrap()] {
            for (index, byte) in &changes {
                *index.get_mut(&mut bytes) = *byte;
            }
            fuzz_link(&bytes);
        }
    }
}
