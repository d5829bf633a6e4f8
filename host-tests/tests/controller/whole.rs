//! The whole controller without its hardware: what it answers, and what its outputs did.

use host_tests::board::{CRYSTAL, INTERNAL, INTERNAL_PLL, facts};
use host_tests::flash::Flash;
use host_tests::fuzz::frame;
use host_tests::line::{LOOP_HZ, Line, TICKS_PER_POLL, TIMER_HZ, decode, us};
use host_tests::rig::{Rig, SECTOR, SharedFlash, saved};
use host_tests::scenario::table::{self, Column};
use host_tests::scenario::yes;
use host_tests::{any_settings, cases};
use proptest::prelude::*;
use rotorlead::capture::{Decoder, Level, Signal, Timing};
use rotorlead::channel::ChannelSettings;
use rotorlead::controller::channel_settings;
use rotorlead::link::{
    ChannelState, ExciteRequest, FRAME_BYTES, Foreign, INJECT_SAMPLES, INJECT_TIMEOUT_MS, InjectRequest, Injected,
    LineSet, Message, NO_INPUT, NOTICE_VERSION, PanicPlace, Path, RecordRequest, Refusal, Request, ResetReason, Sensed,
    Source, VERSION, encode_notice,
};
use rotorlead::settings::{
    DEAD_MAN_MS, Key, Levels, Loaded, MOTORS, Origin, Problem, PulseProtocol, SettingId, Settings, SettingsError,
    Store, Validated,
};
use rotorlead::throttle::{Command, EscCommand};

const STOP: Command = Command::ZERO;
const NO_PULSE: EscCommand = EscCommand::NO_PULSE;
/// 100 ms, the default.
const HOLD_TICKS: usize = 500;
/// 2 s, the default.
const STOP_PULSE_TICKS: usize = 10_000;
const INJECT_TIMEOUT_TICKS: usize = (INJECT_TIMEOUT_MS * LOOP_HZ / 1000) as usize;
const DEAD_MAN_TICKS: usize = (DEAD_MAN_MS * LOOP_HZ / 1000) as usize;

fn command(value: f64) -> Command {
    Command::saturating_from_f64(value)
}

fn mode(motor: u8, source: Source) -> Request {
    Request::SetMode { motor, source, compensate: false }
}

fn inject(first: u32, values: &[f64]) -> Request {
    let samples: Vec<i32> = values.iter().map(|&value| command(value).to_bits()).collect();
    Request::Inject(InjectRequest { motor: 0, first, samples: samples[..].try_into().unwrap() })
}

fn excite(nominal: f64, amplitude: f64, periods: u16) -> ExciteRequest {
    ExciteRequest {
        motor: 0,
        lines: LineSet::Odd30Hz,
        nominal: command(nominal).to_bits(),
        amplitude: command(amplitude).to_bits(),
        periods,
    }
}

fn refused(refusal: Refusal) -> Message {
    Message::Refused(refusal)
}

fn states(rig: &mut Rig) -> [ChannelState; MOTORS] {
    match rig.ask(&Request::Info) {
        Message::Info(info) => info.motors,
        other => panic!("{other:?}"),
    }
}

fn state(rig: &mut Rig) -> ChannelState {
    states(rig)[0]
}

fn dead_man(rig: &mut Rig) -> u32 {
    match rig.ask(&Request::Faults) {
        Message::Faults(faults) => faults.dead_man,
        other => panic!("{other:?}"),
    }
}

/// Motor 0 armed by its pulses for long enough that a loss is held, at `level`.
fn armed(level: f64) -> Rig {
    let mut rig = Rig::new();
    let (low, high) = (rig.pulse(0.0), rig.pulse(level));
    assert_eq!(rig.tick_one(low), STOP);
    assert_eq!(rig.arm_one(high), rig.as_measured(level));
    for _ in 0..=HOLD_TICKS {
        assert_eq!(rig.tick_one(high), rig.as_measured(level));
    }
    rig
}

/// Motor 0 driven by the host, at `level`; 129 samples injected.
fn injecting(level: f64) -> Rig {
    let mut rig = Rig::new();
    assert_eq!(rig.ask(&mode(0, Source::Inject)), Message::Done);
    let tag = rig.send(&inject(0, &[0.0]));
    rig.serve(usize::MAX);
    assert_eq!(rig.tick_one(Signal::Nothing), STOP);
    rig.serve(usize::MAX);
    assert!(matches!(rig.take(tag), Some(Message::Injected(_))));
    let tag = rig.send(&inject(1, &[level; INJECT_SAMPLES]));
    rig.serve(usize::MAX);
    for _ in 0..INJECT_SAMPLES {
        assert_eq!(rig.tick_one(Signal::Nothing), command(level));
    }
    rig.serve(usize::MAX);
    assert!(matches!(rig.take(tag), Some(Message::Injected(_))));
    rig
}

/// Motor 0 on an excitation around 0.5 that has `ticks` behind it, without stop pulses before it.
fn exciting(ticks: usize) -> Rig {
    let mut settings = Settings::default();
    settings.excitation.arm_ms = 0;
    let mut rig = Rig::with(settings);
    assert_eq!(rig.ask(&Request::Excite(excite(0.5, 0.05, 10))), Message::Done);
    for n in 0..ticks {
        if n % 500 == 0 {
            assert_eq!(rig.ask(&Request::KeepAlive), Message::Done);
        }
        rig.tick_one(Signal::Nothing);
    }
    rig
}

fn excitation_ramp() -> Command {
    let limits = Settings::default().excitation;
    let ticks = i32::from(limits.ramp_ms) * LOOP_HZ as i32 / 1000;
    Command::saturating_from_bits(limits.max_command / ticks)
}

// --- Requests -----------------------------------------------------------------------------------------------------

#[test]
fn every_request_is_answered_once_and_with_its_tag_whatever_goes_on() {
    let mut wrong = Settings::default();
    wrong.lead.damping = 9.0;
    let requests = [
        Request::Info,
        Request::GetSettings,
        Request::SetSettings(Settings::default()),
        Request::SetSettings(wrong),
        Request::SaveSettings,
        mode(0, Source::Pulse),
        mode(0, Source::Inject),
        mode(4, Source::Inject),
        Request::Excite(excite(0.5, 0.05, 1)),
        Request::Excite(ExciteRequest { motor: 4, ..excite(0.5, 0.05, 1) }),
        Request::KeepAlive,
        Request::StopExcitation,
        Request::Record(Some(RecordRequest { motor: 0, divisor: 0 })),
        Request::Record(Some(RecordRequest { motor: 4, divisor: 1 })),
        Request::Record(Some(RecordRequest { motor: 0, divisor: u16::MAX })),
        Request::Record(None),
        inject(0, &[0.1; 3]),
        inject(129, &[0.1; 3]),
        inject(0, &[]),
        Request::Inject(InjectRequest { motor: 4, first: 0, samples: Default::default() }),
        Request::Faults,
    ];
    type Start = fn() -> Rig;
    let starts: [(&str, Start); 6] = [
        ("fresh", Rig::new),
        ("armed", || armed(0.5)),
        ("held", || {
            let mut rig = armed(0.5);
            rig.tick_one(Signal::Lost(rotorlead::capture::LossReason::StuckLow));
            rig
        }),
        ("injecting", || injecting(0.5)),
        ("exciting", || exciting(9000)),
        ("recording", || {
            let mut rig = Rig::new();
            rig.ask(&Request::Record(Some(RecordRequest { motor: 0, divisor: 1 })));
            rig
        }),
    ];
    for (name, start) in starts {
        for first in &requests {
            for second in &requests {
                let mut rig = start();
                rig.inbox.clear();
                let tags = [rig.send(first), rig.send(second)];
                for _ in 0..20 {
                    rig.tick_one(Signal::Unchanged);
                    rig.serve(usize::MAX);
                }
                for (tag, request) in tags.into_iter().zip([first, second]) {
                    assert!(rig.take(tag).is_some(), "{name}: no answer to {request:?} of {first:?}, {second:?}");
                    assert!(rig.take(tag).is_none(), "{name}: two answers to {request:?} of {first:?}, {second:?}");
                }
            }
        }
    }
}

#[test]
fn info_tells_why_it_started_and_where_it_panicked() {
    let mut rig = Rig::new();
    let place = PanicPlace::new("src/board/capture.rs", 97);
    rig.hardware.board.status.facts.reset = ResetReason::Panic(place);
    let Message::Info(info) = rig.ask(&Request::Info) else { panic!("no info") };
    assert_eq!(info.reset, ResetReason::Panic(place));
    assert_eq!(place.to_string(), "src/board/capture.rs:97");
    let long = PanicPlace::new("/a/very/long/way/to/src/controller/tick.rs", 3);
    assert_eq!(long.to_string(), "…o/src/controller/tick.rs:3");
    // The cut may fall inside a character.
    assert!(PanicPlace::new("ééééééééééééééééééab.rs", 1).to_string().starts_with("…éé"));
}

