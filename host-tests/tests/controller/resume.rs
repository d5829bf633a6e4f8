//! A reset in flight, and a lowest priority that hangs: the whole controller, with memory that survives.

use host_tests::board::{CRYSTAL, INTERNAL_PLL, facts};
use host_tests::line::LOOP_HZ;
use host_tests::rig::{Rig, SharedFlash, saved};
use rotorlead::capture::{InputReading, LossReason, Signal};
use rotorlead::controller::{BoardFacts, Plan, ResumeMemory, ResumeSource};
use rotorlead::link::{
    ChannelState, ExciteRequest, Faults, Info, InjectRequest, LineSet, Message, PanicPlace, Request, ResetReason,
    Source,
};
use rotorlead::settings::{MOTORS, Origin, Settings};
use rotorlead::throttle::{Command, EscCommand};

/// 100 ms, the default.
const HOLD_TICKS: u32 = LOOP_HZ / 10;
/// From one pulse of the flight controller to the next: 400 Hz, near enough.
const FRAME_TICKS: u32 = LOOP_HZ / 400;

/// A controller, and the flash and the memory that it has after a reset.
struct Flight {
    rig: Rig,
    origin: Origin,
    flash: SharedFlash,
    memory: &'static ResumeMemory,
    tick: u32,
}

impl Flight {
    fn new(settings: &Settings) -> Self {
        let flash = saved(&settings.clone().validate().unwrap());
        let memory = Box::leak(Box::new(ResumeMemory::new()));
        Self::start(flash, memory, facts(CRYSTAL), false)
    }

    fn start(flash: SharedFlash, memory: &'static ResumeMemory, facts: BoardFacts, is_debugged: bool) -> Self {
        let is_debugged: fn() -> bool = if is_debugged { || true } else { || false };
        let (rig, origin) = Rig::after_reset(&flash, facts, Some(ResumeSource { memory, is_debugged }));
        Self { rig, origin, flash, memory, tick: 0 }
    }

    /// The controller after a reset for this reason.
    fn reset(self, reset: ResetReason) -> Self {
        Self::start(self.flash, self.memory, BoardFacts { reset, ..facts(CRYSTAL) }, false)
    }

    /// Ticks of the control task in which the flight controller sends these commands.
    fn fly(&mut self, ticks: u32, commands: [f64; MOTORS], idle_ran: bool) {
        for _ in 0..ticks {
            self.tick += 1;
            let readings = commands.map(|command| {
                let signal =
                    if self.tick.is_multiple_of(FRAME_TICKS) { self.rig.pulse(command) } else { Signal::Unchanged };
                InputReading::from(signal)
            });
            self.rig.hardware.board.control.run(readings, idle_ran);
        }
    }

    /// Ticks without any signal.
    fn silence(&mut self, ticks: u32) {
        for _ in 0..ticks {
            self.rig.hardware.board.control.run([Signal::Nothing.into(); MOTORS], true);
        }
    }

    /// Counts of the pulses of the next frame.
    fn widths(&mut self) -> [u32; MOTORS] {
        self.rig.hardware.board.control.parts_mut().outputs.next_widths
    }

    /// Those of these commands.
    fn compute_widths(&self, settings: &Settings, commands: [f64; MOTORS]) -> [u32; MOTORS] {
        let plan = Plan::new(&settings.clone().validate().unwrap(), CRYSTAL.timer_hz, true).unwrap();
        let (scale, _) = plan.output.pulses().unwrap();
        commands.map(|command| scale.to_width_ticks(EscCommand::from(self.rig.as_measured(command))))
    }

    fn feeds(&mut self) -> u32 {
        self.rig.hardware.board.control.parts_mut().watchdog.feeds
    }

    fn info(&mut self) -> Info {
        match self.rig.ask(&Request::Info) {
            Message::Info(info) => info,
            other => panic!("{other:?}"),
        }
    }

    fn faults(&mut self) -> Faults {
        match self.rig.ask(&Request::Faults) {
            Message::Faults(faults) => faults,
            other => panic!("{other:?}"),
        }
    }
}

const COMMANDS: [f64; MOTORS] = [0.5, 0.4, 0.3, 0.2];
const ALL: [bool; MOTORS] = [true; MOTORS];
const NONE: [bool; MOTORS] = [false; MOTORS];

/// All motors armed for longer than a loss is held.
fn flying(settings: &Settings) -> Flight {
    let mut flight = Flight::new(settings);
    flight.fly(200, [0.0; MOTORS], true);
    flight.fly(2 * HOLD_TICKS, COMMANDS, true);
    assert_eq!(flight.info().motors, [ChannelState::Armed; MOTORS]);
    flight
}

