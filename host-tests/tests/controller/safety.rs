//! What an ESC and a flight controller expect of a controller between them: nothing happens that nobody has asked for.

use host_tests::board::{CRYSTAL, INTERNAL, INTERNAL_PLL, TestBoard, facts};
use host_tests::flash::Flash;
use host_tests::line::{LOOP_HZ, Line, TICKS_PER_POLL, us};
use host_tests::rig::{Rig, SECTOR, SharedFlash, saved};
use rotorlead::capture::{InputReading, Level, Signal};
use rotorlead::controller::hardware::Edge;
use rotorlead::controller::{ClockReport, channel_settings};
use rotorlead::link::{
    BrownOut, ChannelState, CrystalCheck, ExciteRequest, Info, InjectRequest, LineSet, Message, Refusal, Request,
    Source,
};
use rotorlead::settings::{MOTORS, Origin, Pulse, PulseProtocol, Settings, Validated};
use rotorlead::throttle::{Command, EscCommand};

const STOP: Command = Command::ZERO;
const NO_PULSE: EscCommand = EscCommand::NO_PULSE;

fn excite(lines: LineSet) -> Request {
    let bits = |value: f64| Command::saturating_from_f64(value).to_bits();
    Request::Excite(ExciteRequest { motor: 0, lines, nominal: bits(0.5), amplitude: bits(0.05), periods: 1 })
}

fn inject() -> Request {
    Request::SetMode { motor: 0, source: Source::Inject, compensate: false }
}

fn refused(refusal: Refusal) -> Message {
    Message::Refused(refusal)
}

fn info(rig: &mut Rig) -> Info {
    match rig.ask(&Request::Info) {
        Message::Info(info) => info,
        other => panic!("{other:?}"),
    }
}

/// One tick of everything, with the same at every input: the widths that stand in the compare registers after it.
fn widths(rig: &mut Rig, signal: Signal) -> [u32; MOTORS] {
    let control = &mut rig.hardware.board.control;
    control.run([signal.into(); MOTORS], true);
    control.parts_mut().outputs.next_widths
}

/// Flashes from which no settings come: blank, bad, and with a set whose filter cannot be designed.
fn flashes_without_settings() -> [(SharedFlash, Origin); 3] {
    let mut bad = saved(&Validated::default()).copy();
    (bad.bytes[20], bad.bytes[SECTOR + 20]) = (0, 0);
    let mut settings = Settings::default();
    settings.lead.omega_z_rad_s = 3.0;
    [
        (SharedFlash::new(Flash::blank()), Origin::DefaultsBlank),
        (SharedFlash::new(bad), Origin::DefaultsBad),
        (saved(&settings.validate().unwrap()), Origin::DefaultsBad),
    ]
}

/// The stop of standard PWM at 400 Hz, 1000 us, is 40 % duty for an ESC that takes a raw duty.
#[test]
fn without_chosen_settings_every_line_stays_low_until_a_host_sets_some() {
    for (flash, expected) in flashes_without_settings() {
        let (mut rig, origin) = Rig::starting_from(&flash);
        assert_eq!(origin, expected);
        let (low, high) = (rig.pulse(0.0), rig.pulse(0.6));
        for signal in [Signal::Nothing, low, Signal::Unchanged, high, Signal::Unchanged] {
            for _ in 0..1000 {
                assert_eq!(widths(&mut rig, signal), [0; MOTORS], "{signal:?}");
            }
        }
        // It says so, and does nothing for a host either.
        let said = info(&mut rig);
        assert_eq!((said.settings, said.outputs_enabled), (expected, false));
        for request in [inject(), excite(LineSet::Odd30Hz)] {
            assert_eq!(rig.ask(&request), refused(Refusal::NoSettings));
        }
        for _ in 0..1000 {
            widths(&mut rig, low);
        }
        // Whoever stores the defaults has chosen them.
        if expected == Origin::DefaultsBlank {
            assert_eq!(rig.ask(&Request::SaveSettings), Message::Done);
            let said = info(&mut rig);
            assert_eq!((said.settings, said.outputs_enabled), (Origin::Stored, true));
        }
        assert!(matches!(rig.ask(&Request::SetSettings(Settings::default())), Message::SettingsTaken(_)));
        let said = info(&mut rig);
        assert_eq!((said.settings, said.outputs_enabled), (Origin::Host, true));
        assert_eq!(rig.ask(&Request::SaveSettings), Message::Done);
        assert_eq!(info(&mut rig).settings, Origin::Stored);
        let stop = widths(&mut rig, low)[0];
        assert!(stop > 0);
        assert_eq!(Rig::starting_from(&flash).1, Origin::Stored);
    }
}