#[test]
fn settings_out_of_range_are_refused_by_name_and_change_nothing() {
    let mut rig = Rig::new();
    let before = rig.ask(&Request::GetSettings);
    let mut settings = Settings::default();
    settings.motors[2].max = 0;
    let Message::Refused(Refusal::Settings(SettingsError { place, problem })) =
        rig.ask(&Request::SetSettings(settings.clone()))
    else {
        panic!("not refused");
    };
    assert_eq!(place, SettingId { key: Key::Max, motor: Some(2) });
    assert!(matches!(problem, Problem::OutOfRange { .. }));
    assert_eq!(rig.ask(&Request::GetSettings), before);

    // In range, but the board's timers refuse them: nothing has changed either, and the inputs work.
    rig.hardware.refuses = true;
    settings = Settings { recorder_divisor: 7, ..Settings::default() };
    assert_eq!(rig.ask(&Request::SetSettings(settings.clone())), refused(Refusal::Design));
    assert_eq!(rig.ask(&Request::GetSettings), before);
    let low = rig.pulse(0.0);
    rig.tick_one(low);
    let high = rig.pulse(0.4);
    assert_eq!(rig.arm_one(high), rig.as_measured(0.4));
    rig.tick_one(low);

    rig.hardware.refuses = false;
    assert!(matches!(rig.ask(&Request::SetSettings(settings.clone())), Message::SettingsTaken(_)));
    assert_eq!(rig.ask(&Request::GetSettings), Message::Settings(settings));
}

#[test]
fn settings_are_neither_set_nor_saved_while_a_motor_turns_and_its_output_does_not_notice() {
    let flash = saved(&Validated::default());
    let before = flash.copy().bytes;
    let mut rig = Rig::starting_from(&flash).0;
    let (low, high) = (rig.pulse(0.0), rig.pulse(0.5));
    // Motor 3 is the one that turns.
    let only_3 = |signal| [Signal::Nothing, Signal::Nothing, Signal::Nothing, signal];
    rig.hardware.run(only_3(low));
    for _ in 0..HOLD_TICKS + 4 {
        rig.hardware.run(only_3(high));
    }
    let lost = Signal::Lost(rotorlead::capture::LossReason::StuckLow);
    for signal in [high, Signal::Unchanged, lost] {
        let outputs = rig.hardware.run(only_3(signal));
        assert_eq!(outputs, [NO_PULSE, NO_PULSE, NO_PULSE, rig.as_measured(0.5).into()]);
        assert_eq!(rig.ask(&Request::SaveSettings), refused(Refusal::NotDisarmed { motor: 3 }));
        let set = Request::SetSettings(Settings::default());
        assert_eq!(rig.ask(&set), refused(Refusal::NotDisarmed { motor: 3 }));
    }
    assert_eq!(rig.hardware.run(only_3(Signal::Unchanged))[3], rig.as_measured(0.5));
    assert!(rig.hardware.stalls.is_empty());
    assert_eq!(flash.copy().bytes, before);

    // Disarmed it is saved; the board gets it before and after.
    assert_eq!(rig.hardware.run(only_3(low)), [NO_PULSE, NO_PULSE, NO_PULSE, STOP.into()]);
    assert_eq!(rig.ask(&Request::SaveSettings), Message::Done);
    assert_eq!(rig.hardware.stalls, [true, false]);
    assert_eq!(Rig::starting_from(&flash).1, Origin::Stored);
}

#[test]
fn nor_while_the_host_runs_a_motor() {
    for (mut rig, level) in [(injecting(0.5), command(0.5)), (exciting(2), excitation_ramp())] {
        assert_eq!(rig.ask(&Request::SaveSettings), refused(Refusal::NotDisarmed { motor: 0 }));
        let set = Request::SetSettings(Settings::default());
        assert_eq!(rig.ask(&set), refused(Refusal::NotDisarmed { motor: 0 }));
        assert!(rig.hardware.stalls.is_empty());
        assert!(rig.tick_one(Signal::Nothing) >= level);
    }
}

/// The erase stalls the core for seconds: a motor that was armed just before it would turn without anybody at it.
#[test]
fn somebody_who_arms_during_a_save_gets_the_stop_and_has_to_disarm_first() {
    let mut rig = Rig::new();
    let (low, high) = (rig.pulse(0.01), rig.pulse(0.8));
    assert_eq!(rig.tick(low), [STOP; MOTORS]);
    rig.hardware.during_save = [low, high, high, high, Signal::Unchanged].map(|signal| [signal; MOTORS]).to_vec();
    assert_eq!(rig.ask(&Request::SaveSettings), Message::Done);
    assert_eq!(rig.hardware.outputs_during_save, [[STOP; MOTORS]; 5]);
    for signal in [Signal::Unchanged, high, high] {
        assert_eq!(rig.tick(signal), [STOP; MOTORS], "armed during the save: stop");
    }
    assert_eq!(states(&mut rig), [ChannelState::Locked; MOTORS]);
    assert_eq!(rig.tick(low), [STOP; MOTORS]);
    assert_eq!(rig.arm([high; MOTORS]), [rig.as_measured(0.8); MOTORS]);
}

/// Settings are validated and a filter designed meanwhile.
#[test]
fn somebody_who_arms_while_settings_are_set_keeps_the_motor_or_has_to_disarm_first() {
    let mut taken = Vec::new();
    for lock in 0..2 {
        let mut rig = Rig::new();
        let (low, high) = (rig.pulse(0.01), rig.pulse(0.8));
        assert_eq!(rig.tick(low), [STOP; MOTORS]);
        rig.hardware.after_locks.resize(lock, Vec::new());
        let signals = [low, high, high, high, Signal::Unchanged].map(|signal| [signal; MOTORS]);
        rig.hardware.after_locks.push_back(signals.to_vec());
        let answer = rig.ask(&Request::SetSettings(Settings::default()));
        let outputs = &rig.hardware.outputs_after_locks;
        if answer == refused(Refusal::NotDisarmed { motor: 0 }) {
            assert_eq!(
                outputs[3..],
                [[EscCommand::from(rig.as_measured(0.8)); MOTORS]; 2],
                "armed: it turns, and goes on"
            );
            assert_eq!(rig.tick(Signal::Unchanged), [rig.as_measured(0.8); MOTORS]);
        } else {
            assert!(matches!(answer, Message::SettingsTaken(_)), "{answer:?}");
            assert!(outputs.iter().flatten().all(|&output| output <= STOP), "after lock {lock}: {outputs:?}");
            assert!(rig.arm([high; MOTORS]).iter().all(|&output| output <= STOP), "after lock {lock}");
        }
        taken.push(answer != refused(Refusal::NotDisarmed { motor: 0 }));
    }
    assert_eq!(taken, [false, true], "before and after the pause");
}

/// A throttle of zero in flight is no landing, and nobody at the bench has said that nobody flies.
#[test]
fn without_the_jumper_nothing_is_changed_or_stored_until_every_motor_was_at_rest_for_3_s() {
    let changes = [
        Request::SetMode { motor: 0, source: Source::Pulse, compensate: true },
        Request::SetSettings(Settings::default()),
        Request::SaveSettings,
    ];
    let is_done = |answer: &Message| matches!(answer, Message::Done | Message::SettingsTaken(_));
    for change in changes {
        let mut rig = armed(0.5);
        rig.hardware.board.status.bench_enabled = false;
        assert_eq!(rig.ask(&change), refused(Refusal::NotDisarmed { motor: 0 }), "{change:?}");
        let low = rig.pulse(0.0);
        for n in 1..3 * LOOP_HZ {
            rig.tick_one(low);
            // Every tick would take the test minutes.
            if n < 10 || n % 1000 == 0 || n + 3 > 3 * LOOP_HZ {
                assert_eq!(rig.ask(&change), refused(Refusal::NotRested { motor: 0 }), "{change:?} at tick {n}");
            }
        }
        assert!(rig.hardware.stalls.is_empty());
        assert!(!paths(&mut rig)[0].compensates, "nor is it put into the path");
        rig.tick_one(low);
        let answer = rig.ask(&change);
        assert!(is_done(&answer), "{change:?}: {answer:?}");
        // With the jumper it need not be so long.
        let mut rig = armed(0.5);
        rig.tick_one(low);
        let answer = rig.ask(&change);
        assert!(is_done(&answer), "{change:?}: {answer:?}");
    }
    // What was before a start is not known: it may have been a reset in the air.
    let mut rig = Rig::new();
    rig.hardware.board.status.bench_enabled = false;
    let low = rig.pulse(0.0);
    for _ in 1..3 * LOOP_HZ {
        rig.tick(low);
    }
    assert_eq!(rig.ask(&Request::SaveSettings), refused(Refusal::NotRested { motor: 0 }));
    rig.tick(low);
    assert_eq!(rig.ask(&Request::SaveSettings), Message::Done);
    // Other settings take nothing from how long it has been.
    assert!(is_done(&rig.ask(&Request::SetSettings(Settings::default()))));
    assert_eq!(rig.ask(&Request::SaveSettings), Message::Done);
}

/// Whatever is stored, and whatever the mode was set to.
#[test]
fn info_shows_what_is_in_each_path_and_how_often_pulses_come_and_go() {
    let mut rig = Rig::new();
    assert_eq!(paths(&mut rig), [Path::SILENT; MOTORS]);
    assert_eq!(rig.ask(&Request::SetMode { motor: 1, source: Source::Pulse, compensate: true }), Message::Done);
    assert_eq!(rig.ask(&Request::GetSettings), Message::Settings(Settings::default()));
    assert_eq!(paths(&mut rig).map(|path| path.compensates), [false, true, false, false]);
    let low = rig.pulse(0.0);
    rig.tick_one(low);
    let half = rig.pulse(0.5);
    rig.arm_one(half);
    let path = paths(&mut rig)[0];
    let level = rig.as_measured(0.5).to_bits();
    assert_eq!((path.command, path.output), (level, level));
    let lost = Signal::Lost(rotorlead::capture::LossReason::StuckLow);
    for _ in 0..2 * STOP_PULSE_TICKS {
        rig.tick_one(lost);
    }
    assert_eq!(paths(&mut rig)[0], Path::SILENT);
}