fn panicked() -> ResetReason {
    ResetReason::Panic(PanicPlace::new("a.rs", 1))
}

// --- The lowest priority ------------------------------------------------------------------------------------------

#[test]
fn a_lowest_priority_that_hangs_in_flight_is_counted_and_resets_nothing() {
    let mut flight = flying(&Settings::default());
    let before = flight.feeds();
    flight.fly(60 * LOOP_HZ, COMMANDS, false);
    let feeds = flight.feeds() - before;
    // In nearly every tick: 20 ms are the watchdog's time.
    assert!(feeds >= 30 * LOOP_HZ, "{feeds} in 60 s");
    assert_eq!(flight.faults().idle_hangs, 1);
    // On the ground the reset that mends it comes.
    flight.fly(4 * LOOP_HZ, [0.0; MOTORS], false);
    let before = flight.feeds();
    flight.fly(LOOP_HZ, [0.0; MOTORS], false);
    assert_eq!(flight.feeds(), before, "fed at rest");
}

#[test]
fn a_lowest_priority_that_hangs_with_every_motor_at_rest_ends_in_a_reset() {
    let mut flight = Flight::new(&Settings::default());
    flight.fly(20 * LOOP_HZ + 10, [0.0; MOTORS], false);
    let before = flight.feeds();
    flight.fly(LOOP_HZ, [0.0; MOTORS], false);
    assert_eq!(flight.feeds(), before);
    assert_eq!(flight.faults().idle_hangs, 0, "none was in flight");
}

/// A host that drives a motor is the lowest priority itself: its hang ends as before.
#[test]
fn an_injection_keeps_no_hung_lowest_priority_alive() {
    let mut flight = Flight::new(&Settings::default());
    let mode = Request::SetMode { motor: 0, source: Source::Inject, compensate: false };
    assert_eq!(flight.rig.ask(&mode), Message::Done);
    for _ in 0..21 * LOOP_HZ {
        flight.rig.hardware.board.control.run([Signal::Nothing.into(); MOTORS], false);
    }
    let before = flight.feeds();
    flight.rig.hardware.board.control.run([Signal::Nothing.into(); MOTORS], false);
    assert_eq!(flight.feeds(), before);
}

// --- A reset in flight --------------------------------------------------------------------------------------------

#[test]
fn after_a_reset_in_flight_the_first_tick_holds_the_last_commands_until_the_hold_time_is_over() {
    let settings = Settings::default();
    for reset in [ResetReason::Watchdog, panicked(), ResetReason::Fault { program_counter: 1, status: 2 }] {
        let mut flight = flying(&settings).reset(reset);
        assert_eq!((flight.origin, flight.info().resumed), (Origin::Stored, ALL));
        assert_eq!(flight.info().motors, [ChannelState::Holding; MOTORS]);
        for n in 0..HOLD_TICKS {
            flight.silence(1);
            assert_eq!(flight.widths(), flight.compute_widths(&settings, COMMANDS), "tick {n} after {reset:?}");
        }
        flight.silence(1);
        assert_eq!(flight.widths(), flight.compute_widths(&settings, [0.0; MOTORS]), "stop pulses");
        assert_eq!(flight.info().motors, [ChannelState::Lost; MOTORS]);
        // Locked until a disarmed command, as after any loss.
        flight.fly(500, COMMANDS, true);
        assert_eq!(flight.info().motors, [ChannelState::Locked; MOTORS]);
    }
}

#[test]
fn with_good_input_the_flight_goes_on() {
    let settings = Settings::default();
    let mut flight = flying(&settings).reset(ResetReason::Watchdog);
    flight.silence(HOLD_TICKS / 2);
    flight.fly(500, [0.6; MOTORS], true);
    assert_eq!(flight.info().motors, [ChannelState::Armed; MOTORS]);
    assert_eq!(flight.widths(), flight.compute_widths(&settings, [0.6; MOTORS]));
    // And a loss is held again, and the disarmed command stops at once.
    flight.fly(FRAME_TICKS, [0.0; MOTORS], true);
    assert_eq!(flight.info().motors, [ChannelState::Disarmed; MOTORS]);
}

/// A step a moment before the reset has the output at its peak, 3.4 times the step above the old command.
#[test]
fn what_is_held_is_the_command_and_no_peak_of_the_filter() {
    let mut settings = Settings::default();
    settings.motors.iter_mut().for_each(|motor| motor.compensate = true);
    let mut flight = flying(&settings);
    flight.fly(5000, [0.4; MOTORS], true);
    flight.fly(5 * FRAME_TICKS, [0.5; MOTORS], true);
    let held = flight.compute_widths(&settings, [0.5; MOTORS]);
    assert!(flight.widths()[0] > held[0] + held[0] / 20, "{:?} is no peak above {held:?}", flight.widths());
    let mut flight = flight.reset(panicked());
    assert_eq!(flight.info().resumed, ALL);
    for _ in 0..HOLD_TICKS {
        flight.silence(1);
        assert_eq!(flight.widths(), held);
    }
}