#[test]
fn settings_that_are_stored_have_pulses_from_the_first_disarmed_command_on() {
    for (no_signal, silent) in [("no_pulses", NO_PULSE), ("stop_pulses", STOP.into())] {
        let mut settings = Settings::default();
        if no_signal == "stop_pulses" {
            settings.no_signal = rotorlead::settings::NoSignal::StopPulses;
        }
        let mut rig = Rig::with(settings);
        let low = rig.pulse(0.0);
        for _ in 0..1000 {
            assert_eq!(rig.tick(Signal::Nothing), [silent; MOTORS], "{no_signal}");
        }
        assert_eq!(rig.tick(low), [STOP; MOTORS]);
        // After the signal: stop pulses for 2 s, then as before it.
        let lost = Signal::Lost(rotorlead::capture::LossReason::StuckLow);
        for _ in 0..10_000 {
            assert_eq!(rig.tick(lost), [STOP; MOTORS]);
        }
        assert_eq!(rig.tick(lost), [silent; MOTORS], "{no_signal}");
    }
}

/// A full throttle at power-up puts an ESC into its calibration.
#[test]
fn a_full_throttle_at_power_up_does_not_reach_the_escs() {
    let mut rig = Rig::new();
    let full = rig.pulse(1.0);
    for n in 0..50_000 {
        let signal = if n % 12 == 0 { full } else { Signal::Unchanged };
        assert_eq!(rig.tick(signal), [NO_PULSE; MOTORS]);
    }
    assert_eq!(info(&mut rig).motors, [ChannelState::Locked; MOTORS]);
}

#[test]
fn without_the_jumper_no_host_drives_a_motor() {
    let mut rig = Rig::new();
    rig.hardware.board.status.bench_enabled = false;
    assert!(!info(&mut rig).bench_enabled);
    let samples = [0, 1 << 28][..].try_into().unwrap();
    let commands = Request::Inject(InjectRequest { motor: 0, first: 0, samples });
    for request in [inject(), excite(LineSet::Odd30Hz), commands.clone(), Request::KeepAlive] {
        assert_eq!(rig.ask(&request), refused(Refusal::BenchDisabled), "{request:?}");
        assert_eq!(rig.tick(Signal::Nothing), [NO_PULSE; MOTORS]);
    }
    // Giving a motor back to its pulses needs none, once it is known to have been at rest.
    for _ in 0..3 * LOOP_HZ {
        assert_eq!(rig.tick(Signal::Nothing), [NO_PULSE; MOTORS]);
    }
    assert_eq!(rig.ask(&Request::SetMode { motor: 0, source: Source::Pulse, compensate: false }), Message::Done);
    rig.hardware.board.status.bench_enabled = true;
    assert!(info(&mut rig).bench_enabled);
    assert_eq!(rig.ask(&inject()), Message::Done);
    // Taken out meanwhile: the commands are refused, and the motor is lost as with a host that went quiet.
    rig.hardware.board.status.bench_enabled = false;
    assert_eq!(rig.ask(&commands), refused(Refusal::BenchDisabled));
}