fn paths(rig: &mut Rig) -> [Path; MOTORS] {
    match rig.ask(&Request::Info) {
        Message::Info(info) => info.paths,
        other => panic!("{other:?}"),
    }
}

/// A host of another version is told which one is spoken, and a notice is not answered.
#[test]
fn a_frame_of_another_version_is_answered_with_the_version_that_is_spoken() {
    let mut rig = Rig::new();
    let answer = |rig: &mut Rig, version: u8| {
        rig.write(&frame(version, 7, &[1, 2, 3]));
        rig.serve(usize::MAX);
        assert!(rig.inbox.is_empty(), "it is no message");
        rig.take_foreign()
    };
    for version in [1, VERSION - 1, VERSION + 1, 255] {
        assert_eq!(answer(&mut rig, version), Some(Foreign::Notice { version: VERSION }), "{version}");
    }
    assert_eq!(answer(&mut rig, NOTICE_VERSION), None);
    // The bytes are the same in every version.
    let mut bytes = [0; FRAME_BYTES];
    let length = encode_notice(7, &mut bytes);
    assert_eq!(bytes[..length], frame(0, 7, &[VERSION]));
    assert!(matches!(rig.ask(&Request::Info), Message::Info(_)));
}

#[test]
fn a_mode_is_set_only_while_the_motor_is_at_rest() {
    // Armed, then held: the pilot's. Nothing happens to the output.
    let mut rig = armed(0.5);
    let level = rig.as_measured(0.5);
    for (source, refusal) in
        [(Source::Inject, Refusal::InputLive { motor: 0 }), (Source::Pulse, Refusal::NotDisarmed { motor: 0 })]
    {
        assert_eq!(rig.ask(&mode(0, source)), refused(refusal));
        assert_eq!(rig.tick_one(Signal::Unchanged), level);
    }
    let lost = Signal::Lost(rotorlead::capture::LossReason::StuckLow);
    for n in 0..HOLD_TICKS {
        assert_eq!(rig.tick_one(lost), level);
        assert_eq!(rig.ask(&mode(0, Source::Inject)), refused(Refusal::InputLive { motor: 0 }), "held for {n}");
    }
    assert_eq!(rig.tick_one(lost), STOP);
    assert_eq!(rig.ask(&mode(0, Source::Inject)), Message::Done);

    // The host's own: it brings the motor to a stop first.
    let mut rig = injecting(0.6);
    for source in [Source::Inject, Source::Pulse] {
        assert_eq!(rig.ask(&mode(0, source)), refused(Refusal::NotDisarmed { motor: 0 }));
        assert_eq!(rig.tick_one(Signal::Nothing), command(0.6));
    }
    rig.send(&inject(129, &[0.0]));
    rig.serve(usize::MAX);
    assert_eq!(rig.tick_one(Signal::Nothing), STOP);
    assert_eq!(rig.ask(&mode(0, Source::Pulse)), Message::Done);

    let mut rig = exciting(3000);
    let before = rig.tick_one(Signal::Nothing);
    assert_eq!(rig.ask(&mode(0, Source::Inject)), refused(Refusal::Exciting));
    let after = rig.tick_one(Signal::Nothing);
    assert_eq!(after.to_bits() - before.to_bits(), excitation_ramp().to_bits(), "the ramp goes on");
    assert_eq!(rig.ask(&mode(4, Source::Inject)), refused(Refusal::UnknownMotor));
}

#[test]
fn no_host_drives_a_motor_while_pulses_come_at_any_input_armed_or_not() {
    for live in 0..MOTORS {
        for level in [0.0, 0.5] {
            let mut rig = Rig::new();
            let live_refusal = refused(Refusal::InputLive { motor: live as u8 });
            let mut signals = [Signal::Nothing; MOTORS];
            signals[live] = rig.pulse(level);
            rig.hardware.run(signals);
            assert_eq!(rig.ask(&mode(0, Source::Inject)), live_refusal);
            // They come up while the host has the motor: its commands are refused, and then the motor is not its any more.
            let mut rig = Rig::new();
            assert_eq!(rig.ask(&mode(0, Source::Inject)), Message::Done);
            rig.hardware.run(signals);
            assert_eq!(rig.ask(&inject(0, &[0.5])), live_refusal);
            for _ in 0..3 {
                signals[live] = Signal::Unchanged;
                let outputs = rig.hardware.run(signals);
                assert!(outputs.iter().all(|&output| output <= STOP));
            }
            signals[live] = Signal::Lost(rotorlead::capture::LossReason::StuckLow);
            rig.hardware.run(signals);
            assert_eq!(rig.ask(&inject(0, &[0.5])), refused(Refusal::NotInjecting));
        }
    }
}

#[test]
fn an_excitation_is_refused_while_any_pulse_input_is_live_and_the_outputs_do_not_notice() {
    let start = Request::Excite(excite(0.5, 0.05, 1));
    for live in 0..MOTORS {
        let mut rig = Rig::new();
        let refusal = refused(Refusal::InputLive { motor: live as u8 });
        let (low, high) = (rig.pulse(0.01), rig.pulse(0.4));
        let lost = Signal::Lost(rotorlead::capture::LossReason::StuckLow);
        let (stop, high_level) = (EscCommand::from(STOP), rig.as_measured(0.4).into());
        // Locked, disarmed, armed, held.
        let armed = [(high, high_level); HOLD_TICKS + 2];
        let before = [(high, NO_PULSE), (low, stop), (Signal::Unchanged, stop), (high, stop), (high, stop)];
        let after = [(Signal::Unchanged, high_level), (lost, high_level)];
        for (signal, level) in before.into_iter().chain(armed).chain(after) {
            let mut signals = [Signal::Nothing; MOTORS];
            signals[live] = signal;
            let mut expected = [NO_PULSE; MOTORS];
            expected[live] = level;
            assert_eq!(rig.hardware.run(signals), expected);
            assert_eq!(rig.ask(&start), refusal, "motor {live} has {signal:?}");
        }
        for _ in 0..HOLD_TICKS {
            rig.tick(lost);
        }
        assert!(rig.tick(lost).iter().all(|&output| output <= STOP));
        assert_eq!(rig.ask(&start), Message::Done);
    }
}

#[test]
fn an_excitation_outside_the_limits_is_refused_with_the_limits() {
    let mut rig = Rig::new();
    let limits = Settings::default().excitation;
    let idle = Levels::PULSES.idle;
    let outside = refused(Refusal::CommandOutsideLimits {
        min_command: idle,
        max_command: limits.max_command,
        max_amplitude: limits.max_amplitude,
    });
    for (nominal, amplitude) in [(0.08, 0.05), (0.72, 0.05), (0.5, 0.11), (0.5, 0.0), (0.0, 0.0), (1.0, 0.1)] {
        assert_eq!(rig.ask(&Request::Excite(excite(nominal, amplitude, 1))), outside, "{nominal}, {amplitude}");
    }
    for (nominal, amplitude) in [(i32::MAX, 1), (1 << 28, i32::MAX), (-1, 1), (1 << 28, i32::MIN), (i32::MIN, i32::MIN)]
    {
        let request = ExciteRequest { nominal, amplitude, ..excite(0.5, 0.05, 1) };
        assert_eq!(rig.ask(&Request::Excite(request)), outside, "{nominal}, {amplitude}");
    }
    let too_long = refused(Refusal::TooLong { max_duration_s: limits.max_duration_s });
    for periods in [0, 13, u16::MAX] {
        assert_eq!(rig.ask(&Request::Excite(excite(0.5, 0.05, periods))), too_long, "{periods} periods of 10 s");
    }
    let other = Request::Excite(ExciteRequest { motor: 4, ..excite(0.5, 0.05, 1) });
    assert_eq!(rig.ask(&other), refused(Refusal::UnknownMotor));
    assert_eq!(rig.tick(Signal::Nothing), [NO_PULSE; MOTORS]);
    assert_eq!(states(&mut rig), [ChannelState::NoSignal; MOTORS]);

    // One at a time, and none where the host injects.
    assert_eq!(rig.ask(&Request::Excite(excite(0.5, 0.05, 12))), Message::Done);
    let second = Request::Excite(ExciteRequest { motor: 1, ..excite(0.5, 0.05, 1) });
    assert_eq!(rig.ask(&second), refused(Refusal::Exciting));
}