#[test]
fn only_motors_that_a_flight_controller_turned_for_longer_than_a_hold_go_on() {
    // Motor 0 armed a moment ago, 1 long ago; 2 is disarmed, and 3 has no signal.
    let mut flight = Flight::new(&Settings::default());
    let mut run = |ticks: u32, commands: [Option<f64>; MOTORS]| {
        for n in 0..ticks {
            let readings = commands.map(|command| match command {
                None => Signal::Nothing.into(),
                Some(command) if n % FRAME_TICKS == 0 => InputReading::from(flight.rig.pulse(command)),
                Some(_) => Signal::Unchanged.into(),
            });
            flight.rig.hardware.board.control.run(readings, true);
        }
    };
    run(200, [Some(0.0), Some(0.0), Some(0.0), None]);
    run(2 * HOLD_TICKS, [Some(0.0), Some(0.4), Some(0.0), None]);
    run(HOLD_TICKS / 2, [Some(0.5), Some(0.4), Some(0.0), None]);
    let mut flight = flight.reset(ResetReason::Watchdog);
    assert_eq!(flight.info().resumed, [false, true, false, false]);
    flight.silence(1);
    assert_eq!(flight.widths(), [0, flight.compute_widths(&Settings::default(), [0.4; MOTORS])[1], 0, 0]);
}

#[test]
fn a_motor_that_was_holding_goes_on_for_the_rest_of_its_time() {
    let mut flight = flying(&Settings::default());
    for _ in 0..HOLD_TICKS - 100 {
        flight.rig.hardware.board.control.run([Signal::Lost(LossReason::StuckLow).into(); MOTORS], true);
    }
    let mut flight = flight.reset(ResetReason::Watchdog);
    assert_eq!(flight.info().resumed, ALL);
    // What the record knows is up to 4 ms old.
    flight.silence(99);
    assert_eq!(flight.info().motors, [ChannelState::Holding; MOTORS]);
    flight.silence(21);
    assert_eq!(flight.info().motors, [ChannelState::Lost; MOTORS]);
}

#[test]
fn nothing_goes_on_after_any_other_reset_nor_where_it_is_not_wanted() {
    let others = [
        ResetReason::PowerOn,
        ResetReason::BrownOut,
        ResetReason::Pin,
        ResetReason::Software,
        ResetReason::CrystalLost,
        ResetReason::SupplyLow,
    ];
    let is_locked = |mut flight: Flight, what: &str| {
        assert_eq!(flight.info().resumed, NONE, "{what}");
        flight.silence(10);
        assert_eq!(flight.widths(), [0; MOTORS], "{what}");
        flight.fly(500, COMMANDS, true);
        assert_eq!(flight.info().motors, [ChannelState::Locked; MOTORS], "{what}");
    };
    for reset in others {
        is_locked(flying(&Settings::default()).reset(reset), &format!("{reset:?}"));
        let twice = flying(&Settings::default()).reset(reset).reset(ResetReason::Watchdog);
        is_locked(twice, "cleared by the start before");
    }
    let never = Settings { resume: false, ..Settings::default() };
    is_locked(flying(&never).reset(ResetReason::Watchdog), "the setting is off");
    let Flight { flash, memory, .. } = flying(&Settings::default());
    let reset = BoardFacts { reset: ResetReason::Watchdog, ..facts(CRYSTAL) };
    is_locked(Flight::start(flash, memory, reset, true), "a debugger is attached");
    let flight = flying(&Settings::default());
    flight.memory.clear();
    is_locked(flight.reset(ResetReason::Watchdog), "the firmware has cleared it");
}

#[test]
fn nothing_goes_on_without_the_crystal() {
    let Flight { flash, memory, .. } = flying(&Settings::default());
    let reset = BoardFacts { reset: ResetReason::Watchdog, ..facts(INTERNAL_PLL) };
    let mut flight = Flight::start(flash, memory, reset, false);
    assert_eq!(flight.info().resumed, NONE);
    flight.silence(10);
    assert_eq!(flight.widths(), [0; MOTORS]);
}