/// A request takes time: the check is not the start.
#[test]
fn pulses_that_come_up_while_an_excitation_is_made_keep_it_from_starting() {
    for live in 0..MOTORS {
        let mut rig = Rig::new();
        let mut signals = [Signal::Nothing; MOTORS];
        signals[live] = rig.pulse(0.0);
        rig.hardware.during_check = vec![signals];
        assert_eq!(rig.ask(&excite(LineSet::Odd30Hz)), refused(Refusal::InputLive { motor: live as u8 }));
        signals[live] = Signal::Unchanged;
        for _ in 0..20_000 {
            assert!(rig.hardware.run(signals).iter().all(|&output| output <= STOP));
        }
    }
}

#[test]
fn an_excitation_ends_when_the_jumper_is_taken_out() {
    let mut settings = Settings::default();
    settings.excitation.arm_ms = 0;
    let mut rig = Rig::with(settings);
    assert_eq!(rig.ask(&excite(LineSet::Odd30Hz)), Message::Done);
    let mut highest = STOP.into();
    for n in 0..8000 {
        if n % 250 == 0 {
            assert_eq!(rig.ask(&Request::KeepAlive), Message::Done);
        }
        highest = rig.tick_one(Signal::Nothing).max(highest);
    }
    assert!(highest > Command::saturating_from_f64(0.5));
    rig.hardware.board.status.bench_enabled = false;
    assert_eq!(rig.ask(&Request::KeepAlive), refused(Refusal::BenchDisabled));
    // From the next tick on, and at once on the whole ramp: not only when the dead-man's time is over.
    let limits = channel_settings(&Settings::default().validate().unwrap(), 0);
    let level = |rig: &mut Rig| rig.hardware.tick_mut().motors()[0].channel().command().to_bits();
    let mut before = level(&mut rig);
    for _ in 0..limits.excitation.dead_man_ticks {
        rig.tick_one(Signal::Nothing);
        let now = level(&mut rig);
        assert_eq!(before - now, limits.excitation.ramp_per_tick.to_bits());
        before = now;
    }
    let mut ticks = 0;
    while rig.tick_one(Signal::Nothing) > STOP {
        // A host that goes on does not help.
        if ticks % 250 == 0 {
            rig.ask(&Request::KeepAlive);
        }
        ticks += 1;
        assert!(ticks < 8000, "the ramp from 0.55 takes 1.5 s");
    }
}

#[test]
fn more_lines_than_the_clock_has_time_for_are_refused_with_lines_and_loop_rate() {
    let on = |clocks: ClockReport, loop_rate_hz: u32, lines: LineSet| {
        let settings = Settings { loop_rate_hz, ..Settings::default() };
        let flash = saved(&settings.validate().unwrap());
        Rig::starting_on(&flash, facts(clocks)).0.ask(&excite(lines))
    };
    for clocks in [CRYSTAL, INTERNAL_PLL] {
        for lines in [LineSet::Odd30Hz, LineSet::Odd45Hz] {
            assert_eq!(on(clocks, 5000, lines), Message::Done);
        }
    }
    assert_eq!(on(INTERNAL, 1000, LineSet::Odd30Hz), Message::Done);
    let Message::Refused(refusal) = on(INTERNAL, 5000, LineSet::Odd30Hz) else {
        panic!("150 lines at 16 MHz cannot run")
    };
    assert!(
        matches!(refusal, Refusal::TooSlow { lines: 150, loop_rate_hz: 5000, core_hz: 16_000_000, percent } if percent > 100)
    );
    let text = refusal.to_string();
    for part in ["150 lines", "loop_rate_hz 5000", "16 MHz", "80 %"] {
        assert!(text.contains(part), "{text}");
    }
}