#[test]
fn the_host_drives_one_motor_at_a_time() {
    // An excitation plays, or ramps down: no motor is injected.
    let mut rig = exciting(3000);
    for stop in [Request::KeepAlive, Request::StopExcitation] {
        assert_eq!(rig.ask(&stop), Message::Done);
        for motor in 0..MOTORS as u8 {
            let before = rig.hardware.tick_mut().motors()[0].channel().command();
            assert_eq!(rig.ask(&mode(motor, Source::Inject)), refused(Refusal::Exciting), "motor {motor}");
            assert!(rig.tick_one(Signal::Nothing) > before.min(STOP));
        }
    }
    while state(&mut rig) == ChannelState::Excitation {
        rig.tick_one(Signal::Nothing);
    }
    assert_eq!(rig.ask(&mode(1, Source::Inject)), Message::Done);

    // A motor is injected, turning or at rest: nothing is excited, and no other one is injected.
    let at_rest = || {
        let mut rig = Rig::new();
        assert_eq!(rig.ask(&mode(0, Source::Inject)), Message::Done);
        rig
    };
    for (mut rig, level) in [(injecting(0.3), command(0.3).into()), (at_rest(), NO_PULSE)] {
        let injecting = refused(Refusal::Injecting { motor: 0 });
        for motor in 0..MOTORS as u8 {
            let request = Request::Excite(ExciteRequest { motor, ..excite(0.5, 0.05, 1) });
            assert_eq!(rig.ask(&request), injecting, "motor {motor}");
            if motor > 0 {
                assert_eq!(rig.ask(&mode(motor, Source::Inject)), injecting, "motor {motor}");
                // Which takes nothing from the pulses.
                assert_eq!(rig.ask(&mode(motor, Source::Pulse)), Message::Done);
            }
            assert_eq!(rig.tick_one(Signal::Nothing), level);
        }
    }
    // Afterwards it may be another one.
    let mut rig = at_rest();
    assert_eq!(rig.ask(&mode(0, Source::Inject)), Message::Done, "it starts afresh");
    assert_eq!(rig.ask(&mode(0, Source::Pulse)), Message::Done);
    assert_eq!(rig.ask(&mode(1, Source::Inject)), Message::Done);
    for _ in 0..=INJECT_TIMEOUT_TICKS {
        rig.tick_one(Signal::Nothing);
    }
    assert_eq!(rig.ask(&Request::Excite(excite(0.5, 0.05, 1))), Message::Done);
}

// --- Injection ----------------------------------------------------------------------------------------------------

#[test]
fn an_injection_goes_on_only_with_commands_and_answers_with_what_went_out() {
    let mut rig = Rig::new();
    rig.ask(&mode(0, Source::Inject));
    let tags = [rig.send(&inject(0, &[0.0, 0.4])), rig.send(&inject(2, &[0.5]))];
    rig.serve(usize::MAX);
    let outputs: Vec<EscCommand> = (0..6).map(|_| rig.tick_one(Signal::Nothing)).collect();
    // Three commands, and then the last one is held.
    assert_eq!(outputs, [0.0, 0.4, 0.5, 0.5, 0.5, 0.5].map(command));
    rig.serve(usize::MAX);
    for (tag, first, values) in [(tags[0], 0, &[0.0, 0.4][..]), (tags[1], 2, &[0.5][..])] {
        let bits: Vec<i32> = values.iter().map(|&value| command(value).to_bits()).collect();
        let outputs = bits[..].try_into().unwrap();
        assert_eq!(rig.take(tag), Some(Message::Injected(Injected { first, outputs })));
    }
    assert_eq!(rig.ask(&inject(5, &[0.5])), refused(Refusal::OutOfSequence { expected: 3 }));
}

#[test]
fn a_host_that_vanishes_during_an_injection_loses_the_motor_after_the_hold_time() {
    let mut rig = injecting(0.5);
    // The last command was consumed in the tick before the first of these.
    let outputs: Vec<EscCommand> = (1..=20_000).map(|_| rig.tick_one(Signal::Nothing)).collect();
    let (held, rest) = outputs.split_at(HOLD_TICKS);
    let (stops, rest) = rest.split_at(STOP_PULSE_TICKS);
    assert!(held.iter().all(|&output| output == command(0.5)), "it is held");
    assert!(stops.iter().all(|&output| output == STOP), "100 ms after the last command: stop");
    assert!(rest.iter().all(|&output| output == NO_PULSE), "and 2 s after that no pulses");
    assert_eq!(state(&mut rig), ChannelState::Lost);
    // A host that comes back does not go on where it was.
    assert_eq!(rig.ask(&inject(129, &[0.5])), refused(Refusal::NotInjecting));
    assert_eq!(rig.tick_one(Signal::Nothing), NO_PULSE);
}

/// The lead answers a step with three times the step. A host that goes quiet there must not leave that at the motor.
#[test]
fn commands_are_answered_whenever_their_injection_ends() {
    // The injection into a motor at rest ends with the next tick, which comes at any point of the request.
    for lock in 0..4 {
        let mut rig = Rig::new();
        assert_eq!(rig.ask(&mode(0, Source::Inject)), Message::Done);
        for _ in 0..INJECT_TIMEOUT_TICKS {
            rig.tick_one(Signal::Nothing);
        }
        rig.hardware.after_locks.resize(lock, Vec::new());
        rig.hardware.after_locks.push_back(vec![[Signal::Nothing; MOTORS]]);
        let tag = rig.send(&inject(0, &[0.0; 3]));
        rig.serve(usize::MAX);
        for _ in 0..3 {
            rig.tick_one(Signal::Nothing);
        }
        rig.serve(usize::MAX);
        match rig.take(tag) {
            // Ended before the check.
            Some(Message::Refused(Refusal::NotInjecting)) if lock == 0 => {}
            Some(Message::Injected(_)) if lock > 0 => {}
            other => panic!("a tick after lock {lock}: {other:?}"),
        }
    }
}

#[test]
fn commands_of_an_injection_that_ends_are_answered_though_the_settings_are_saved_meanwhile() {
    for own in [false, true] {
        for ticks in [1, 2, INJECT_SAMPLES - 1] {
            let mut settings = Settings::default();
            settings.motors[0].compensate = own;
            let mut rig = Rig::with(settings);
            let request = Request::SetMode { motor: 0, source: Source::Inject, compensate: !own };
            assert_eq!(rig.ask(&request), Message::Done);
            let tag = rig.send(&inject(0, &[0.0; INJECT_SAMPLES]));
            rig.serve(usize::MAX);
            // A flight controller comes up.
            let low = rig.pulse(0.0);
            for _ in 0..=ticks {
                assert_eq!(rig.tick_one(low), STOP);
            }
            rig.hardware.during_save = vec![[low; MOTORS]; 3];
            assert_eq!(rig.ask(&Request::SaveSettings), Message::Done);
            for _ in 0..=INJECT_SAMPLES {
                rig.tick_one(low);
            }
            rig.serve(usize::MAX);
            assert!(matches!(rig.take(tag), Some(Message::Injected(_))), "saved after {ticks} ticks");
            // What the injection did with the filter is over, and the motor is the flight controller's.
            let motor = &rig.hardware.tick_mut().motors()[0];
            assert_eq!((motor.channel().is_enabled(), motor.state()), (own, ChannelState::Disarmed));
        }
    }
}

#[test]
fn an_injection_that_ends_has_its_stop_pulses_unless_it_had_none() {
    let mut rig = Rig::new();
    assert_eq!(rig.ask(&mode(0, Source::Inject)), Message::Done);
    rig.send(&inject(0, &[0.0]));
    rig.serve(usize::MAX);
    for _ in 0..INJECT_TIMEOUT_TICKS + STOP_PULSE_TICKS {
        assert_eq!(rig.tick_one(Signal::Nothing), STOP);
    }
    // The command's own.
    assert_eq!(rig.tick_one(Signal::Nothing), STOP);
    assert_eq!(rig.tick_one(Signal::Nothing), NO_PULSE);
    // Without a command it arms no ESC, neither while it lasts nor when it ends.
    assert_eq!(rig.ask(&mode(0, Source::Inject)), Message::Done);
    for _ in 0..INJECT_TIMEOUT_TICKS + STOP_PULSE_TICKS {
        assert_eq!(rig.tick_one(Signal::Nothing), NO_PULSE);
    }
}

#[test]
fn a_host_that_goes_quiet_at_the_leads_peak_leaves_its_command_and_not_the_peak() {
    let mut rig = Rig::with(Settings { slew_per_s: 0.0, ..Settings::default() });
    assert_eq!(rig.ask(&Request::SetMode { motor: 0, source: Source::Inject, compensate: true }), Message::Done);
    let samples: Vec<f64> = [0.0].into_iter().chain([0.4; 5]).chain([0.5; 60]).collect();
    rig.send(&inject(0, &samples));
    rig.serve(usize::MAX);
    let outputs: Vec<EscCommand> = samples.iter().map(|_| rig.tick_one(Signal::Nothing)).collect();
    let peak = *outputs.last().unwrap();
    assert!(peak > command(0.7), "{peak:?}");
    for n in 0..HOLD_TICKS {
        assert_eq!(rig.tick_one(Signal::Nothing), command(0.5), "tick {n} without the host");
    }
    assert_eq!(rig.tick_one(Signal::Nothing), STOP);
}

/// By default the filter is not in the path of the pulses, and what an injection does with it must not stay.
#[test]
fn the_filter_of_an_injection_ends_with_it() {
    let mut rig = Rig::new();
    assert_eq!(rig.ask(&Request::SetMode { motor: 0, source: Source::Inject, compensate: true }), Message::Done);
    rig.send(&inject(0, &[0.0, 0.5, 0.5]));
    rig.serve(usize::MAX);
    for _ in 0..3 {
        rig.tick_one(Signal::Nothing);
    }
    for _ in 0..=HOLD_TICKS {
        rig.tick_one(Signal::Nothing);
    }
    assert_eq!(state(&mut rig), ChannelState::Lost);
    let (low, half, more) = (rig.pulse(0.0), rig.pulse(0.5), rig.pulse(0.6));
    assert_eq!(rig.tick_one(low), STOP);
    rig.arm_one(half);
    for _ in 0..1000 {
        assert_eq!(rig.tick_one(half), rig.as_measured(0.5));
    }
    // Compensated, the answer to a step is more than the step.
    assert_eq!(rig.tick_one(more), rig.as_measured(0.6));
    assert_eq!(rig.tick_one(more), rig.as_measured(0.6));
}