#[test]
fn neither_an_injection_nor_an_excitation_goes_on() {
    let mut settings = Settings::default();
    settings.excitation.arm_ms = 0;
    let mut flight = Flight::new(&settings);
    let lines = LineSet::Odd30Hz;
    let (nominal, amplitude) =
        (Command::saturating_from_f64(0.5).to_bits(), Command::saturating_from_f64(0.05).to_bits());
    let excite = Request::Excite(ExciteRequest { motor: 0, lines, nominal, amplitude, periods: 10 });
    assert_eq!(flight.rig.ask(&excite), Message::Done);
    for _ in 0..50 {
        assert_eq!(flight.rig.ask(&Request::KeepAlive), Message::Done);
        flight.silence(500);
    }
    assert_eq!(flight.info().motors[0], ChannelState::Excitation);
    assert!(flight.widths()[0] > 0);
    let mut flight = flight.reset(ResetReason::Watchdog);
    assert_eq!(flight.info().resumed, NONE);
    flight.silence(10);
    assert_eq!(flight.widths(), [0; MOTORS]);

    let mut flight = Flight::new(&settings);
    assert_eq!(
        flight.rig.ask(&Request::SetMode { motor: 0, source: Source::Inject, compensate: false }),
        Message::Done
    );
    for n in 0..12 {
        let level = if n == 0 { 0 } else { Command::saturating_from_f64(0.5).to_bits() };
        let samples: Vec<i32> = vec![level; 100];
        let request = InjectRequest { motor: 0, first: 100 * n, samples: samples[..].try_into().unwrap() };
        flight.rig.send(&Request::Inject(request));
        flight.rig.serve(usize::MAX);
        flight.silence(100);
        flight.rig.serve(usize::MAX);
    }
    assert!(flight.widths()[0] > 0, "the host turns it");
    let mut flight = flight.reset(ResetReason::Watchdog);
    assert_eq!(flight.info().resumed, NONE);
}

#[test]
fn settings_that_a_host_has_set_and_not_saved_go_on_too_and_where_they_come_from_is_known() {
    let mut flight = Flight::new(&Settings::default());
    let mut settings = Settings::default();
    settings.motors.iter_mut().for_each(|motor| motor.hold_ms = 30);
    let taken = flight.rig.ask(&Request::SetSettings(settings.clone()));
    assert!(matches!(taken, Message::SettingsTaken(_)), "{taken:?}");
    let fly = |flight: &mut Flight| {
        flight.fly(200, [0.0; MOTORS], true);
        flight.fly(2 * HOLD_TICKS, COMMANDS, true);
    };
    fly(&mut flight);
    let mut flight = flight.reset(ResetReason::Watchdog);
    assert_eq!((flight.origin, flight.info().resumed), (Origin::Host, ALL));
    assert_eq!(flight.rig.ask(&Request::GetSettings), Message::Settings(settings.clone()));
    flight.silence(150);
    assert_eq!(flight.info().motors, [ChannelState::Holding; MOTORS]);
    flight.silence(1);
    assert_eq!(flight.info().motors, [ChannelState::Lost; MOTORS]);
    // Saved, they come from the flash.
    assert_eq!(flight.rig.ask(&Request::SaveSettings), Message::Done);
    fly(&mut flight);
    let mut flight = flight.reset(ResetReason::Watchdog);
    assert_eq!((flight.origin, flight.info().resumed), (Origin::Stored, ALL));
}

/// Without settings that somebody has chosen no output has a pulse: not after a reset either.
#[test]
fn defaults_that_nobody_has_chosen_do_not_go_on() {
    let flash = SharedFlash::new(host_tests::flash::Flash::blank());
    let memory: &'static ResumeMemory = Box::leak(Box::new(ResumeMemory::new()));
    let mut flight = Flight::start(flash, memory, facts(CRYSTAL), false);
    flight.fly(200, [0.0; MOTORS], true);
    flight.fly(2 * HOLD_TICKS, COMMANDS, true);
    assert_eq!(flight.widths(), [0; MOTORS]);
    let mut flight = flight.reset(ResetReason::Watchdog);
    assert_eq!(flight.info().resumed, NONE);
    flight.silence(10);
    assert_eq!(flight.widths(), [0; MOTORS]);
}

#[test]
fn a_third_reset_within_10_s_ends_off() {
    let mut flight = flying(&Settings::default());
    // Whether it goes on after this reset, and seconds up to the next.
    let resets = [
        (true, 0),
        (true, 3),
        (false, 3),
        (true, 1),
        (true, 12),
        (true, 3),
        (true, 9),
        (true, 2),
        (true, 5),
        (false, 1),
    ];
    for (n, (goes_on, seconds)) in resets.into_iter().enumerate() {
        flight = flight.reset(panicked());
        assert_eq!(flight.info().resumed, [goes_on; MOTORS], "reset {n}");
        if !goes_on {
            flight.fly(200, [0.0; MOTORS], true);
        }
        flight.fly(seconds * LOOP_HZ + 2 * HOLD_TICKS, COMMANDS, true);
    }
}