/// A board with another crystal runs on its internal oscillator, and arms no motor.
#[test]
fn a_wrong_crystal_is_reported_and_arms_no_motor() {
    let wrong = ClockReport { crystal: CrystalCheck::Wrong { measured_hz: 16_020_000 }, ..INTERNAL_PLL };
    let mut rig = Rig::starting_on(&saved(&Validated::default()), facts(wrong)).0;
    let said = info(&mut rig);
    assert_eq!((said.crystal, said.may_arm), (CrystalCheck::Wrong { measured_hz: 16_020_000 }, false));
    for value in [0.0, 0.0, 0.5, 1.0] {
        let signal = rig.pulse(value);
        assert_eq!(rig.tick(signal), [NO_PULSE; MOTORS]);
    }
    assert_eq!(info(&mut rig).motors, [ChannelState::Locked; MOTORS]);
    // Other settings do not change that.
    assert!(matches!(rig.ask(&Request::SetSettings(Settings::default())), Message::SettingsTaken(_)));
    for value in [0.0, 0.0, 0.5, 1.0] {
        let signal = rig.pulse(value);
        assert_eq!(rig.tick(signal), [NO_PULSE; MOTORS]);
    }
    assert_eq!(info(&mut rig).motors, [ChannelState::Locked; MOTORS]);
    assert!(info(&mut Rig::new()).may_arm);
}

#[test]
fn the_brown_out_level_is_reported() {
    let mut rig = Rig::new();
    for level in [BrownOut::Unknown, BrownOut::Off, BrownOut::Level1, BrownOut::Level2, BrownOut::Level3] {
        rig.hardware.board.status.facts.brown_out = level;
        assert_eq!(info(&mut rig).brown_out, level);
    }
}

/// The paper's mode, from the edges of an input to the compare registers.
#[test]
fn raw_duty_goes_through_from_pulse_to_pulse() {
    let raw = Pulse { protocol: PulseProtocol::RawDuty, frame_hz: 600 };
    let bits = |value: f64| Command::saturating_from_f64(value).to_bits();
    let mut settings = Settings { input: raw, output: raw, stop: bits(0.02), ..Settings::default() };
    settings.motors.iter_mut().for_each(|motor| motor.max = bits(0.98));
    let mut rig = Rig::with(settings);
    let low = rig.pulse(0.02);
    let counts = rig.hardware.board.control.parts_mut().outputs.frames.1;
    // 84 MHz over 3 and over 600.
    assert_eq!(counts, 46_667);
    for (value, expected) in [(0.02, 0.02), (0.5, 0.5), (0.75, 0.75)] {
        let signal = rig.pulse(value);
        rig.arm([signal; MOTORS]);
        let width = widths(&mut rig, signal)[2];
        assert!((f64::from(width) / f64::from(counts) - expected).abs() < 1e-4, "{value}: {width} of {counts}");
    }
    assert_eq!(widths(&mut rig, low), [(0.02 * f64::from(counts)).round() as u32; MOTORS], "2 % again");
}

#[test]
fn a_late_tick_is_counted_and_a_second_in_a_row_ends_an_excitation() {
    let mut settings = Settings::default();
    settings.excitation.arm_ms = 0;
    let mut rig = Rig::with(settings);
    assert_eq!(rig.ask(&excite(LineSet::Odd30Hz)), Message::Done);
    let run = |rig: &mut Rig, due: bool| {
        rig.hardware.board.control.parts_mut().timer.is_due = due;
        rig.ask(&Request::KeepAlive);
        widths(rig, Signal::Nothing);
        rig.hardware.tick_mut().motors()[0].channel().command()
    };
    let mut before = run(&mut rig, false);
    for due in [true, false, true, false] {
        let now = run(&mut rig, due);
        assert!(now > before, "one late tick at a time changes nothing");
        before = now;
    }
    run(&mut rig, true);
    let before = run(&mut rig, true);
    assert!(run(&mut rig, false) < before, "two in a row end it");
    let Message::Faults(faults) = rig.ask(&Request::Faults) else { panic!("no faults") };
    assert_eq!(faults.missed_deadlines, 4);
}