#[test]
fn a_flight_controller_that_comes_up_at_another_motor_ends_an_excitation() {
    let mut rig = exciting(10_000);
    let disarmed = rig.pulse(0.0);
    let signals = [Signal::Nothing, Signal::Nothing, Signal::Nothing, disarmed];
    let mut ticks = 0;
    while rig.hardware.run(signals)[0] > STOP {
        if ticks % 500 == 0 {
            assert_eq!(rig.ask(&Request::KeepAlive), Message::Done);
        }
        ticks += 1;
        assert!(ticks < 20_000, "the motor is kept running beside a flight controller");
    }
}

#[test]
fn requests_that_cannot_be_used_do_not_keep_an_injected_motor_running() {
    let mut rig = injecting(0.5);
    let mut ticks = 0;
    while rig.tick_one(Signal::Nothing) > STOP {
        ticks += 1;
        assert!(ticks < 20_000, "a host that sends nothing of use has the motor running");
        if ticks % 100 == 0 {
            rig.ask(&Request::Info);
            rig.ask(&Request::KeepAlive);
            rig.ask(&inject(7, &[0.5]));
            rig.ask(&inject(129, &[]));
        }
    }
    assert_eq!(ticks, HOLD_TICKS);
}

#[test]
fn a_host_that_is_back_within_the_hold_time_goes_on() {
    let mut rig = injecting(0.5);
    for _ in 0..HOLD_TICKS {
        assert_eq!(rig.tick_one(Signal::Nothing), command(0.5));
    }
    rig.send(&inject(129, &[0.6, 0.7]));
    rig.serve(usize::MAX);
    assert_eq!([rig.tick_one(Signal::Nothing), rig.tick_one(Signal::Nothing)], [0.6, 0.7].map(command));
}

#[test]
fn an_injection_into_a_motor_at_rest_ends_a_second_after_the_host() {
    let mut rig = Rig::new();
    assert_eq!(rig.ask(&mode(0, Source::Inject)), Message::Done);
    for _ in 0..INJECT_TIMEOUT_TICKS {
        assert_eq!(rig.tick_one(Signal::Nothing), NO_PULSE);
        assert_eq!(state(&mut rig), ChannelState::Injected);
    }
    rig.tick_one(Signal::Nothing);
    assert_eq!(state(&mut rig), ChannelState::Lost);
}

/// The flight controller's throttle was up all the time: nobody has seen it down.
#[test]
fn a_flight_controller_that_comes_up_stops_an_injection_at_once_and_has_to_disarm_first() {
    for level in [0.0, 0.9] {
        let mut rig = injecting(0.5);
        let (low, pulse) = (rig.pulse(0.0), rig.pulse(level));
        let tags = [rig.send(&inject(129, &[0.5; INJECT_SAMPLES])), rig.send(&inject(257, &[0.6; INJECT_SAMPLES]))];
        rig.serve(usize::MAX);
        // It is seen in one tick, and acted on in the next.
        assert_eq!(rig.tick_one(pulse), command(0.5));
        for _ in 0..5000 {
            assert_eq!(rig.tick_one(pulse), STOP);
        }
        // What was under way is answered with what went out: stop pulses.
        rig.serve(usize::MAX);
        let first = [command(0.5)].into_iter().chain([STOP; INJECT_SAMPLES - 1]);
        for (tag, first, outputs) in [(tags[0], 129, first.collect()), (tags[1], 257, vec![STOP; INJECT_SAMPLES])] {
            let outputs: Vec<i32> = outputs.iter().map(|output| output.to_bits()).collect();
            let outputs = outputs[..].try_into().unwrap();
            assert_eq!(rig.take(tag), Some(Message::Injected(Injected { first, outputs })));
        }
        assert_eq!(state(&mut rig), if level > 0.0 { ChannelState::Locked } else { ChannelState::Disarmed });
        assert_eq!(rig.tick_one(low), STOP);
        let high = rig.pulse(0.9);
        assert_eq!(rig.arm_one(high), rig.as_measured(0.9));
    }
}

#[test]
fn commands_that_a_change_of_mode_cuts_off_are_refused_and_never_played() {
    let mut rig = Rig::new();
    rig.ask(&mode(0, Source::Inject));
    let tags = [rig.send(&inject(0, &[0.0; 5])), rig.send(&inject(5, &[0.5; 5]))];
    rig.serve(usize::MAX);
    assert_eq!(rig.tick_one(Signal::Nothing), STOP);
    assert_eq!(rig.ask(&mode(0, Source::Inject)), Message::Done);
    for tag in tags {
        assert_eq!(rig.take(tag), Some(refused(Refusal::NotInjecting)));
    }
    for _ in 0..100 {
        assert_eq!(rig.tick_one(Signal::Nothing), NO_PULSE);
    }
    // Numbers begin at 0 again.
    assert_eq!(rig.ask(&inject(10, &[0.5])), refused(Refusal::OutOfSequence { expected: 0 }));
}

// --- Excitation ---------------------------------------------------------------------------------------------------

/// What motor 0 does from now on without a keep-alive, until it stands. The motor may move away from stop during the
/// dead-man's time only; then every tick takes it down by the ramp's step, to the stop.
fn check_dead_man(rig: &mut Rig, mut each_tick: impl FnMut(&mut Rig, usize)) -> usize {
    assert_eq!(rig.ask(&Request::KeepAlive), Message::Done);
    let step = excitation_ramp().to_bits();
    let idle = Levels::PULSES.idle;
    let arming = Levels::PULSES.arming;
    let mut level = None;
    for n in 0.. {
        each_tick(rig, n);
        let before = rig.hardware.tick_mut().motors()[0].channel().command();
        let output = rig.tick_one(Signal::Nothing);
        if n < DEAD_MAN_TICKS {
            assert!(output > STOP, "tick {n}: the dead-man's time is not over");
            continue;
        }
        let command = level.unwrap_or(before.to_bits()) - step;
        level = Some(command);
        // Below the arming threshold it passes as it is, above it is idle at least: as any command.
        let expected = if command < arming { command.max(0) } else { command.max(idle) };
        assert_eq!(output.to_bits(), expected, "tick {n}: down the ramp");
        if output == STOP {
            assert_eq!(dead_man(rig), 1);
            for _ in 0..2000 {
                assert_eq!(rig.tick_one(Signal::Nothing), STOP);
            }
            for _ in 0..STOP_PULSE_TICKS {
                rig.tick_one(Signal::Nothing);
            }
            assert_eq!(rig.tick_one(Signal::Nothing), NO_PULSE);
            return n;
        }
    }
    unreachable!()
}

/// 200 ms, and at most 0.75 at 0.375 a second.
const LONGEST_DEAD_MAN_TICKS: usize = DEAD_MAN_TICKS + 10_001;

#[test]
fn a_host_that_vanishes_during_an_excitation_has_the_motor_ramped_down_to_the_stop_within_2_2_s() {
    // On the way up, soon after the start of the lines, later.
    for before in [100, 3000, 8000, 30_000] {
        let ticks = check_dead_man(&mut exciting(before), |_, _| {});
        assert!(ticks <= LONGEST_DEAD_MAN_TICKS, "{ticks}");
    }
}

#[test]
fn garbage_and_a_flood_of_bytes_keep_no_excitation_alive() {
    let mut state = 1_u64;
    let ticks = check_dead_man(&mut exciting(10_000), |rig, _| {
        // 1 Mbaud fills a tick with 20 bytes; 30 are more than arrive.
        let noise: [u8; 30] = std::array::from_fn(|_| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 56) as u8
        });
        rig.write(&noise);
        rig.serve(30);
    });
    assert!(ticks <= LONGEST_DEAD_MAN_TICKS, "{ticks}");
}

#[test]
fn good_requests_other_than_keep_alives_keep_no_excitation_alive() {
    let ticks = check_dead_man(&mut exciting(10_000), |rig, n| {
        match n % 4 {
            0 => rig.send(&Request::Info),
            1 => rig.send(&Request::Faults),
            2 => rig.send(&Request::Excite(excite(0.5, 0.05, 10))),
            _ => rig.send(&mode(0, Source::Inject)),
        };
        rig.serve(2000);
        rig.inbox.clear();
    });
    assert!(ticks <= LONGEST_DEAD_MAN_TICKS, "{ticks}");
}

#[test]
fn a_frame_that_is_damaged_is_no_keep_alive_and_a_good_one_in_a_flood_is() {
    let mut rig = exciting(10_000);
    // 5 s of noise with a good keep-alive every 100 ms in it: the lines are played on.
    let mut garbage = (0..).map(|n: u64| (n.wrapping_mul(n) >> 3) as u8 | 1);
    for n in 0..25_000 {
        let noise: Vec<u8> = garbage.by_ref().take(10).collect();
        rig.write(&noise);
        if n % 500 == 0 {
            rig.send(&Request::KeepAlive);
        }
        rig.serve(40);
        assert!(rig.tick_one(Signal::Nothing) >= command(0.44), "tick {n}");
    }
    assert_eq!(dead_man(&mut rig), 0);
    // The same frame with one bit wrong.
    let mut frame = [0; rotorlead::link::FRAME_BYTES];
    let length = rotorlead::link::encode(9, &Request::KeepAlive, &mut frame).unwrap();
    frame[4] ^= 1;
    let ticks = check_dead_man(&mut rig, |rig, _| {
        rig.write(&frame[..length]);
        rig.serve(100);
    });
    assert!(ticks <= LONGEST_DEAD_MAN_TICKS, "{ticks}");
}

/// The emulated line carries 19 kB/s, a recording at 5 kHz takes four times that.
#[test]
fn a_recording_that_is_faster_than_the_line_keeps_no_request_from_being_heard() {
    let mut rig = exciting(9000);
    rig.ask(&Request::Record(Some(RecordRequest { motor: 0, divisor: 1 })));
    for n in 0..25_000 {
        if n % 500 == 0 {
            rig.send(&Request::KeepAlive);
        }
        rig.serve(4);
        assert!(rig.tick_one(Signal::Nothing) >= command(0.44), "tick {n}: the keep-alives do not arrive");
    }
    rig.send(&Request::StopExcitation);
    let mut ticks = 0;
    while rig.tick_one(Signal::Nothing) > STOP {
        rig.serve(4);
        ticks += 1;
    }
    // 0.55 at 0.375 a second, and one record that is already on its way.
    assert!(ticks < 7334 + 200, "{ticks}");
    let tag = rig.send(&Request::Record(None));
    let answered = (0..2000).any(|_| {
        rig.tick_one(Signal::Nothing);
        rig.serve(4);
        rig.take(tag).is_some()
    });
    assert!(answered, "the recording cannot be stopped");
}

#[test]
fn the_wire_of_the_last_request_has_the_link() {
    let mut rig = Rig::new();
    let recording = rig.send(&Request::Record(Some(RecordRequest { motor: 0, divisor: 1 })));
    let records = |rig: &mut Rig| {
        rig.inbox.clear();
        for _ in 0..100 {
            rig.tick_one(Signal::Nothing);
            rig.serve(usize::MAX);
        }
        rig.inbox.iter().filter(|received| received.tag == recording).count()
    };
    assert!(records(&mut rig) >= 3);
    // Noise and frames of another version at the other one take nothing away, and the notice goes to who asked.
    rig.wire = 1;
    rig.write(&[1, 2, 0, 3, 0]);
    rig.write(&frame(VERSION + 1, 7, &[1, 2, 3]));
    assert_eq!(records(&mut rig), 0);
    assert_eq!(rig.take_foreign(), Some(Foreign::Notice { version: VERSION }));
    assert!(rig.elsewhere > 300, "{}", rig.elsewhere);
    // A request does, and the faults are those of both.
    let Message::Faults(faults) = rig.ask(&Request::Faults) else { panic!() };
    assert_eq!(faults.link.total(), 3, "{:?}", faults.link);
    assert!(records(&mut rig) >= 3);
    let elsewhere = rig.elsewhere;
    rig.wire = 0;
    assert_eq!(records(&mut rig), 0);
    assert!(rig.elsewhere > elsewhere + 300);
}

#[test]
fn the_boot_loader_is_called_with_the_jumper_and_every_motor_at_rest_and_nobody_arms_any_more() {
    let mut rig = armed(0.5);
    assert_eq!(rig.ask(&Request::BootLoader), refused(Refusal::NotDisarmed { motor: 0 }));
    let (low, high) = (rig.pulse(0.0), rig.pulse(0.5));
    rig.tick_one(low);
    rig.hardware.board.status.bench_enabled = false;
    assert_eq!(rig.ask(&Request::BootLoader), refused(Refusal::BenchDisabled));
    rig.hardware.board.status.bench_enabled = true;
    rig.hardware.board.status.facts.has_boot_loader = false;
    assert_eq!(rig.ask(&Request::BootLoader), refused(Refusal::NoBootLoader));
    rig.hardware.board.status.facts.has_boot_loader = true;
    assert!(!rig.is_leaving());
    assert_eq!(rig.arm_one(high), rig.as_measured(0.5), "a refusal changes nothing");
    rig.tick_one(low);
    assert_eq!(rig.ask(&Request::BootLoader), Message::Done);
    assert!(rig.is_leaving());
    // Each of these would let the ticks go on.
    for request in [Request::SetSettings(Settings::default()), Request::SaveSettings, mode(0, Source::Pulse)] {
        rig.send(&request);
        rig.serve(usize::MAX);
        rig.tick_one(low);
    }
    assert!(rig.arm_one(high) <= STOP);

    let mut rig = exciting(100);
    assert_eq!(rig.ask(&Request::BootLoader), refused(Refusal::NotDisarmed { motor: 0 }));
}

#[test]
fn a_flood_of_requests_keeps_no_record_from_being_sent() {
    let mut rig = Rig::new();
    let recording = Request::Record(Some(RecordRequest { motor: 0, divisor: 10 }));
    let tag = rig.send(&recording);
    for _ in 0..6400 {
        rig.send(&Request::KeepAlive);
        rig.tick_one(Signal::Nothing);
        rig.serve(20);
    }
    let records =
        rig.inbox.iter().filter(|received| received.tag == tag && matches!(received.message, Message::Record(_)));
    assert!(records.count() >= 19, "20 records were due");
}

// --- Recorder -----------------------------------------------------------------------------------------------------

#[test]
fn a_recording_has_every_sample_or_says_which_are_missing() {
    for (bytes_per_tick, is_lossless) in [(usize::MAX, true), (3, false)] {
        let mut rig = Rig::new();
        let low = rig.pulse(0.0);
        rig.tick_one(low);
        let tag = rig.send(&Request::Record(Some(RecordRequest { motor: 0, divisor: 1 })));
        rig.serve(usize::MAX);
        assert_eq!(rig.take(tag), Some(Message::Done));
        let mut sent = Vec::new();
        for n in 0..10_000_u32 {
            let level = 0.4 + 0.1 * f64::from(n * 7919 % 1000) / 1000.0;
            let mut signals = [Signal::Nothing; MOTORS];
            signals[0] = rig.pulse(level);
            let output = rig.hardware.tick_mut().run(signals.map(Into::into), |_| Sensed::adc(n as u16))[0];
            sent.push((rig.as_measured(level).to_bits(), output.to_bits(), i32::from(n as u16)));
            rig.serve(bytes_per_tick);
        }
        let stop = rig.send(&Request::Record(None));
        rig.serve(usize::MAX);
        assert_eq!(rig.take(stop), Some(Message::Done));
        let (mut received, mut missing, mut next) = (0, 0, 0);
        for reply in std::mem::take(&mut rig.inbox) {
            let Message::Record(record) = reply.message else { panic!("{reply:?}") };
            assert_eq!((reply.tag, record.motor, record.divisor), (tag, 0, 1));
            missing += record.first_tick - next;
            for (index, &after) in record.after.as_slice().iter().enumerate() {
                let (input, output, adc) = sent[record.first_tick as usize + index];
                assert_eq!(record.input.as_slice()[index], input);
                assert_eq!((after, record.adc.as_slice()[index]), (output, adc));
                received += 1;
            }
            next = record.first_tick + record.after.len() as u32;
        }
        let Message::Faults(faults) = rig.ask(&Request::Faults) else { panic!("no faults") };
        // Those after the last one that found room are missed by nobody but the counter.
        assert_eq!(received + faults.record_dropped, 10_000);
        assert!(missing <= faults.record_dropped && missing + 40 >= faults.record_dropped || !is_lossless);
        assert_eq!(faults.record_dropped == 0, is_lossless, "{faults:?}");
        assert!(missing <= faults.record_dropped && (missing > 0) != is_lossless);
        println!("{bytes_per_tick} bytes a tick: {received} received, {missing} seen to be missing");
    }
}

#[test]
fn a_recording_without_a_pulse_input_says_so() {
    let mut rig = Rig::new();
    rig.ask(&Request::Record(Some(RecordRequest { motor: 0, divisor: 1 })));
    for _ in 0..32 {
        rig.tick_one(Signal::Nothing);
    }
    rig.serve(usize::MAX);
    let Some(Message::Record(record)) = rig.inbox.pop().map(|received| received.message) else { panic!("no record") };
    assert_eq!(record.input.as_slice(), [NO_INPUT; 32]);
    assert_eq!((record.before.as_slice(), record.after.as_slice()), (&[0; 32][..], &[NO_PULSE.to_bits(); 32][..]));
}

// --- Faults at the inputs -----------------------------------------------------------------------------------------

/// A line of servo pulses: 0.25 s disarmed, then armed at 1500 us from 0.25 s to 0.5 s.
fn disarmed_then_armed() -> Line {
    let servo = |start_us: f64, width_us: f64| Line::pulses(us(start_us), us(2500.0), us(width_us), 100);
    servo(1000.0, 1000.0).then(&servo(251_000.0, 1500.0))
}

/// What motor 0 puts out at every tick while `line` is at its input, seconds and microseconds; the others have nothing.
fn outputs(line: &Line, seconds: f64) -> Vec<(f64, f64)> {
    let mut rig = Rig::new();
    let mut decoder = Decoder::new(Timing::new(PulseProtocol::StandardPwm.at(400), TIMER_HZ, LOOP_HZ).unwrap());
    decode(&mut decoder, line, 0, us(seconds * 1e6))
        .into_iter()
        .map(|(time, signal)| {
            let mut signals = [Signal::Nothing; MOTORS];
            signals[0] = signal;
            let outputs = rig.hardware.run(signals);
            assert_eq!(outputs[1..], [NO_PULSE; 3], "the other outputs are low");
            let width_us = outputs[0].command().map_or(0.0, |command| 1000.0 + 1000.0 * command.to_f64());
            (time as f64 / f64::from(TIMER_HZ), width_us)
        })
        .collect()
}

/// All outputs from one time to another are that pulse, to a hundredth of a timer tick.
fn assert_pulse(outputs: &[(f64, f64)], from: f64, to: f64, width_us: f64) {
    for &(time, width) in outputs.iter().filter(|(time, _)| (from..to).contains(time)) {
        assert!((width - width_us).abs() < 1e-4, "{width} us at {time} s, not {width_us}");
    }
}