/// Nobody has chosen settings that are not stored.
#[test]
fn a_save_that_fails_enables_no_outputs() {
    let flash = SharedFlash::new(Flash { cut_after: Some(0), ..Flash::blank() });
    let mut rig = Rig::starting_from(&flash).0;
    let low = rig.pulse(0.0);
    assert_eq!(rig.ask(&Request::SaveSettings), refused(Refusal::SaveFailed));
    let said = info(&mut rig);
    assert_eq!((said.settings, said.outputs_enabled), (Origin::DefaultsBlank, false));
    for _ in 0..1000 {
        assert_eq!(widths(&mut rig, low), [0; MOTORS]);
    }
}

/// What the control hardware received.
#[derive(Debug, PartialEq)]
struct HardwareTrace {
    tick_rate_hz: u32,
    /// In each tick: divider and length of the frames, and the widths.
    ticks: Vec<((u32, u32), [u32; MOTORS])>,
    /// When frames began, in counts.
    starts: Vec<u64>,
}

/// While pulses come at the input's frame rate.
fn hardware_trace(mut rig: Rig, settings: &Validated) -> HardwareTrace {
    let timer_hz = CRYSTAL.timer_hz;
    let scale = settings.input.scale(timer_hz).unwrap();
    let control = &mut rig.hardware.board.control;
    let rate = settings.loop_rate_hz;
    let ticks_per_frame = rate / u32::from(settings.input.frame_hz);
    let mut ticks = Vec::new();
    for n in 0..2000_u32 {
        let outputs = &mut control.parts_mut().outputs;
        outputs.advance(timer_hz / outputs.frames.0 / rate);
        let command = Command::saturating_from_f64(if n < 500 { 0.021 } else { 0.25 });
        let pulse =
            Signal::Pulse { width_ticks: scale.to_ticks(command), period_ticks: timer_hz / rate * ticks_per_frame };
        let signal = if n % ticks_per_frame == 0 { pulse } else { Signal::Unchanged };
        control.run([signal.into(); MOTORS], true);
        ticks.push((control.parts_mut().outputs.frames, control.parts_mut().outputs.next_widths));
    }
    let parts = control.parts_mut();
    HardwareTrace { tick_rate_hz: parts.timer.rate_hz, ticks, starts: std::mem::take(&mut parts.outputs.starts) }
}

/// The scales, the frames, whether they follow the input, and the rates: all are those of the new set.
#[test]
fn settings_that_are_set_do_what_they_do_after_a_start_with_them() {
    let pulse = |protocol, frame_hz| Pulse { protocol, frame_hz };
    let slow = Settings { output: pulse(PulseProtocol::StandardPwm, 100), ..Settings::default() };
    let fast = Settings {
        input: pulse(PulseProtocol::OneShot125, 1000),
        output: pulse(PulseProtocol::OneShot125, 1200),
        loop_rate_hz: 8000,
        ..Settings::default()
    };
    for (first, second) in [(&slow, &fast), (&fast, &slow)] {
        let [first, second] = [first, second].map(|settings| settings.clone().validate().unwrap());
        let started = hardware_trace(Rig::starting_from(&saved(&second)).0, &second);
        let mut rig = Rig::starting_from(&saved(&first)).0;
        assert!(matches!(rig.ask(&Request::SetSettings(Settings::clone(&second))), Message::SettingsTaken(_)));
        assert!(hardware_trace(rig, &second) == started, "{second:?}");
        assert_ne!(hardware_trace(Rig::starting_from(&saved(&first)).0, &second), started);
    }
}

/// What the inputs' decoders make of a line at motor 0.
fn readings(board: &mut TestBoard, line: &Line, end: u64) -> Vec<InputReading> {
    let mut edges = line.edges().iter().peekable();
    (1..=end / TICKS_PER_POLL)
        .map(|tick| {
            let now = tick * TICKS_PER_POLL;
            while let Some(&(time, level)) = edges.next_if(|&&(time, _)| time < now) {
                let edge = Edge { timestamp: time as u32, is_high: level == Level::High, overcapture: false };
                board.capture.get().edges[0] = Some(edge);
                board.inputs.capture();
            }
            board.capture.get().now = now as u32;
            board.inputs.poll()[0]
        })
        .collect()
}