#[test]
fn a_line_that_sticks_low_or_high_while_armed_is_held_and_then_stopped() {
    for sticks_high in [false, true] {
        let mut line = disarmed_then_armed();
        if sticks_high {
            line.level(us(501_000.0), Level::High);
        }
        let outputs = outputs(&line, 3.0);
        // Live with the third pulse of which all is seen.
        assert_pulse(&outputs, 0.0, 0.0095, 0.0);
        assert_pulse(&outputs, 0.0100, 0.2525, 1000.0);
        // The last pulse ends at 0.5 s. 100 ms until it counts as lost, 100 ms of hold, 2 s of stop pulses.
        assert_pulse(&outputs, 0.2580, 0.6998, 1500.0);
        assert_pulse(&outputs, 0.7004, 2.6998, 1000.0);
        assert_pulse(&outputs, 2.7004, 3.0, 0.0);
    }
}

#[test]
fn a_line_that_is_flooded_while_armed_is_held_and_then_stopped() {
    let mut line = disarmed_then_armed();
    for n in 0..60_000 {
        line.level(us(501_000.0 + 25.0 * f64::from(n)), if n % 2 == 0 { Level::High } else { Level::Low });
    }
    let outputs = outputs(&line, 3.0);
    assert_pulse(&outputs, 0.2580, 0.6998, 1500.0);
    assert_pulse(&outputs, 0.7004, 2.6998, 1000.0);
    assert_pulse(&outputs, 2.7004, 3.0, 0.0);
}

#[test]
fn glitches_do_not_reach_the_output() {
    // In the gap of a disarmed frame, in the pulse of an armed one, and in its gap.
    let line = disarmed_then_armed();
    let line = line.with_glitch(us(52_800.0), us(0.9)).with_glitch(us(301_400.0), us(1.5));
    let line = line.with_glitch(us(403_000.0), us(1.9)).with_glitch(us(403_100.0), us(0.2));
    let outputs = outputs(&line, 0.6);
    assert_pulse(&outputs, 0.0100, 0.2525, 1000.0);
    assert_pulse(&outputs, 0.2580, 0.6, 1500.0);
}

#[test]
fn an_input_that_is_gone_for_less_than_timeout_and_hold_goes_on_and_for_longer_must_be_disarmed_first() {
    let servo = |start_us: f64, width_us: f64, count| Line::pulses(us(start_us), us(2500.0), us(width_us), count);
    // Back after 150 ms, 50 ms into the hold, at 1600 us.
    let short = outputs(&disarmed_then_armed().then(&servo(650_000.0, 1600.0, 100)), 0.9);
    assert_pulse(&short, 0.2580, 0.6500, 1500.0);
    assert_pulse(&short, 0.6600, 0.9, 1600.0);
    // Back after 300 ms.
    let long = disarmed_then_armed().then(&servo(800_000.0, 1600.0, 100));
    let long = long.then(&servo(1_050_000.0, 1000.0, 10)).then(&servo(1_075_000.0, 1300.0, 50));
    let long = outputs(&long, 1.2);
    assert_pulse(&long, 0.2580, 0.6998, 1500.0);
    assert_pulse(&long, 0.7004, 1.0812, 1000.0);
    assert_pulse(&long, 1.0816, 1.2, 1300.0);
}

/// The flight controller goes on flying while the controller starts anew.
#[test]
fn after_a_brown_out_while_armed_no_output_has_pulses_until_its_input_was_seen_disarmed() {
    let flash = saved(&Validated::default());
    let mut rig = Rig::starting_from(&flash).0;
    let (low, high) = (rig.pulse(0.0), rig.pulse(0.7));
    rig.tick(low);
    assert_eq!(rig.arm([high; MOTORS]), [rig.as_measured(0.7); MOTORS]);

    let mut rig = Rig::starting_from(&flash).0;
    // No pulse yet, then armed ones, for 10 s.
    assert_eq!(rig.tick(Signal::Nothing), [NO_PULSE; MOTORS]);
    for n in 0..50_000 {
        let signal = if n % 12 == 0 { high } else { Signal::Unchanged };
        assert_eq!(rig.tick(signal), [NO_PULSE; MOTORS], "tick {n} after the reset");
    }
    assert_eq!(states(&mut rig), [ChannelState::Locked; MOTORS]);
    // Each input by itself.
    assert_eq!(rig.hardware.run([low, high, high, high]), [STOP.into(), NO_PULSE, NO_PULSE, NO_PULSE]);
    let level = rig.as_measured(0.7).into();
    assert_eq!(rig.arm([high; MOTORS]), [level, NO_PULSE, NO_PULSE, NO_PULSE]);
}

/// A raw duty of 0 has no edges, so that an ESC takes it for a broken wire.
#[test]
fn no_pulse_is_ever_below_the_stop() {
    let mut settings = Settings { stop: command(0.02).to_bits(), ..Settings::default() };
    settings.output.protocol = PulseProtocol::RawDuty;
    settings.motors.iter_mut().for_each(|motor| motor.max = command(0.95).to_bits());
    let mut rig = Rig::with(settings);
    let stop = command(0.02);
    assert_eq!(rig.tick(Signal::Nothing), [NO_PULSE; MOTORS]);
    for (level, expected) in [(0.0, stop), (0.01, stop), (0.025, stop), (0.5, rig.as_measured(0.5)), (0.0, stop)] {
        let pulse = rig.pulse(level);
        assert_eq!(rig.arm([pulse; MOTORS]), [expected; MOTORS], "{level}");
    }
    for _ in 0..2 * HOLD_TICKS {
        let lost = Signal::Lost(rotorlead::capture::LossReason::StuckLow);
        assert_eq!(rig.tick(lost), [stop; MOTORS]);
    }
    rig.ask(&mode(0, Source::Inject));
    rig.send(&inject(0, &[0.0]));
    rig.serve(usize::MAX);
    assert_eq!(rig.tick_one(Signal::Nothing), stop);
}

// --- Faults of the flash ------------------------------------------------------------------------------------------

/// Settings that differ from the defaults in what matters to the outputs.
fn others() -> Validated {
    let mut settings = Settings { recorder_divisor: 9, ..Settings::default() };
    settings.motors.iter_mut().for_each(|motor| {
        motor.arming = Some(command(0.045).to_bits());
        motor.hold_ms = 20;
        motor.compensate = true;
    });
    settings.validate().unwrap()
}

/// Starts from `flash` with armed inputs: there is no pulse until a disarmed command came, and then the controller works
/// where somebody has chosen its settings. What a start makes of a flash is what it loads from it, so each outcome is
/// started once.
fn assert_safe_start(flash: &SharedFlash, seen: &mut Vec<Loaded>) -> Validated {
    let loaded = Store::new(flash.clone(), Flash::<SECTOR>::SECTORS).load();
    if seen.contains(&loaded) {
        return loaded.settings;
    }
    let (mut rig, origin) = Rig::starting_from(flash);
    assert_eq!(origin, loaded.origin);
    let (low, high) = (rig.pulse(0.0), rig.pulse(0.5));
    for signal in [Signal::Nothing, high, Signal::Unchanged, high] {
        assert_eq!(rig.tick(signal), [NO_PULSE; MOTORS]);
    }
    let (stop, level) =
        if origin.is_chosen() { (STOP.into(), rig.as_measured(0.5).into()) } else { (NO_PULSE, NO_PULSE) };
    assert_eq!(rig.tick(low), [stop; MOTORS]);
    assert_eq!(rig.arm([high; MOTORS]), [level; MOTORS]);
    let settings = loaded.settings.clone();
    seen.push(loaded);
    settings
}

#[test]
fn settings_with_a_wrong_byte_anywhere_turn_no_motor_and_are_the_ones_that_were_stored() {
    let whole = saved(&others()).copy();
    let mut seen = Vec::new();
    for address in 0..whole.bytes.len() {
        for flip in [0x01, 0x80, 0xff] {
            let mut flash = whole.clone();
            flash.bytes[address] ^= flip;
            assert_eq!(assert_safe_start(&SharedFlash::new(flash), &mut seen), others(), "byte {address}");
        }
    }
}

#[test]
fn settings_with_a_wrong_byte_in_both_copies_bring_no_pulses() {
    let whole = saved(&others()).copy();
    let used = whole.bytes[..SECTOR].iter().rposition(|&byte| byte != 0xff).unwrap() + 1;
    let mut seen = Vec::new();
    for address in 0..used {
        let mut flash = whole.clone();
        flash.bytes[address] ^= 0x04;
        flash.bytes[SECTOR + (address + 5) % used] ^= 0x40;
        assert_eq!(assert_safe_start(&SharedFlash::new(flash), &mut seen), Validated::default(), "byte {address}");
    }
    assert!(seen.iter().all(|loaded| loaded.origin == Origin::DefaultsBad));
}