#[test]
fn settings_that_are_set_change_what_an_input_takes_for_a_pulse() {
    let servo = (PulseProtocol::StandardPwm, 400, Line::pulses(us(1000.0), us(2500.0), us(1500.0), 100));
    let oneshot = (PulseProtocol::OneShot125, 2000, Line::pulses(us(1000.0), us(500.0), us(187.5), 500));
    let pulses = [servo, oneshot];
    for (protocol, frame_hz, _) in &pulses {
        for (sent, _, line) in &pulses {
            let mut rig = Rig::new();
            let input = Pulse { protocol: *protocol, frame_hz: *frame_hz };
            let settings = Settings { input, ..Settings::default() };
            assert!(matches!(rig.ask(&Request::SetSettings(settings)), Message::SettingsTaken(_)));
            let all = readings(&mut rig.hardware.board, line, us(251_000.0));
            let is_live = all.iter().any(|reading| reading.is_live());
            assert_eq!(is_live, sent == protocol, "{sent:?} after {protocol:?} was set");
        }
    }
}

/// Ticks within which the control task has asked after the lowest priority: a sixth of the time in which the watchdog bites at 10 kHz.
const REVIEW_TICKS: u32 = 32;

/// A lowest priority that stays away for 20 s has the watchdog bite, at every loop rate.
#[test]
fn the_watchdog_is_fed_for_20_s_without_the_lowest_priority() {
    let mut rig = Rig::new();
    for loop_rate_hz in [5000, 1000, 10_000] {
        let set = Request::SetSettings(Settings { loop_rate_hz, ..Settings::default() });
        assert!(matches!(rig.ask(&set), Message::SettingsTaken(_)));
        let control = &mut rig.hardware.board.control;
        control.run([InputReading::NOTHING; MOTORS], true);
        let (mut feeds, mut last_feed) = (control.parts_mut().watchdog.feeds, 0);
        for n in 1..=25 * loop_rate_hz {
            control.run([InputReading::NOTHING; MOTORS], false);
            if std::mem::replace(&mut feeds, control.parts_mut().watchdog.feeds) != feeds {
                // Not in every tick, and long before the watchdog bites.
                assert!(n - last_feed <= REVIEW_TICKS, "none from {last_feed} to {n} at {loop_rate_hz} Hz");
                last_feed = n;
            }
        }
        assert!(last_feed.abs_diff(20 * loop_rate_hz) <= REVIEW_TICKS, "the last at {last_feed} at {loop_rate_hz} Hz");
        for _ in 0..REVIEW_TICKS {
            control.run([InputReading::NOTHING; MOTORS], true);
        }
        assert!(control.parts_mut().watchdog.feeds > feeds);
    }
}

#[test]
fn the_watchdog_is_patient_only_while_the_flash_stalls() {
    let mut rig = Rig::new();
    let patient = |rig: &mut Rig| rig.hardware.board.control.parts_mut().watchdog.patient;
    assert!(!patient(&mut rig));
    rig.hardware.during_save = vec![[Signal::Nothing; MOTORS]];
    assert_eq!(rig.ask(&Request::SaveSettings), Message::Done);
    assert_eq!(rig.hardware.patient_during_save, [true]);
    assert!(!patient(&mut rig));
    widths(&mut rig, Signal::Nothing);
    assert_eq!(rig.hardware.board.control.parts_mut().watchdog.feeds, 1);
    rig.hardware.board.control.run([InputReading::NOTHING; MOTORS], false);
    assert_eq!(rig.hardware.board.control.parts_mut().watchdog.feeds, 2, "the lowest priority may be away for a while");
}