#[test]
fn a_power_cut_at_any_byte_of_a_save_turns_no_motor_then_or_at_the_next_start() {
    // The fifth save erases.
    for saves_before in [1, 4] {
        let flash = SharedFlash::new(Flash::blank());
        for _ in 0..saves_before {
            Store::new(flash.clone(), Flash::<SECTOR>::SECTORS).save(&Validated::default()).unwrap();
        }
        let before = flash.copy();
        let (mut old, mut new, mut seen) = (0, 0, Vec::new());
        for cut in 0.. {
            let flash = SharedFlash::new(Flash { cut_after: Some(cut), ..before.clone() });
            let mut rig = Rig::starting_from(&flash).0;
            let (low, high) = (rig.pulse(0.0), rig.pulse(0.6));
            rig.tick(low);
            rig.hardware.during_save = vec![[high; MOTORS]];
            let set = Request::SetSettings((*others()).clone());
            assert!(matches!(rig.ask(&set), Message::SettingsTaken(_)));
            let answer = rig.ask(&Request::SaveSettings);
            assert!(rig.hardware.outputs_during_save[0].iter().all(|&output| output <= STOP));
            // The power is gone for the flash alone: were the rest alive, the motors would still stand.
            assert!(rig.tick(high).iter().all(|&output| output <= STOP));
            if answer == Message::Done {
                break;
            }
            assert_eq!(answer, refused(Refusal::SaveFailed), "cut after {cut} bytes");
            let mut left = flash.copy();
            left.power_on();
            let started = assert_safe_start(&SharedFlash::new(left), &mut seen);
            assert!(started == Validated::default() || started == others(), "cut after {cut} bytes");
            *(if started == others() { &mut new } else { &mut old }) += 1;
        }
        println!("{saves_before} saves before: {old} cuts leave the old set, {new} the new one");
        assert!(old > 0 && new > 0);
    }
    table::hold(table::POWER_CUT, Column::Mocks, &yes());
}

// --- Anything -----------------------------------------------------------------------------------------------------

/// What happens next in a random life.
#[derive(Clone, Debug)]
#[allow(clippy::large_enum_variant)] // A few at a time.
enum Event {
    /// An input has this level (or nothing), for so many ticks.
    Input(usize, Option<f64>, usize),
    Request(Request),
    Noise(Vec<u8>),
}

fn any_event() -> impl Strategy<Value = Event> {
    let level = proptest::option::weighted(0.7, prop_oneof![Just(0.0), 0.0..1.0_f64]);
    let ticks = prop_oneof![1..20_usize, 400..1500_usize, Just(6000_usize)];
    let motor = 0..MOTORS as u8;
    let source = prop_oneof![Just(Source::Pulse), Just(Source::Inject)];
    let lines = prop_oneof![Just(LineSet::Odd30Hz), Just(LineSet::Odd45Hz)];
    let excitation = (motor.clone(), lines, 0.0..=1.0_f64, 0.001..0.25_f64, 1..3_u16);
    let values = proptest::collection::vec(prop_oneof![Just(0.0), 0.0..1.0_f64], 0..20);
    let request = prop_oneof![
        3 => (motor.clone(), source, any::<bool>())
            .prop_map(|(motor, source, compensate)| Request::SetMode { motor, source, compensate }),
        3 => (motor.clone(), values).prop_map(|(motor, values)| {
            let bits: Vec<i32> = values.iter().map(|&value| command(value).to_bits()).collect();
            Request::Inject(InjectRequest { motor, first: 0, samples: bits[..].try_into().unwrap() })
        }),
        2 => motor.prop_map(|motor| Request::Excite(ExciteRequest { motor, ..excite(0.5, 0.05, 1) })),
        2 => excitation.prop_map(|(motor, lines, nominal, amplitude, periods)| {
            Request::Excite(ExciteRequest { motor, lines, ..excite(nominal, amplitude, periods) })
        }),
        2 => Just(Request::KeepAlive),
        1 => Just(Request::StopExcitation),
        1 => Just(Request::SaveSettings),
        1 => Just(Request::SetSettings(Settings::default())),
    ];
    prop_oneof![
        4 => (0..MOTORS, level, ticks).prop_map(|(motor, level, ticks)| Event::Input(motor, level, ticks)),
        5 => request.prop_map(Event::Request),
        1 => proptest::collection::vec(any::<u8>(), 0..50).prop_map(Event::Noise),
    ]
}

proptest! {
    #![proptest_config(cases(600))]

    /// A second, much simpler account of which motor may turn, beside the controller and over all valid settings: whoever
    /// drives it was seen disarmed, or the host has it and has given a sign of life.
    #[test]
    fn whatever_happens_at_inputs_and_link_no_motor_turns_that_should_not(
        mut settings in any_settings(),
        mut other in any_settings(),
        clocks in prop_oneof![3 => Just(CRYSTAL), 1 => Just(INTERNAL_PLL), 1 => Just(INTERNAL)],
        events in proptest::collection::vec(any_event(), 1..40)
    ) {
        let mut rig = Rig::starting_on(&saved(&settings), facts(clocks)).0;
        let all_limits = |settings: &Validated| -> [_; MOTORS] { std::array::from_fn(|motor| channel_settings(settings, motor)) };
        let mut limits = all_limits(&settings);
        // What a pulse counts as: where the clock does not tell them apart, as an armed one.
        let counts = |rig: &Rig, level: f64| if clocks.tells_pulses_apart() { rig.as_measured(level) } else { Command::ONE };
        // After the longest of: an injection's hold; the dead-man's time and the way down, with or without the stop pulses.
        let longest = |limits: &[ChannelSettings; MOTORS], motor: usize| {
            let step = limits[0].excitation.ramp_per_tick.to_bits();
            let ramp = limits[0].excitation.dead_man_ticks + (Command::ONE.to_bits() / step) as u32 + 1;
            limits[motor].hold_ticks.max(ramp) as usize + 2
        };
        let mut signals = [Signal::Nothing; MOTORS];
        // As sent, and as taken.
        let mut sent: [Option<f64>; MOTORS] = [None; MOTORS];
        let mut levels: [Option<Command>; MOTORS] = [None; MOTORS];
        // Ticks since the motor was last allowed to turn by: a pilot who was seen disarmed, the host.
        let mut quiet = [usize::MAX; MOTORS];
        let mut next = [0_u32; MOTORS];
        for event in events {
            match event {
                Event::Noise(bytes) => {
                    rig.write(&bytes);
                    rig.serve(usize::MAX);
                }
                Event::Request(mut request) => {
                    match &mut request {
                        Request::Inject(inject) => inject.first = next[usize::from(inject.motor)],
                        Request::SetSettings(set) => *set = Settings::clone(&other),
                        _ => {}
                    }
                    let tag = rig.send(&request);
                    rig.serve(usize::MAX);
                    let answer = rig.take(tag);
                    match (&request, &answer) {
                        (Request::SetMode { motor, .. }, Some(Message::Done)) => next[usize::from(*motor)] = 0,
                        (Request::SetSettings(_), Some(Message::SettingsTaken(_))) => {
                            std::mem::swap(&mut settings, &mut other);
                            rig.set_pulses(&settings);
                            limits = all_limits(&settings);
                            next = [0; MOTORS];
                            // The flight controller's pulses are of the new kind; the last one was of the old.
                            levels = sent.map(|level| level.map(|level| counts(&rig, level)));
                            quiet = [usize::MAX; MOTORS];
                        }
                        (Request::Inject(inject), None | Some(Message::Done)) => {
                            prop_assert!(levels.iter().all(Option::is_none), "injected with a live input");
                            let motor = usize::from(inject.motor);
                            next[motor] += inject.samples.len() as u32;
                            if !inject.samples.is_empty() { quiet[motor] = 0; }
                        }
                        (Request::Excite(excite), Some(Message::Done)) => {
                            prop_assert!(levels.iter().all(Option::is_none), "excited with a live input");
                            quiet[usize::from(excite.motor)] = 0;
                        }
                        (Request::KeepAlive, _) => {
                            for (quiet, motor) in quiet.iter_mut().zip(rig.hardware.tick_mut().motors()) {
                                if motor.state() == ChannelState::Excitation {
                                    *quiet = 0;
                                }
                            }
                        }
                        _ => {}
                    }
                }
                Event::Input(motor, level, ticks) => {
                    sent[motor] = level;
                    levels[motor] = level.map(|level| counts(&rig, level));
                    let stop = limits[0].stop;
                    for n in 0..ticks {
                        for (signal, (index, level)) in signals.iter_mut().zip(levels.iter().enumerate()) {
                            *signal = match level {
                                Some(_) if n % 12 != 0 || index != motor => Signal::Unchanged,
                                Some(_) => rig.pulse(sent[index].unwrap_or_default()),
                                None if *signal == Signal::Nothing => Signal::Nothing,
                                None => Signal::Lost(rotorlead::capture::LossReason::StuckLow),
                            };
                        }
                        let outputs = rig.hardware.run(signals);
                        for index in 0..MOTORS {
                            quiet[index] = quiet[index].saturating_add(1);
                            let motor = &rig.hardware.tick_mut().motors()[index];
                            let (by_pulse, state) = (motor.source() == Source::Pulse, motor.state());
                            let is_at_rest = motor.channel().state().is_at_rest();
                            let disarming = limits[index].disarming_threshold;
                            if levels[index].is_some_and(|level| level < disarming) && by_pulse && n > 12 {
                                prop_assert!(outputs[index] <= stop, "motor {index} turns on a disarmed input");
                                quiet[index] = 0;
                            }
                            if state == ChannelState::Armed {
                                prop_assert!(levels[index].is_some_and(|level| level >= disarming));
                                quiet[index] = 0;
                            }
                            if quiet[index] > longest(&limits, index) {
                                prop_assert!(outputs[index] <= stop, "motor {index} turns for nobody");
                            }
                            if is_at_rest {
                                prop_assert!(outputs[index] <= stop, "motor {index} is above the stop in {state:?}");
                            }
                        }
                    }
                    rig.serve(usize::MAX);
                    rig.inbox.clear();
                }
            }
        }
    }
}

#[test]
fn a_tick_of_the_tests_is_one_of_the_controller() {
    assert_eq!(TICKS_PER_POLL * u64::from(LOOP_HZ), u64::from(TIMER_HZ));
}
